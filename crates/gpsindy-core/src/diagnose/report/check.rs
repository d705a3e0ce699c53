//! What must hold of included causes before they are believed.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// One check of a verdict with causes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Check {
    /// `closure`, `constancy`, `lack_of_fit`, `typicality` or `spread`.
    pub id: String,
    /// Whether it holds.
    pub passed: bool,
    /// Chance of as much against it where the causes are right, in 0..1; `None` where it has none.
    pub p_value: Option<f64>,
    /// What was found, in one sentence.
    pub says: String,
}
