//! Sparse, noisy logs of a real machine to equations, and a diagnosis of where a simulator is wrong.
//!
//! Few nouns: [`Dataset`] (runs of samples), `Library` (candidate terms), `Model` (a named ODE),
//! `Effect` (a physical hypothesis), `Diagnosis`. Verbs: smooth, identify, simulate, score, diagnose.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod data;
pub mod diagnose;
mod differentiate;
mod error;
mod expression;
pub mod fleet;
pub mod gp;
mod identify;
pub mod library;
mod model;
mod paired;
mod progress;
mod refine;
pub mod regress;
mod score;
mod simulate;
mod smooth;
pub mod systems;
mod weak;

pub use data::{Channel, Dataset, Run};
pub use differentiate::{Derivatives, Differentiation, Prediction, RunDerivatives, SecondStage, central, slope};
pub use error::{Error, Result};
pub use expression::{Expression, Function, Operator, Tape};
pub use identify::{
    Author, AuthorResult, Choice, Delay, Estimate, Identification, Identify, Online, OnlineSettings, StateReport,
    Target,
};
pub use model::{
    Control, Dynamics, IdentificationRecord, Input, InputKind, Language, Model, Parameter, SCHEMA as MODEL_SCHEMA,
    State, System,
};
pub use paired::{Paired, PairedDiagnosis};
pub use progress::{Progress, Silent};
pub use refine::{Experiment, Free, Hold, Log, Past, Refine, Refined, Starts, Window};
pub use score::{Errors, Score, Scoring, StateError, score};
pub use simulate::{Excitation, Method, Rollout, Simulate, StateReader, initial_state, unmeasure};
pub use smooth::{Noise, Smoothed, SmoothedRun, Smoother};
pub use weak::{WeakForm, WeakRows};
