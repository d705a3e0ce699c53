//! What a posterior is asked for.

/// What is asked for at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The function itself, without noise.
    Value,
    /// Its derivative with respect to time.
    Derivative,
}
