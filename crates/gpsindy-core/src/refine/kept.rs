//! Derivatives that one fit hands on to the next.

use super::blocks::{Block, Jacobian};
use crate::model::System;
use crate::refine::{Experiment, Free, Window};
use std::sync::Arc;

/// Derivatives of a fit, for another one of the same windows with other effects.
#[derive(Debug, Clone)]
pub(crate) struct Kept {
    jacobian: Arc<Jacobian>,
    /// The states whose columns come first, and the parameters whose columns come behind them; nothing in the place of those that are not
    /// handed on.
    states: Vec<String>,
    parameters: Vec<Option<String>>,
    windows: Vec<Window>,
    columns: Vec<usize>,
    noise: Vec<f64>,
}

impl Kept {
    pub(crate) fn new(jacobian: Jacobian, system: &System, experiment: &Experiment, free: &[Free]) -> Self {
        Self {
            states: system.model().states.iter().take(jacobian.n_states).map(|s| s.name.clone()).collect(),
            jacobian: Arc::new(jacobian),
            parameters: free.iter().map(|f| Some(name(system, f).to_string())).collect(),
            windows: experiment.windows.clone(),
            columns: experiment.columns.clone(),
            noise: experiment.noise.clone(),
        }
    }

    /// The same with the parameters of `system` alone: the others may be other ones of the same name elsewhere.
    pub(crate) fn of_parameters_in(&self, system: &System) -> Self {
        let own = |name: &String| system.model().parameter_index(name).is_some();
        let parameters = self.parameters.iter().map(|name| name.clone().filter(own)).collect();
        Self { parameters, ..self.clone() }
    }

    /// The parameters that are handed on.
    #[cfg(test)]
    pub(super) fn parameters(&self) -> Vec<Option<&str>> {
        self.parameters.iter().map(Option::as_deref).collect()
    }

    /// Whether these are the derivatives of the same readings.
    pub(super) fn serves(&self, experiment: &Experiment) -> bool {
        self.windows == experiment.windows && self.columns == experiment.columns
    }

    /// Fills a column of a window's block in; whether it is known, for the window itself or one that begins alike and goes on for longer.
    pub(super) fn fill(
        &self,
        (system, experiment, free): (&System, &Experiment, &[Free]),
        (window, column): (usize, usize),
        block: &mut Block,
    ) -> bool {
        let n = system.n_states();
        let wanted = experiment.windows[window];
        let begins = |own: &Window| own.log == wanted.log && own.first == wanted.first && own.last >= wanted.last;
        let own = match self.windows.get(window) {
            Some(same) if begins(same) => Some(window),
            _ => self.windows.iter().position(begins),
        };
        let place = match column.checked_sub(n) {
            None => self.states.iter().position(|s| *s == system.model().states[column].name),
            Some(place) => {
                let name = name(system, &free[place]);
                let known = self.parameters.iter().position(|p| p.as_deref() == Some(name));
                known.map(|place| self.jacobian.n_states + place)
            }
        };
        let Some((own, place)) = own.zip(place) else { return false };
        let known = self.jacobian.blocks[own].derivative.column(place);
        // In units of the noise, which may have been another.
        let noise = &experiment.noise;
        for (row, (value, known)) in block.derivative.column_mut(column).iter_mut().zip(known.iter()).enumerate() {
            let of = row % noise.len();
            *value = known * self.noise[of] / noise[of];
        }
        true
    }
}

fn name<'a>(system: &'a System, free: &Free) -> &'a str {
    &system.model().parameters[free.parameter].name
}
