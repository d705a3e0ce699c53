//! Standardisation of targets: each run by its own mean, all by one standard deviation.

use super::settings::FitSettings;
use crate::error::Result;
use crate::gp::points::Points;

/// Offsets and scale of the targets, and the noise floor that goes with them.
#[derive(Debug, Clone)]
pub(crate) struct Scale {
    /// Mean of each run.
    pub(crate) means: Vec<f64>,
    /// Mean of all.
    pub(crate) mean: f64,
    /// Standard deviation about the means of the runs; 0 where all are equal.
    pub(crate) deviation: f64,
    /// Lowest noise relative to the deviation: the setting, or what quantisation leaves.
    pub(crate) noise_floor: f64,
}

impl Scale {
    pub(crate) fn of(runs: &[Points], settings: &FitSettings) -> Result<Self> {
        let all = || runs.iter().flat_map(|r| &r.targets);
        let n = all().count() as f64;
        // By the largest first, so that no square overflows.
        let largest = all().fold(0.0f64, |m, v| m.max(v.abs()));
        let unit = if largest > 0.0 { largest } else { 1.0 };
        let mean = unit * (all().map(|v| v / unit).sum::<f64>() / n);
        let means: Vec<f64> =
            runs.iter().map(|r| if r.is_empty() { mean } else { mean_of(&r.targets, unit) }).collect();
        let variance = runs
            .iter()
            .zip(&means)
            .flat_map(|(r, m)| r.targets.iter().map(move |v| ((v - m) / unit).powi(2)))
            .sum::<f64>()
            / n;
        let deviation = unit * variance.sqrt();
        // Below a few units in the last place of the values themselves there is nothing to fit.
        let deviation = if deviation > 8.0 * f64::EPSILON * largest { deviation } else { 0.0 };
        let mut noise_floor = settings.noise_floor;
        if let Some(step) = quantisation(runs)
            && deviation > 0.0
        {
            // An error uniform within a step; coarse steps must leave room for a signal.
            noise_floor = noise_floor.max((step / 12f64.sqrt() / deviation).min(0.5));
        }
        Ok(Self { means, mean, deviation, noise_floor })
    }
}

fn mean_of(values: &[f64], unit: f64) -> f64 {
    unit * (values.iter().map(|v| v / unit).sum::<f64>() / values.len() as f64)
}

/// The runs with standardised targets; `None` where all targets are equal.
pub(crate) fn standardise(runs: &[Points], scale: &Scale) -> Option<Vec<Points>> {
    (scale.deviation > 0.0).then(|| {
        let shifted = |(run, mean): (&Points, &f64)| Points {
            targets: run.targets.iter().map(|v| (v - mean) / scale.deviation).collect(),
            ..run.clone()
        };
        runs.iter().zip(&scale.means).map(shifted).collect()
    })
}

/// Step of targets that are on a grid and repeat; `None` for others.
fn quantisation(runs: &[Points]) -> Option<f64> {
    let mut values: Vec<f64> = runs.iter().flat_map(|r| &r.targets).copied().collect();
    let n = values.len();
    values.sort_by(f64::total_cmp);
    let largest = values.first()?.abs().max(values.last()?.abs());
    let steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-12 * largest).collect();
    // A grid shows in values that occur several times.
    if steps.len() + 1 > n - n / 8 {
        return None;
    }
    let step = steps.iter().copied().fold(f64::INFINITY, f64::min);
    steps.iter().all(|d| (d / step - (d / step).round()).abs() < 1e-3 * (d / step).clamp(1.0, 100.0)).then_some(step)
}
