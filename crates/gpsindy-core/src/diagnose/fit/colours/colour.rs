//! The colour of every sensor's noise: autoregressions of the residuals, one a column.

pub(crate) use crate::diagnose::fit::colours::autoregression::Colour;
use crate::diagnose::fit::colours::autoregression::levinson;
use crate::diagnose::fit::colours::cells::Cells;
use crate::diagnose::fit::colours::whitening::prediction_error;
use crate::diagnose::limits::MAX_ORDER;

/// Noise models of every column, pooled over the windows. `residuals`: sample by sample, NaN is missing. `repeats`: which of them repeat the
/// value before, nothing where none does. The noise model of a column that repeats its readings is that of one cell after the other.
pub(crate) fn colours(residuals: &[Vec<f64>], n_columns: usize, repeats: &[Vec<bool>]) -> Vec<Colour> {
    (0..n_columns)
        .map(|column| {
            let mut within = 0.0;
            let of_window = |(w, all): (usize, &Vec<f64>)| -> Vec<f64> {
                let rows: Vec<f64> = all.iter().skip(column).step_by(n_columns).copied().collect();
                let own = repeats.get(w).filter(|own| !own.is_empty());
                let Some(cells) = own.and_then(|own| {
                    let repeats = own.iter().skip(column).step_by(n_columns);
                    Cells::new(rows.iter().map(|e| e.is_finite()).zip(repeats.copied()))
                }) else {
                    return rows;
                };
                let means = cells.means(&rows);
                within += cells.within(&rows, &means);
                means
            };
            let series: Vec<Vec<f64>> = residuals.iter().enumerate().map(of_window).collect();
            let count = series.iter().flatten().filter(|e| e.is_finite()).count();
            let variance =
                series.iter().flatten().filter(|e| e.is_finite()).map(|e| e * e).sum::<f64>() / count.max(1) as f64;
            let covariance: Vec<f64> = (0..=MAX_ORDER).map(|lag| variance * autocorrelation(&series, lag)).collect();
            let mut colour = levinson(&covariance, count);
            if count < series.iter().map(Vec::len).sum() {
                colour.error = prediction_error(&colour, &series);
            }
            // What is missed of the repeats is no part of the noise, and adds to whatever is left.
            let within = within / count.max(1) as f64;
            colour.innovation += within;
            colour.error += within;
            colour.covariance[0] += within;
            colour
        })
        .collect()
}

/// Correlation of values `lag` samples apart, as if the ends of all windows were padded with zeros, which keeps the
/// autoregression stable (Brockwell and Davis 1991, section 7.2).
///
/// Over the pairs that are there, products are compared with their own squares, so that a hole next to a large value biases
/// nothing; the values that are there say what the squares of all pairs would be.
fn autocorrelation(series: &[Vec<f64>], lag: usize) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    // Squares and their number: of all values, and of those in pairs, which counts values near an end half.
    let (mut all, mut paired) = ((0.0, 0.0), (0.0, 0.0));
    let (mut values, mut pairs) = (0usize, 0usize);
    for window in series {
        values += window.len();
        pairs += window.len().saturating_sub(lag);
        for (i, value) in window.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let share = 0.5 * (f64::from(i >= lag) + f64::from(i + lag < window.len()));
            all = (all.0 + value * value, all.1 + 1.0);
            paired = (paired.0 + share * value * value, paired.1 + share);
        }
        for (a, b) in window.iter().zip(window.iter().skip(lag)).filter(|(a, b)| (*a * *b).is_finite()) {
            products += a * b;
            squares += 0.5 * (a * a + b * b);
        }
    }
    if !(squares > 0.0 && paired.1 > 0.0) {
        return 0.0;
    }
    let whole = paired.0 / paired.1 * pairs as f64 / (all.0 / all.1 * values as f64);
    products / squares * whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fit::colours::whitening::Whitener;
    use crate::random::normal;
    use nalgebra::DVector;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    fn noise(seed: u64, count: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| normal(&mut random)).collect()
    }

    /// Noise with a coefficient of 0.8.
    fn slow_noise(seed: u64, count: usize) -> Vec<f64> {
        let mut series = noise(seed, count);
        for i in 1..count {
            series[i] += 0.8 * series[i - 1];
        }
        series
    }

    #[test]
    fn an_autoregressive_series_gives_its_coefficient_back_and_becomes_white() {
        let series = slow_noise(1, 4000);
        let colour = colours(std::slice::from_ref(&series), 1, &[]).remove(0);
        // Standard error sqrt((1 - 0.8^2)/4000) = 0.01.
        assert!((colour.coefficients[0] - 0.8).abs() < 0.04, "{colour:?}");
        assert!((colour.innovation - 1.0).abs() < 0.1);
        let mut white = DVector::from_vec(series);
        Whitener::new(&[colour], &[true; 4000], &[]).whiten(&mut white);
        let white = colours(&[white.as_slice().to_vec()], 1, &[]).remove(0);
        assert!(white.coefficients.is_empty(), "{white:?}");
    }

    #[test]
    fn white_noise_is_taken_as_white() {
        let colour = colours(&[noise(2, 3000)], 1, &[]).remove(0);
        assert!(colour.coefficients.is_empty());
        assert!((colour.covariance[0] - 1.0).abs() < 0.1);
    }

    #[test]
    fn missing_values_are_left_out() {
        let mut series = noise(3, 2000);
        series.iter_mut().step_by(7).for_each(|v| *v = f64::NAN);
        let colour = colours(&[series], 1, &[]).remove(0);
        assert!((colour.variance() - 1.0).abs() < 0.12);
        assert!(colour.coefficients.len() <= 1);
    }

    #[test]
    fn without_holes_correlations_are_those_of_the_textbook() {
        let series = noise(4, 50);
        let products: f64 = series.iter().zip(&series[3..]).map(|(a, b)| a * b).sum();
        let squares: f64 = series.iter().map(|e| e * e).sum();
        assert!((autocorrelation(&[series], 3) - products / squares).abs() < 1e-14);
    }

    #[test]
    fn a_large_smooth_rest_with_holes_is_predicted_no_better_than_its_noise_allows() {
        let mut series = noise(5, 1500);
        for (i, value) in series.iter_mut().enumerate() {
            *value += 40.0 * (0.01 * i as f64).sin();
            if i % 3 == 1 {
                *value = f64::NAN;
            }
        }
        let colour = colours(&[series], 1, &[]).remove(0);
        assert!(colour.error > 1.0, "{colour:?}");
        // Noise alone is what it is.
        let mut alone = slow_noise(6, 3000);
        alone.iter_mut().step_by(3).for_each(|v| *v = f64::NAN);
        let colour = colours(&[alone], 1, &[]).remove(0);
        // A hole makes the value behind it as uncertain as 1 + 0.8^2: the geometric mean over half of the values is 1.28.
        assert!((colour.error - 1.28).abs() < 0.1, "{colour:?}");
    }

    #[test]
    fn holes_bias_neither_the_colour_nor_the_size_of_the_noise() {
        let mut series = slow_noise(3, 20_000);
        let full = colours(std::slice::from_ref(&series), 1, &[]).remove(0);
        series.iter_mut().step_by(3).for_each(|v| *v = f64::NAN);
        let holed = colours(&[series], 1, &[]).remove(0);
        assert_eq!(holed.count, 13_333);
        // Standard error sqrt((1 - 0.8^2)/20000) = 0.004, more with a third missing.
        assert!((holed.coefficients[0] - full.coefficients[0]).abs() < 0.03, "{holed:?}");
        assert!((holed.innovation / full.innovation - 1.0).abs() < 0.1, "{holed:?}");
    }
}
