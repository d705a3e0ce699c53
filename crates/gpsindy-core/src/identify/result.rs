//! The result of an identification.

use crate::identify::notes::Note;
use crate::identify::outlook::{LeftOut, Outlook};
use crate::model::Model;
use crate::refine::Hold;

/// A learnt model and how it came about.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Identification {
    /// The model, with its [`IdentificationRecord`](crate::IdentificationRecord).
    pub model: Model,
    /// One entry a state.
    pub states: Vec<StateReport>,
    /// One entry for every control with a delay.
    pub delays: Vec<DelayReport>,
    /// Length of the rollouts that the refinement ended with, s; none without refinement.
    pub window: Option<f64>,
    /// What the controls were taken to do between samples: simulate the model with the same.
    pub hold: Hold,
    /// How far rollouts lie from the logs that were learnt from; none of a log that was followed as it grew, and where no
    /// state moves.
    pub fidelity: Option<Fidelity>,
    /// What the logs leave open.
    pub outlook: Option<Outlook>,
    /// What a reader of the result should know.
    pub notes: Vec<Note>,
}

impl Identification {
    /// Whether the model predicts the very logs that it was learnt from no better than the mean of each column, or than
    /// standing still; or, fitted to their first part, the last part clearly worse than its mean.
    pub fn is_poor(&self) -> bool {
        self.fidelity.is_some_and(|fidelity| fidelity.is_poor()) || self.left_out().is_some_and(|part| part.is_poor())
    }

    /// How the model foretells a part of the logs that it was not fitted to, where that was tried.
    pub fn left_out(&self) -> Option<LeftOut> {
        self.outlook.as_ref().and_then(|outlook| outlook.left_out)
    }
}

/// How far rollouts lie from the logs that a model was learnt from.
///
/// Errors are root mean squares over samples and states, each state in units of its standard deviation over all logs: 1 is as
/// bad as predicting the mean.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fidelity {
    /// Length of the rollouts, s: whole runs, or for as long as the noise of a start takes to outgrow the motion.
    pub length: f64,
    /// Error of rollouts from the smoothed states; none where one diverges.
    pub error: Option<f64>,
    /// Error of staying where each rollout starts.
    pub still: f64,
}

impl Fidelity {
    /// Whether the rollouts are no better than the mean, or than standing still.
    pub fn is_poor(&self) -> bool {
        self.error.is_none_or(|error| error >= self.still.min(1.0))
    }
}

/// How the equation of one state was learnt.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct StateReport {
    /// The state.
    pub state: String,
    /// Names of the terms in its equation.
    pub terms: Vec<String>,
    /// Tuning value of the sparse regression; none where the equation was given.
    pub level: Option<f64>,
    /// Held-out mean squared error of the regression in units of the noise, or the criterion's value; none where neither was
    /// asked for.
    pub score: Option<f64>,
    /// Mean squared residual of the regression in units of the noise; near 1 where the equation holds.
    pub residual: Option<f64>,
    /// Noise of the column, in its unit: what the equations leave, or what the smoother found without refinement.
    pub noise: f64,
    /// The smoother's kernel; empty without smoother.
    pub kernel: String,
}

/// The delay of one control.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DelayReport {
    /// The control.
    pub control: String,
    /// Its delay, s.
    pub delay: f64,
    /// Standard error, s; none where the delay was given, or not refined.
    pub standard_error: Option<f64>,
}
