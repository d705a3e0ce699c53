//! Rollouts of a model along the windows of an experiment: its predicted readings and its states.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::fit::contestant::Contestant;
use crate::model::System;
use crate::refine::{Experiment, Job, lanes::Lanes, roll_together};

/// Noise-scaled outputs of a model, one list a window.
pub(crate) fn outputs(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    if system.engine().is_some() {
        let jobs = jobs(parameters, initial);
        let mut values = vec![Vec::new(); jobs.len()];
        roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut |job, _, c, value| {
            values[job].push(value / experiment.noise[c]);
        });
        return values;
    }
    let parameters: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
    let windows = experiment.windows.iter().zip(initial);
    windows
        .map(|(window, start)| {
            let log = &experiment.logs[window.log];
            let mut lanes = Lanes::<1>::new(system, log, (experiment.hold, experiment.past), &parameters);
            let start: Vec<[f64; 1]> = start.iter().map(|&v| [v]).collect();
            let mut values = Vec::new();
            lanes.roll((window.first, window.last), &start, &experiment.columns, experiment.substeps, |_, c, v| {
                values.push(v[0] / experiment.noise[c]);
            });
            values
        })
        .collect()
}

/// All states along every window: one list a window, one row a state.
pub(crate) fn trajectories(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
) -> Vec<Vec<Vec<f64>>> {
    let n = system.n_states();
    if system.engine().is_some() {
        let jobs = jobs(parameters, initial);
        let mut paths = vec![vec![Vec::new(); n]; jobs.len()];
        roll_together(system, experiment, &jobs, None, &mut |job, _, j, value| paths[job][j].push(value));
        return paths;
    }
    let parameters: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
    experiment
        .windows
        .iter()
        .zip(initial)
        .map(|(window, start)| {
            let log = &experiment.logs[window.log];
            let mut lanes = Lanes::<1>::new(system, log, (experiment.hold, experiment.past), &parameters);
            let start: Vec<[f64; 1]> = start.iter().map(|&v| [v]).collect();
            let mut path = vec![Vec::with_capacity(window.last - window.first + 1); n];
            lanes.roll_states((window.first, window.last), &start, experiment.substeps, |_, j, v| path[j].push(v[0]));
            path
        })
        .collect()
}

/// One rollout a window, all with the same parameters.
fn jobs(parameters: &[f64], initial: &[Vec<f64>]) -> Vec<Job> {
    let job =
        |(window, start): (usize, &Vec<f64>)| Job { window, parameters: parameters.to_vec(), initial: start.clone() };
    initial.iter().enumerate().map(job).collect()
}

/// What the logs excite, where the model goes as a contestant does.
pub(crate) fn scene_of(contestant: &Contestant) -> Scene {
    let Contestant { system, experiment, refined, .. } = contestant;
    Scene::new(system, experiment, &trajectories(system, experiment, &refined.parameters, &refined.initial))
}
