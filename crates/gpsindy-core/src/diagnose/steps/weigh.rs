//! Weigh: probabilities, exclusions and the verdict, from the outcome of the contest to the report.

use crate::data::Dataset;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::moved::deviation;
use crate::diagnose::limits::verify::QUIET;
use crate::diagnose::limits::weigh::{COUNTS, CROWDING, FEW, LIKELY, MANY, PART, REAL, REST_LEFT, ROUGH, TYPICAL};
use crate::diagnose::limits::{REST, SHOWN, STRUCTURE};
use crate::diagnose::notes::Note;
use crate::diagnose::report::{
    Cause, Check, Diagnosis, Excluded, Figures, ModelParameter, Runs, SCHEMA, Unexplained, Verdict, finite,
};
use crate::diagnose::steps::augment::equations;
use crate::diagnose::steps::causes::{Causes, gap_energy, random_force};
use crate::diagnose::steps::checks::Checked;
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::curves;
use crate::diagnose::steps::findings::{self, Detected, Outcome, Told, crowding};
use crate::diagnose::steps::localise::Located;
use crate::diagnose::steps::stability::{self, Stability};
use crate::diagnose::steps::typicality::Typicality;
use crate::diagnose::steps::verify::Verification;
use crate::model::Model;

/// All that a report is made of.
pub(crate) struct Found<'a> {
    pub(crate) judged: &'a findings::Judged,
    pub(crate) typicality: Option<Typicality>,
    pub(crate) verification: Verification,
    pub(crate) located: Located,
}

pub(crate) fn report(
    confidence: f64,
    contest: &Contest<'_>,
    found: Found<'_>,
    (train, holdout): (&Dataset, &Dataset),
    augmented: Model,
) -> (Diagnosis, Model) {
    let Found { judged, typicality, verification, located } = found;
    let findings::Judged { nominal, detected, outcome, forcing, .. } = judged;
    let hypotheses = &outcome.best.hypotheses;
    let has_function = hypotheses.iter().any(Hypothesis::is_nameless);
    let model = nominal.system.model();
    let stability =
        |place: usize| (!hypotheses[place].is_nameless()).then(|| stability::of(model, &outcome.best, place)).flatten();
    let stabilities: Vec<Option<Stability>> = (0..hypotheses.len()).map(stability).collect();
    let unexplained = match forcing {
        // What is random is no structure, and rollouts miss the held-out runs by it.
        Some(forcing) => Unexplained { probability: 1.0 - forcing.probability(), share: 0.0, depends_on: Vec::new() },
        None => unexplained(nominal, outcome, detected, &verification, typicality.as_ref()),
    };
    let gap = gap_energy(nominal, outcome);
    let named = hypotheses.len() - usize::from(has_function);
    let credible = |place: usize| {
        // A function without a name imitates nothing: it is what it is.
        if hypotheses[place].is_nameless() {
            return 1.0;
        }
        let share = outcome.removed.get(place).map_or(0.0, |removed| removed / gap);
        credible(share, unexplained.probability, named, stabilities[place].as_ref().map_or(1.0, |s| s.p_value))
    };
    let credible: Vec<f64> = (0..hypotheses.len()).map(credible).collect();
    let is_forced = forcing.as_ref().is_some_and(|forcing| !forcing.forces.is_empty());
    let checked = Checked {
        outcome,
        unexplained: &unexplained,
        stabilities: &stabilities,
        verification: &verification,
        typicality: typicality.as_ref(),
        forced: forcing.as_ref().filter(|_| is_forced).map(|forcing| forcing.p_value),
    };
    let has_causes = detected.gap && (is_forced || !hypotheses.is_empty());
    let checks = if has_causes { checked.all() } else { Vec::new() };
    let share = |place: usize| outcome.removed.get(place).map_or(1.0, |removed| removed / gap);
    let worth: Vec<(f64, f64)> = (0..hypotheses.len()).map(|place| (credible[place], share(place))).collect();
    let are_credible = are_believed(&worth);
    let verdict = verdict(judged, &checks, are_credible, &verification);
    // A search that was cut short has not shown that nothing else is there.
    let verdict = match verdict {
        Verdict::Explained if contest.run.is_cut() => Verdict::PartlyExplained,
        Verdict::NoGap if contest.run.is_cut() => Verdict::Unexplained,
        verdict => verdict,
    };
    let keep = has_function || matches!(verdict, Verdict::Explained | Verdict::PartlyExplained);
    let stated = Causes { confidence, contest, nominal, outcome, stabilities: &stabilities, credible: &credible, keep };
    if let Some(forcing) = forcing {
        forcing.forces.iter().for_each(|told| contest.run.notes.say(random(model, told)));
        forcing.errors.iter().for_each(|told| contest.run.notes.say(coloured(model, told)));
    }
    let mut causes = if detected.gap { stated.all() } else { Vec::new() };
    if let Some(forcing) = forcing {
        let first = causes.iter().position(|c| !c.included).unwrap_or(causes.len());
        // What is left is random only if the causes beside it are right.
        let probability = forcing.probability() * credible.iter().product::<f64>();
        let told = forcing.forces.iter().map(|told| random_force(confidence, model, probability, told));
        causes.splice(first..first, told);
    }
    let augmented = if keep { augmented } else { nominal.system.model().clone() };
    if detected.gap && outcome.best.hypotheses.is_empty() {
        contest.run.notes.say(Note::NothingExplains);
    }
    if keep {
        let notes = causes.iter().filter_map(disagreement).chain(astray(&verification));
        notes.for_each(|note| contest.run.notes.say(note));
    }
    let verification = if keep { verification } else { verification.without_causes() };
    let equations = equations(nominal.system.model(), &augmented);
    let names = |data: &Dataset| data.runs().iter().map(|r| r.name.clone()).collect();
    let diagnosis = Diagnosis {
        schema: SCHEMA.into(),
        model: nominal.system.model().name.clone(),
        runs: Runs { train: names(train), holdout: names(holdout) },
        verdict,
        confidence: Some(confidence),
        gap: located.gap,
        causes,
        parameters: if keep { parameters(nominal.system.model(), &augmented, &outcome.best) } else { Vec::new() },
        excluded: excluded(contest, outcome),
        unexplained,
        checks: if keep { checks } else { Vec::new() },
        closure: verification.closure,
        augmented_model: Some("augmented.toml".into()),
        notes: contest.run.notes.all().iter().map(ToString::to_string).collect(),
        power: None,
        work: Vec::new(),
        figures: Some(Figures {
            rollouts: verification.figures,
            residuals: located.figures,
            equations,
            difference: Vec::new(),
            signals: curves::signals(nominal.system.model(), train, holdout),
            checks: verification.checks,
        }),
    };
    (diagnosis, augmented)
}

/// What is to be said of a cause whose size differs between parts of the logs.
fn disagreement(cause: &Cause) -> Option<Note> {
    let stability = cause.stability.as_ref().filter(|s| !s.disagree.is_empty())?;
    let (effect, state) = (cause.effect.clone(), cause.state.clone());
    Some(Note::Disagreement { effect, state, parts: stability.disagree.clone() })
}

/// What is to be said of a random force.
fn random(model: &Model, told: &Told) -> Note {
    let state = &model.states[told.state];
    Note::RandomForce { state: state.name.clone(), deviation: told.deviation, unit: state.rate_unit(), time: told.time }
}

/// What is to be said of a sensor whose errors have a memory.
fn coloured(model: &Model, told: &Told) -> Note {
    let state = &model.states[told.state];
    Note::ColouredNoise {
        column: state.name.clone(),
        deviation: told.deviation,
        unit: state.unit.clone(),
        time: told.time,
    }
}

/// What is to be said of columns that the corrected model does not follow.
fn astray(verification: &Verification) -> Option<Note> {
    let lost = verification.missed.iter().filter(|m| m.is_lost);
    let columns: Vec<String> = lost.map(|m| m.name.clone()).collect();
    (!columns.is_empty()).then_some(Note::NotFollowed { columns })
}

/// The augmented model's parameters beside the nominal ones.
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

/// Probability that an effect is one of the machine's, and imitates none that the catalogue lacks: of one that removes `share` of
/// the gap, where a rest is left with probability `rest` and so many effects are `named`.
///
/// Its odds are those of [`REAL`] times the share, for a use that a search finds for one more effect is small; less where much
/// is left or many are named. Then by the `chance` of the disagreement of its sizes between parts of the logs: that of a true
/// cause is spread evenly, that of some imitations crowds near zero.
fn credible(share: f64, rest: f64, named: usize, chance: f64) -> f64 {
    let many = if named < FEW { 1.0 } else { MANY };
    let disagreement = 1.0 - CROWDING + CROWDING * crowding(chance);
    let odds = REAL * share.clamp(0.0, 1.0) / (many * REST_LEFT.powf(rest) * disagreement);
    odds / (1.0 + odds)
}

/// What remains after the named causes: by functions without a name on the training logs, and column by column in rollouts
/// of the held-out ones.
fn unexplained(
    nominal: &Contestant,
    outcome: &Outcome,
    detected: &Detected,
    verification: &Verification,
    typicality: Option<&Typicality>,
) -> Unexplained {
    let nothing = Unexplained { probability: 0.0, share: 0.0, depends_on: Vec::new() };
    if !detected.gap {
        return nothing;
    }
    let missed = verification.missed();
    let Some(left) = &outcome.left else { return Unexplained { probability: missed, ..nothing } };
    if outcome.best.hypotheses.is_empty() {
        return Unexplained { probability: 1.0, share: 1.0, depends_on: left.depends_on.clone() };
    }
    let share = (left.energy / gap_energy(nominal, outcome)).min(1.0);
    // Both the significance and the size of the rest count: a long log finds the roughness of any model.
    let significant = 1.0 - left.p_value;
    let size = left.energy / STRUCTURE;
    let relative = share / REST;
    let odds = (size * size).min(relative * relative);
    // Simulated logs say how surely it is no noise, of whatever size; below that of rounding it is none all the same.
    let seen = typicality.filter(|_| share >= ROUGH).map_or(0.0, |t| 1.0 / (1.0 + (t.p_value / TYPICAL).powi(2)));
    let structure = (significant * odds / (1.0 + odds)).max(seen);
    let probability = 1.0 - (1.0 - structure) * (1.0 - missed);
    let depends_on = if structure > LIKELY { left.depends_on.clone() } else { Vec::new() };
    Unexplained { probability, share, depends_on }
}

/// Whether causes, each credible to such a degree and with such a share of the gap, are believed together.
///
/// One without which less than the verdict allows would be left need not be sure, beside one that is: of several that can stand for
/// each other none would be missed.
fn are_believed(causes: &[(f64, f64)]) -> bool {
    let is_sure = |&(credible, _): &(f64, f64)| credible > LIKELY;
    let all = causes.iter().all(|cause| is_sure(cause) || cause.1 < COUNTS);
    all && (causes.is_empty() || causes.iter().any(is_sure))
}

/// `are_credible`: whether every cause that counts is more likely one of the machine's than an imitation.
fn verdict(judged: &findings::Judged, checks: &[Check], are_credible: bool, verification: &Verification) -> Verdict {
    let findings::Judged { detected, outcome, forcing, .. } = judged;
    if !detected.gap {
        return Verdict::NoGap;
    }
    let is_forced = forcing.as_ref().is_some_and(|forcing| !forcing.forces.is_empty());
    if outcome.best.hypotheses.iter().all(Hypothesis::is_nameless) && !is_forced {
        return Verdict::Unexplained;
    }
    let has_function = outcome.best.hypotheses.iter().any(Hypothesis::is_nameless);
    // A nominal model that diverges where the corrected one does not is all gap.
    let closure = &verification.closure;
    let rescued = closure.before.is_none() && closure.after.is_some();
    let closed = if rescued { 1.0 } else { closure.closed.unwrap_or(0.0) };
    let is_quiet = closure.before.zip(closure.floor).is_some_and(|(before, floor)| before < (1.0 + QUIET) * floor);
    let is_closed = closed >= PART || is_quiet || is_forced;
    if checks.iter().all(|check| check.passed) && are_credible && !has_function && is_closed {
        return Verdict::Explained;
    }
    if closed >= PART || is_forced { Verdict::PartlyExplained } else { Verdict::Unexplained }
}

/// Effects that these logs would have shown beside the winner's, had they been larger than a size.
fn excluded(contest: &Contest<'_>, outcome: &Outcome) -> Vec<Excluded> {
    let model = outcome.best.system.model();
    let mut all: Vec<Excluded> = Vec::new();
    for (hypothesis, summary) in contest.hypotheses.iter().zip(&outcome.screened) {
        let Some((deviation, unit)) = &summary.resolution else { continue };
        // Not the same effect in the same equation, whatever it depends on: a reader would see a contradiction.
        let is_same = |h: &Hypothesis| h.id() == hypothesis.id() && h.state == hypothesis.state;
        let is_quiet = summary.gain < 9.0 && !outcome.best.hypotheses.iter().any(is_same);
        if is_quiet && deviation.is_finite() && *deviation > 0.0 && hypothesis.has_single_size() {
            let state = model.states[hypothesis.moves()].name.clone();
            let (variables, place) = (hypothesis.variables.clone(), hypothesis.place());
            let is_listed = |e: &Excluded| {
                (e.effect.as_str(), &e.state, &e.variables, &e.place) == (hypothesis.id(), &state, &variables, &place)
            };
            if !all.iter().any(is_listed) {
                all.push(Excluded {
                    effect: hypothesis.id().into(),
                    state,
                    variables,
                    place,
                    above: SHOWN * deviation,
                    unit: unit.clone(),
                });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_causes_need_not_be_sure_beside_one_that_is_and_explain_nothing_alone() {
        assert!(are_believed(&[(0.9, 0.9), (0.2, 0.005)]));
        assert!(!are_believed(&[(0.9, 0.9), (0.2, 0.05)]));
        assert!(!are_believed(&[(0.02, 0.005), (0.02, 0.004), (0.01, 0.004)]));
        assert!(are_believed(&[]));
    }

    #[test]
    fn a_cause_of_the_whole_gap_is_credible_and_one_of_a_hundredth_of_it_is_not() {
        assert!(credible(1.0, 0.0, 1, 0.5) > 0.95);
        assert!(credible(0.01, 0.0, 2, 0.5) < 0.3);
        // Dry friction that removes nearly all of a real drive's gap is likely still, where a rest is left beside it.
        assert!((0.6..0.9).contains(&credible(0.97, 1.0, 1, 0.5)));
        assert!(credible(0.97, 1.0, 3, 0.5) < 0.3);
    }

    #[test]
    fn a_size_that_differs_between_parts_makes_an_imitation_likely() {
        assert!(credible(1.0, 0.0, 1, 1e-6) < 0.05);
        let all: Vec<f64> = (0..60).map(|i| credible(1.0, 0.0, 1, 10f64.powf(-0.1 * f64::from(i)))).collect();
        assert!(all.windows(2).all(|w| w[1] <= w[0] && w[0] - w[1] < 0.15), "{all:?}");
    }
}
