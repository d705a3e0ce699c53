//! Initial values and typical sizes of the states that a hypothesis adds.

use crate::diagnose::catalogue::hypothesis::Applied;
use crate::model::{Model, State, System};
use crate::refine::Experiment;

/// Initial states with every added state (from `known` on) where [`start_of`] has it.
pub(crate) fn with_lagging(
    system: &System,
    experiment: &Experiment,
    mut initial: Vec<Vec<f64>>,
    known: usize,
) -> Vec<Vec<f64>> {
    let model = system.model();
    for (window, start) in experiment.windows.iter().zip(&mut initial) {
        start.resize(model.states.len(), 0.0);
        let (known, added) = start.split_at_mut(known);
        let control = |c: usize| experiment.logs[window.log].controls[c][window.first];
        for (state, value) in model.states[known.len()..].iter().zip(added) {
            *value = start_of(model, state, known, control);
        }
    }
    initial
}

/// The start of an added state: what the model gives it, else what it follows: a control (a lagging input), or one of the
/// `known` states (a filtered sensor).
pub(crate) fn start_of(model: &Model, state: &State, known: &[f64], control: impl Fn(usize) -> f64) -> f64 {
    let names = state.equation.variables();
    let given = model.initial.get(&state.name).copied();
    let followed = || names.iter().find_map(|name| model.control_index(name)).map(&control);
    let seen = || names.iter().find_map(|name| model.state_index(name).and_then(|j| known.get(j))).copied();
    given.or_else(followed).or_else(seen).unwrap_or(0.0)
}

/// Typical sizes of the states that lagging inputs added: the largest value of their control.
pub(crate) fn scale_lagging(experiment: &mut Experiment, applied: &Applied) {
    for state in &applied.model.states[experiment.scale.len()..] {
        let control = state.equation.variables().iter().find_map(|n| applied.model.control_index(n));
        let largest = control.map_or(1.0, |c| {
            let values = experiment.logs.iter().flat_map(|l| &l.controls[c]);
            values.fold(0.0, |a: f64, v| a.max(v.abs()))
        });
        experiment.scale.push(if largest > 0.0 { largest } else { 1.0 });
    }
}
