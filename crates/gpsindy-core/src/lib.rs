//! Identification of equations from sparse, noisy logs, and diagnosis of where a simulator is wrong.
//!
//! Few nouns: [`Dataset`] (runs of samples), [`Library`](library::Library) (candidate terms), [`Model`] (a named ODE),
//! [`Effect`](diagnose::Effect) (a physical hypothesis), [`Diagnosis`](diagnose::Diagnosis). Five verbs:
//!
//! | verb | settings and call | result |
//! | --- | --- | --- |
//! | smooth | [`Smoother::smooth`] | [`Smoothed`]: states and derivatives, with standard deviations |
//! | identify | [`Identify::fit`] (sample by sample: [`Online`]) | [`Identification`]: a model with standard errors |
//! | simulate | [`Simulate::rollout`] | [`Rollout`]: states and predicted readings |
//! | score | [`score`](fn@score) | [`Score`]: errors of the predictions |
//! | diagnose | [`Diagnose::run`](diagnose::Diagnose::run) | [`Diagnosed`](diagnose::Diagnosed): the causes of the gap, and the corrected model |
//!
//! A model that `identify` learns, `diagnose` can start from; a model that `diagnose` corrects, `simulate` runs. All
//! settings are plain structs with defaults, all randomness comes from a seed, and nothing here prints or reads a file:
//! logs and models in files are the business of the crate `gpsindy-files`.
//!
//! # Smooth
//!
//! ```
//! use gpsindy_core::systems::{SensorNoise, van_der_pol};
//! use gpsindy_core::{Silent, Smoother};
//!
//! let log = van_der_pol().sample_usual(SensorNoise::Relative(0.05), 1)?;
//! let smoothed = Smoother::default().smooth(&log, &[0], &Silent)?;
//! assert_eq!(smoothed.runs[0].derivative.nrows(), log.runs()[0].n_samples());
//! # Ok::<(), gpsindy_core::Error>(())
//! ```
//!
//! # Identify
//!
//! ```
//! use gpsindy_core::library::LibrarySettings;
//! use gpsindy_core::systems::{SensorNoise, lotka_volterra};
//! use gpsindy_core::{Identify, Silent};
//!
//! let log = lotka_volterra().sample_usual(SensorNoise::Relative(0.01), 1)?;
//! let settings = Identify {
//!     states: vec!["x1".into(), "x2".into()],
//!     library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
//!     ..Identify::default()
//! };
//! let found = settings.fit(&log, &Silent)?;
//! assert!(found.model.states[0].equation.to_string().contains("x1*x2"));
//! # Ok::<(), gpsindy_core::Error>(())
//! ```
//!
//! # Simulate
//!
//! ```
//! use gpsindy_core::faer::Mat;
//! use gpsindy_core::{Excitation, Expression, Hold, Model, Simulate, State};
//!
//! let decay = Model { states: vec![State::new("x", Expression::parse("-2*x")?)], ..Model::default() };
//! let system = decay.compile()?;
//! let no_controls = Mat::zeros(2, 0);
//! let excitation = Excitation::new(&system, &[0.0, 1.0], no_controls.as_ref(), Hold::Zero)?;
//! let rollout = Simulate::default().rollout(&system, &excitation, &[1.0])?;
//! assert!((rollout.states[(1, 0)] - f64::exp(-2.0)).abs() < 1e-6);
//! # Ok::<(), gpsindy_core::Error>(())
//! ```
//!
//! # Score
//!
//! ```
//! use gpsindy_core::systems::{SensorNoise, pendulum};
//! use gpsindy_core::{Scoring, Silent, score};
//!
//! let truth = pendulum();
//! let log = truth.sample_usual(SensorNoise::None, 1)?;
//! let scored = score(&truth.model.compile()?, &log, &Scoring::default(), &Silent)?;
//! println!("{scored:?}");
//! # Ok::<(), gpsindy_core::Error>(())
//! ```
//!
//! # Diagnose
//!
//! ```
//! use gpsindy_core::diagnose::{Diagnose, Verdict, hold_out};
//! use gpsindy_core::systems::{SensorNoise, van_der_pol};
//! use gpsindy_core::Silent;
//!
//! let machine = van_der_pol();
//! let start = |x: f64, seed| machine.sample(&machine.times()[..150], &[x, 0.5], SensorNoise::Absolute(0.01), seed);
//! let runs = [start(1.0, 1), start(-0.5, 2), start(1.5, 3)];
//! let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
//! let all = runs.iter().flat_map(|log| log.runs().to_vec()).collect();
//! let logs = gpsindy_core::Dataset::new(runs[0].channels().to_vec(), all)?;
//! let (train, holdout) = hold_out(&logs)?;
//! let found = Diagnose::default().run(&machine.model, &train, &holdout, &Silent)?;
//! assert_eq!(found.diagnosis.verdict, Verdict::NoGap);
//! # Ok::<(), gpsindy_core::Error>(())
//! ```
//!
//! # Where to go
//!
//! What the five verbs take and give is at the root. A family of parts from which one is chosen, or that can be used
//! on its own, is a module:
//!
//! - [`library`]: candidate terms, and what is known of equations beforehand
//! - [`regress`]: sparse regressions, and how one place on their path is chosen
//! - [`gp`]: kernels and Gaussian processes over time
//! - [`refine`]: fits of parameters through the integrator
//! - [`expression`]: the language of equations
//! - [`diagnose`]: the catalogue of effects, the report, what logs could reveal at all
//! - [`systems`]: test systems with known answers
//!
//! # Features
//!
//! `parallel` (default): runs, states, kernels and hypotheses on all processors; the numbers are the same without.
//! `serde` (default): models, expressions and diagnoses can be written and read.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod clock;
mod data;
pub mod diagnose;
mod differentiate;
mod error;
mod excerpt;
mod excitation;
pub mod expression;
pub mod fleet;
pub mod gp;
mod identify;
pub mod library;
mod model;
mod optimise;
mod paired;
mod parallel;
mod progress;
mod random;
pub mod refine;
pub mod regress;
mod score;
mod simulate;
mod smooth;
pub mod systems;

/// The matrices of this crate's interface are `faer::Mat<f64>`: take faer from here, so that its version is the one that
/// this crate was built with. faer is below 1.0, and a new version of it is a new version of this crate.
pub use faer;

pub use clock::{ClockOffset, Signal, clock_offset};
pub use data::{Channel, Dataset, Hold, Run};
pub use differentiate::{Derivatives, Differentiation, Prediction, RunDerivatives, SecondStage, central, slope};
pub use error::{Error, Result};
pub use expression::Expression;
pub use identify::{
    Author, AuthorResult, Choice, Delay, DelayReport, Doubt, Estimate, Exchange, Fidelity, Identification, Identify,
    LeftOut, Note, Online, OnlineSettings, Outlook, Regression, SensorRange, StateReport, Target,
};
pub use model::{
    Control, Dynamics, Export, IdentificationRecord, Input, InputKind, Language, Model, Parameter, Port, Rows,
    SCHEMA as MODEL_SCHEMA, State, Steps, System, rate_unit, rate_unit_in, shows,
};
pub use paired::{Paired, PairedDiagnosis};
pub use progress::{Progress, Silent};
pub use score::{Errors, Score, Scoring, StateError, score};
pub use simulate::{Controller, Excitation, Method, Rollout, Simulate, StateReader, initial_state, unmeasure};
pub use smooth::{Noise, Smoothed, SmoothedRun, Smoother};
