//! What readings do to the states of a simulator that is guided by a log.

use super::lockstep::{Group, L};
use nalgebra::DMatrix;

/// What the readings of one sample do to the simulator's states.
pub(crate) struct Correction {
    /// Simulator's states before the readings, and the readings that they predict.
    pub(super) predicted: Vec<f64>,
    pub(super) shown: Vec<f64>,
    /// States by readings (n x c), in their units; zero where nothing was read.
    pub(super) gain: DMatrix<f64>,
}

impl Correction {
    /// Moves the lanes of a group to the guided state `at`, each as far from it as its prediction and its readings are off.
    pub(super) fn apply(&self, group: &mut Group<'_>, at: &[f64], shown: &[[f64; L]]) {
        for (j, (at, predicted)) in at.iter().zip(&self.predicted).enumerate() {
            let now = group.state(j);
            group.set_state(
                j,
                std::array::from_fn(|lane| {
                    let readings = shown.iter().zip(&self.shown).enumerate();
                    let back: f64 = readings.map(|(c, (now, then))| self.gain[(j, c)] * (now[lane] - then)).sum();
                    at + (now[lane] - predicted) - back
                }),
            );
        }
    }
}
