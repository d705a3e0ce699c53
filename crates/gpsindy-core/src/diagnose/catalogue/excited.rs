//! What the logs excite: ranges, typical rates and typical times, from the nominal trajectories.

use crate::diagnose::catalogue::site::Reach;
use crate::model::System;
use crate::refine::Experiment;

/// How a variable moves over all training logs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Excursion {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Standard deviation.
    pub(crate) spread: f64,
    /// Root mean square.
    pub(crate) rms: f64,
    /// Absolute values, sorted, thinned to a few hundred.
    sizes: Vec<f64>,
}

impl Excursion {
    fn of(values: &[f64]) -> Self {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let count = finite.len().max(1) as f64;
        let mean = finite.iter().sum::<f64>() / count;
        let square = finite.iter().map(|v| v * v).sum::<f64>() / count;
        let mut sizes: Vec<f64> = finite.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let stride = (sizes.len() / 400).max(1);
        Self {
            low: finite.iter().copied().fold(f64::INFINITY, f64::min),
            high: finite.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            spread: (square - mean * mean).max(0.0).sqrt(),
            rms: square.sqrt(),
            sizes: sizes.into_iter().step_by(stride).collect(),
        }
    }

    /// Size below which a share `part` of the samples stays.
    pub(crate) fn size_quantile(&self, part: f64) -> f64 {
        let last = self.sizes.len().saturating_sub(1);
        self.sizes.get((part * last as f64).round() as usize).copied().unwrap_or(0.0)
    }

    /// A size that is never zero: the rms, or one.
    pub(crate) fn size(&self) -> f64 {
        if self.rms.is_finite() && self.rms > 0.0 { self.rms } else { 1.0 }
    }

    pub(crate) fn range(&self) -> f64 {
        if self.high > self.low { self.high - self.low } else { 0.0 }
    }
}

/// The trajectories of the nominal model and what they excite.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) states: Vec<Excursion>,
    pub(crate) controls: Vec<Excursion>,
    /// Typical size of every state's rate, in its unit per second.
    pub(crate) rates: Vec<f64>,
    /// Median sampling period, s.
    pub(crate) period: f64,
    /// First and last time of any log, s.
    pub(crate) times: (f64, f64),
    /// Longest log, s.
    pub(crate) duration: f64,
    /// Longest rollout between two starts, s.
    pub(crate) window: f64,
    /// Angular frequencies (rad/s) at which the residual has peaks, strongest first.
    pub(crate) peaks: Vec<f64>,
    /// What ports, controls and a simulator's own parameters move.
    pub(crate) reach: Reach,
}

impl Scene {
    /// What the logs of `experiment` excite where the states of `system` take the `paths`: one list a window, one row a state.
    pub(crate) fn new(system: &System, experiment: &Experiment, paths: &[Vec<Vec<f64>>]) -> Self {
        let n = system.n_states();
        let states: Vec<Excursion> = (0..n)
            .map(|j| {
                // A logged state is described by its log, which a bad nominal model can't spoil.
                let logged = experiment
                    .column_of(j)
                    .map(|c| experiment.logs.iter().flat_map(|l| l.measured[c].iter().copied()).collect::<Vec<_>>());
                Excursion::of(&logged.unwrap_or_else(|| paths.iter().flat_map(|p| p[j].iter().copied()).collect()))
            })
            .collect();
        let controls: Vec<Excursion> = (0..system.n_controls())
            .map(|c| {
                let values: Vec<f64> = experiment.logs.iter().flat_map(|l| l.controls[c].iter().copied()).collect();
                Excursion::of(&values)
            })
            .collect();
        let mut steps: Vec<f64> = experiment.logs.iter().flat_map(|l| l.time.windows(2).map(|w| w[1] - w[0])).collect();
        steps.sort_by(f64::total_cmp);
        let period = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
        let length = |l: &crate::refine::Log| l.time[l.time.len() - 1] - l.time[0];
        let times = experiment
            .logs
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), l| (a.min(l.time[0]), b.max(l.time[l.time.len() - 1])));
        let duration = experiment.logs.iter().map(length).fold(period, f64::max);
        let rates: Vec<f64> = (0..n).map(|j| typical_rate(experiment, paths, j, states[j].size() / duration)).collect();
        let reach = Reach::new(system, &states, &controls, &rates);
        let window = experiment.longest_window();
        Self { states, controls, rates, period, times, duration, window, peaks: Vec::new(), reach }
    }
}

/// Root mean square of the rate of state `j` along the trajectories; `least` where it never moves.
fn typical_rate(experiment: &Experiment, paths: &[Vec<Vec<f64>>], j: usize, least: f64) -> f64 {
    let mut sum = 0.0;
    let mut count = 0usize;
    for (window, path) in experiment.windows.iter().zip(paths) {
        let time = &experiment.logs[window.log].time[window.first..=window.last];
        for (pair, t) in path[j].windows(2).zip(time.windows(2)) {
            let rate = (pair[1] - pair[0]) / (t[1] - t[0]);
            if rate.is_finite() {
                sum += rate * rate;
                count += 1;
            }
        }
    }
    let rms = (sum / count.max(1) as f64).sqrt();
    if rms.is_finite() && rms > least { rms } else { least.max(f64::MIN_POSITIVE) }
}
