//! The diagnosis of the gap between a simulator and the logs of the machine.
//!
//! Where the gap lies, which unmodelled effect causes it, how far it shrinks on held-out logs; and when
//! to say "no gap" or "none of these". Effects are judged in output space: each is written into the model
//! and fitted by rollouts to the raw measurements, with initial states and tolerated parameters free.

mod catalogue;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod contract;
mod fit;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod fixture;
mod power;
pub mod report;
mod steps;

pub use catalogue::definition::Family;
pub use catalogue::effect::{CustomEffect, CustomParameter, Effect};
pub use power::study::Power;
pub use report::{Diagnosis, Verdict};

use crate::data::Dataset;
use crate::error::{Error, Result};
use crate::model::{Dynamics, Model, System};
use crate::progress::Progress;
use crate::refine::{Experiment, Hold, Refine};
use catalogue::excited::Scene;
use catalogue::{hypothesis, joint, rival};
use fit::fitted::Fitted;
use fit::tolerance;
use power::study;
use std::sync::Arc;
use steps::contest::Contest;
use steps::{attribute, check, hold, localise, prepare, verify, weigh};

/// Settings of a diagnosis.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `effects` | none | ids | only these effects are suspects; empty: all |
/// | `without` | none | ids | these effects are no suspects |
/// | `custom` | none | | effects of the user's own |
/// | `confidence` | 0.95 | 0.5 to 0.999 | of intervals, and of the detection |
/// | `most_effects` | 6 | 1 to 6 | effects together, at most; never more than four in one equation |
/// | `hold` | estimated | | what the control does between samples |
/// | `model_error` | none | at least 0 | what the model itself misses of the simulator, in the column's unit |
/// | `power` | none | | also study which effects these logs could reveal |
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnose {
    /// Ids of the effects that are suspects; empty: the whole catalogue.
    pub effects: Vec<String>,
    /// Ids of effects that are no suspects.
    pub without: Vec<String>,
    /// Effects of the user's own.
    pub custom: Vec<CustomEffect>,
    /// Confidence of intervals; a gap is detected when its p-value is at most one minus this.
    pub confidence: f64,
    /// Largest number of effects together; never more than four of them in one equation.
    pub most_effects: usize,
    /// What controls do between samples; estimated where absent.
    pub hold: Option<Hold>,
    /// State and root mean square by which the model misses the simulator that it stands for, in the column's unit: a gap of
    /// that size is none. For a model that was identified from the simulator's logs.
    pub model_error: Vec<(String, f64)>,
    /// Whether and how to study which effects these logs could reveal.
    pub power: Option<Power>,
}

impl Default for Diagnose {
    fn default() -> Self {
        Self {
            effects: Vec::new(),
            without: Vec::new(),
            custom: Vec::new(),
            confidence: 0.95,
            most_effects: 6,
            hold: None,
            model_error: Vec::new(),
            power: None,
        }
    }
}

/// A diagnosis and the corrected simulator.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosed {
    /// The report.
    pub diagnosis: Diagnosis,
    /// The nominal model with the included causes added.
    pub augmented: Model,
}

/// Training and held-out logs of one diagnosis.
///
/// Without held-out logs the last quarter of the runs is held out; of a single run its last quarter in time.
///
/// # Errors
/// Too few samples to hold any out.
pub fn hold_out(data: &Dataset) -> Result<(Dataset, Dataset)> {
    let count = data.runs().len();
    if count > 1 {
        let train = count - (count / 4).max(1);
        let first: Vec<usize> = (0..train).collect();
        let last: Vec<usize> = (train..count).collect();
        return Ok((data.with_runs(&first)?, data.with_runs(&last)?));
    }
    let run = &data.runs()[0];
    if run.n_samples() < 16 {
        return Err(Error::TooFewSamples { what: format!("run `{}`", run.name), needed: 16, found: run.n_samples() });
    }
    let (first, last) = (run.time[0], run.time[run.n_samples() - 1]);
    let split = first + 0.75 * (last - first);
    Ok((data.filter_samples(|_, t| t <= split)?, data.filter_samples(|_, t| t > split)?))
}

impl Diagnose {
    /// Diagnoses the gap between `model` and the logs `train`, and verifies on the logs `holdout`.
    ///
    /// # Errors
    /// A model that does not fit its logs (unknown names, missing columns), too few samples, a nominal model
    /// that diverges whatever its initial state, or a request to stop.
    pub fn run(&self, model: &Model, train: &Dataset, holdout: &Dataset, progress: &dyn Progress) -> Result<Diagnosed> {
        self.run_system(&System::new(model)?, train, holdout, progress)
    }

    /// As [`Diagnose::run`] for a simulator of the user's own: names in `model`, rates from `simulator`.
    ///
    /// # Errors
    /// As [`Diagnose::run`], and the simulator's own errors.
    pub fn run_simulator(
        &self,
        model: &Model,
        simulator: Arc<dyn Dynamics>,
        train: &Dataset,
        holdout: &Dataset,
        progress: &dyn Progress,
    ) -> Result<Diagnosed> {
        self.run_system(&System::with_simulator(model, Some(simulator))?, train, holdout, progress)
    }

    fn run_system(
        &self,
        system: &System,
        train: &Dataset,
        holdout: &Dataset,
        progress: &dyn Progress,
    ) -> Result<Diagnosed> {
        self.check()?;
        let model = system.model();
        let mut notes = Vec::new();
        let (train, holdout) =
            (&prepare::unwrapped(model, train, &mut notes)?, &prepare::unwrapped(model, holdout, &mut Vec::new())?);

        check::values(model, train)?;
        check::values(model, holdout)?;
        if !check::moves(model, train) {
            return Err(Error::invalid(
                "no state moves in the logs: every value of a column is the same; record a motion, or check the sensors",
            ));
        }
        if !check::moves(model, holdout) {
            notes.push("no state moves in the held-out logs, so the closure tells little; hold out other ones".into());
        }

        // Prepare: noise, outliers, hold, windows, integration steps.
        let experiment = prepare::experiment(system, train, self.hold, &mut notes)?;
        let tolerated = tolerance::tolerated(model);
        let mut nominal = Fitted::nominal(system.clone(), experiment, tolerated, &Refine::default())?;
        check::nominal(&nominal)?;
        nominal.model_error = self.error_of(model, &nominal.experiment);
        let scene = Scene::new(system, &nominal.experiment, &nominal.refined.parameters, &nominal.refined.initial);

        // Detect and attribute: does any suspect, or any smooth function, explain more than noise would; and which?
        let logged = nominal.experiment.columns.clone();
        let hypotheses = self.suspects(hypothesis::enumerate(model, &scene, &logged, &self.custom)?)?;
        let settings = Refine { max_iterations: 15, tolerance: 1e-5 };
        let joint = [joint::frictions(model, &hypotheses), joint::exchanges(model, &hypotheses)].concat();
        let most = self.most_effects;
        let contest = Contest { hypotheses, joint, most, scene, settings, progress };
        let rivals = rival::enumerate(model, &contest.scene, model.states.len());
        let held = attribute::judge(&contest, nominal, &rivals, self, &mut notes)?;
        // Means over several samples are held exactly, but not interpolated: they would act half a step too early.
        let samples: usize = held.nominal.experiment.logs.iter().map(|l| l.time.len()).sum();
        let is_averaged = samples < train.runs().iter().map(|r| r.n_samples()).sum();
        let judged = match self.hold {
            Some(_) => held,
            None if is_averaged => held,
            None => hold::reconsider_hold(&contest, held, &rivals, self, &mut notes)?,
        };
        let attribute::Judged { nominal, detected, free_gains, outcome } = judged;

        // Verify on held-out logs, localise, and write it down.
        let nominal = outcome.nominal.as_ref().unwrap_or(&nominal);
        let closure = verify::closure(nominal, &outcome.best, holdout, self.confidence, &mut notes)?;
        let gap = localise::gap(&contest, nominal, &outcome, &rivals, &free_gains, &detected);
        let mut diagnosed =
            weigh::report(self, &contest, nominal, &outcome, &detected, gap, closure, (train, holdout), notes)?;
        if let Some(power) = &self.power {
            let (hypotheses, scene) = (&contest.hypotheses, &contest.scene);
            let study = study::Study { settings: self, power, hypotheses, scene, progress };
            diagnosed.diagnosis.power = Some(study.run(nominal, &outcome.best, train, holdout)?);
        }
        Ok(diagnosed)
    }

    /// Mean square of the model's own error over the logged columns, in units of their noise.
    fn error_of(&self, model: &Model, experiment: &Experiment) -> f64 {
        let of = |&state: &usize| self.model_error.iter().find(|(name, _)| *name == model.states[state].name);
        let errors = experiment.columns.iter().map(of).zip(&experiment.noise);
        let sum: f64 = errors.map(|(error, noise)| error.map_or(0.0, |(_, rms)| (rms / noise).powi(2))).sum();
        sum / experiment.columns.len() as f64
    }

    fn check(&self) -> Result<()> {
        if !(0.5..=0.999).contains(&self.confidence) {
            return Err(Error::range("confidence", "between 0.5 and 0.999", self.confidence));
        }
        if !(1..=6).contains(&self.most_effects) {
            return Err(Error::range("most_effects", "between 1 and 6", self.most_effects));
        }
        if let Some(power) = &self.power {
            power.check()?;
        }
        let known = || Effect::ALL.iter().map(|e| e.id()).chain(self.custom.iter().map(|c| c.id.as_str()));
        for id in self.effects.iter().chain(&self.without) {
            if !known().any(|k| k == id) {
                return Err(Error::unknown("effect", id, known()));
            }
        }
        Ok(())
    }

    fn suspects(&self, mut all: Vec<hypothesis::Hypothesis>) -> Result<Vec<hypothesis::Hypothesis>> {
        all.retain(|h| {
            let chosen = match self.effects.is_empty() {
                true => !h.is_only_if_asked(),
                false => self.effects.iter().any(|e| e == h.id()),
            };
            chosen && !self.without.iter().any(|e| e == h.id())
        });
        if all.is_empty() {
            return Err(Error::invalid("no effect of the chosen ones can act in this model; choose others"));
        }
        Ok(all)
    }
}
