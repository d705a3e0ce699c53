//! Responses: by how much the outputs of a fit change where a hypothesis is switched on.

use crate::diagnose::catalogue::hypothesis::Applied;
use crate::diagnose::fit::contestant::Linearised;
use crate::diagnose::fit::guide::Guide;
use crate::model::System;
use crate::refine::tally::Purpose;
use crate::refine::{Job, Refined, lanes::Lanes, roll_together, tangent};
use nalgebra::DVector;

/// Columns that are rolled out at once: the width of the widest vector registers in doubles.
pub(crate) const LANES: usize = 8;

/// Change of the noise-scaled outputs for every column; zero where nothing was measured.
pub(crate) fn responses(
    system: &System,
    applied: &Applied,
    at: &Linearised<'_>,
    initial: &[Vec<f64>],
    columns: &[&Vec<f64>],
) -> Vec<Vec<DVector<f64>>> {
    let Linearised { contestant: fitted, jacobian, .. } = at;
    let experiment = &fitted.experiment;
    let mut values = applied.model.parameters.iter().map(|p| p.value).collect::<Vec<_>>();
    values[..fitted.refined.parameters.len()].copy_from_slice(&fitted.refined.parameters);
    let mut parameters: Vec<[f64; LANES]> = values.iter().map(|&v| [v; LANES]).collect();
    for (lane, column) in columns.iter().enumerate() {
        for ((index, _), value) in applied.fitted.iter().zip(column.iter()) {
            parameters[*index][lane] = *value;
        }
    }
    let n_columns = experiment.columns.len();
    experiment.tally.columns(columns.len());
    experiment.tally.pass(Purpose::Responses, experiment.n_samples());
    if system.engine().is_some() {
        let lane = |l: usize| parameters.iter().map(|p| p[l]).collect::<Vec<f64>>();
        return stepped_responses(system, at, initial, &(0..columns.len()).map(lane).collect::<Vec<_>>());
    }
    let mut out: Vec<Vec<DVector<f64>>> = vec![Vec::with_capacity(experiment.windows.len()); columns.len()];
    let mut lanes: Option<(usize, Lanes<'_, LANES>)> = None;
    for (w, window) in experiment.windows.iter().enumerate() {
        let log = &experiment.logs[window.log];
        let lanes = match &mut lanes {
            Some((index, lanes)) if *index == window.log => lanes,
            other => {
                &mut other
                    .insert((window.log, Lanes::new(system, log, (experiment.hold, experiment.past), &parameters)))
                    .1
            }
        };
        let block = &jacobian.blocks[w];
        let rows = block.residual.len();
        let mut results = vec![DVector::zeros(rows); columns.len()];
        let start: Vec<[f64; LANES]> = initial[w].iter().map(|&v| [v; LANES]).collect();
        lanes.roll((window.first, window.last), &start, &experiment.columns, experiment.substeps, |i, c, v| {
            let row = (i - window.first) * n_columns + c;
            if block.present[row] {
                let base = log.measured[c][i] / experiment.noise[c] - block.residual[row];
                for (lane, result) in results.iter_mut().enumerate() {
                    result[row] = v[lane] / experiment.noise[c] - base;
                }
            }
        });
        for (list, result) in out.iter_mut().zip(results) {
            list.push(result);
        }
    }
    out
}

/// The same where the simulator steps by itself: one list of changes a window for each set of `parameters`.
fn stepped_responses(
    system: &System,
    at: &Linearised<'_>,
    initial: &[Vec<f64>],
    parameters: &[Vec<f64>],
) -> Vec<Vec<DVector<f64>>> {
    let (experiment, blocks) = (&at.contestant.experiment, &at.jacobian.blocks);
    let n_columns = experiment.columns.len();
    let windows = 0..experiment.windows.len();
    let job = |window: usize, parameters: &Vec<f64>| Job {
        window,
        parameters: parameters.clone(),
        initial: initial[window].clone(),
    };
    let jobs: Vec<Job> = windows.flat_map(|w| parameters.iter().map(move |p| job(w, p))).collect();
    let empty: Vec<DVector<f64>> = blocks.iter().map(|b| DVector::zeros(b.residual.len())).collect();
    let mut out = vec![empty; parameters.len()];
    let mut receive = |job: usize, sample: usize, c: usize, value: f64| {
        let (w, set) = (job / parameters.len(), job % parameters.len());
        let window = experiment.windows[w];
        let row = (sample - window.first) * n_columns + c;
        if blocks[w].present[row] {
            let measured = experiment.logs[window.log].measured[c][sample];
            let base = measured / experiment.noise[c] - blocks[w].residual[row];
            out[set][w][row] = value / experiment.noise[c] - base;
        }
    };
    // A straight line from the fitted rollout tells where a suspect would take it, without a rollout of its own.
    let contestant = at.contestant;
    let Refined { parameters: now, initial: starts, .. } = &contestant.refined;
    let lines = match &at.guide {
        Some(Guide { tangent, .. }) => {
            tangent.windows_of(experiment, now, starts).map(|windows| (tangent.clone(), windows))
        }
        None => tangent(&contestant.system, experiment, now, starts),
    };
    match lines {
        Some((tangent, windows)) => {
            tangent.roll(system, (experiment, &windows), &jobs, &experiment.columns, &mut receive);
        }
        None => roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut receive),
    }
    out
}
