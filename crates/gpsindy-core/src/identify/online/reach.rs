//! The reach of a sample: the rate at which its influence on a smoothed value decays.
//!
//! Smoothing by a Matern process of spectral density `S(w) = q / (lambda^2 + w^2)^m` under noise of density `r` is a filter
//! `S / (S + r)`, whose poles are where `(lambda^2 - s^2)^m = -q / r`. The slowest of them is the rate asked for.
//!
//! Between samples that hardly carry noise the process interpolates like a spline, and a sample's influence falls by a
//! constant factor a sample; the two add up.
//!
//! Source: Wiener 1949; Unser 1999, Splines: a perfect fit for signal and image processing (the poles of splines); Sarkka and Solin 2019, Applied Stochastic Differential Equations, section 12.3.

use crate::gp::{Fit, Kernel, Role};
use crate::identify::limits::online::NOTHING;

/// Samples over which the influence of a sample falls by a factor of e, for samples every `period` s; `None` for another
/// kernel than `matern32` and `matern52`.
fn samples(fit: &Fit, period: f64) -> Option<f64> {
    let value = |wanted: fn(&Role) -> bool| fit.parameters().iter().find(|(role, _)| wanted(role)).map(|(_, v)| *v);
    let amplitude = value(|role| matches!(role, Role::Amplitude))?;
    let length = value(|role| matches!(role, Role::Length(_)))?;
    // q / r for a process of unit rate, then the square of the pole, 1 - (-q / r)^(1/m), in 1/lambda^2.
    let ratio = |factor: f64, lambda: f64| factor * (amplitude / fit.noise).powi(2) / (lambda * period);
    let (lambda, real, imaginary, spline) = match fit.kernel {
        Kernel::Matern32 => {
            let lambda = 3f64.sqrt() / length;
            (lambda, 1.0, ratio(MATERN_32, lambda).sqrt(), CUBIC)
        }
        Kernel::Matern52 => {
            let lambda = 5f64.sqrt() / length;
            let root = ratio(MATERN_52, lambda).cbrt();
            (lambda, 1.0 - 0.5 * root, 0.5 * 3f64.sqrt() * root, QUINTIC)
        }
        _ => return None,
    };
    let rate = lambda * (0.5 * (real.hypot(imaginary) + real)).sqrt();
    Some(1.0 / (rate * period) - 1.0 / spline.ln())
}

/// Spectral densities of the two processes at frequency 0, of unit variance and `lambda`. Exact.
const MATERN_32: f64 = 4.0;
const MATERN_52: f64 = 16.0 / 3.0;

/// Factor a sample by which the influence in an interpolating cubic spline falls: `2 - sqrt(3)`. Exact.
const CUBIC: f64 = 0.267_949_192_431_122_7;

/// The same for a quintic one. Exact.
const QUINTIC: f64 = 0.430_575_347_099_973_8;

/// Samples beyond which no other affects a smoothed value, at most `most`.
pub(super) fn reach(fits: &[Fit], period: f64, most: usize) -> usize {
    let longest = fits.iter().filter_map(|fit| samples(fit, period)).fold(1.0, f64::max);
    ((-NOTHING.ln() * longest).ceil() as usize).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gp::{Conditioned, FitSettings, Points, Quantity, fit};
    use crate::random::normal;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;
    use std::slice::from_ref;

    #[test]
    fn a_sample_as_far_away_as_the_reach_tells_nothing() {
        let period = 0.1;
        let time: Vec<f64> = (0..400).map(|i| period * f64::from(i)).collect();
        for kernel in [Kernel::Matern32, Kernel::Matern52] {
            for noise in [0.003, 0.3] {
                let mut random = ChaCha8Rng::seed_from_u64(5);
                let values: Vec<f64> = time.iter().map(|t| t.sin() + noise * normal(&mut random)).collect();
                let points = Points::in_time(&time, &values);
                let found = fit(from_ref(&kernel), from_ref(&points), &FitSettings::default()).unwrap();
                let at = [vec![time[200]]];
                let value = |points: &Points| {
                    let process = Conditioned::about(&found, points, found.mean).unwrap();
                    process.predict(&at, &[Quantity::Value], false).unwrap().mean[0]
                };
                let far = reach(from_ref(&found), period, usize::MAX);
                assert!((10..190).contains(&far), "{far}");
                let change = |distance: usize| {
                    let mut moved = points.clone();
                    moved.targets[200 + distance] += 1.0;
                    (value(&moved) - value(&points)).abs()
                };
                // The gain at distance 0 is below 1.
                assert!(change(far) < 1e-6, "{kernel} {noise}: {:e} at {far}", change(far));
                // It is no waste either: a third of it is too little.
                assert!(change(far / 3) > 1e-5, "{kernel} {noise}: {:e} at a third of {far}", change(far / 3));
            }
        }
    }
}
