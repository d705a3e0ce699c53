//! What acts beside a simulator that steps: rates that it does not know.

use super::{Group, L};
use crate::model::System;

impl Group<'_> {
    /// By how much terms outside the simulator move their states in a step: exactly where such a rate is a straight line in
    /// its own state.
    pub(super) fn rates_beside(&mut self, system: &System, dt: f64) -> Vec<(usize, [f64; L])> {
        let Some(drive) = system.drive() else { return Vec::new() };
        if drive.rows.is_empty() {
            return Vec::new();
        }
        let n = system.simulator().map_or(0, |s| s.n_states());
        drive.beside.evaluate(&mut self.beside);
        let rates: Vec<[f64; L]> = (0..drive.rows.len()).map(|i| drive.beside.output(&self.beside, i)).collect();
        let rows = drive.rows.iter().zip(&rates).enumerate();
        rows.map(|(i, (&j, rate))| {
            if j < n {
                return (j, rate.map(|rate| dt * rate));
            }
            let shift = self.x[j].map(|x| 1e-6 * (1.0 + x.abs()));
            for lane in 0..L {
                self.beside[j][lane] = self.x[j][lane] + shift[lane];
            }
            drive.beside.evaluate(&mut self.beside);
            let raised = drive.beside.output(&self.beside, i);
            self.beside[j] = self.x[j];
            let moved = std::array::from_fn(|lane| {
                let growth = dt * (raised[lane] - rate[lane]) / shift[lane];
                let part = if growth.abs() < 1e-9 { 1.0 } else { growth.exp_m1() / growth };
                dt * rate[lane] * part
            });
            (j, moved)
        })
        .collect()
    }
}
