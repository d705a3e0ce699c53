//! What a diagnosis did with the logs: its cost in counts that no clock and no other job on the machine changes.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// The work of one stage. Lanes that are rolled out side by side count once.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct StageWork {
    /// What was done.
    pub stage: String,
    /// Fits that were begun.
    pub fits: u64,
    /// Responses of the outputs to suspects that were made, a column each.
    pub columns: u64,
    /// Samples that were rolled out for derivatives of fits.
    pub derivatives: u64,
    /// Samples that were rolled out for trial steps of fits and for comparisons.
    pub trials: u64,
    /// Samples that were rolled out for responses to suspects.
    pub responses: u64,
}
