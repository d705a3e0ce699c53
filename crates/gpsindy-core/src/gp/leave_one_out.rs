//! What predictions of each point by all others need.

/// What leave-one-out predictions need: without point i the process predicts
/// `y_i - weights_i/diagonal_i` with variance `1/diagonal_i` (noise included).
///
/// Source: Rasmussen & Williams 2006, equation 5.12.
#[derive(Debug, Clone, Default)]
pub struct LeaveOneOut {
    /// `K^-1 y`, n values.
    pub weights: Vec<f64>,
    /// Diagonal of `K^-1`, n values.
    pub diagonal: Vec<f64>,
}
