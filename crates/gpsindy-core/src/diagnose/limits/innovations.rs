//! The filter whose innovations screen a simulator that steps.

/// Rounds of expectation maximisation of the pushes: each brings them nearer by a share, and a filter's memory hardly changes
/// with a tenth of them. Convention.
pub(crate) const PUSH_ROUNDS: usize = 12;

/// Least deviation of a push, as a share of the reading's noise: a filter that takes the model as exact over a hundred samples
/// and more gains nothing from a longer memory, and its matrices lose their digits. Argument.
pub(crate) const LEAST_PUSH: f64 = 0.01;

/// Step of a derivative along the tangent, in typical sizes: a straight line has the same slope over any. Argument.
pub(crate) const STRAIGHT: f64 = 1e-3;
