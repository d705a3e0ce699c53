//! What the logs excite: ranges, typical rates and typical times, from the nominal trajectories.

pub(crate) mod repeats;

use crate::diagnose::catalogue::excursion::{Excursion, shows_time, turns};
use crate::diagnose::catalogue::site::Reach;
use crate::diagnose::limits::catalogue::MOMENTS_OF_PATHS;
use crate::model::System;
use crate::refine::{Experiment, Log, Window, present};
use repeats::Repeats;

/// The trajectories of the nominal model and what they excite.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub(crate) states: Vec<Excursion>,
    pub(crate) controls: Vec<Excursion>,
    /// Of an unlogged speed whose place is logged whether that goes either way; nothing of other states.
    pub(crate) turns: Vec<Option<bool>>,
    /// Names of the states and controls that show how long a run has lasted.
    pub(crate) clocks: Vec<String>,
    /// Period and phase, s, of the sensor of every logged state that repeats its readings; nothing of other states.
    pub(crate) samplings: Vec<Option<(f64, f64)>>,
    /// Periods and phases, s, that every control may be held with, by what a fit leaves; nothing before one was looked at.
    pub(crate) holds: Vec<Vec<(f64, f64)>>,
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
    /// States and then controls at some moments of the nominal paths, spread over all of them.
    pub(crate) moments: Vec<Vec<f64>>,
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
                match experiment.column_of(j) {
                    Some(c) => {
                        let logged = experiment.logs.iter().flat_map(|l| l.measured[c].iter().copied());
                        Excursion::of(&logged.collect::<Vec<f64>>()).with_noise(experiment.noise[c])
                    }
                    None => Excursion::of(&paths.iter().flat_map(|p| p[j].iter().copied()).collect::<Vec<f64>>()),
                }
            })
            .collect();
        let place = |j: usize| system.model().integral_of(j).and_then(|i| experiment.column_of(i));
        let turning = |c: usize| turns(experiment.logs.iter().map(|l| l.measured[c].as_slice()), experiment.noise[c]);
        let is_unlogged = |j: &usize| experiment.column_of(*j).is_none();
        let turns = (0..n).map(|j| Some(j).filter(is_unlogged).and_then(place).map(turning)).collect();
        let controls: Vec<Excursion> = (0..system.n_controls())
            .map(|c| {
                let values: Vec<f64> = experiment.logs.iter().flat_map(|l| l.controls[c].iter().copied()).collect();
                Excursion::of(&values)
            })
            .collect();
        // Of the samples of each sensor: topics of their own have rows between them.
        let steps = |log: &Log| {
            let of = |column: &Vec<f64>| -> Vec<f64> {
                present(column).windows(2).map(|w| log.time[w[1].0] - log.time[w[0].0]).collect()
            };
            log.measured.iter().flat_map(of).collect::<Vec<f64>>()
        };
        let mut steps: Vec<f64> = experiment.logs.iter().flat_map(steps).collect();
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
        let clocks = clocks(system, experiment, paths);
        let sampling = |j: usize| {
            let repeats = Repeats::of(&experiment.logs, experiment.column_of(j)?)?;
            repeats.clock.or_else(|| Some((repeats.own_period?, 0.0)))
        };
        let samplings = (0..n).map(sampling).collect();
        let window = experiment.longest_window();
        let moments = moments(experiment, paths);
        Self {
            states,
            controls,
            turns,
            clocks,
            samplings,
            holds: Vec::new(),
            rates,
            period,
            times,
            duration,
            window,
            peaks: Vec::new(),
            moments,
            reach,
        }
    }
}

/// States and then controls at a few hundred moments of the paths.
fn moments(experiment: &Experiment, paths: &[Vec<Vec<f64>>]) -> Vec<Vec<f64>> {
    let total: usize = paths.iter().map(|path| path.first().map_or(0, Vec::len)).sum();
    let windows = experiment.windows.iter().zip(paths);
    let of_window = |(window, path): (&Window, &Vec<Vec<f64>>)| -> Vec<Vec<f64>> {
        let log = &experiment.logs[window.log];
        let at = |i: usize| {
            path.iter().map(|state| state[i]).chain(log.controls.iter().map(|c| c[window.first + i])).collect()
        };
        (0..path.first().map_or(0, Vec::len)).step_by(total.div_ceil(MOMENTS_OF_PATHS).max(1)).map(at).collect()
    };
    windows.flat_map(of_window).collect()
}

/// States and controls that show how long a run has lasted: states by their logs, those that are not logged by the trajectories.
fn clocks(system: &System, experiment: &Experiment, paths: &[Vec<Vec<f64>>]) -> Vec<String> {
    let model = system.model();
    let since = |log: &Log, sample: usize| log.time[sample] - log.time[0];
    let of_log = |log: &Log, values: &[f64]| -> Vec<(f64, f64)> {
        values.iter().enumerate().map(|(sample, &value)| (since(log, sample), value)).collect()
    };
    let of_state = |j: usize| -> Vec<(f64, f64)> {
        if let Some(c) = experiment.column_of(j) {
            return experiment.logs.iter().flat_map(|log| of_log(log, &log.measured[c])).collect();
        }
        let windows = experiment.windows.iter().zip(paths);
        let of_window = |(window, path): (&Window, &Vec<Vec<f64>>)| -> Vec<(f64, f64)> {
            let log = &experiment.logs[window.log];
            path[j].iter().enumerate().map(|(i, &value)| (since(log, window.first + i), value)).collect()
        };
        windows.flat_map(of_window).collect()
    };
    let states = (0..model.states.len()).filter(|&j| shows_time(&of_state(j))).map(|j| model.states[j].name.clone());
    let of_control = |c: usize| -> Vec<(f64, f64)> {
        experiment.logs.iter().flat_map(|log| of_log(log, &log.controls[c])).collect()
    };
    let controls = (0..system.n_controls()).filter(|&c| shows_time(&of_control(c)));
    states.chain(controls.map(|c| model.controls[c].name.clone())).collect()
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
