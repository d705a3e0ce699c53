//! The settings of an identification.

use crate::differentiate::{Differentiation, SecondStage};
use crate::error::{Error, Result};
use crate::library::{Constraints, LibrarySettings};
use crate::refine::Hold;
use crate::regress::{Lasso, Regressor, Selection, Subset};
use crate::smooth::Smoother;
use std::sync::Arc;

/// What the regression compares.
#[derive(Debug, Clone)]
pub enum Target {
    /// Integrals of the terms with the states as logged: nothing is differentiated.
    Weak,
    /// The terms with derivatives at the samples.
    Derivative(Differentiation),
}

/// A control's delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delay {
    /// Known, s.
    Fixed(f64),
    /// Estimated, between 0 and this many seconds; `None`: as far as sampling and length of the runs allow.
    Auto(Option<f64>),
}

/// How the tuning value of the regression is chosen.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// By the regression's own rows: cross-validation, BIC, or a number.
    Rows(Selection),
    /// By the error of rollouts over the windows of the refinement.
    Rollout,
}

/// The values that the sensor of a state can show.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorRange {
    /// The state.
    pub state: String,
    /// Lowest and highest value; infinite where there is no end.
    pub range: (f64, f64),
}

impl SensorRange {
    /// Reads `STATE=LOW:HIGH`, either of which may be absent.
    ///
    /// # Errors
    /// Text of another form, no end, or a lowest value that is not below the highest.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = || Error::settings(format!("`{text}`: expected STATE=LOW:HIGH, STATE=:HIGH or STATE=LOW:"));
        let end = |text: &str, without: f64| match text.trim() {
            "" => Ok(without),
            text => text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(wrong),
        };
        let (state, ends) = text.split_once('=').ok_or_else(wrong)?;
        let (low, high) = ends.split_once(':').ok_or_else(wrong)?;
        let range = (end(low, f64::NEG_INFINITY)?, end(high, f64::INFINITY)?);
        let is_range = range.0 < range.1 && (range.0.is_finite() || range.1.is_finite());
        if !is_range || state.trim().is_empty() {
            return Err(wrong());
        }
        Ok(Self { state: state.trim().into(), range })
    }
}

/// Settings of an identification.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `states`, `controls` | | columns of the log |
/// | `derivatives` | none | (state, column) pairs: the log carries these derivatives |
/// | `library` | degree 3 | candidate terms |
/// | `grow` | true | whether more terms are tried where these leave more than the noise |
/// | `constraints` | none | equations given, terms forbidden, signs |
/// | `ranges` | none | the values that sensors can show |
/// | `smoother` | Gaussian process | `None` takes the samples as they are |
/// | `target` | weak form | what the regression compares |
/// | `regressor` | best subset | any [`Regressor`] |
/// | `choice` | cross-validation, one standard error | |
/// | `delays` | none | (control, delay) pairs |
/// | `standardize` | false | columns and target at unit size before the regression |
/// | `train_fraction` | 1 | first part of each run that is learnt from, above 0 |
/// | `ensemble` | 0 | above 0: inclusion probabilities, by the evidence with `refine`, by so many bootstraps without |
/// | `refine` | true | the refinement through the integrator: coefficients and terms on the raw samples |
/// | `window` | `None` | length of the rollouts of the refinement, s; `None`: as long as they stay on course |
/// | `consensus` | true | where long rollouts leave the logs of a controlled motion: a vote of several sets of equations |
/// | `hold` | `None` | what controls do between samples; `None`: held, unless interpolated is the better explanation |
/// | `seed` | 0 | of the bootstraps |
#[derive(Debug, Clone)]
pub struct Identify {
    /// Columns that are states.
    pub states: Vec<String>,
    /// Columns that are controls.
    pub controls: Vec<String>,
    /// State and the column that carries its derivative.
    pub derivatives: Vec<(String, String)>,
    /// Candidate terms.
    pub library: LibrarySettings,
    /// Whether a larger library is tried where these terms leave more than the noise: sines and cosines of every variable and their
    /// products, `sign(v)` and `v*abs(v)` of one that changes its sign, the logarithm, the root and the reciprocal of one that stays positive;
    /// rates that saturate, `x/(h + x)` and `x^2/(h^2 + x^2)`, with h a free number.
    /// Its equations are taken where the evidence leaves no doubt. Without effect where `refine` is off.
    pub grow: bool,
    /// What is known beforehand.
    pub constraints: Constraints,
    /// Sensors that show a part of their state's values only: a value at an end says that the state is there or beyond.
    pub ranges: Vec<SensorRange>,
    /// The smoother, or none.
    pub smoother: Option<Smoother>,
    /// What the regression compares.
    pub target: Target,
    /// The sparse regression.
    pub regressor: Arc<dyn Regressor>,
    /// How its tuning value is chosen.
    pub choice: Choice,
    /// Control and its delay.
    pub delays: Vec<(String, Delay)>,
    /// Whether columns and target are brought to unit size before the regression.
    pub standardize: bool,
    /// First part of each run that is learnt from.
    pub train_fraction: f64,
    /// Above 0: inclusion probabilities. With `refine` they are those of the evidence for the terms of the final equations;
    /// without it the share of so many block bootstraps of the regression.
    pub ensemble: usize,
    /// Whether the refinement through the integrator runs.
    pub refine: bool,
    /// Length of its rollouts, s; `None`: they grow from short ones for as long as they stay on course.
    pub window: Option<f64>,
    /// Whether, where the equations are only an approximation of a controlled motion, rollouts of four more lengths look for
    /// equations, and those are taken that stay nearest to the logs in long rollouts and agree best with the others. It takes
    /// about four times as long; without effect where `window` is given.
    pub consensus: bool,
    /// What controls do between samples; `None`: what explains the logs better.
    pub hold: Option<Hold>,
    /// Seed of the bootstraps.
    pub seed: u64,
}

impl Default for Identify {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            controls: Vec::new(),
            derivatives: Vec::new(),
            library: LibrarySettings::default(),
            grow: true,
            constraints: Constraints::default(),
            ranges: Vec::new(),
            smoother: Some(Smoother::default()),
            target: Target::Weak,
            regressor: Arc::new(Subset::default()),
            choice: Choice::Rows(Selection::default()),
            delays: Vec::new(),
            standardize: false,
            train_fraction: 1.0,
            ensemble: 0,
            refine: true,
            window: None,
            consensus: true,
            hold: None,
            seed: 0,
        }
    }
}

impl Identify {
    /// Algorithm 1 as the paper states it, done right: kernels by evidence, derivatives by a second Gaussian process from the
    /// smoothed states, LASSO to its optimum on scaled columns, refitted, lambda by blocked cross-validation; no refinement.
    pub fn paper() -> Self {
        Self {
            target: Target::Derivative(Differentiation::GpState(SecondStage::default())),
            regressor: Arc::new(Lasso::default()),
            choice: Choice::Rows(Selection::CrossValidation { one_standard_error: false }),
            refine: false,
            ..Self::default()
        }
    }
}
