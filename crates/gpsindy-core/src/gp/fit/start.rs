//! Ranges, weak priors and starting points of the hyperparameters, from the span and the spacing
//! of the inputs. Targets are standardised here.

use super::scale::Scale;
use super::settings::FitSettings;
use crate::gp::kernel::{Kernel, Role};
use crate::gp::points::Points;

/// Ranges of the log hyperparameters with priors.
#[derive(Debug, Clone)]
pub(crate) struct Bounds {
    /// Largest span of each input over the runs.
    spans: Vec<f64>,
    /// Typical spacing of each input.
    spacings: Vec<f64>,
    /// Shortest length in spacings.
    shortest: f64,
    pub(crate) noise_floor: f64,
    /// Relative to the deviation of the targets.
    pub(crate) known_noise: Option<f64>,
}

impl Bounds {
    pub(crate) fn of(runs: &[Points], scale: &Scale, settings: &FitSettings) -> Self {
        let dimension = runs[0].dimension();
        let n = runs.iter().map(Points::len).max().unwrap_or(1).max(2) as f64;
        let spans: Vec<f64> = (0..dimension).map(|d| span(runs, d)).collect();
        let spacings = if dimension == 1 {
            vec![spacing(runs, spans[0], n)]
        } else {
            spans.iter().map(|s| 0.5 * s * n.powf(-1.0 / dimension as f64)).collect()
        };
        let known_noise = settings.noise.map(|noise| (noise / scale.deviation).clamp(1e-6, 1e3));
        Self { spans, spacings, shortest: 1.0, noise_floor: scale.noise_floor, known_noise }
    }

    /// The same with a shortest length of four spacings.
    pub(crate) fn wider(&self) -> Self {
        Self { shortest: 4.0, ..self.clone() }
    }

    /// Lowest and highest logarithm, mean and standard deviation of the prior.
    fn range(&self, role: Role) -> [f64; 4] {
        match role {
            Role::Amplitude => [-9.0, 5.0, 0.0, 2.0],
            Role::Length(d) => {
                let (span, spacing) = (self.spans[d], self.spacings[d]);
                [(self.shortest * spacing).min(0.5 * span).ln(), (20.0 * span).ln(), (0.2 * span).ln(), 2.0]
            }
            Role::Roughness => [-2.3, 3.0, 0.0, 1.0],
            Role::Period => {
                let (span, spacing) = (self.spans[0], self.spacings[0]);
                [
                    (3.0 * self.shortest.max(1.0) * spacing).min(0.5 * span).ln(),
                    (2.0 * span).ln(),
                    (0.3 * span).ln(),
                    2.0,
                ]
            }
            Role::Exponent => [-3.0, 6.0, 0.0, 2.0],
        }
    }

    /// Negative log prior with its slope; beyond the range a wall that is smooth and steep.
    pub(crate) fn penalty(&self, role: Role, z: f64, n_points: f64) -> (f64, f64) {
        let [low, high, mean, deviation] = self.range(role);
        wall(z, low, high, mean, deviation, n_points)
    }

    /// The same for the log of the free part of the noise.
    pub(crate) fn noise_penalty(&self, z: f64, n_points: f64) -> (f64, f64) {
        wall(z, self.noise_floor.ln() - 3.0, 1.0, -2.0, 3.0, n_points)
    }

    /// Cycles of a period, given by its logarithm, in the span of the first input.
    pub(crate) fn cycles(&self, log_period: f64) -> f64 {
        self.spans[0] * (-log_period).exp()
    }

    /// Whether a length or period ended at or beyond an end of its range that means something.
    pub(crate) fn reached(&self, role: Role, z: f64) -> bool {
        let [low, high, ..] = self.range(role);
        matches!(role, Role::Length(_) | Role::Period) && (z <= low + 0.02 || z >= high - 0.02)
    }
}

/// Normal prior inside, and 10 n_points (distance beyond the range)^2 outside.
fn wall(z: f64, low: f64, high: f64, mean: f64, deviation: f64, n_points: f64) -> (f64, f64) {
    let u = (z - mean) / deviation;
    let beyond = (z - high).max(0.0) + (z - low).min(0.0);
    (0.5 * u * u + 10.0 * n_points * beyond * beyond, u / deviation + 20.0 * n_points * beyond)
}

/// Largest span of input d over the runs; 1 where it is a single value.
pub(crate) fn span(runs: &[Points], d: usize) -> f64 {
    let mut span = 0.0f64;
    for run in runs {
        let (low, high) =
            run.inputs[d].iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
        if high > low {
            span = span.max(high - low);
        }
    }
    if span > 0.0 && span.is_finite() { span } else { 1.0 }
}

/// Mean of the middle half of the steps in time: neither duplicates nor gaps count.
fn spacing(runs: &[Points], span: f64, n: f64) -> f64 {
    let mut steps = Vec::new();
    for run in runs {
        let mut time = run.inputs[0].clone();
        time.sort_by(f64::total_cmp);
        steps.extend(time.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0));
    }
    steps.sort_by(f64::total_cmp);
    let middle = &steps[steps.len() / 4..steps.len() - steps.len() / 4];
    let typical = middle.iter().sum::<f64>() / middle.len() as f64;
    if middle.is_empty() { 0.5 * span } else { typical.clamp(1e-3 * span / n, span) }
}

/// Full lists of log hyperparameters (the log of the free noise last) from which a fit may start.
pub(crate) fn starts(kernel: &Kernel, runs: &[Points], bounds: &Bounds) -> Vec<Vec<f64>> {
    let roles = kernel.roles(runs[0].dimension());
    let has = |wanted: fn(&Role) -> bool| roles.iter().any(wanted);
    let periods = if has(|r| matches!(r, Role::Period)) { likely_periods(runs, bounds) } else { vec![bounds.spans[0]] };
    let lengths = match (has(|r| matches!(r, Role::Length(_))), periods.len() > 1) {
        (true, false) => ladder(bounds),
        (true, true) => vec![1.0, 0.2],
        _ => vec![1.0],
    };
    let noises: &[f64] = if bounds.known_noise.is_some() { &[0.1] } else { &[0.02, 0.15, 0.6] };
    let mut list = Vec::new();
    for &period in &periods {
        for &fraction in &lengths {
            for &noise in noises {
                let of = |role: &Role| match role {
                    Role::Length(d) => {
                        (fraction * bounds.spans[*d]).max(2.0 * bounds.shortest * bounds.spacings[*d]).ln()
                    }
                    Role::Period => period.ln(),
                    _ => 0.0,
                };
                let mut start: Vec<f64> = roles.iter().map(of).collect();
                start.push(f64::max(noise, 1.5 * bounds.noise_floor).ln());
                list.push(start);
            }
        }
    }
    list.dedup();
    list
}

/// Shortest length of the ladder beyond a hundredth of the span, in spacings: a signal whose length is shorter still has
/// its optimum downhill from there.
const FINEST: f64 = 10.0;

/// Lengths to start from, in spans: down to a hundredth, and on to a few spacings of a long log. A likelihood is flat where
/// the length is far too long (the noise explains everything), so a start must be near the length of the signal.
fn ladder(bounds: &Bounds) -> Vec<f64> {
    let mut lengths = vec![1.0, 0.3, 0.1, 0.03, 0.01];
    let finest = bounds.spans.iter().zip(&bounds.spacings).map(|(span, spacing)| FINEST * spacing / span);
    let finest = finest.fold(f64::INFINITY, f64::min);
    let finer = (0..).map(|k| if k % 2 == 0 { 3e-3 } else { 1e-3 } * 0.1f64.powi(k / 2));
    lengths.extend(finer.take_while(|fraction| *fraction >= finest.max(1e-12)));
    lengths
}

/// Periods at the three highest peaks of the least-squares periodogram, and twice the first.
///
/// Source: Lomb 1976, Least-squares frequency analysis of unequally spaced data.
fn likely_periods(runs: &[Points], bounds: &Bounds) -> Vec<f64> {
    let (span, spacing) = (bounds.spans[0], bounds.spacings[0]);
    let highest = (span / (4.0 * spacing)).clamp(1.0, 400.0);
    // Frequencies in cycles per span, oversampled twice; long logs are thinned for this look.
    let count = (2.0 * highest) as usize;
    let power: Vec<f64> =
        (1..=count).map(|i| periodogram(runs, std::f64::consts::TAU * 0.5 * i as f64 / span)).collect();
    let peak = |i: usize| (i == 0 || power[i] >= power[i - 1]) && (i + 1 == count || power[i] > power[i + 1]);
    let mut peaks: Vec<usize> = (0..count).filter(|&i| peak(i)).collect();
    peaks.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
    let mut periods: Vec<f64> = peaks.iter().take(3).map(|&i| span / (0.5 * (i + 1) as f64)).collect();
    if let Some(&first) = periods.first() {
        periods.push((2.0 * first).min(span));
    } else {
        periods.push(span);
    }
    periods
}

fn periodogram(runs: &[Points], omega: f64) -> f64 {
    let mut power = 0.0;
    for run in runs {
        let stride = run.len() / 2000 + 1;
        let (mut c, mut s) = (0.0, 0.0);
        for (t, y) in run.inputs[0].iter().zip(&run.targets).step_by(stride) {
            let (sine, cosine) = (omega * (t - run.inputs[0][0])).sin_cos();
            c += y * cosine;
            s += y * sine;
        }
        power += (c * c + s * s) / run.len().max(1) as f64;
    }
    power
}
