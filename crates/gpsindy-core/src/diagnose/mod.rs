//! The diagnosis of the gap between a simulator and the logs of the machine.
//!
//! It reports where the gap lies, which unmodelled effect causes it, and how far a correction closes it on held-out logs;
//! or that there is no gap, or that no effect explains it. Effects are compared in output space: each is written into the
//! model and fitted by rollouts to the raw measurements, with initial states and uncertain parameters free.

mod by_part;
mod catalogue;
pub mod conformal;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod contract;
mod design;
mod exclusions;
mod fit;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod fixture;
mod handed;
mod limits;
mod notes;
mod parts;
mod power;
pub mod report;
mod run;
mod steps;

pub use catalogue::custom::{CustomEffect, CustomParameter};
pub use catalogue::example::{Drive, Example};
pub use catalogue::list::Effect;
pub use catalogue::place::Family;
pub use design::open::{Candidate, Open};
pub use design::settings::{Design, Designed, Separation};
pub use handed::{Handed, Member};
pub use notes::Note;
pub use parts::{Part, PartKind};
pub use power::settings::Power;
pub use report::{Diagnosis, Verdict};

use crate::data::Dataset;
use crate::diagnose::conformal::Conditions;
use crate::diagnose::limits::{CONFIDENCE, CONFIDENCES, MOST_MATERIAL, SEARCHED, TRAINED};
use crate::error::{Error, Result};
use crate::model::unit::{has_seconds, in_time_unit};
use crate::model::{Dynamics, Model, System};
use crate::progress::Progress;
use crate::refine::Hold;
use design::open::left_open;
use power::study::{Found, Study};
use run::Run;
use std::sync::Arc;
use steps::attribution::attribute::attribute;
use steps::attribution::contest::Contest;
use steps::attribution::detect::{detect, detect_behind};
use steps::attribution::forcing::forced;
use steps::attribution::hold::{begun, reconsider_hold};
use steps::attribution::nameless;
use steps::attribution::suspects::{Choice, suspects};
use steps::findings::Judged;
use steps::logs::prepare::{Known, Prepared, prepare};
use steps::verdict::augment::{augment, without};
use steps::verdict::{localise, typicality, verify, weigh};

/// Settings of a diagnosis.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `effects` | none | ids | only these effects are suspects; empty: all |
/// | `without` | none | ids | these effects are no suspects |
/// | `custom` | none | | effects of the user's own |
/// | `parts` | none | | joints and actuators, by which the report sums up |
/// | `only` | none | | only effects in these parts are suspects; empty: all |
/// | `allow_place` | false | | an effect may depend on where the machine is although no rate of the model does |
/// | `all_suspects` | false | | effects are suspects also where they make no sense by units or place |
/// | `confidence` | 0.95 | 0.5 to 0.999 | of intervals; no verdict, probability or cause depends on it |
/// | `most_effects` | 6 | 1 to 6 | effects together, at most; never more than four in one equation |
/// | `hold` | estimated | | what the control does between samples |
/// | `model_error` | none | at least 0 | what the model itself misses of the simulator, in the column's unit |
/// | `material` | 0 | 0 to 0.5 | share of each column's motion below which a gap is none |
/// | `keep_function` | false | | add what is left to the corrected model, as a function without a name |
/// | `time_limit` | none | above 0 | seconds after which the search ends with the best that it has |
/// | `power` | none | | also study which effects these logs could reveal |
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnose {
    /// Ids of the effects that are suspects; empty: the whole catalogue.
    pub effects: Vec<String>,
    /// Ids of effects that are no suspects.
    pub without: Vec<String>,
    /// Effects of the user's own.
    pub custom: Vec<CustomEffect>,
    /// Joints and actuators of the machine, by which the report sums up.
    pub parts: Vec<Part>,
    /// The parts whose effects are suspects; empty: everything. Random forces and effects outside of all parts are then none.
    pub only: Vec<Part>,
    /// Whether an effect may depend on where the machine is, or which way it faces, although no rate of the model does.
    pub allow_place: bool,
    /// Whether effects are suspects also where they make no sense: by units, by what the logs show, by place.
    pub all_suspects: bool,
    /// Confidence of intervals. A gap is detected at a level of its own: 5 % of gap-free logs, at most, show one.
    pub confidence: f64,
    /// Largest number of effects together; never more than four of them in one equation.
    pub most_effects: usize,
    /// What controls do between samples; estimated where absent.
    pub hold: Option<Hold>,
    /// State and root mean square by which the model misses the simulator that it stands for, in the column's unit: a gap of
    /// that size is none. For a model that was identified from the simulator's logs.
    pub model_error: Vec<(String, f64)>,
    /// Share of the motion, root mean square of each column around its mean, below which a gap is none: what the user would not mend.
    pub material: f64,
    /// Whether what is left is added to the corrected model as a function without a name.
    pub keep_function: bool,
    /// Seconds after which the search ends with the best that it has; its verdict is then no `explained`. What follows it
    /// (held-out rollouts, the report) takes a little longer. A simulator that steps has nine tenths of it for the search, and only the most
    /// exciting windows of logs that it can't pass through in time. Kept where the listener has a clock, [`Progress::seconds`].
    pub time_limit: Option<f64>,
    /// Whether and how to study which effects these logs could reveal.
    pub power: Option<Power>,
}

impl Default for Diagnose {
    fn default() -> Self {
        Self {
            effects: Vec::new(),
            without: Vec::new(),
            custom: Vec::new(),
            parts: Vec::new(),
            only: Vec::new(),
            allow_place: false,
            all_suspects: false,
            confidence: CONFIDENCE,
            most_effects: 6,
            hold: None,
            model_error: Vec::new(),
            material: 0.0,
            keep_function: false,
            time_limit: None,
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
    /// What the report's notes say, as data.
    pub notes: Vec<Note>,
    /// What the logs can't distinguish, for the next experiment.
    pub open: Open,
    /// For every included cause, as [`Diagnosis::included`] has them, the corrected simulator without it.
    pub without: Vec<Model>,
    /// Seconds of every stage of the report's `work`, by the listener's clock; zeros where nobody keeps the time.
    pub seconds: Vec<f64>,
    /// The sets of effects that were fitted, round by round.
    pub handed: Vec<Handed>,
}

impl Diagnosed {
    /// Names rates per `time_unit` where the logs count time in it: `kpelts/year` in place of `kpelts/s`.
    ///
    /// Without effect where a unit of the nominal model speaks of seconds: that is the user's own word.
    pub fn count_time_in(&mut self, nominal: &Model, time_unit: &str) {
        if nominal.units().any(has_seconds) {
            return;
        }
        self.diagnosis.count_time_in(time_unit);
        for parameter in &mut self.augmented.parameters {
            parameter.unit = in_time_unit(&parameter.unit, time_unit);
        }
    }
}

/// The corrected simulator without each of the included causes, in the report's order.
fn ablated(contest: &Contest<'_>, judged: &Judged, diagnosis: &Diagnosis) -> Result<Vec<Model>> {
    let best = &judged.outcome.best;
    let place = |cause: &report::Cause| {
        let is_it = |h: &catalogue::hypothesis::Hypothesis| {
            let names = (h.id(), h.stated(), h.place(), h.form());
            names == (&cause.effect, &cause.variables[..], cause.place.clone(), cause.form.clone())
        };
        let on_row = |h: &catalogue::hypothesis::Hypothesis| best.system.model().states[h.moves()].name == cause.state;
        best.hypotheses.iter().position(|h| is_it(h) && on_row(h))
    };
    let places = diagnosis.included().filter_map(place);
    places.map(|place| without(best, &judged.nominal, place, &contest.scene)).collect()
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
    let split = first + TRAINED * (last - first);
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

    /// The diagnosis, and the study of its power where one is wanted.
    fn run_system(
        &self,
        system: &System,
        train: &Dataset,
        holdout: &Dataset,
        progress: &dyn Progress,
    ) -> Result<Diagnosed> {
        self.check()?;
        for run in train.runs().iter().chain(holdout.runs()) {
            system.check_stamps(&run.name, &run.time)?;
        }
        let (mut diagnosed, found) = self.body(system, [train, holdout], progress)?;
        if let Some(power) = &self.power {
            // The copies are judged as the logs were, but each in its own time.
            let settings = Self { power: None, time_limit: None, ..self.clone() };
            let diagnose = |train: &Dataset, holdout: &Dataset, progress: &dyn Progress| {
                Ok(settings.body(system, [train, holdout], progress)?.0.diagnosis)
            };
            let study = Study { diagnose: &diagnose, power, found: &found, progress };
            diagnosed.diagnosis.power = Some(study.run()?);
        }
        Ok(diagnosed)
    }

    /// The steps of a diagnosis, in their order.
    ///
    /// Random forces are asked for before the hold of the controls, which they would decide by chance, and again where another hold
    /// gives another account. Held-out logs are looked at when all is decided.
    fn body(&self, system: &System, logs: [&Dataset; 2], progress: &dyn Progress) -> Result<(Diagnosed, Found)> {
        let share = if system.engine().is_some() { SEARCHED } else { 1.0 };
        let run = Run::with_share(progress, self.time_limit, share);
        let mut prepared = prepare(&run, system, logs, &self.known())?;
        let (suspects, of_suspects) = suspects(&prepared.nominal, &self.choice())?;
        prepared.notes.extend(of_suspects);
        let mut contest = Contest::new(&run, prepared.fitter, suspects, self.most_effects);
        let suspected = detect(&contest, prepared.nominal.clone())?;
        let suspected = detect_behind(&mut contest, suspected)?;
        let suspected = begun(&contest, &prepared, suspected)?;
        let judged = attribute(&mut contest, suspected)?;
        let judged = forced(&contest, judged)?;
        let judged = reconsider_hold(&mut contest, &prepared, judged)?;
        let judged = forced(&contest, judged)?.with_structure();
        let judged = if self.keep_function { nameless::kept(&contest, judged) } else { judged };
        let (mut diagnosed, found) = self.reported(contest, prepared, judged)?;
        conformal::state(&mut diagnosed.diagnosis, &self.conditions(system, logs[0]));
        Ok((diagnosed, found))
    }

    /// What the coverage of a set of causes depends on besides the report.
    fn conditions(&self, system: &System, train: &Dataset) -> Conditions {
        let lists = [&self.effects, &self.without];
        let has_chosen = lists.iter().any(|ids| !ids.is_empty()) || !self.custom.is_empty() || !self.only.is_empty();
        let has_error = !self.model_error.is_empty() || self.material > 0.0;
        let has_more = self.allow_place || self.all_suspects || has_error;
        Conditions {
            has_usual_suspects: !has_chosen && !has_more && self.most_effects == Self::default().most_effects,
            steps: system.engine().is_some(),
            states: system.model().states.len(),
            samples: train.runs().iter().map(|run| run.n_samples()).sum(),
        }
    }

    /// The report on what was found: verified on held-out logs, located, written into the model and weighed.
    fn reported(&self, contest: Contest<'_>, prepared: Prepared, mut judged: Judged) -> Result<(Diagnosed, Found)> {
        contest.run.begin("held-out logs and report");
        judged.outcome.best = judged.outcome.best.out_of_reach();
        let verified = verify::closure(&judged, &prepared.holdout, self.confidence)?;
        let gap = localise::gap(&contest, &judged, &verified.resting);
        let augmented = augment(&judged.outcome.best);
        let states = &judged.nominal.system.model().states;
        let resting: Vec<String> = verified.resting.iter().map(|&j| states[j].name.clone()).collect();
        let logs = (&prepared.train, &prepared.holdout);
        // What is random leaves a rest that the noise does not.
        let has_causes = judged.detected.gap && !judged.outcome.best.hypotheses.is_empty() && judged.forcing.is_none();
        let typicality = has_causes.then(|| typicality::of(&contest, &judged.outcome.best)).transpose()?.flatten();
        let interpolated = prepared.is_other_hold(&judged).then_some(Note::Interpolated);
        let small =
            verified.is_quiet().then(|| weigh::of_an_integrator(&judged.nominal, &judged.outcome.best)).flatten();
        let mut notes = [&prepared.notes[..], &judged.notes].concat();
        notes.extend(interpolated.into_iter().chain(verified.notes.iter().cloned()).chain(contest.run.note_of_end()));
        let found = weigh::Found { judged: &judged, typicality, verification: verified, located: gap };
        let (mut diagnosis, augmented, of_outcome) = weigh::report(self.confidence, &contest, found, logs, augmented);
        // What nothing explains, no held-out rollout shows and any integrator leaves is none of the machine's.
        let is_open = matches!(diagnosis.verdict, Verdict::PartlyExplained | Verdict::Unexplained);
        if let Some(share) = small.filter(|_| is_open && diagnosis.interrupted.is_none()) {
            return self.reported(contest, prepared, judged.without_gap(Note::OfAnIntegrator { share }));
        }
        let resting: Vec<&str> = resting.iter().map(String::as_str).collect();
        diagnosis.excluded = exclusions::telling(diagnosis.excluded, &resting);
        let model = judged.nominal.system.model();
        let columns = judged.nominal.experiment.columns.iter().map(|&j| model.states[j].name.clone());
        let measured: Vec<String> = columns.collect();
        diagnosis.by_part = by_part::by_part(&self.parts, &self.only, model, &measured, &diagnosis);
        let open = left_open(&judged);
        let without = ablated(&contest, &judged, &diagnosis)?;
        let (work, seconds) = contest.run.work();
        diagnosis.work = work;
        notes.extend(of_outcome);
        diagnosis.notes = notes.iter().map(ToString::to_string).collect();
        let handed = contest.run.handed.take();
        let diagnosed = Diagnosed { diagnosis, augmented, notes, open, without, seconds, handed };
        let Contest { hypotheses, scene, .. } = contest;
        let Judged { nominal, outcome, .. } = judged;
        let Prepared { train, holdout, .. } = prepared;
        Ok((diagnosed, Found { nominal, best: outcome.best, hypotheses, scene, train, holdout }))
    }

    fn known(&self) -> Known<'_> {
        Known { hold: self.hold, model_error: &self.model_error, material: self.material }
    }

    fn choice(&self) -> Choice<'_> {
        Choice {
            chosen: &self.effects,
            without: &self.without,
            custom: &self.custom,
            parts: &self.parts,
            only: &self.only,
            places: self.allow_place,
            senseless: self.all_suspects,
        }
    }

    fn check(&self) -> Result<()> {
        if !(CONFIDENCES.0..=CONFIDENCES.1).contains(&self.confidence) {
            return Err(Error::range("confidence", "between 0.5 and 0.999", self.confidence));
        }
        if !(1..=6).contains(&self.most_effects) {
            return Err(Error::range("most_effects", "between 1 and 6", self.most_effects));
        }
        if !(0.0..=MOST_MATERIAL).contains(&self.material) {
            return Err(Error::range("material", "between 0 and 0.5", self.material));
        }
        if let Some(seconds) = self.time_limit.filter(|s| !(*s > 0.0)) {
            return Err(Error::range("time_limit", "above 0 s", seconds));
        }
        if let Some(power) = &self.power {
            power.check()?;
        }
        if let Some(custom) = self.custom.iter().find(|custom| CustomEffect::is_reserved(&custom.id)) {
            return Err(Error::settings(format!(
                "the id `{}` of an effect of your own has a meaning already; give it another id",
                custom.id
            )));
        }
        let known = || Effect::ALL.iter().map(|e| e.id()).chain(self.custom.iter().map(|c| c.id.as_str()));
        for id in self.effects.iter().chain(&self.without) {
            if !known().any(|k| k == id) {
                return Err(Error::unknown("effect", id, known()));
            }
        }
        Ok(())
    }
}
