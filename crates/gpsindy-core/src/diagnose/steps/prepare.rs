//! Prepare: noise level of every column, outliers, windows and integration steps, before anything is judged.

use crate::data::Dataset;
use crate::diagnose::fit::substeps::choose_substeps;
use crate::diagnose::fit::tolerance::tolerated;
use crate::diagnose::limits::{MOST_SAMPLES, ROUNDING};
use crate::diagnose::notes::{Note, Notes};
use crate::diagnose::steps::noise::{noise_levels, remove_outliers};
use crate::diagnose::steps::windows::{Purpose, choose_windows, whole_runs};
use crate::error::Result;
use crate::model::{Model, System};
use crate::refine::{Experiment, Hold, Log};

/// The experiment of a diagnosis: noise, outliers, hold, windows and steps chosen; says what it did in `notes`.
pub(crate) fn experiment(system: &System, data: &Dataset, hold: Option<Hold>, notes: &Notes) -> Result<Experiment> {
    let mut experiment = Experiment::new(system, data, None)?;
    check_columns(system, &experiment)?;
    let n_columns = experiment.columns.len();
    experiment.noise = noise_levels(&experiment.logs, n_columns);
    let noise = experiment.noise.clone();
    let removed = remove_outliers(std::sync::Arc::make_mut(&mut experiment.logs).as_mut_slice(), &noise);
    if removed > 0 {
        notes.say(Note::Outliers { count: removed });
        experiment.noise = noise_levels(&experiment.logs, n_columns);
    }
    experiment = decimate(experiment, notes);
    let free = tolerated(system.model());
    let parameters = system.parameter_values();
    let start = crate::refine::guess_initial(system, &experiment);
    experiment = choose_substeps(system, experiment, &parameters, &start, ROUNDING);
    let (experiment, cut) = choose_windows(system, experiment, &parameters, &free, Purpose::Search)?;
    let mut experiment = thin(experiment, notes);
    experiment.hold = hold.unwrap_or_default();
    if let Some(length) = cut {
        notes.say(Note::Restarted { length });
    }
    Ok(experiment)
}

/// The logs with wrapped angles unwrapped: columns of states that stay within a turn and jump by one.
pub(crate) fn unwrapped(model: &Model, data: &Dataset, notes: &Notes) -> Result<Dataset> {
    use std::f64::consts::{PI, TAU};
    let mut data = data.clone();
    for state in model.states.iter().filter(|s| s.unit.is_empty() || s.unit == "rad") {
        let Ok(column) = data.index_of(&state.name) else { continue };
        let values = || data.runs().iter().flat_map(|r| r.column(column).iter().copied()).filter(|v| v.is_finite());
        let within = values().all(|v| v.abs() < 1.02 * PI) || values().all(|v| (-0.02 * PI..1.02 * TAU).contains(&v));
        let jumps =
            |r: &crate::data::Run| r.column(column).windows(2).any(|w| ((w[1] - w[0]).abs() - TAU).abs() < 0.2 * PI);
        if within && data.runs().iter().any(jumps) {
            data.unwrap_angle(&state.name)?;
            notes.say(Note::Unwrapped { column: state.name.clone() });
        }
    }
    Ok(data)
}

/// Keeps evenly spread windows where the logs are longer than a contest needs.
fn thin(experiment: Experiment, notes: &Notes) -> Experiment {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    if total <= MOST_SAMPLES {
        return experiment;
    }
    let seconds: f64 = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).sum();
    // At least forty stretches, so that every part of the logs is seen.
    let length = experiment.windows.iter().map(|w| {
        let time = &experiment.logs[w.log].time;
        time[w.last] - time[w.first]
    });
    let length = length.fold(0.0, f64::max).min(seconds * MOST_SAMPLES as f64 / total as f64 / 40.0 * 2.0);
    let mut experiment = experiment.with_windows_of(length);
    let keep_every = total.div_ceil(MOST_SAMPLES);
    experiment.windows = experiment.windows.into_iter().step_by(keep_every).collect();
    notes.say(Note::Thinned { samples: total, length, one_in: keep_every });
    experiment
}

/// Takes every k-th sample of logs that are far denser than their motion, with the mean of the controls between.
fn decimate(experiment: Experiment, notes: &Notes) -> Experiment {
    let total: usize = experiment.logs.iter().map(|l| l.time.len()).sum();
    let stride = total.div_ceil(MOST_SAMPLES);
    if stride < 2 || !is_dense(&experiment, stride) {
        return experiment;
    }
    let logs: Vec<Log> = experiment
        .logs
        .iter()
        .map(|log| {
            let mean =
                |values: &Vec<f64>| values.chunks(stride).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
            Log {
                name: log.name.clone(),
                time: log.time.iter().copied().step_by(stride).collect(),
                controls: log.controls.iter().map(mean).collect(),
                measured: log.measured.iter().map(|c| c.iter().copied().step_by(stride).collect()).collect(),
            }
        })
        .collect();
    notes.say(Note::Decimated { stride });
    whole_runs(Experiment { logs: logs.into(), ..experiment })
}

/// Whether every column is a straight line over `stride` samples to either side, up to noise or a hundredth of its spread.
fn is_dense(experiment: &Experiment, stride: usize) -> bool {
    (0..experiment.columns.len()).all(|c| {
        let bends = experiment.logs.iter().flat_map(|log| {
            let values = &log.measured[c];
            (stride..values.len().saturating_sub(stride))
                .map(|i| values[i] - 0.5 * (values[i - stride] + values[i + stride]))
        });
        let finite: Vec<f64> = bends.filter(|b| b.is_finite()).collect();
        let rms = (finite.iter().map(|b| b * b).sum::<f64>() / finite.len().max(1) as f64).sqrt();
        // Noise alone bends by sqrt(1 + 2/4) of itself.
        rms < 2.5 * experiment.noise[c] || rms < 0.01 * experiment.scale[experiment.columns[c]]
    })
}

/// Every state must be logged, be the rate of one that is, or have a start that its equation or `initial` gives.
fn check_columns(system: &System, experiment: &Experiment) -> Result<()> {
    use crate::error::Error;
    let model = system.model();
    for (j, state) in model.states.iter().enumerate() {
        let is_rate = model.integral_of(j).is_some_and(|i| experiment.column_of(i).is_some());
        let own = |name: &String| *name == state.name || model.state_index(name).is_none();
        let follows_input = state.equation.variables().iter().all(own);
        let known_start = model.initial.contains_key(&state.name);
        if experiment.column_of(j).is_none() && !is_rate && !follows_input && !known_start {
            return Err(Error::invalid(format!(
                "the logs have no column for state `{}`, and no logged state has it as its rate; log it, rename a column, or give it an [initial] value",
                state.name
            )));
        }
    }
    let needed = 8;
    for log in experiment.logs.iter() {
        if log.time.len() < needed {
            return Err(Error::TooFewSamples { what: format!("run `{}`", log.name), needed, found: log.time.len() });
        }
    }
    Ok(())
}
