//! Rows of one call of a simulator that steps.

use crate::model::batched::{Span, advance};
use crate::model::{Rows, Steps, System};

/// Size of a state beyond which a row counts as diverged; what a simulator makes of it is no number.
const BOUND: f64 = 1e9;

/// What goes to the simulator in one call, and what comes back.
#[derive(Default)]
pub(super) struct Buffer {
    pub(super) count: usize,
    pub(super) states: Vec<f64>,
    pub(super) commands: Vec<f64>,
    pub(super) forces: Vec<f64>,
    pub(super) parameters: Vec<f64>,
    pub(super) next: Vec<f64>,
}

impl Buffer {
    pub(super) fn clear(&mut self) {
        self.count = 0;
        for part in [&mut self.states, &mut self.commands, &mut self.forces, &mut self.parameters] {
            part.clear();
        }
    }

    /// Commands, forces and parameters of a row.
    pub(super) fn arguments(&self, row: usize) -> impl Iterator<Item = f64> {
        let parts = [&self.commands, &self.forces, &self.parameters];
        parts.into_iter().flat_map(move |part| {
            let width = part.len() / self.count.max(1);
            part[row * width..(row + 1) * width].iter().copied()
        })
    }

    /// Adds a row of the states and of so many commands, forces, and parameters.
    pub(super) fn push(&mut self, states: &[f64], arguments: &[f64], (m, f): (usize, usize)) {
        self.states.extend_from_slice(states);
        self.commands.extend_from_slice(&arguments[..m]);
        self.forces.extend_from_slice(&arguments[m..m + f]);
        self.parameters.extend_from_slice(&arguments[m + f..]);
        self.count += 1;
    }

    /// A step of `dt[i]` s for row i.
    pub(super) fn step_each(&mut self, engine: &dyn Steps, system: &System, dt: &[f64]) {
        self.advance(engine, system, Span::Each(dt));
    }

    /// So many samples of so many whole steps each; the rows have commands and forces of every sample, and so has what comes back.
    pub(super) fn rollout(&mut self, engine: &dyn Steps, system: &System, (samples, count): (usize, usize)) {
        self.advance(engine, system, Span::Rollout(samples, count));
        let n = system.simulator().map_or(0, |s| s.n_states());
        for row in self.next.chunks_mut((samples * n).max(1)) {
            let is_lost = |state: &[f64]| state.iter().any(|v| !(v.abs() < BOUND));
            if let Some(sample) = row.chunks(n.max(1)).position(is_lost) {
                row[(sample + 1) * n..].fill(f64::NAN);
            }
        }
    }

    fn advance(&mut self, engine: &dyn Steps, system: &System, span: Span<'_>) {
        let n = system.simulator().map_or(0, |s| s.n_states());
        self.next.clear();
        let samples = if let Span::Rollout(samples, _) = span { samples } else { 1 };
        self.next.resize(self.count * samples * n, f64::NAN);
        // A row that has left all bounds is no longer shown to the simulator.
        let lost: Vec<usize> =
            (0..self.count).filter(|r| self.states[r * n..(r + 1) * n].iter().any(|v| !(v.abs() < BOUND))).collect();
        for r in &lost {
            self.states[r * n..(r + 1) * n].fill(0.0);
        }
        for part in [&mut self.commands, &mut self.forces] {
            part.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        }
        let rows = Rows {
            count: self.count,
            states: &self.states,
            commands: &self.commands,
            forces: &self.forces,
            parameters: &self.parameters,
        };
        if advance(engine, &rows, span, &mut self.next).is_err() {
            self.next.fill(f64::NAN);
        }
        for r in &lost {
            self.next[r * samples * n..(r + 1) * samples * n].fill(f64::NAN);
        }
    }
}
