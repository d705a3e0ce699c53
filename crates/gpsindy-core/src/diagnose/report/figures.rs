//! The curves of the HTML page; not part of the promise of the schema.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Most points that one curve of [`Figures`] carries: an agreement with the page. Exact.
pub const FIGURE_POINTS: usize = 400;

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

/// A held-out rollout with its log, at most [`FIGURE_POINTS`] samples; all lists are equally long.
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

/// Indices of at most [`FIGURE_POINTS`] of `n` samples, evenly spread, with the first and the last.
pub fn thinned(n: usize) -> Vec<usize> {
    if n <= FIGURE_POINTS {
        return (0..n).collect();
    }
    (0..FIGURE_POINTS).map(|i| i * (n - 1) / (FIGURE_POINTS - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_short_lists_and_the_ends_of_long_ones() {
        assert_eq!(thinned(3), [0, 1, 2]);
        assert!(thinned(0).is_empty());
        let kept = thinned(100_000);
        assert_eq!((kept.len(), kept[0], kept[FIGURE_POINTS - 1]), (FIGURE_POINTS, 0, 99_999));
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
