//! What an identification gives back.

use crate::identify::notes::Note;
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
    /// What a reader of the result should know.
    pub notes: Vec<Note>,
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
