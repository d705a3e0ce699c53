//! The effects among which the missing ones are, with a stated coverage: schema `gpsindy.diagnosis/1`, `prediction_set`.

use super::cause::FUNCTION;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A conformal prediction set: of machines like the drawn ones that calibrate it, in a share `coverage` at least every effect that the simulator lacks is in it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PredictionSet {
    /// Share of machines, in 0..1.
    pub coverage: f64,
    /// Listed causes and their twins, in the report's order; `function` wherever it is listed.
    pub causes: Vec<SetCause>,
    /// An effect that the report does not list is in the set, too: of the catalogue or not.
    pub none_of_these: bool,
    /// What the coverage rests on.
    pub calibration: SetCalibration,
}

/// An effect at a place, in a [`PredictionSet`].
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct SetCause {
    /// Id of the catalogue, or `function`.
    pub effect: String,
    /// The state in whose equation (or whose column) it acts.
    pub state: String,
    /// The port or control at which it acts, where it does not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// What it depends on.
    pub variables: Vec<String>,
}

impl SetCause {
    /// Whether it is structure without a name, and no effect.
    pub fn is_nameless(&self) -> bool {
        self.effect == FUNCTION
    }
}

/// The drawn machines from which the coverage of a [`PredictionSet`] follows.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct SetCalibration {
    /// How many of them.
    pub cases: usize,
    /// Which: those whose leading included cause is of this family of the catalogue, `unexplained` without an included cause; `all`
    /// where there are too few of these.
    pub group: String,
}
