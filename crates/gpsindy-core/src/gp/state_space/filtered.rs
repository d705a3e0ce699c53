//! What a filter leaves at an event.

use super::matern::{Matrix, Vector};

/// What the filter leaves at an event, for unit amplitude.
#[derive(Clone, Copy)]
pub(super) struct Filtered<const M: usize> {
    /// Before the measurement.
    pub(super) mean: Vector<M>,
    pub(super) covariance: Matrix<M>,
    pub(super) gain: Vector<M>,
    /// Innovation over its variance, and one over its variance; 0 without measurement.
    pub(super) innovation: f64,
    pub(super) precision: f64,
}
