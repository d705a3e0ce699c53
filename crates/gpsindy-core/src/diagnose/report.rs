//! The report of a diagnosis, schema `gpsindy.diagnosis/1`: plain data, the same names as in the JSON.
//!
//! JSON has no infinity and no NaN. Whatever may be either (a rollout that diverged, a missing
//! sample, an interval without end) is an `Option` here and `null` there; [`finite`] converts.
//! All other numbers must be finite. Everything but [`Figures`] is public interface.

mod cause;
mod check;
mod closure;
mod figures;
mod gap;
mod part;
mod power;
mod set;
mod time_unit;
mod work;

use super::limits::CONFIDENCE;
pub(crate) use cause::FUNCTION;
pub use cause::{BetweenRuns, Cause, Excluded, ModelParameter, Parameter, RunValue, Stability, Twin};
pub use check::Check;
pub use closure::{Closure, ClosureState};
pub use figures::{
    EquationFigure, FIGURE_POINTS, Figures, ResidualCheck, ResidualCurve, ResidualFigure, ResidualTrace, RolloutFigure,
    SignalFigure, thinned,
};
pub use gap::{Gap, GapRegion, GapState, GapWindow, Unexplained};
pub use part::{Bound, PartFound};
pub use power::{PowerEffect, PowerNoise, PowerNull, PowerReport, PowerRival, PowerTrial};
pub use set::{PredictionSet, SetCalibration, SetCause};
pub use work::StageWork;

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// The schema that [`Diagnosis::schema`] names.
pub const SCHEMA: &str = "gpsindy.diagnosis/1";

/// What a diagnosis found: is there a gap, where, what causes it, how far does the cause close it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Diagnosis {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// Name of the nominal model.
    pub model: String,
    /// The logs, by the part that they played.
    pub runs: Runs,
    /// The finding in one word.
    pub verdict: Verdict,
    /// Confidence of every interval in the report, in 0..1; nothing else depends on it. `None` in reports that don't state it.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub confidence: Option<f64>,
    /// Is there a gap, and where.
    pub gap: Gap,
    /// Ranked, best first; those with `included` make up the augmented model.
    pub causes: Vec<Cause>,
    /// Parameters of the augmented model, nominal and fitted; empty without included causes.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub parameters: Vec<ModelParameter>,
    /// Effects that are not there above a size, given the included causes.
    pub excluded: Vec<Excluded>,
    /// What was found by joint; empty where the simulator names none.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub by_part: Vec<PartFound>,
    /// What remains after the included causes.
    pub unexplained: Unexplained,
    /// Effects among which the missing ones are, with a stated coverage; `None` without a gap, and where there is no ground for one.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub prediction_set: Option<PredictionSet>,
    /// Why there is a gap and no prediction set.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub no_prediction_set: Option<String>,
    /// What must hold of the included causes before they are believed; empty without any.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub checks: Vec<Check>,
    /// How far the included causes close the gap, on held-out runs only.
    pub closure: Closure,
    /// File of the nominal model with the included causes added; `None` where there is no such file.
    pub augmented_model: Option<String>,
    /// Seconds after which the time limit or the user ended the search before all was tried.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub interrupted: Option<f64>,
    /// What a reader must know beside the numbers, one sentence or two each.
    pub notes: Vec<String>,
    /// Which effects these logs could reveal, where that was asked for.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub power: Option<PowerReport>,
    /// What was done with the logs, stage by stage.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub work: Vec<StageWork>,
    /// Curves for the HTML page; not part of the promise of the schema.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub figures: Option<Figures>,
}

impl Diagnosis {
    /// Confidence of the intervals; 0.95 where the report does not state it.
    pub fn level(&self) -> f64 {
        self.confidence.unwrap_or(CONFIDENCE)
    }

    /// Whether the search ended before it could decide whether there is a gap.
    pub fn is_undecided(&self) -> bool {
        self.is_cut() && !self.gap.detected
    }

    /// Whether the time limit or the user ended the search before all was tried.
    pub fn is_cut(&self) -> bool {
        self.interrupted.is_some()
    }

    /// The included causes, best first.
    pub fn included(&self) -> impl Iterator<Item = &Cause> {
        self.causes.iter().filter(|cause| cause.included)
    }
}

/// The finding in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Verdict {
    /// The nominal model and noise explain the logs.
    NoGap,
    /// The included causes explain the gap.
    Explained,
    /// The included causes explain a part, and structure is left.
    PartlyExplained,
    /// No effect of the catalogue explains the gap.
    Unexplained,
}

impl Verdict {
    /// The word as in the JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NoGap => "no_gap",
            Self::Explained => "explained",
            Self::PartlyExplained => "partly_explained",
            Self::Unexplained => "unexplained",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.as_str())
    }
}

/// Names of the logs that fitted and of those that judged.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Runs {
    /// Seen by fits and choices.
    pub train: Vec<String>,
    /// Never seen by any fit or choice. Of a single run that was cut in time, its name stands in both.
    pub holdout: Vec<String>,
}

/// `value` where it is a finite number, else `None`.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_is_written_in_snake_case() {
        for verdict in [Verdict::NoGap, Verdict::Explained, Verdict::PartlyExplained, Verdict::Unexplained] {
            assert_eq!(serde_json::to_value(verdict).unwrap(), verdict.as_str());
        }
    }

    #[test]
    fn infinity_and_nan_are_absent_numbers() {
        assert_eq!(finite(f64::INFINITY), None);
        assert_eq!(finite(f64::NAN), None);
        assert_eq!(finite(-1.5), Some(-1.5));
    }

    #[test]
    fn absent_numbers_are_null_and_may_be_missing_when_read() {
        let parameter = Parameter { name: "c".into(), value: 1.0, low: None, high: Some(2.0), unit: String::new() };
        let json = serde_json::to_value(&parameter).unwrap();
        assert!(json["low"].is_null());
        let read: Parameter = serde_json::from_str(r#"{"name": "c", "value": 1.0, "high": 2.0, "unit": ""}"#).unwrap();
        assert_eq!(read, parameter);
    }
}
