//! The report of a diagnosis, schema `gpsindy.diagnosis/1`: plain data, the same names as in the JSON.
//!
//! JSON has no infinity and no NaN. Whatever may be either (a rollout that diverged, a missing
//! sample, an interval without end) is an `Option` here and `null` there; [`finite`] converts.
//! All other numbers must be finite. Everything but [`Figures`] is public interface.

mod power;

pub use power::{PowerEffect, PowerNoise, PowerNull, PowerReport, PowerRival, PowerTrial};

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// The schema that [`Diagnosis::schema`] names.
pub const SCHEMA: &str = "gpsindy.diagnosis/1";

/// Most points that one curve of [`Figures`] carries.
pub const FIGURE_POINTS: usize = 400;

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
    /// Confidence of every interval in the report, in 0..1; nothing else depends on it. `None` in reports that don't tell.
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
    /// What remains after the included causes.
    pub unexplained: Unexplained,
    /// How far the included causes close the gap, on held-out runs only.
    pub closure: Closure,
    /// File of the nominal model with the included causes added; `None` where there is no such file.
    pub augmented_model: Option<String>,
    /// What a reader must know beside the numbers, one sentence or two each.
    pub notes: Vec<String>,
    /// Which effects these logs could reveal, where that was asked for.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub power: Option<PowerReport>,
    /// Curves for the HTML page; not part of the promise of the schema.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub figures: Option<Figures>,
}

impl Diagnosis {
    /// Confidence of the intervals; 0.95 where the report does not tell.
    pub fn level(&self) -> f64 {
        self.confidence.unwrap_or(0.95)
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

/// Is there a gap, and where. Shares are of the summed squared, noise-scaled gap.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Gap {
    /// The nominal model plus measurement noise does not explain the logs, at 5 %.
    pub detected: bool,
    /// Of the hypothesis that it does, in 0..1.
    pub p_value: f64,
    /// Largest share first.
    pub by_state: Vec<GapState>,
    /// State by state as in `by_state`, along the variable's axis; neighbours that are alike are one region.
    pub by_region: Vec<GapRegion>,
    /// Run by run along time, of the equation with the largest share; neighbours that are alike are one stretch.
    pub by_window: Vec<GapWindow>,
}

/// The gap in one equation.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapState {
    /// The state whose equation it is.
    pub state: String,
    /// In 0..1.
    pub share: f64,
    /// Of the hypothesis that this equation is right, in 0..1.
    pub p_value: f64,
    /// Root mean square of what the equation lacks, in `unit`.
    pub residual_rms: f64,
    /// Root mean square that noise alone would give there, in `unit`.
    pub noise_rms: f64,
    /// Unit of the equation's right side; empty where unknown.
    pub unit: String,
}

/// The gap in one band of one variable.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapRegion {
    /// The state whose equation it is.
    pub state: String,
    /// State or control that the band is of.
    pub variable: String,
    /// Lower end, in the variable's unit.
    pub from: f64,
    /// Upper end, in the variable's unit.
    pub to: f64,
    /// In 0..1.
    pub share: f64,
}

/// The gap in one stretch of time of one run.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapWindow {
    /// Name of the run.
    pub run: String,
    /// Begin, s.
    pub from: f64,
    /// End, s.
    pub to: f64,
    /// In 0..1.
    pub share: f64,
}

/// One candidate cause.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Cause {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation (or whose column) it acts.
    pub state: String,
    /// The port or control at which it acts, where it does not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// What it depends on: states, controls, or the name of the parameter that is wrong.
    pub variables: Vec<String>,
    /// It is part of the augmented model.
    pub included: bool,
    /// Calibrated, in 0..1.
    pub probability: f64,
    /// What it adds to the equation, or becomes, with the names of `parameters`.
    pub form: String,
    /// Fitted sizes.
    pub parameters: Vec<Parameter>,
    /// Ids of effects that these logs cannot tell from this one.
    pub equivalent: Vec<String>,
    /// The experiment that would tell them apart; `None` where `equivalent` is empty.
    pub next_experiment: Option<String>,
    /// Whether its size agrees between parts of the logs; `None` where it was not asked or no part tells a size.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub stability: Option<Stability>,
}

/// Whether a cause keeps its size between runs, in the inner and the outer part of its range, early and late.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Stability {
    /// Parts of the logs (runs and halves) that tell a size of their own.
    pub runs: usize,
    /// How many of them agree.
    pub agree: usize,
    /// Chance of so much disagreement, in 0..1.
    pub p_value: f64,
    /// The parts that disagree, in words.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub disagree: Vec<String>,
}

/// A parameter of the augmented model.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ModelParameter {
    /// Its name in the model.
    pub name: String,
    /// In the nominal model; `None` where a cause brought it.
    pub nominal: Option<f64>,
    /// In the augmented model, in `unit`.
    pub value: f64,
    /// Standard deviation with the size and colour of what the fit leaves; `None` where it was not fitted.
    pub deviation: Option<f64>,
    /// Empty where unknown or without dimension.
    pub unit: String,
}

/// A fitted size with its interval, at the report's confidence.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Parameter {
    /// Name in the form.
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// Lower end; `None` where the logs set no lower end.
    pub low: Option<f64>,
    /// Upper end; `None` where the logs set no upper end.
    pub high: Option<f64>,
    /// Empty where unknown or without dimension.
    pub unit: String,
}

/// An effect that would have been found, with 95 % power, had it been larger than `above`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Excluded {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation it would act.
    pub state: String,
    /// What it would depend on.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub variables: Vec<String>,
    /// The port or control at which it would act, where it would not act in the state's equation alone.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub place: Option<String>,
    /// Size of the effect's first parameter, in `unit`.
    pub above: f64,
    /// Empty where unknown or without dimension.
    pub unit: String,
}

/// What remains after the included causes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Unexplained {
    /// That it is structure and not noise, in 0..1.
    pub probability: f64,
    /// Of the gap, in 0..1.
    pub share: f64,
    /// Variables that it depends on; empty where none shows.
    pub depends_on: Vec<String>,
}

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

/// Curves for the HTML page. They may change in any version; a script should not read them.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Figures {
    /// Per held-out run and logged column.
    pub rollouts: Vec<RolloutFigure>,
    /// Per state whose equation may be wrong.
    pub residuals: Vec<ResidualFigure>,
    /// Equations that the included causes change; a sensor effect changes what a column reads.
    #[cfg_attr(feature = "serde", serde(default))]
    pub equations: Vec<EquationFigure>,
    /// Where the simulator is the file of an engine: the lines that changed in it, as in `diff -u`.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub difference: Vec<String>,
    /// What the logs hold, per run and column.
    #[cfg_attr(feature = "serde", serde(default))]
    pub signals: Vec<SignalFigure>,
    /// Per logged column that moves, what the better model leaves of the held-out runs.
    #[cfg_attr(feature = "serde", serde(default))]
    pub checks: Vec<ResidualCheck>,
}

/// One column of one run, at most [`FIGURE_POINTS`] samples.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct SignalFigure {
    /// Name of the run.
    pub run: String,
    /// No fit and no choice saw it.
    pub held_out: bool,
    /// The column.
    pub column: String,
    /// Empty where unknown.
    pub unit: String,
    /// The model's control, else one of its states.
    pub is_control: bool,
    /// s.
    pub time: Vec<f64>,
    /// `None` is a missing sample.
    pub values: Vec<Option<f64>>,
}

/// How what is left of a column repeats itself.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ResidualCheck {
    /// The column.
    pub column: String,
    /// Correlation of what is left with itself, from one sample apart on.
    pub autocorrelation: Vec<f64>,
    /// Half width of the band in which 99 % of the values lie where what is left is white noise.
    pub band: f64,
}

/// An equation before and after, as text.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct EquationFigure {
    /// The left side as it is shown: `v'`, or `v reads`.
    pub left: String,
    /// Right side in the nominal model; empty for a state that a cause adds.
    pub before: String,
    /// Right side in the augmented model.
    pub after: String,
}

/// A held-out rollout beside its log, at most [`FIGURE_POINTS`] samples; all lists are equally long.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct RolloutFigure {
    /// Name of the run.
    pub run: String,
    /// The logged column.
    pub column: String,
    /// Empty where unknown.
    pub unit: String,
    /// s.
    pub time: Vec<f64>,
    /// `None` is a missing sample.
    pub measured: Vec<Option<f64>>,
    /// Rollout of the nominal model; `None` from where it diverged.
    pub before: Vec<Option<f64>>,
    /// Rollout of the augmented model; `None` from where it diverged. Empty without included causes.
    pub after: Vec<Option<f64>>,
    /// Share of the column's motion that the nominal model follows, `1 - rms(error)/rms(column - its mean)`; may be
    /// negative, `None` where it diverged or nothing moves.
    #[cfg_attr(feature = "serde", serde(default))]
    pub fit_before: Option<f64>,
    /// The same of the augmented model.
    #[cfg_attr(feature = "serde", serde(default))]
    pub fit_after: Option<f64>,
}

/// What one equation lacks.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ResidualFigure {
    /// The state whose equation it is.
    pub state: String,
    /// Unit of the right side; empty where unknown.
    pub unit: String,
    /// Against the variable that it depends on most; `None` where it depends on none.
    pub curve: Option<ResidualCurve>,
    /// Over the time of each training run.
    pub traces: Vec<ResidualTrace>,
}

/// Residual against a variable, at most [`FIGURE_POINTS`] points in rising order of `x`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ResidualCurve {
    /// State or control.
    pub variable: String,
    /// Unit of the variable; empty where unknown.
    pub unit: String,
    /// The variable.
    pub x: Vec<f64>,
    /// The residual, in the figure's unit.
    pub y: Vec<f64>,
    /// Half width of its 95 % band.
    pub band: Vec<f64>,
    /// What the included causes add there, same length as `x`, or empty.
    pub explained: Vec<f64>,
}

/// Residual over the time of a run, at most [`FIGURE_POINTS`] points.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct ResidualTrace {
    /// Name of the run.
    pub run: String,
    /// s.
    pub time: Vec<f64>,
    /// The residual, in the figure's unit.
    pub y: Vec<f64>,
    /// Half width of its 95 % band.
    pub band: Vec<f64>,
}

/// `value` where it is a finite number, else `None`.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Indices of at most [`FIGURE_POINTS`] of `n` samples, evenly spread, with the first and the last.
pub fn thinned(n: usize) -> Vec<usize> {
    if n <= FIGURE_POINTS {
        return (0..n).collect();
    }
    (0..FIGURE_POINTS).map(|i| i * (n - 1) / (FIGURE_POINTS - 1)).collect()
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
    fn thinning_keeps_short_lists_and_the_ends_of_long_ones() {
        assert_eq!(thinned(3), [0, 1, 2]);
        assert!(thinned(0).is_empty());
        let kept = thinned(100_000);
        assert_eq!((kept.len(), kept[0], kept[FIGURE_POINTS - 1]), (FIGURE_POINTS, 0, 99_999));
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
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
