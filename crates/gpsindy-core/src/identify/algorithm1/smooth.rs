//! The states as the rows see them: smoothed, or the samples as they are.

use crate::data::Dataset;
use crate::differentiate::{Differentiation, central};
use crate::error::{Error, Result};
use crate::identify::{Identify, Target};
use crate::progress::Progress;
use crate::smooth::{SmoothedRun, Smoother};
use faer::Mat;

/// Smoothed runs and what the smoother says of them, the noise of each state, its kernel.
pub(crate) type SmoothedRuns = ((Vec<SmoothedRun>, Option<crate::smooth::Smoothed>), Vec<f64>, Vec<String>);

/// The states smoothed; what makes a fit weak becomes a note.
pub(crate) fn smooth(
    smoother: &Smoother,
    settings: &Identify,
    data: &Dataset,
    states: &[usize],
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<SmoothedRuns> {
    let wants_covariance = matches!(settings.target, Target::Derivative(Differentiation::GpTime));
    let smoother = Smoother { covariance: wants_covariance, ..smoother.clone() };
    let smoothed = smoother.smooth(data, states, progress)?;
    let mut kernels = Vec::new();
    for (fit, channel) in smoothed.fits.iter().zip(&smoothed.channels) {
        let weak: Vec<String> = fit.weak.iter().map(ToString::to_string).collect();
        if !weak.is_empty() {
            notes.push(format!("smoothing of `{}`: {}", channel.name, weak.join("; ")));
        }
        kernels.push(fit.kernel.to_string());
    }
    let noise = smoothed.fits.iter().map(|f| f.noise).collect();
    Ok(((smoothed.runs.clone(), Some(smoothed)), noise, kernels))
}

/// The samples as they are: gaps closed by straight lines, slopes by parabolas.
pub(crate) fn unsmoothed(data: &Dataset, states: &[usize]) -> Result<SmoothedRuns> {
    let mut runs = Vec::with_capacity(data.runs().len());
    for run in data.runs() {
        let r = run.n_samples();
        let mut mean = Mat::zeros(r, states.len());
        let mut derivative = Mat::zeros(r, states.len());
        for (j, &c) in states.iter().enumerate() {
            let filled = fill(&run.time, run.column(c)).ok_or_else(|| Error::TooFewSamples {
                what: format!("channel `{}` in run `{}`", data.channels()[c].name, run.name),
                needed: 1,
                found: 0,
            })?;
            derivative.col_as_slice_mut(j).copy_from_slice(&central(&run.time, &filled));
            mean.col_as_slice_mut(j).copy_from_slice(&filled);
        }
        let zeros = Mat::zeros(r, states.len());
        runs.push(SmoothedRun {
            name: run.name.clone(),
            time: run.time.clone(),
            mean,
            std: zeros.clone(),
            derivative,
            derivative_std: zeros,
            derivative_covariance: Vec::new(),
        });
    }
    Ok(((runs, None), roughness(data, states), vec![String::new(); states.len()]))
}

fn fill(time: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let there: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    let (&first, &last) = (there.first()?, there.last()?);
    let between = |i: usize| {
        if values[i].is_finite() {
            return values[i];
        }
        let after = there.partition_point(|&k| k < i);
        if i < first || i > last {
            return values[if i < first { first } else { last }];
        }
        let (a, b) = (there[after - 1], there[after]);
        values[a] + (values[b] - values[a]) * (time[i] - time[a]) / (time[b] - time[a])
    };
    Some((0..values.len()).map(between).collect())
}

/// Noise of channels from their second differences (of variance 6 for white noise of variance 1), at least 1e-4 of the spread.
pub(crate) fn roughness(data: &Dataset, channels: &[usize]) -> Vec<f64> {
    let of = |c: usize| {
        let mut bends: Vec<f64> = Vec::new();
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for run in data.runs() {
            let values: Vec<f64> = run.column(c).iter().copied().filter(|v| v.is_finite()).collect();
            bends.extend(values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()));
            for v in values {
                sum += v;
                square += v * v;
                count += 1.0;
            }
        }
        bends.sort_by(f64::total_cmp);
        let middle = bends.get(bends.len() / 2).copied().unwrap_or(0.0);
        let spread = if count > 0.0 { (square / count - (sum / count).powi(2)).max(0.0).sqrt() } else { 0.0 };
        (middle / (0.6745 * 6f64.sqrt())).max(1e-4 * spread).max(f64::MIN_POSITIVE.sqrt())
    };
    channels.iter().map(|&c| of(c)).collect()
}
