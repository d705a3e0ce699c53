//! Linearised gains: how far each hypothesis would improve the fit, with all free quantities projected out.
//!
//! A column is the change of the whitened outputs when the hypothesis is switched on at its start values. Initial states
//! and free parameters are eliminated first (Frisch and Waugh 1933), so that an effect which another parameter value or
//! initial state could imitate has no gain.

use crate::diagnose::catalogue::hypothesis::{Added, Applied, Combine, Start};
use crate::diagnose::fit::bounded::{bounded_gain, span_gain};
use crate::diagnose::fit::colour::Colour;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::fitter::starts;
use crate::diagnose::fit::guide::whiten;
use crate::diagnose::fit::lagging::with_lagging;
use crate::diagnose::fit::moved::is_strained;
use crate::diagnose::fit::responses::{LANES, responses};
use crate::diagnose::fit::whitening::Whitener;
use crate::diagnose::limits::{MOST_STRAINED, SHOWN, STEP};
use crate::model::System;
use crate::refine::Starts;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Residuals of a fit after whitening and projection, and what is needed to treat columns alike.
pub(crate) struct Basis {
    windows: Vec<Projected>,
    first: First,
    /// Inverse of the free parameters' Gram matrix, and their product with the residual.
    inverse: DMatrix<f64>,
    slope: DVector<f64>,
    /// Parameters that stand where their tolerance ends: an effect may let them back, never further out.
    strained: Vec<Strained>,
}

/// The values of a window's first samples, and by how much they count more than the others.
struct First {
    values: usize,
    weight: f64,
}

impl First {
    fn weigh(&self, values: &mut DVector<f64>) {
        values.iter_mut().take(self.values).for_each(|value| *value *= self.weight);
    }
}

/// A tolerated parameter at the end of its tolerance, as a column that points back.
struct Strained {
    /// Its place among the free parameters, and the way back to its nominal value.
    place: usize,
    back: f64,
    /// What its belief adds to the column's product with itself, and as much to that with the residual.
    belief: f64,
    /// Per window, whitened and projected like the free directions.
    column: Vec<DVector<f64>>,
}

/// One window.
struct Projected {
    whitening: Whitening,
    /// Orthonormal directions of the initial state.
    directions: DMatrix<f64>,
    residual: DVector<f64>,
    /// Directions of the free parameters.
    free: DMatrix<f64>,
}

/// What makes a window's values white.
enum Whitening {
    /// Noise with a memory, column by column.
    Noise(Whitener),
    /// The innovations of a filter, sample by sample.
    Innovations(Arc<Vec<DMatrix<f64>>>),
}

impl Whitening {
    fn apply(&self, values: &mut DVector<f64>) {
        match self {
            Self::Noise(whitener) => whitener.whiten(values),
            Self::Innovations(by_sample) => whiten(by_sample, values),
        }
    }
}

/// What a start of a hypothesis would gain.
#[derive(Debug, Clone)]
pub(crate) struct Gain {
    /// Decrease of twice the negative log likelihood, by a straight line.
    pub(crate) gain: f64,
    /// Start values of the added parameters for a fit.
    pub(crate) values: Vec<f64>,
    /// Degrees of freedom of this start.
    pub(crate) degrees: usize,
    /// Standard deviation of the size that the first column moves, where it moves one from zero; `None` where only sizes
    /// beyond the typical one would show.
    pub(crate) deviation: Option<f64>,
}

impl Basis {
    /// Noise as white as the residual is large where `white`, else of the residual's colours; a filter's innovations are what it
    /// expects.
    pub(crate) fn new(at: &Linearised<'_>, white: bool) -> Self {
        let Linearised { contestant: fitted, jacobian, guide } = at;
        let colours: Vec<Colour> = fitted
            .evidence
            .colours
            .iter()
            .map(|c| match white {
                true => Colour {
                    coefficients: Vec::new(),
                    innovation: 1.0,
                    error: 1.0,
                    covariance: vec![1.0],
                    count: c.count,
                },
                false => c.clone(),
            })
            .collect();
        let n = jacobian.n_states;
        let q = fitted.free.len();
        let mut gram = DMatrix::zeros(q, q);
        let mut slope = DVector::zeros(q);
        for (i, free) in fitted.free.iter().enumerate() {
            if let Some((mean, sd)) = free.prior {
                // A belief is one more measurement, of the parameter itself.
                gram[(i, i)] += 1.0 / (sd * sd);
                slope[i] += (mean - fitted.refined.parameters[free.parameter]) / (sd * sd);
            }
        }
        let mut strained: Vec<Strained> = (0..q)
            .filter(|&place| is_strained(fitted, place))
            .filter_map(|place| {
                let (mean, sd) = fitted.free[place].prior?;
                let back = mean - fitted.refined.parameters[fitted.free[place].parameter];
                Some(Strained { place, back, belief: (back / sd).powi(2), column: Vec::new() })
            })
            .take(MOST_STRAINED)
            .collect();
        let starts = if guide.is_some() { Starts::default() } else { starts(fitted) };
        let first = First { values: starts.samples * fitted.experiment.columns.len(), weight: starts.weight(0).sqrt() };
        let windows = jacobian
            .blocks
            .iter()
            .enumerate()
            .map(|(window, block)| {
                let whitening = match guide {
                    Some(guide) => Whitening::Innovations(guide.whitening[window].clone()),
                    None => Whitening::Noise(Whitener::new(&colours, &block.present)),
                };
                let mut residual = block.residual.clone();
                whitening.apply(&mut residual);
                first.weigh(&mut residual);
                let mut derivative = block.derivative.clone();
                for mut column in derivative.column_iter_mut() {
                    let mut values = column.clone_owned();
                    whitening.apply(&mut values);
                    first.weigh(&mut values);
                    column.copy_from(&values);
                }
                let directions = orthonormal(derivative.columns(0, n).into_owned());
                let mut free = derivative.columns(n, q).into_owned();
                free -= &directions * directions.tr_mul(&free);
                for strained in &mut strained {
                    strained.column.push(free.column(strained.place) * strained.back);
                }
                // What stands where its tolerance ends does not go further for an effect.
                (0..q).filter(|&i| is_strained(fitted, i)).for_each(|i| free.column_mut(i).fill(0.0));
                residual -= &directions * directions.tr_mul(&residual);
                gram += free.tr_mul(&free);
                slope += free.tr_mul(&residual);
                Projected { whitening, directions, residual, free }
            })
            .collect();
        let ridge = gram.diagonal().max() * 1e-12 + f64::MIN_POSITIVE;
        let inverse = (gram + DMatrix::identity(q, q) * ridge).try_inverse().unwrap_or_else(|| DMatrix::zeros(q, q));
        Self { windows, first, inverse, slope, strained }
    }

    /// Bounds of the lengths of the strained columns: anywhere back, nowhere further out.
    fn back(&self) -> impl Iterator<Item = (f64, f64)> {
        self.strained.iter().map(|_| (0.0, f64::INFINITY))
    }

    /// Products of columns (one list of windows each) among themselves and with the residual; the strained parameters
    /// are further columns.
    fn products(&self, columns: &mut [Vec<DVector<f64>>]) -> (DMatrix<f64>, DVector<f64>) {
        for column in columns.iter_mut() {
            for (Projected { whitening, directions, .. }, values) in self.windows.iter().zip(column) {
                whitening.apply(values);
                self.first.weigh(values);
                *values -= directions * directions.tr_mul(values);
            }
        }
        let all: Vec<&Vec<DVector<f64>>> = columns.iter().chain(self.strained.iter().map(|s| &s.column)).collect();
        let (own, k) = (columns.len(), all.len());
        let mut gram = DMatrix::zeros(k, k);
        let mut slope = DVector::zeros(k);
        let mut mixed = DMatrix::zeros(self.inverse.nrows(), k);
        for (w, Projected { residual, free, .. }) in self.windows.iter().enumerate() {
            for i in 0..k {
                slope[i] += all[i][w].dot(residual);
                mixed.column_mut(i).axpy(1.0, &free.tr_mul(&all[i][w]), 1.0);
                for j in 0..=i {
                    gram[(i, j)] += all[i][w].dot(&all[j][w]);
                }
            }
        }
        for (i, strained) in self.strained.iter().enumerate() {
            gram[(own + i, own + i)] += strained.belief;
            slope[own + i] += strained.belief;
        }
        gram.fill_upper_triangle_with_lower_triangle();
        let eliminated = &self.inverse * &mixed;
        (gram - mixed.tr_mul(&eliminated), slope - eliminated.tr_mul(&self.slope))
    }

    /// Best straight-line gain of columns that belong together.
    fn gain(&self, start: &Start, fitted: &[(usize, Added)], columns: &mut [Vec<DVector<f64>>]) -> Gain {
        let before: Vec<f64> = columns.iter().map(|c| c.iter().map(DVector::norm_squared).sum()).collect();
        let (gram, slope) = self.products(columns);
        let nothing = Gain::nothing(start);
        // What is left after the projection must not be rounding error.
        let usable = |i: usize| gram[(i, i)] > 1e-9 * before[i] && gram[(i, i)].is_finite() && gram[(i, i)] > 0.0;
        match start.combine {
            Combine::Keep if usable(0) && !self.strained.is_empty() => {
                let bounds: Vec<(f64, f64)> = std::iter::once(STEP).chain(self.back()).collect();
                let (gain, _) = bounded_gain(&gram, &slope, &bounds);
                Gain { gain, ..nothing }
            }
            Combine::Keep if usable(0) => {
                // The column is a finite step: taken in full, half or double, not at any length.
                let length = (slope[0] / gram[(0, 0)]).clamp(STEP.0, STEP.1);
                Gain { gain: 2.0 * length * slope[0] - length * length * gram[(0, 0)], ..nothing }
            }
            Combine::Amplitude => {
                let count = columns.len();
                let own = (0..count).map(|i| if usable(i) { length_bounds(start, fitted, i) } else { (0.0, 0.0) });
                let bounds: Vec<(f64, f64)> = own.chain(self.back()).collect();
                let (gain, mut lengths) = bounded_gain(&gram, &slope, &bounds);
                lengths.truncate(count);
                let mut values = start.columns[0].clone();
                for (i, &(place, origin)) in start.amplitudes.iter().enumerate() {
                    values[place] = origin + lengths[i] * (start.columns[i][place] - origin);
                }
                let (place, origin) = start.amplitudes[0];
                let is_size = usable(0) && origin == 0.0;
                let deviation = is_size.then(|| start.columns[0][place].abs() / gram[(0, 0)].sqrt());
                let deviation = deviation.filter(|deviation| is_telling(*deviation, fitted.get(place)));
                let degrees = lengths.iter().filter(|l| **l != 0.0).count().max(1);
                Gain { gain, values, degrees, deviation }
            }
            Combine::Sinusoid if usable(0) && usable(1) => {
                let free = [(f64::NEG_INFINITY, f64::INFINITY); 2];
                let bounds: Vec<(f64, f64)> = free.into_iter().chain(self.back()).collect();
                let (gain, lengths) = bounded_gain(&gram, &slope, &bounds);
                let mut values = start.columns[0].clone();
                values[0] *= lengths[0].hypot(lengths[1]);
                if let Some(phase) = values.last_mut() {
                    *phase += lengths[1].atan2(lengths[0]);
                }
                let deviation = (gain > 0.0).then(|| (values[0] / gain.sqrt()).abs());
                let deviation = deviation.filter(|deviation| is_telling(*deviation, fitted.first()));
                Gain { gain, values, degrees: 2, deviation }
            }
            Combine::Span => {
                let k = before.len();
                let (gram, slope) = (gram.view((0, 0), (k, k)).into_owned(), slope.rows(0, k).into_owned());
                match span_gain(&gram, &slope, &before) {
                    Some((gain, degrees)) => Gain { gain, degrees, ..nothing },
                    None => nothing,
                }
            }
            _ => nothing,
        }
    }
}

impl Gain {
    fn nothing(start: &Start) -> Self {
        Self { gain: 0.0, values: start.columns[0].clone(), degrees: 1, deviation: None }
    }
}

/// Whether a size that shows at this deviation is below the typical one, with which the effect would move its equation as much
/// as all else does together: a larger one shows in any log, so its exclusion says nothing.
fn is_telling(deviation: f64, added: Option<&(usize, Added)>) -> bool {
    added.is_none_or(|(_, added)| SHOWN * deviation < added.scale)
}

/// Least and greatest length of column `i` for which its parameter stays within its bounds: a friction that would
/// have to push is refused here already.
fn length_bounds(start: &Start, fitted: &[(usize, Added)], i: usize) -> (f64, f64) {
    let (place, origin) = start.amplitudes[i];
    let Some((_, added)) = fitted.get(place) else { return (f64::NEG_INFINITY, f64::INFINITY) };
    let step = start.columns[i][place] - origin;
    let (a, b) = ((added.lower - origin) / step, (added.upper - origin) / step);
    if a.is_nan() || b.is_nan() { (f64::NEG_INFINITY, f64::INFINITY) } else { (a.min(b), a.max(b)) }
}

/// Orthonormal basis of the columns that are not negligible (modified Gram-Schmidt).
fn orthonormal(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut kept: Vec<DVector<f64>> = Vec::new();
    for column in matrix.column_iter_mut() {
        let size = column.norm();
        let mut values = column.clone_owned();
        for _ in 0..2 {
            for other in &kept {
                let part = other.dot(&values);
                values.axpy(-part, other, 1.0);
            }
        }
        let left = values.norm();
        if left > 1e-8 * size && left > 0.0 {
            kept.push(values / left);
        }
    }
    if kept.is_empty() { DMatrix::zeros(matrix.nrows(), 0) } else { DMatrix::from_columns(&kept) }
}

/// Gains of every start of an applied hypothesis under several bases, best start first under the first basis.
pub(crate) fn gains(applied: &Applied, at: &Linearised<'_>, bases: &[&Basis]) -> Vec<Vec<Gain>> {
    let fitted = at.contestant;
    let system = System::with_simulator(&applied.model, fitted.system.simulator().cloned());
    let Ok(system) = system.and_then(|s| s.with_followers(fitted.nominal_states())) else {
        return Vec::new();
    };
    let initial = with_lagging(&system, &fitted.experiment, fitted.refined.initial.clone(), fitted.system.n_states());
    let per_pass = |starts: &[Start]| starts.iter().map(|s| s.columns.len()).sum::<usize>();
    let mut all = Vec::with_capacity(applied.starts.len());
    let mut rest = &applied.starts[..];
    while !rest.is_empty() {
        let count = (1..=rest.len()).rev().find(|&c| per_pass(&rest[..c]) <= LANES).unwrap_or(1);
        let (now, later) = rest.split_at(count);
        let wanted: Vec<&Vec<f64>> = now.iter().flat_map(|s| &s.columns).collect();
        let passes = wanted.chunks(LANES).map(|part| responses(&system, applied, at, &initial, part));
        let mut columns: Vec<Vec<DVector<f64>>> = passes.flatten().collect();
        for start in now {
            let own: Vec<Vec<DVector<f64>>> = columns.drain(..start.columns.len()).collect();
            let finite = own.iter().flatten().all(|v| v.iter().all(|x| x.is_finite()));
            let gains = bases.iter().map(|basis| match finite {
                true => basis.gain(start, &applied.fitted, &mut own.clone()),
                false => Gain::nothing(start),
            });
            all.push(gains.collect());
        }
        rest = later;
    }
    all
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::enumerate::enumerate;
    use crate::diagnose::fit::contestant::Contestant;
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::fit::outputs::scene_of;
    use crate::diagnose::fit::tolerance::tolerated;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::limits::Budget;
    use crate::refine::Experiment;

    /// Straight-line gain of a viscous friction for a drive whose tolerated rate (1 per second, 2 %) is another one.
    fn relaxation(rate: f64) -> (f64, Contestant) {
        let (model, data) = drive(Some(0.02), |x| rate * x, 0.0, (1, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap();
        let fitter = Fitter::default();
        let fitted = fitter.nominal(system.clone(), experiment, tolerated(&model), Budget::Thorough).unwrap();
        let scene = scene_of(&fitted);
        let all = enumerate(&model, &scene, &[0], &[]).unwrap();
        let friction = all.iter().find(|h| h.id() == "viscous_friction").unwrap();
        let applied = friction.apply(&model, &scene).unwrap();
        let gain = {
            let at = fitted.linearised().unwrap();
            gains(&applied, &at, &[&Basis::new(&at, true)])[0][0].gain
        };
        (gain, fitted)
    }

    #[test]
    fn a_part_of_the_windows_tells_its_share_of_the_gain() {
        let (model, data) = drive(None, |x| 1.3 * x, 1e-3, (4, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap().with_windows_of(1.0);
        let fitted = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let scene = scene_of(&fitted);
        let all = enumerate(&model, &scene, &[0], &[]).unwrap();
        let applied = all.iter().find(|h| h.id() == "viscous_friction").unwrap().apply(&model, &scene).unwrap();
        let gain = |at: &Linearised<'_>| gains(&applied, at, &[&Basis::new(at, true)])[0][0].gain;
        let at = fitted.linearised().unwrap();
        let readings = fitted.experiment.n_values();
        let sketch = at.sketch(readings.div_ceil(3)).unwrap();
        assert!((sketch.share - 1.0 / 3.0).abs() < 0.06, "{}", sketch.share);
        let (whole, part) = (gain(&at), gain(&sketch.linearised()) / sketch.share);
        assert!((part / whole - 1.0).abs() < 0.2, "{part} of {whole}");
        // There is no part of what is few already.
        assert!(at.sketch(readings).is_none());
    }

    #[test]
    fn an_effect_gains_the_strain_of_a_tolerated_parameter_that_it_relieves() {
        let (gain, fitted) = relaxation(1.04);
        // The rate is two tolerances off and the friction is the same term: the belief's square of two comes free.
        assert!((gain - 4.0).abs() < 0.05, "{gain}");
        assert!(fitted.evidence.strain > 1.0, "{}", fitted.evidence.strain);
    }

    #[test]
    fn an_effect_lets_a_parameter_back_from_the_end_of_its_tolerance() {
        let (gain, fitted) = relaxation(1.061);
        assert!(is_strained(&fitted, 0));
        // The friction explains all: what the end of the tolerance leaves, and the belief's square of three. Straight
        // lines lose about a twentieth of the residual's part (the rate moves by 6 %).
        let left = fitted.refined.cost - 9.0;
        assert!(left > 5.0, "{left}");
        assert!((gain - fitted.refined.cost).abs() < 0.2 * left + 0.5, "{gain} of {}", fitted.refined.cost);
    }
}
