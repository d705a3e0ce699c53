//! What readings do to the states of a simulator that is guided by a log.

use super::lockstep::{Group, L};
use super::product::Product;

/// What the readings of one sample do to the simulator's states.
pub(crate) struct Correction {
    /// Simulator's states before the readings, and the readings that they predict.
    pub(super) predicted: Vec<f64>,
    pub(super) shown: Vec<f64>,
    /// States by readings (n x c), row after row, in their units; zero where nothing was read.
    pub(super) gain: Vec<f64>,
}

impl Correction {
    /// Moves the lanes of a group to the guided state `at`, each as far from it as its prediction and its readings are off; what `off` and
    /// `states` held is lost.
    pub(super) fn apply(
        &self,
        group: &mut Group<'_>,
        at: &[f64],
        shown: &[[f64; L]],
        (off, states): (&mut Vec<[f64; L]>, &mut Vec<[f64; L]>),
    ) {
        off.clear();
        off.extend(shown.iter().zip(&self.shown).map(|(now, then)| now.map(|now| then - now)));
        states.clear();
        let place = |(j, (at, predicted)): (usize, (&f64, &f64))| group.state(j).map(|now| at + (now - predicted));
        states.extend(at.iter().zip(&self.predicted).enumerate().map(place));
        Product { matrix: &self.gain, vectors: off, sums: states }.add();
        states.iter().enumerate().for_each(|(j, state)| group.set_state(j, *state));
    }
}
