//! Logs to equations: Algorithm 1 of the paper, and what is better than it, as one body.
//!
//! Smooth the states, make rows of regression, choose terms by sparse regression, then look again through the integrator:
//! coefficients, delays and initial states on the raw measurements, terms dropped, added and exchanged by evidence.

mod algorithm1;
mod author;
mod online;
mod prepare;
mod support;
mod velocities;

pub use author::{Author, AuthorResult};
pub use online::{Estimate, Online, OnlineSettings};

use crate::data::Dataset;
use crate::differentiate::{Differentiation, SecondStage};
use crate::error::Result;
use crate::library::{Constraints, LibrarySettings};
use crate::model::{IdentificationRecord, Model};
use crate::parallel::*;
use crate::progress::{Progress, step};
use crate::refine::Hold;
use crate::regress::{Ensemble, Lasso, Regressor, Selection, Subset};
use crate::smooth::Smoother;
use algorithm1::regress::{Chosen, Task};
use algorithm1::rows::Rows;
use prepare::Plan;
use std::sync::Arc;
use support::equations::Equations;
use support::lengthen::{Refinement, SecondLook, starts};

/// What the regression compares.
#[derive(Debug, Clone)]
#[non_exhaustive]
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
    /// Estimated, between 0 and this many seconds.
    Auto(f64),
}

/// How the tuning value of the regression is chosen.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// By the regression's own rows: cross-validation, BIC, or a number.
    Rows(Selection),
    /// By the error of rollouts over the windows of the refinement.
    Rollout,
}

/// Settings of an identification.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `states`, `controls` | | columns of the log |
/// | `derivatives` | none | (state, column) pairs: the log carries these derivatives |
/// | `library` | degree 3 | candidate terms |
/// | `constraints` | none | equations given, terms forbidden, signs |
/// | `smoother` | Gaussian process | `None` takes the samples as they are |
/// | `target` | weak form | what the regression compares |
/// | `regressor` | best subset | any [`Regressor`] |
/// | `choice` | cross-validation, one standard error | |
/// | `delays` | none | (control, delay) pairs |
/// | `standardize` | false | columns and target at unit size before the regression |
/// | `train_fraction` | 1 | first part of each run that is learnt from, above 0 |
/// | `ensemble` | 0 | above 0: inclusion probabilities, by the evidence with `refine`, by so many bootstraps without |
/// | `refine` | true | the second look, through the integrator |
/// | `window` | `None` | length of the rollouts of the refinement, s; `None`: as long as they stay on course |
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
    /// What is known beforehand.
    pub constraints: Constraints,
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
    /// Length of its rollouts, s.
    pub window: Option<f64>,
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
            constraints: Constraints::default(),
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
            hold: None,
            seed: 0,
        }
    }
}

/// A learnt model and how it came about.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The model, with its [`IdentificationRecord`].
    pub model: Model,
    /// One entry a state.
    pub states: Vec<StateReport>,
    /// Control, delay (s) and its standard error (0 where it was given), for every control with a delay.
    pub delays: Vec<(String, f64, f64)>,
    /// Length of the rollouts that the refinement ended with, s; NaN without refinement.
    pub window: f64,
    /// What the controls were taken to do between samples: simulate the model with the same.
    pub hold: Hold,
    /// What a reader of the result should know.
    pub notes: Vec<String>,
}

/// How the equation of one state was learnt.
#[derive(Debug, Clone)]
pub struct StateReport {
    /// The state.
    pub state: String,
    /// Names of the terms in its equation.
    pub terms: Vec<String>,
    /// Tuning value of the sparse regression; NaN where the equation was given.
    pub level: f64,
    /// Held-out mean squared error of the regression in units of the noise, or the criterion's value.
    pub score: f64,
    /// Mean squared residual of the regression in units of the noise; near 1 where the equation holds.
    pub residual: f64,
    /// Noise of the column, in its unit: what the equations leave, or what the smoother found without refinement.
    pub noise: f64,
    /// The smoother's kernel and whatever makes it weak; empty without smoother.
    pub kernel: String,
}

impl Identify {
    /// Algorithm 1 as the paper states it, done right: kernels by evidence, derivatives by a second Gaussian process from the
    /// smoothed states, LASSO to its optimum on scaled columns, refitted, lambda by blocked cross-validation; no second look.
    pub fn paper() -> Self {
        Self {
            target: Target::Derivative(Differentiation::GpState(SecondStage::default())),
            regressor: Arc::new(Lasso::default()),
            choice: Choice::Rows(Selection::CrossValidation { one_standard_error: false }),
            refine: false,
            ..Self::default()
        }
    }

    /// Learns the equations of `data`.
    ///
    /// A state that the data lack is allowed where an equation that is given, `x' = v`, says whose velocity it is.
    ///
    /// # Errors
    /// Unknown columns, settings out of range, too few samples; a request to stop.
    pub fn fit(&self, data: &Dataset, progress: &dyn Progress) -> Result<Identification> {
        let (data, unlogged) = self.with_velocities(data, progress)?;
        let mut plan = Plan::new(self, &data, progress)?;
        let mut equations = plan.equations(self)?;
        let timings = plan.find_timings(self, &mut equations, progress)?;
        let rows = plan.rows(self, &equations)?;
        let chosen = self.choose(&plan, &equations, &rows, progress)?;
        for (s, chosen) in chosen.iter().enumerate() {
            if let Some(chosen) = chosen {
                equations.coefficients[s].clone_from(&chosen.coefficients);
            }
        }
        let mut notes = [plan.notes.clone(), unlogged].concat();
        let look = SecondLook { window: self.window, plan: &plan, timings: &timings, progress };
        let refined = if self.refine { look.refine(&starts(&equations, &chosen), &mut notes)? } else { None };
        let hold = refined.as_ref().map_or(timings[0].hold, |refined| refined.hold);
        if self.hold.is_none() && hold == Hold::Linear {
            notes
                .push("the controls look interpolated between samples, not held; simulate with `--hold linear`".into());
        }
        let inclusion = match &refined {
            Some(refined) if self.ensemble > 0 => refined.trial.inclusion.clone(),
            _ => self.inclusion(&plan, &equations, &rows, &chosen)?,
        };
        Ok(self.report(&plan, &equations, &chosen, (refined, hold), inclusion, notes))
    }

    /// The sparse regression of every state whose equation is not given.
    fn choose(
        &self,
        plan: &Plan,
        equations: &Equations,
        rows: &[Option<Rows>],
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Chosen>>> {
        let selection = match &self.choice {
            Choice::Rows(selection) => selection.clone(),
            Choice::Rollout => Selection::default(),
        };
        step(progress, "choose terms", 0, 1)?;
        let one = |(s, rows): (usize, &Option<Rows>)| {
            rows.as_ref().map(|rows| self.task(equations, s, &selection).choose(rows)).transpose()
        };
        let mut chosen = rows.par_iter().enumerate().map(one).collect::<Result<Vec<_>>>()?;
        if self.choice == Choice::Rollout {
            self.choose_by_rollout(plan, equations, &mut chosen)?;
        }
        Ok(chosen)
    }

    fn task<'a>(&'a self, equations: &'a Equations, s: usize, selection: &'a Selection) -> Task<'a> {
        Task {
            allowed: &equations.allowed[s],
            kept: &equations.kept[s],
            signs: &equations.signs[s],
            regressor: self.regressor.as_ref(),
            selection,
            standardize: self.standardize,
        }
    }

    /// State by state, the candidate of the path with which rollouts come closest to the logs.
    fn choose_by_rollout(&self, plan: &Plan, equations: &Equations, chosen: &mut [Option<Chosen>]) -> Result<()> {
        let mut trial = equations.clone();
        for (s, chosen) in chosen.iter().enumerate() {
            if let Some(chosen) = chosen {
                trial.coefficients[s].clone_from(&chosen.coefficients);
            }
        }
        let window = self.window.unwrap_or_else(|| plan.shortest_window());
        for (s, chosen) in chosen.iter_mut().enumerate() {
            let Some(chosen) = chosen else { continue };
            let mut best = (f64::INFINITY, chosen.coefficients.clone());
            for candidate in &chosen.path {
                trial.coefficients[s].clone_from(candidate);
                let error = plan.search(plan.hold()).rollout_error(&trial, window)?;
                if error < best.0 {
                    best = (error, candidate.clone());
                }
            }
            trial.coefficients[s].clone_from(&best.1);
            (chosen.score, chosen.coefficients) = best;
        }
        Ok(())
    }

    /// Inclusion probabilities by block bootstraps of the regression, one row a state.
    fn inclusion(
        &self,
        plan: &Plan,
        equations: &Equations,
        rows: &[Option<Rows>],
        chosen: &[Option<Chosen>],
    ) -> Result<Vec<Vec<f64>>> {
        if self.ensemble == 0 {
            return Ok(Vec::new());
        }
        let ensemble = Ensemble { replicates: self.ensemble, seed: self.seed, ..Ensemble::default() };
        let selection = Selection::default();
        let one = |s: usize| match (&rows[s], &chosen[s]) {
            (Some(rows), Some(chosen)) => self.task(equations, s, &selection).stability(rows, chosen.level, &ensemble),
            _ => Ok(vec![0.0; equations.n_terms()]),
        };
        (0..plan.n_states()).map(one).collect()
    }

    fn report(
        &self,
        plan: &Plan,
        equations: &Equations,
        chosen: &[Option<Chosen>],
        (refined, hold): (Option<Refinement>, Hold),
        inclusion: Vec<Vec<f64>>,
        notes: Vec<String>,
    ) -> Identification {
        let n = plan.n_states();
        let (equations, errors, noise, delay_errors, window) = match refined {
            Some(Refinement { trial, window, .. }) => {
                (trial.equations, trial.errors, trial.noise, trial.delay_errors, window)
            }
            None => {
                let errors =
                    chosen.iter().map(|c| c.as_ref().map_or(vec![0.0; equations.n_terms()], |c| c.errors.clone()));
                (equations.clone(), errors.collect(), plan.noise.clone(), Vec::new(), f64::NAN)
            }
        };
        let names = equations.library.names();
        let support = equations.support();
        let of = |s: usize, pick: fn(&Chosen) -> f64| chosen[s].as_ref().map_or(f64::NAN, pick);
        let states = (0..n).map(|s| StateReport {
            state: equations.states[s].0.clone(),
            terms: support[s].iter().map(|&j| names[j].to_string()).collect(),
            level: of(s, |c| c.level),
            score: of(s, |c| c.score),
            residual: of(s, |c| c.residual),
            noise: noise[s],
            kernel: plan.kernels[s].clone(),
        });
        let states: Vec<StateReport> = states.collect();
        let mut free = delay_errors.into_iter();
        let with_delay = equations.delays.iter().enumerate().filter(|(_, d)| d.free || d.value != 0.0);
        let delays = with_delay
            .map(|(k, d)| {
                let error = if d.free { free.next().unwrap_or(0.0) } else { 0.0 };
                (equations.controls[k].0.clone(), d.value, error)
            })
            .collect();
        let mut model = equations.model(&support, false);
        model.identification = Some(IdentificationRecord {
            terms: names.iter().map(ToString::to_string).collect(),
            coefficients: equations.coefficients.clone(),
            standard_errors: errors,
            inclusion_probabilities: inclusion,
            lambda: states.iter().map(|s| if s.level.is_finite() { s.level } else { 0.0 }).collect(),
        });
        Identification { model, states, delays, window, hold, notes }
    }
}

#[cfg(test)]
mod tests;
