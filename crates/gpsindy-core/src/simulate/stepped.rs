//! Simulation by a simulator that steps on its own: its own steps, whatever the method asked for.

use super::{Excitation, Rollout, Simulate};
use crate::error::{Error, Result};
use crate::model::System;
use crate::refine::{Experiment, Job, Log, Past, Starts, Window, roll_together};
use faer::Mat;
use std::ops::Range;

/// A rollout over the samples `range` from `initial`.
pub(super) fn rollout(
    settings: &Simulate,
    system: &System,
    excitation: &Excitation,
    initial: &[f64],
    range: Range<usize>,
) -> Result<Rollout> {
    system.check_stamps(&system.model().name, excitation.time())?;
    let n = system.n_states();
    let time: Vec<f64> = excitation.time().into();
    let log = Log {
        name: String::new(),
        time,
        controls: excitation.controls().to_vec(),
        measured: Vec::new(),
        ..Log::default()
    };
    let window = Window { log: 0, first: range.start, last: range.end - 1 };
    let experiment = Experiment {
        logs: vec![log].into(),
        columns: Vec::new(),
        noise: Vec::new(),
        news: Vec::new(),
        windows: vec![window],
        hold: excitation.hold(),
        past: Past::Still,
        starts: Starts::default(),
        substeps: 1,
        scale: vec![1.0; n],
        tally: Default::default(),
    };
    let job = || Job { window: 0, parameters: system.parameter_values(), initial: initial.to_vec() };
    let mut states = Mat::zeros(range.len(), n);
    let mut outputs = Mat::zeros(range.len(), n);
    roll_together(system, &experiment, &[job()], None, &mut |_, sample, j, value| {
        states[(sample - range.start, j)] = value;
    });
    let columns: Vec<usize> = (0..n).collect();
    let measures = system.model().states.iter().any(|s| s.measured.is_some());
    if measures {
        roll_together(system, &experiment, &[job()], Some(&columns), &mut |_, sample, j, value| {
            outputs[(sample - range.start, j)] = value;
        });
    } else {
        outputs.clone_from(&states);
    }
    let time = &excitation.time()[range];
    for (i, &t) in time.iter().enumerate() {
        if let Some(j) = (0..n).find(|&j| !(states[(i, j)].abs() <= settings.bound)) {
            if let Some(failure) = failure(system, excitation, initial) {
                return Err(failure);
            }
            return Err(Error::Diverged {
                what: format!("the simulator `{}`", system.model().name),
                time: t,
                state: system.model().states[j].name.clone(),
                value: states[(i, j)],
            });
        }
    }
    Ok(Rollout { time: time.into(), states, outputs, n_steps: 0, n_coarse: 0, stiff_from: None })
}

/// The simulator's own error, if it has one.
fn failure(system: &System, excitation: &Excitation, initial: &[f64]) -> Option<Error> {
    let simulator = system.simulator()?;
    let n = simulator.n_states();
    let controls: Vec<f64> = excitation.controls().iter().map(|c| c[0]).collect();
    let mut dx = vec![0.0; n];
    simulator.derivative(excitation.time()[0], &initial[..n], &controls, &mut dx).err()
}
