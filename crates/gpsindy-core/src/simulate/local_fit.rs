//! A derivative at one time from noisy samples around it: local polynomials, the window chosen by the data.
//!
//! Among polynomials of several degrees and windows the one with the least variance is taken that still
//! agrees with every one of larger variance (Lepski's rule, as intersection of confidence intervals).
//!
//! Source: Goldenshluger, Nemirovski 1997, On spatially adaptive estimation of nonparametric regression.

use crate::data::difference_noise;
use nalgebra::{DMatrix, DVector};

/// Half width of the confidence intervals that must agree, in standard deviations.
const AGREEMENT: f64 = 2.0;
const WINDOWS: [usize; 11] = [5, 7, 10, 14, 20, 28, 40, 56, 80, 160, 320];

/// Derivative number `order` at time `at` (s) of the samples (`time`, `values`), which are without gaps and
/// carry white noise of standard deviation `noise` (see [`noise_level`]).
///
/// None for fewer samples than a polynomial of that degree needs.
pub(super) fn local_derivative(time: &[f64], values: &[f64], noise: f64, at: f64, order: usize) -> Option<f64> {
    if time.len() < order + 2 {
        return None;
    }
    let mut candidates = Vec::new();
    for degree in order..=order + 2 {
        for window in WINDOWS.iter().map(|&w| w.max(degree + 1).min(time.len())) {
            if window > degree
                && let Some(found) = polynomial(nearest(time, at, window), time, values, at, order, degree)
            {
                candidates.push((found.0, found.1 * noise));
            }
        }
    }
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut chosen = None;
    for (value, deviation) in candidates {
        low = low.max(value - AGREEMENT * deviation);
        high = high.min(value + AGREEMENT * deviation);
        if low > high {
            break;
        }
        chosen = Some(value);
    }
    chosen
}

/// The `window` samples nearest to time `at`.
fn nearest(time: &[f64], at: f64, window: usize) -> std::ops::Range<usize> {
    let mut start = time.partition_point(|&t| t < at);
    let mut end = start;
    while end - start < window {
        let left = start.checked_sub(1).map_or(f64::INFINITY, |i| at - time[i]);
        let right = time.get(end).map_or(f64::INFINITY, |t| t - at);
        if left < right { start -= 1 } else { end += 1 }
    }
    start..end
}

/// The derivative by a least-squares polynomial, and its standard deviation for noise of size 1.
fn polynomial(
    rows: std::ops::Range<usize>,
    time: &[f64],
    values: &[f64],
    at: f64,
    order: usize,
    degree: usize,
) -> Option<(f64, f64)> {
    let reach = rows.clone().map(|i| (time[i] - at).abs()).fold(0.0, f64::max);
    if reach == 0.0 {
        return None;
    }
    let first = rows.start;
    let basis = DMatrix::from_fn(rows.len(), degree + 1, |i, k| ((time[first + i] - at) / reach).powi(k as i32));
    let wanted = DVector::from_fn(rows.len(), |i, _| values[first + i]);
    let qr = basis.qr();
    let upper = qr.r();
    let mut coefficients = qr.q().transpose() * wanted;
    if !upper.solve_upper_triangular_mut(&mut coefficients) {
        return None;
    }
    // The variance of coefficient k is the squared length of row k of the inverse of R.
    let mut unit = DVector::zeros(degree + 1);
    unit[order] = 1.0;
    if !upper.tr_solve_upper_triangular_mut(&mut unit) {
        return None;
    }
    let factor = (1..=order).map(|k| k as f64).product::<f64>() / reach.powi(order as i32);
    Some((coefficients[order] * factor, unit.norm() * factor))
}

/// Standard deviation of white noise on a smooth signal, by its third differences.
///
/// A column with a resolution carries at least the noise of its rounding.
pub(super) fn noise_level(values: &[f64]) -> f64 {
    let size = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let floor = (4.0 * f64::EPSILON * size.max(f64::MIN_POSITIVE)).max(resolution(values) / 12.0_f64.sqrt());
    difference_noise([values], 3).max(floor)
}

/// The step of which all differences are multiples, such as an encoder's count; 0 where there is none.
fn resolution(values: &[f64]) -> f64 {
    let size = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let steps = || values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|step| *step > 1e-9 * size);
    let smallest = steps().fold(f64::INFINITY, f64::min);
    let is_multiple = |step: &f64| (step / smallest - (step / smallest).round()).abs() < 0.05;
    if steps().count() > 3 && steps().all(|step| is_multiple(&step)) { smallest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_clean_sine_is_close_and_that_of_a_line_exact() {
        let time: Vec<f64> = (0..200).map(|i| 0.02 * i as f64).collect();
        let line: Vec<f64> = time.iter().map(|t| 3.0 - 2.0 * t).collect();
        assert!((local_derivative(&time, &line, noise_level(&line), 0.0, 1).unwrap() + 2.0).abs() < 1e-12);
        let sine: Vec<f64> = time.iter().map(|t| t.sin()).collect();
        // A cubic through five samples errs by about h^3 = 1e-5.
        assert!((local_derivative(&time, &sine, noise_level(&sine), 0.0, 1).unwrap() - 1.0).abs() < 1e-4);
        assert!((local_derivative(&time, &sine, noise_level(&sine), 1.0, 2).unwrap() + 1.0_f64.sin()).abs() < 1e-2);
    }

    #[test]
    fn noise_widens_the_window() {
        use rand_chacha::ChaCha8Rng;
        use rand_core::{Rng, SeedableRng};
        let time: Vec<f64> = (0..200).map(|i| 0.02 * i as f64).collect();
        let mut worst: f64 = 0.0;
        for seed in 0..20 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let noisy: Vec<f64> = time
                .iter()
                .map(|t| t.sin() + 0.017 * ((random.next_u32() as f64) / f64::from(u32::MAX) * 2.0 - 1.0))
                .collect();
            worst = worst.max((local_derivative(&time, &noisy, noise_level(&noisy), 0.0, 1).unwrap() - 1.0).abs());
        }
        // Noise of 0.01 gives the slope of the shortest window, a line of five, a deviation of 0.16; its cubic one of 1.6.
        assert!(worst < 0.25, "{worst}");
    }

    #[test]
    fn an_encoders_counts_are_taken_for_noise() {
        // A slope of a fifth of a count a sample, read in counts of 0.01: most third differences are 0.
        let time: Vec<f64> = (0..200).map(|i| 0.01 * i as f64).collect();
        let counts: Vec<f64> = time.iter().map(|t| (0.2 * t / 0.01).floor() * 0.01).collect();
        assert!((resolution(&counts) - 0.01).abs() < 1e-12);
        let slope = local_derivative(&time, &counts, noise_level(&counts), 0.5, 1).unwrap();
        assert!((slope - 0.2).abs() < 0.02, "{slope}");
        let smooth: Vec<f64> = time.iter().map(|t| t.sin()).collect();
        assert_eq!(resolution(&smooth), 0.0);
    }
}
