//! Checks a smoother that mistakes all motion for noise.
//!
//! For a motion with few samples per period, the likelihood has a steep optimum at its length scale and a flat one at "all
//! noise", where an optimiser may end. Whether a column is predictable from its last samples decides between the two,
//! regardless of the kernel: for a motion that obeys a linear recursion `x_i = sum_k a_k x_(i-k)`, logged with white noise of standard deviation e, the recursion misses by
//! `e sqrt(1 + sum_k a_k^2)`.
//!
//! Source: Kay 1988, Modern Spectral Estimation, chapters 6 and 7.

use crate::data::Dataset;
use crate::error::Result;
use crate::gp::Weakness;
use crate::identify::limits::{CONTRADICTED, RECURSION};
use crate::progress::Progress;
use crate::regress::{LeastSquares, Regressor};
use crate::smooth::{Noise, Smoothed, Smoother};
use faer::Mat;

/// Smooths columns; where the noise explains nearly everything and yet the column can be foretold from its last samples, once
/// more with the noise that this leaves room for.
pub(crate) fn smooth_columns(
    smoother: &Smoother,
    data: &Dataset,
    columns: &[usize],
    progress: &dyn Progress,
) -> Result<Smoothed> {
    let smoothed = smoother.smooth(data, columns, progress)?;
    let opinion = |(fit, &c): (&crate::gp::Fit, &usize)| {
        let doubted = fit.weak.contains(&Weakness::NoSignal) && smoother.noise == Noise::Estimated;
        let room = if doubted { noise_of_recursion(data, c) } else { None };
        room.filter(|noise| *noise < CONTRADICTED * fit.noise)
    };
    let opinions: Vec<Option<f64>> = smoothed.fits.iter().zip(columns).map(opinion).collect();
    if opinions.iter().all(Option::is_none) {
        return Ok(smoothed);
    }
    let noise = opinions.iter().zip(&smoothed.fits).map(|(opinion, fit)| opinion.unwrap_or(fit.noise)).collect();
    Smoother { noise: Noise::Given(noise), ..smoother.clone() }.smooth(data, columns, progress)
}

/// Noise of a column by what a linear recursion over its last samples misses; none where there are too few samples.
fn noise_of_recursion(data: &Dataset, column: usize) -> Option<f64> {
    let (mut before, mut now) = (Vec::new(), Vec::new());
    for run in data.runs() {
        for window in run.column(column).windows(RECURSION + 1).filter(|w| w.iter().all(|v| v.is_finite())) {
            before.extend_from_slice(&window[..RECURSION]);
            now.push(window[RECURSION]);
        }
    }
    if now.len() < 4 * RECURSION {
        return None;
    }
    let theta = Mat::from_fn(now.len(), RECURSION, |i, k| before[i * RECURSION + k]);
    let fit = LeastSquares.fit(theta.as_ref(), &now).ok()?;
    let gain = 1.0 + fit.coefficients.iter().map(|a| a * a).sum::<f64>();
    Some((fit.residual / (now.len() - RECURSION) as f64 / gain).sqrt())
        .filter(|noise| noise.is_finite() && *noise > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};

    fn column(value: impl Fn(usize) -> f64) -> Dataset {
        let run = Run {
            name: "a".into(),
            time: (0..400).map(f64::from).collect(),
            values: Mat::from_fn(400, 1, |i, _| value(i)),
        };
        Dataset::new(vec![Channel::new("y")], vec![run]).unwrap()
    }

    #[test]
    fn a_resonance_of_nine_samples_a_period_is_foretold_and_noise_is_not() {
        // Hashes of the sample's number, between -1 and 1: noise of standard deviation 0.58.
        let noise = |i: usize| 2.0 * ((i as f64 * 12.9898).sin() * 43758.5453).fract().abs() - 1.0;
        let resonance = column(|i| (0.7 * i as f64).sin() + 0.01 * noise(i));
        assert!(noise_of_recursion(&resonance, 0).unwrap() < 0.02);
        assert!(noise_of_recursion(&column(noise), 0).unwrap() > 0.4);
        assert!(noise_of_recursion(&column(|i| if i % 3 == 0 { f64::NAN } else { 1.0 }), 0).is_none());
    }
}
