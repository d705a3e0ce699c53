//! Spectral lines of a residual: where a periodic effect should look.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{CARRIED, FREQUENCIES, LINES, OF_LINE, OF_PERIOD};
use crate::parallel;
use std::f64::consts::{PI, TAU};

/// Angular frequencies at which the residual has lines, with neighbours as close as all logs together can part.
pub(crate) fn peaks(fitted: &Contestant) -> Vec<f64> {
    let experiment = &fitted.experiment;
    let n_columns = experiment.columns.len();
    let longest = experiment.longest_window();
    let total = experiment
        .logs
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), l| (a.min(l.time[0]), b.max(l.time[l.time.len() - 1])));
    if longest <= 0.0 {
        return Vec::new();
    }
    let spacing = PI / longest;
    let highest = CARRIED * PI / (longest / experiment.logs[0].time.len().max(2) as f64);
    let count = FREQUENCIES.min((highest / spacing) as usize);
    let mut found: Vec<f64> = Vec::new();
    for differenced in [false, true] {
        let power: Vec<f64> =
            parallel::map(1..=count, |k| power_at(fitted, spacing * k as f64, n_columns, differenced));
        let mut lines: Vec<usize> = (0..power.len())
            .filter(|&k| {
                let near = |i: usize| power.get(i).copied().unwrap_or(0.0);
                power[k] >= near(k + 1) && (k == 0 || power[k] >= near(k - 1))
            })
            .collect();
        lines.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
        found.extend(lines.iter().take(LINES).map(|&k| spacing * (k + 1) as f64));
    }
    found.sort_by(f64::total_cmp);
    found.dedup();
    // Logs on one clock resolve finer than one log alone: offer what lies between, too, where the windows agree on the phase.
    let fine = PI / (total.1 - total.0).max(longest);
    let around = ((0.5 * spacing / fine).ceil() as i32).clamp(1, 6);
    let between = |&w: &f64| {
        let all = (-around..=around).map(|k| w + fine * f64::from(k)).filter(|&w| w > 0.0 && w.is_finite());
        let mut all: Vec<(f64, f64)> = all.map(|w| (w, coherent_power_at(fitted, w, n_columns))).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all.into_iter().take(OF_LINE).map(|(w, _)| w).collect::<Vec<_>>()
    };
    let mut offered: Vec<f64> = parallel::map(&found, between).concat();
    offered.sort_by(f64::total_cmp);
    offered.dedup();
    offered
}

/// Power of the residual at one angular frequency on the clock of the logs, all windows in phase, each column in units of its own.
fn coherent_power_at(fitted: &Contestant, omega: f64, n_columns: usize) -> f64 {
    let mut sums = vec![(0.0, 0.0, 0.0); n_columns];
    for (window, residual) in fitted.experiment.windows.iter().zip(&fitted.refined.residuals) {
        let time = &fitted.experiment.logs[window.log].time[window.first..=window.last];
        let stride = thinned(time, omega);
        for (&t, row) in time.iter().zip(residual.chunks_exact(n_columns)).step_by(stride) {
            let (sine, cosine) = (omega * t).sin_cos();
            for (sum, value) in sums.iter_mut().zip(row).filter(|(_, value)| value.is_finite()) {
                *sum = (sum.0 + value * cosine, sum.1 + value * sine, sum.2 + value * value);
            }
        }
    }
    let of_column = |(real, imaginary, squares): &(f64, f64, f64)| match *squares > 0.0 {
        true => (real * real + imaginary * imaginary) / squares,
        false => 0.0,
    };
    sums.iter().map(of_column).sum()
}

/// By how many samples to go where long windows are thinned to what a frequency needs.
fn thinned(time: &[f64], omega: f64) -> usize {
    let period = (time[time.len() - 1] - time[0]) / (time.len().max(2) - 1) as f64;
    ((TAU / omega / OF_PERIOD / period) as usize).max(1)
}

/// Power of the residual at one angular frequency, summed over windows and columns.
fn power_at(fitted: &Contestant, omega: f64, n_columns: usize, differenced: bool) -> f64 {
    let mut power = 0.0;
    for (window, residual) in fitted.experiment.windows.iter().zip(&fitted.refined.residuals) {
        let time = &fitted.experiment.logs[window.log].time[window.first..=window.last];
        let stride = thinned(time, omega);
        for c in 0..n_columns {
            let (mut real, mut imaginary) = (0.0, 0.0);
            let mut last = 0.0;
            for (i, &t) in time.iter().enumerate().step_by(stride) {
                let value = residual[i * n_columns + c];
                if !value.is_finite() {
                    continue;
                }
                let used = if differenced { value - last } else { value };
                last = value;
                let (s, k) = (omega * t).sin_cos();
                real += used * k;
                imaginary += used * s;
            }
            power += (real * real + imaginary * imaginary) * (stride * stride) as f64 / time.len() as f64;
        }
    }
    power
}
