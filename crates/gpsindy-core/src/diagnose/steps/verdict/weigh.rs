//! Weigh: probabilities, exclusions and the verdict, from the outcome of the contest to the report.

mod assemble;
mod decide;
mod left;
mod small;

use crate::data::Dataset;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::notes::Note;
use crate::diagnose::report::{Cause, Diagnosis};
use crate::diagnose::run::Ending;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Judged, StatedProcess};
use crate::diagnose::steps::verdict::causes::{Causes, random_force};
use crate::diagnose::steps::verdict::localise::Located;
use crate::diagnose::steps::verdict::typicality::Typicality;
use crate::diagnose::steps::verdict::verify::Verification;
use crate::model::Model;
use assemble::assemble;
use decide::Decided;
pub(crate) use small::of_an_integrator;

/// All that a report is made of.
pub(crate) struct Found<'a> {
    pub(crate) judged: &'a Judged,
    pub(crate) typicality: Option<Typicality>,
    pub(crate) verification: Verification,
    pub(crate) located: Located,
}

/// A report but for its notes, the corrected model, and what the outcome adds to the notes.
pub(crate) fn report(
    confidence: f64,
    contest: &Contest<'_>,
    found: Found<'_>,
    logs: (&Dataset, &Dataset),
    augmented: Model,
) -> (Diagnosis, Model, Vec<Note>) {
    let decided = Decided::of(contest, &found);
    let causes = stated(confidence, contest, &found, &decided);
    let notes = notes(contest, &found, &decided, &causes);
    let (diagnosis, augmented) = assemble(confidence, contest, found, (decided, causes), logs, augmented);
    (diagnosis, augmented, notes)
}

/// The causes as the report states them, random forces behind what is included.
fn stated(confidence: f64, contest: &Contest<'_>, found: &Found<'_>, decided: &Decided) -> Vec<Cause> {
    let Judged { nominal, detected, outcome, forcing, .. } = found.judged;
    let Decided { stabilities, credible, keep, .. } = decided;
    let stated = Causes { confidence, contest, nominal, outcome, stabilities, credible, keep: *keep };
    let mut causes = if detected.gap { stated.all() } else { Vec::new() };
    if let Some(forcing) = forcing {
        let first = causes.iter().position(|c| !c.included).unwrap_or(causes.len());
        // What is random leaves no room for single effects.
        if outcome.seats.is_empty() {
            causes.iter_mut().for_each(|cause| cause.probability *= 1.0 - forcing.probability());
        }
        // What is left is random only if the causes beside it are right.
        let probability = forcing.probability() * credible.iter().product::<f64>();
        let model = nominal.system.model();
        let forces = forcing.forces.iter().map(|force| random_force(confidence, model, probability, force));
        causes.splice(first..first, forces);
    }
    if detected.gap {
        left::list(&mut causes, contest, found, decided);
    }
    causes
}

/// What the notes say of the outcome.
fn notes(contest: &Contest<'_>, found: &Found<'_>, decided: &Decided, causes: &[Cause]) -> Vec<Note> {
    let Judged { nominal, detected, outcome, forcing, .. } = found.judged;
    let model = nominal.system.model();
    let random = forcing.iter().flat_map(|f| f.forces.iter().map(|stated| random(model, stated)));
    let coloured = forcing.iter().flat_map(|f| f.errors.iter().map(|stated| coloured(model, stated)));
    // A search that ended early does not know.
    let has_nothing = detected.gap && outcome.best.hypotheses.is_empty() && contest.run.ending() == Ending::Complete;
    let nothing = has_nothing.then_some(Note::NothingExplains);
    let unmeasured = (0..outcome.best.hypotheses.len()).filter_map(|place| unmeasured(&outcome.best, place));
    let kept = causes
        .iter()
        .filter_map(disagreement)
        .chain(unmeasured)
        .chain(astray(&found.verification))
        .filter(|_| decided.keep);
    // Without causes nothing is known of the gap's size.
    let has_causes = detected.gap && !outcome.best.hypotheses.is_empty();
    let small = of_an_integrator(nominal, &outcome.best).filter(|_| has_causes).map(|share| Note::Small { share });
    random.chain(coloured).chain(nothing).chain(small).chain(kept).collect()
}

/// What is to be said of a cause whose size differs between parts of the logs.
fn disagreement(cause: &Cause) -> Option<Note> {
    let stability = cause.stability.as_ref().filter(|s| !s.disagree.is_empty())?;
    let (effect, state) = (cause.effect.clone(), cause.state.clone());
    Some(Note::Disagreement { effect, state, parts: stability.disagree.clone() })
}

/// What is to be said of the effect at `place` where the logs do not measure what it is named for.
fn unmeasured(best: &Contestant, place: usize) -> Option<Note> {
    let parameters = best.unmeasured(place);
    let hypothesis = &best.hypotheses[place];
    let state = best.system.model().states[hypothesis.moves()].name.clone();
    (!parameters.is_empty()).then(|| Note::Unmeasured { effect: hypothesis.id().into(), state, parameters })
}

/// What is to be said of a random force.
fn random(model: &Model, process: &StatedProcess) -> Note {
    let state = &model.states[process.state];
    Note::RandomForce {
        state: state.name.clone(),
        deviation: process.deviation,
        unit: state.rate_unit(),
        time: process.time,
    }
}

/// What is to be said of a sensor whose errors have a memory.
fn coloured(model: &Model, process: &StatedProcess) -> Note {
    let state = &model.states[process.state];
    Note::ColouredNoise {
        column: state.name.clone(),
        deviation: process.deviation,
        unit: state.unit.clone(),
        time: process.time,
    }
}

/// What is to be said of columns that the corrected model does not follow.
fn astray(verification: &Verification) -> Option<Note> {
    let lost = verification.missed.iter().filter(|m| m.is_lost);
    let columns: Vec<String> = lost.map(|m| m.name.clone()).collect();
    (!columns.is_empty()).then_some(Note::NotFollowed { columns })
}
