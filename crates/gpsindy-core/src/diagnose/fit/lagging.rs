//! Where the states of lagging inputs start.

use crate::model::System;
use crate::refine::Experiment;

/// Initial states with every lagging input (states from `known` on) starting at its control.
pub(crate) fn with_lagging(
    system: &System,
    experiment: &Experiment,
    mut initial: Vec<Vec<f64>>,
    known: usize,
) -> Vec<Vec<f64>> {
    let model = system.model();
    for (window, start) in experiment.windows.iter().zip(&mut initial) {
        start.resize(model.states.len(), 0.0);
        for (state, value) in model.states[known..].iter().zip(&mut start[known..]) {
            let control = state.equation.variables().iter().find_map(|name| model.control_index(name));
            *value = control.map_or(0.0, |c| experiment.logs[window.log].controls[c][window.first]);
        }
    }
    initial
}
