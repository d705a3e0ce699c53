//! The report, put together from what was found, decided and stated.

use crate::data::Dataset;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::moved::deviation;
use crate::diagnose::limits::SHOWN;
use crate::diagnose::limits::weigh::QUIET_GAIN;
use crate::diagnose::report::{Cause, Diagnosis, Excluded, Figures, ModelParameter, Runs, SCHEMA, Verdict, finite};
use crate::diagnose::run::Ending;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::Outcome;
use crate::diagnose::steps::verdict::augment::equations;
use crate::diagnose::steps::verdict::curves;
use crate::diagnose::steps::verdict::weigh::Found;
use crate::diagnose::steps::verdict::weigh::decide::Decided;
use crate::model::Model;

/// The report, and the corrected model that goes with it: the nominal one where nothing is kept.
pub(crate) fn assemble(
    confidence: f64,
    contest: &Contest<'_>,
    found: Found<'_>,
    (decided, causes): (Decided, Vec<Cause>),
    (train, holdout): (&Dataset, &Dataset),
    augmented: Model,
) -> (Diagnosis, Model) {
    let Found { judged, verification, located, .. } = found;
    let Decided { unexplained, checks, verdict, keep, .. } = decided;
    let (nominal, outcome) = (judged.nominal.system.model(), &judged.outcome);
    let augmented = if keep { augmented } else { nominal.clone() };
    let verification = if keep { verification } else { verification.without_causes() };
    let names = |data: &Dataset| data.runs().iter().map(|r| r.name.clone()).collect();
    let diagnosis = Diagnosis {
        schema: SCHEMA.into(),
        model: nominal.name.clone(),
        runs: Runs { train: names(train), holdout: names(holdout) },
        verdict,
        confidence: Some(confidence),
        gap: located.gap,
        causes,
        parameters: if keep { parameters(nominal, &augmented, &outcome.best) } else { Vec::new() },
        excluded: excluded(contest, outcome, verdict),
        by_part: Vec::new(),
        unexplained,
        prediction_set: None,
        no_prediction_set: None,
        checks: if keep { checks } else { Vec::new() },
        closure: verification.closure,
        augmented_model: Some("augmented.toml".into()),
        interrupted: match contest.run.ending() {
            Ending::Interrupted { after } => Some(after),
            Ending::Complete => None,
        },
        notes: Vec::new(),
        power: None,
        work: Vec::new(),
        figures: Some(Figures {
            rollouts: verification.figures,
            residuals: located.figures,
            equations: equations(nominal, &augmented),
            difference: Vec::new(),
            signals: curves::signals(nominal, train, holdout),
            checks: verification.checks,
        }),
    };
    (diagnosis, augmented)
}

/// The augmented model's parameters with the nominal ones.
fn parameters(before: &Model, after: &Model, best: &Contestant) -> Vec<ModelParameter> {
    let one = |(index, parameter): (usize, &crate::model::Parameter)| ModelParameter {
        name: parameter.name.clone(),
        nominal: before.parameters.iter().find(|p| p.name == parameter.name).map(|p| p.value),
        value: parameter.value,
        deviation: deviation(best, index).and_then(finite),
        unit: parameter.unit.clone(),
    };
    after.parameters.iter().enumerate().map(one).collect()
}

/// Effects that these logs would have shown besides the winner's, had they been larger than a size: where the winner leaves a rest,
/// none of those that may do what it does.
///
/// Where the gap is unexplained nothing is excluded: what is missing may hide any of them, as a search that was cut may.
fn excluded(contest: &Contest<'_>, outcome: &Outcome, verdict: Verdict) -> Vec<Excluded> {
    let is_cut = contest.run.ending() != Ending::Complete && outcome.best.hypotheses.is_empty();
    if is_cut || verdict == Verdict::Unexplained {
        return Vec::new();
    }
    let model = outcome.best.system.model();
    let is_whole = matches!(verdict, Verdict::Explained | Verdict::NoGap);
    let mut all: Vec<Excluded> = Vec::new();
    for (hypothesis, summary) in contest.hypotheses.iter().zip(&outcome.screened) {
        let Some((deviation, unit)) = &summary.resolution else { continue };
        // Not the same effect in the same equation, whatever it depends on: a reader would see a contradiction. Wrong parameters have names.
        let is_same = |h: &Hypothesis| {
            h.id() == hypothesis.id()
                && h.state == hypothesis.state
                && (h.frees().is_none() || h.frees() == hypothesis.frees())
        };
        let has_size = hypothesis.has_single_size() && !hypothesis.effect().is_some_and(Effect::size_is_a_limit);
        let is_quiet = summary.gain < QUIET_GAIN && !outcome.best.hypotheses.iter().any(is_same);
        let may_be = !is_whole && outcome.may_carry(hypothesis);
        if is_quiet && !may_be && deviation.is_finite() && *deviation > 0.0 && has_size {
            let state = model.states[hypothesis.moves()].name.clone();
            let (variables, place) = (hypothesis.stated().to_vec(), hypothesis.place());
            let is_listed = |e: &&mut Excluded| {
                (e.effect.as_str(), &e.state, &e.variables, &e.place) == (hypothesis.id(), &state, &variables, &place)
            };
            let above = SHOWN * deviation;
            match all.iter_mut().find(is_listed) {
                // Of several terms or sources of heat under one name, what holds for each.
                Some(listed) => listed.above = listed.above.max(above),
                None => {
                    let (effect, unit) = (hypothesis.id().into(), unit.clone());
                    all.push(Excluded { effect, state, variables, place, above, unit });
                }
            }
        }
    }
    all
}
