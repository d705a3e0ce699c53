//! How far the causes close the gap: schema `gpsindy.diagnosis/1`, `closure`.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// How far the included causes close the gap, on held-out runs only.
///
/// `before`, `after`, `floor`: root mean square, over samples and logged columns that move, of the rollout
/// error divided by that column's noise. `None` is a rollout that diverged, or a number that follows from one.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Closure {
    /// Always `rollout_rmse` in this version.
    pub metric: String,
    /// Of the nominal model.
    pub before: Option<f64>,
    /// Of the augmented model.
    pub after: Option<f64>,
    /// What noise alone leaves.
    pub floor: Option<f64>,
    /// How the floor was got: `repeated runs`, `parametric simulation` or `sensor noise`.
    pub floor_source: String,
    /// `(before - after) / (before - floor)`; may be negative; zero where there is no gap to close.
    pub closed: Option<f64>,
    /// Lower end of its interval over blocks of the runs.
    pub low: Option<f64>,
    /// Upper end of its interval.
    pub high: Option<f64>,
    /// Duration of the longest rollout, s: longer ones were restarted from the log.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub horizon: Option<f64>,
    /// Share of the held-out errors within the 95 % band that random forces predict; `None` without such forces.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub spread: Option<f64>,
    /// By logged column that moves, in its unit.
    pub by_state: Vec<ClosureState>,
}

/// Rollout error of one logged column.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ClosureState {
    /// The column.
    pub state: String,
    /// Of the nominal model, in `unit`.
    pub before: Option<f64>,
    /// Of the augmented model, in `unit`.
    pub after: Option<f64>,
    /// What noise alone leaves, in `unit`.
    pub floor: Option<f64>,
    /// As [`Closure::closed`], of this column.
    #[cfg_attr(feature = "serde", serde(default))]
    pub closed: Option<f64>,
    /// Empty where unknown.
    pub unit: String,
}
