//! Whitening under autoregressive noise, where values may be missing.
//!
//! Kalman's filter of the last values: each value less what the ones before it predict, by the spread of that prediction.
//! Source: Jones 1980, Technometrics 22(3), "Maximum likelihood fitting of ARMA models to time series with missing
//! observations", section 3.

use crate::diagnose::fit::colours::autoregression::Colour;
use crate::diagnose::fit::colours::cells::Cells;
use crate::diagnose::limits::MAX_ORDER;
use nalgebra::DVector;

/// Values that are filtered side by side. Exact.
const BLOCK: usize = 8;

/// Values after which all that an autoregression looks at are known. Exact.
const START: usize = MAX_ORDER + 1;

/// What is done with one value.
#[derive(Debug, Clone, PartialEq)]
enum Step {
    /// Nothing was measured: the value is predicted, and counts as zero.
    Missing,
    /// The last values are all known: the autoregression alone predicts.
    Plain,
    /// Some of the last values are guessed: the inverse spread of the prediction, and how far its error moves the guesses.
    Guessed(f64, [f64; MAX_ORDER]),
}

/// Filters the interleaved columns of one window to unit, uncorrelated noise.
pub(crate) struct Whitener {
    /// By column; none where its noise is white and of unit size already.
    filters: Vec<Option<Filter>>,
}

/// The filter of one column.
struct Filter {
    coefficients: Vec<f64>,
    /// Inverse spread of the innovations.
    scale: f64,
    /// From the first value on; after the last of them all steps are plain.
    steps: Vec<Step>,
    /// Of a column that repeats its readings: it is filtered cell by cell.
    cells: Option<Cells>,
}

impl Whitener {
    /// `present`: whether a value was measured, sample by sample; `repeats`: whether it repeats the one before, nothing where none does.
    pub(crate) fn new(colours: &[Colour], present: &[bool], repeats: &[bool]) -> Self {
        let filters = colours.iter().enumerate().map(|(column, colour)| {
            let is_white = colour.coefficients.is_empty() && colour.innovation == 1.0;
            let own = present.iter().skip(column).step_by(colours.len()).copied();
            let repeats = repeats.iter().skip(column).step_by(colours.len()).copied();
            let cells = Cells::new(own.clone().zip(repeats));
            (!is_white || cells.is_some()).then(|| Filter {
                coefficients: colour.coefficients.clone(),
                scale: colour.innovation.sqrt().recip(),
                // No cell is missing.
                steps: if cells.is_some() {
                    steps(colour, std::iter::repeat_n(true, START))
                } else {
                    steps(colour, own)
                },
                cells,
            })
        });
        Self { filters: filters.collect() }
    }

    /// Whitens values in place; what was not measured becomes zero.
    pub(crate) fn whiten(&self, values: &mut DVector<f64>) {
        let stride = self.filters.len();
        let values = values.as_mut_slice();
        let mut own = Vec::with_capacity(values.len() / stride + 1);
        for (column, filter) in self.filters.iter().enumerate() {
            if let Some(filter) = filter {
                own.clear();
                own.extend(values.chunks_exact(stride).map(|sample| sample[column]));
                match &filter.cells {
                    Some(cells) => {
                        let means = cells.means(&own);
                        let mut whitened = means.clone();
                        filter.run(&mut whitened);
                        cells.spread(&mut own, (&means, &whitened), filter.scale);
                    }
                    None => filter.run(&mut own),
                }
                values.chunks_exact_mut(stride).zip(&own).for_each(|(sample, own)| sample[column] = *own);
            }
        }
    }
}

/// Variance of the errors with which `colour` predicts the values of `series` that are there from those before them: the
/// geometric mean over the values, times what the errors are beyond it. Never less than that of the innovations.
///
/// Far above the noise the correlations of neighbours that are there and of those about a hole differ by more than what a
/// prediction leaves, and the recursion's own figure is then none of these values.
pub(crate) fn prediction_error(colour: &Colour, series: &[Vec<f64>]) -> f64 {
    let (mut squares, mut logarithms, mut count) = (0.0, 0.0, 0.0);
    for window in series {
        let there = || window.iter().map(|v| v.is_finite());
        let steps = steps(colour, there());
        let scale = colour.innovation.sqrt().recip();
        let mut values: Vec<f64> = window.iter().map(|&v| if v.is_finite() { v } else { 0.0 }).collect();
        for step in steps.iter().take(values.len()) {
            if let Step::Guessed(own, _) = step {
                logarithms += 2.0 * (scale / own).ln();
            }
        }
        Filter { coefficients: colour.coefficients.clone(), scale, steps, cells: None }.run(&mut values);
        squares += values.iter().map(|v| v * v).sum::<f64>();
        count += there().filter(|&is_there| is_there).count() as f64;
    }
    let found = colour.innovation * squares / f64::max(count, 1.0) * (logarithms / f64::max(count, 1.0)).exp();
    if found.is_finite() { found.max(colour.innovation) } else { colour.innovation }
}

impl Filter {
    fn run(&self, series: &mut [f64]) {
        // All of the last values are as they were measured from here on.
        let order = self.coefficients.len();
        let start = (self.steps.len() + order).min(series.len());
        // From the end, so that what comes before is still as it was measured.
        let mut end = series.len();
        while end - start >= BLOCK {
            let from = end - BLOCK;
            let mut errors: [f64; BLOCK] = std::array::from_fn(|k| series[from + k]);
            for (lag, a) in self.coefficients.iter().enumerate() {
                let before = &series[from - lag - 1..][..BLOCK];
                errors.iter_mut().zip(before).for_each(|(error, value)| *error -= a * value);
            }
            series[from..end].iter_mut().zip(errors).for_each(|(value, error)| *value = error * self.scale);
            end = from;
        }
        for i in (start..end).rev() {
            let before = series[..i].iter().rev();
            let predicted: f64 = self.coefficients.iter().zip(before).map(|(a, v)| a * v).sum();
            series[i] = (series[i] - predicted) * self.scale;
        }
        self.begin(&mut series[..start]);
    }

    /// The first values, before which some are not known.
    fn begin(&self, series: &mut [f64]) {
        // The last values, the latest first, as known or guessed.
        let mut last = [0.0; MAX_ORDER];
        for (value, step) in series.iter_mut().zip(self.steps.iter().chain(std::iter::repeat(&Step::Plain))) {
            let predicted: f64 = self.coefficients.iter().zip(&last).map(|(a, v)| a * v).sum();
            let error = *value - predicted;
            last.rotate_right(1);
            last[0] = predicted;
            match step {
                Step::Missing => *value = 0.0,
                Step::Plain => {
                    last[0] = *value;
                    *value = error * self.scale;
                }
                Step::Guessed(scale, gains) => {
                    last.iter_mut().zip(gains).for_each(|(v, g)| *v += g * error);
                    *value = error * scale;
                }
            }
        }
    }
}

/// The filter's gains, which depend on what is missing and not on the values.
fn steps(colour: &Colour, present: impl Iterator<Item = bool>) -> Vec<Step> {
    type Square = [[f64; MAX_ORDER]; MAX_ORDER];
    let order = colour.coefficients.len();
    // Before the first value the last ones are as uncertain as the noise is large.
    let mut spread: Square = std::array::from_fn(|i| {
        std::array::from_fn(|j| if i.max(j) < order { colour.covariance[i.abs_diff(j)] } else { 0.0 })
    });
    let negligible = 1e-12 * colour.innovation;
    let is_known = |spread: &Square| (0..order).all(|i| spread[i][i] <= negligible);
    let mut steps = Vec::new();
    for there in present {
        if there && is_known(&spread) {
            steps.push(Step::Plain);
            continue;
        }
        let shared: [f64; MAX_ORDER] =
            std::array::from_fn(|j| colour.coefficients.iter().zip(&spread).map(|(a, row)| a * row[j]).sum());
        let variance = colour.innovation + colour.coefficients.iter().zip(&shared).map(|(a, s)| a * s).sum::<f64>();
        let next: Square = std::array::from_fn(|i| {
            std::array::from_fn(|j| match (i, j) {
                (0, 0) => variance,
                (0, k) | (k, 0) => shared[k - 1],
                _ => spread[i - 1][j - 1],
            })
        });
        if there {
            let gains: [f64; MAX_ORDER] = std::array::from_fn(|i| next[i][0] / variance);
            spread = std::array::from_fn(|i| std::array::from_fn(|j| next[i][j] - gains[i] * next[0][j]));
            steps.push(Step::Guessed(variance.sqrt().recip(), gains));
        } else {
            spread = next;
            steps.push(Step::Missing);
        }
        // What is older than the autoregression looks is of no use.
        for i in 0..MAX_ORDER {
            for j in 0..MAX_ORDER {
                if i.max(j) >= order {
                    spread[i][j] = 0.0;
                }
            }
        }
    }
    while steps.last() == Some(&Step::Plain) {
        steps.pop();
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Stationary noise `e_i = 0.9 e_(i-1) - 0.5 e_(i-2) + n`, n of variance 2.
    fn second_order() -> Colour {
        let (a, b, innovation) = (0.9, -0.5, 2.0);
        let first = a / (1.0 - b);
        let variance = innovation / (1.0 - a * first - b * (a * first + b));
        let covariance = vec![variance, first * variance];
        Colour { coefficients: vec![a, b], innovation, error: innovation, covariance, count: 40 }
    }

    #[test]
    fn whitened_values_have_the_likelihood_of_the_dense_covariance_of_those_that_are_there() {
        let colour = second_order();
        let mut covariance = vec![colour.covariance[0], colour.covariance[1]];
        for lag in 2..40 {
            covariance.push(0.9 * covariance[lag - 1] - 0.5 * covariance[lag - 2]);
        }
        // Holes at the start, alone, in pairs, and longer than the memory.
        let is_there = |i: &usize| ![0, 5, 11, 12, 20, 21, 22, 30].contains(i);
        let there: Vec<usize> = (0..40).filter(is_there).collect();
        let value = |i: usize| (1.7 * i as f64).sin() + 0.3 * (i % 5) as f64;
        let dense = DMatrix::from_fn(there.len(), there.len(), |i, j| covariance[there[i].abs_diff(there[j])]);
        let known = DVector::from_iterator(there.len(), there.iter().map(|&i| value(i)));
        let expected = dense.cholesky().map_or(f64::NAN, |c| known.dot(&c.solve(&known)));
        // Two columns, the other one of unit white noise.
        let white = Colour { coefficients: Vec::new(), innovation: 1.0, error: 1.0, covariance: vec![1.0], count: 40 };
        let present: Vec<bool> = (0..80).map(|k| k % 2 == 1 || is_there(&(k / 2))).collect();
        let mut values = DVector::from_fn(80, |k, _| if present[k] { value(k / 2) } else { 0.0 });
        let other: Vec<f64> = values.iter().skip(1).step_by(2).copied().collect();
        let colours = [colour, white];
        Whitener::new(&colours, &present, &[]).whiten(&mut values);
        let found: f64 = values.iter().step_by(2).map(|v| v * v).sum();
        assert!((found / expected - 1.0).abs() < 1e-10, "{found} beside {expected}");
        assert!(values.iter().skip(1).step_by(2).eq(other.iter()));
    }

    #[test]
    fn without_holes_the_autoregression_alone_predicts_after_the_start() {
        let colour = second_order();
        let steps = steps(&colour, std::iter::repeat_n(true, 10));
        assert_eq!(steps.len(), 2, "{steps:?}");
    }
}
