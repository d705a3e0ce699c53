//! Probabilities, groups, exclusions and the verdict: from the contest's outcome to the report.

use crate::data::Dataset;
use crate::diagnose::catalogue::effect::separating_experiment;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::report::{
    Cause, Closure, Diagnosis, EquationFigure, Excluded, Figures, Parameter, Runs, SCHEMA, Unexplained, Verdict, finite,
};
use crate::diagnose::steps::attribute::Outcome;
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::detect::Detected;
use crate::diagnose::steps::localise::Located;
use crate::diagnose::steps::prune::{REST, STRUCTURE};
use crate::diagnose::steps::verify::Verification;
use crate::diagnose::{Diagnose, Diagnosed};
use crate::error::Result;
use crate::model::Model;
use std::cmp::Ordering;

/// Difference in BIC below which two effects count as not told apart.
const TWINS: f64 = 6.0;

/// Squared error of held-out rollouts beyond the floor's, as a share of it, that a whole explanation shows at most.
const EXCESS: f64 = 0.25;

/// Probability that something is missing where held-out rollouts lie beyond that, and the closure's interval below one.
///
/// A count: of 562 drawn cases that were called explained 15 were so; in six the effect was outside the catalogue (of seven
/// such), in six one was wrong, missing or too many, and three were right.
const INCOMPLETE: f64 = 0.75;

#[allow(clippy::too_many_arguments)]
pub(crate) fn report(
    settings: &Diagnose,
    contest: &Contest<'_>,
    nominal: &Fitted,
    outcome: &Outcome,
    detected: &Detected,
    located: Located,
    verification: Verification,
    (train, holdout): (&Dataset, &Dataset),
    mut notes: Vec<String>,
) -> Result<Diagnosed> {
    let unexplained = unexplained(nominal, outcome, detected, &verification.closure);
    let closed = verification.closure.closed;
    let verdict = verdict(outcome, detected, &unexplained, closed);
    let keep = matches!(verdict, Verdict::Explained | Verdict::PartlyExplained);
    let causes = if detected.gap { causes(settings, contest, outcome, &unexplained, keep) } else { Vec::new() };
    let augmented = if keep { tidy(&outcome.best) } else { nominal.system.model().clone() };
    if detected.gap && outcome.best.hypotheses.is_empty() {
        notes.push("no effect of the catalogue explains a material part of the gap".into());
    }
    let equations = equations(nominal.system.model(), &augmented);
    let names = |data: &Dataset| data.runs().iter().map(|r| r.name.clone()).collect();
    let diagnosis = Diagnosis {
        schema: SCHEMA.into(),
        model: nominal.system.model().name.clone(),
        runs: Runs { train: names(train), holdout: names(holdout) },
        verdict,
        gap: located.gap,
        causes,
        excluded: excluded(contest, outcome),
        unexplained,
        closure: verification.closure,
        augmented_model: Some("augmented.toml".into()),
        notes,
        power: None,
        figures: Some(Figures { rollouts: verification.figures, residuals: located.figures, equations }),
    };
    Ok(Diagnosed { diagnosis, augmented })
}

/// Energy of the gap above noise in the nominal fit, in noise units.
fn gap_energy(nominal: &Fitted, outcome: &Outcome) -> f64 {
    let floor = outcome.best.misfit().min(1.0);
    (nominal.misfit() - floor).max(1e-12)
}

/// Odds that the truth is outside the catalogue although `effects` of it fit well.
///
/// Any curve is imitated by enough effects. One and two effects are counted: of 47 drawn cases outside the catalogue none
/// was imitated well by one effect and two by two, while 61 of 64 causes that were stated in twos were right. With one
/// case in seven outside the catalogue and one in ten a pair, Laplace's rule gives two effects odds of a tenth. Three and
/// more are an argument: few cases have so many, and eight of 19 outside the catalogue took them.
fn imitated(effects: usize) -> f64 {
    match effects {
        0 | 1 => 0.02,
        2 => 0.1,
        _ => 0.75,
    }
}

/// Probability that held-out rollouts show a rest: they stop short of the floor by more than whole explanations do.
fn held_out_rest(closure: &Closure) -> f64 {
    let (Some(after), Some(floor), Some(closed)) = (closure.after, closure.floor, closure.closed) else {
        // A corrected model that diverges on held-out logs has not explained them.
        return if closure.before.is_some() && closure.after.is_none() { 0.8 } else { 0.0 };
    };
    let excess = (after / floor).powi(2) - 1.0;
    if closure.high.unwrap_or(closed) < 1.0 && excess > EXCESS { INCOMPLETE } else { 0.0 }
}

fn unexplained(nominal: &Fitted, outcome: &Outcome, detected: &Detected, closure: &Closure) -> Unexplained {
    if !detected.gap {
        return Unexplained { probability: 0.0, share: 0.0, depends_on: Vec::new() };
    }
    let Some(left) = &outcome.left else { return Unexplained { probability: 0.0, share: 0.0, depends_on: Vec::new() } };
    let share = (left.energy / gap_energy(nominal, outcome)).min(1.0);
    let share = if outcome.best.hypotheses.is_empty() { 1.0 } else { share };
    // Both the significance and the size of the rest count: a long log finds the roughness of any model.
    let significant = 1.0 - left.p_value;
    let size = left.energy / STRUCTURE;
    let relative = share / REST;
    let odds = (size * size).min(relative * relative);
    let structure = significant * odds / (1.0 + odds);
    let none_left =
        (1.0 - structure) * (1.0 - imitated(outcome.best.hypotheses.len())) * (1.0 - held_out_rest(closure));
    let probability = if outcome.best.hypotheses.is_empty() { 1.0 } else { 1.0 - none_left };
    let depends_on = if probability > 0.3 { left.depends_on.clone() } else { Vec::new() };
    Unexplained { probability, share, depends_on }
}

fn verdict(outcome: &Outcome, detected: &Detected, unexplained: &Unexplained, closed: Option<f64>) -> Verdict {
    if !detected.gap {
        return Verdict::NoGap;
    }
    if outcome.best.hypotheses.is_empty() {
        return Verdict::Unexplained;
    }
    if unexplained.probability < 0.5 {
        return Verdict::Explained;
    }
    // Half of the gap on held-out logs, or more: a part is explained.
    if closed.is_some_and(|c| c >= 0.5) { Verdict::PartlyExplained } else { Verdict::Unexplained }
}

/// Posterior weights of contestants that differ in one effect.
fn weights(contest: &Contest<'_>, fits: &[Fitted]) -> Vec<f64> {
    let scores: Vec<f64> = fits.iter().map(|f| contest.score(f)).collect();
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let raw: Vec<f64> = scores.iter().map(|s| (s - best).exp()).collect();
    let total: f64 = raw.iter().sum();
    raw.iter().map(|r| r / total).collect()
}

fn causes(
    settings: &Diagnose,
    contest: &Contest<'_>,
    outcome: &Outcome,
    unexplained: &Unexplained,
    keep: bool,
) -> Vec<Cause> {
    let sound = 1.0 - unexplained.probability;
    let mut all: Vec<Cause> = Vec::new();
    if outcome.best.hypotheses.is_empty() {
        let weights = weights(contest, &outcome.singles);
        for (fit, weight) in outcome.singles.iter().zip(weights).take(5) {
            all.push(cause(settings, fit, 0, 0.1 * weight, false, Vec::new()));
        }
        return all;
    }
    // The effect that removes most comes first.
    let mut places: Vec<usize> = (0..outcome.best.hypotheses.len()).collect();
    let removed = |place: usize| outcome.removed.get(place).copied().unwrap_or(0.0);
    places.sort_by(|&a, &b| removed(b).total_cmp(&removed(a)));
    for place in places {
        let (fits, hypothesis) = (&outcome.alternatives[place], &outcome.best.hypotheses[place]);
        let weights = weights(contest, fits);
        let best_bic = fits.iter().map(|f| -2.0 * f.score()).fold(f64::INFINITY, f64::min);
        // The effect that each contestant has in this one's place.
        let differing = |fit: &Fitted| {
            let others: Vec<&Hypothesis> = outcome.best.hypotheses.iter().filter(|h| *h != hypothesis).collect();
            fit.hypotheses.iter().position(|h| !others.contains(&h)).unwrap_or(0)
        };
        let mut class_weight = 0.0;
        let mut equivalent: Vec<String> = Vec::new();
        let mut rest: Vec<Cause> = Vec::new();
        for (fit, weight) in fits.iter().zip(&weights) {
            let place = differing(fit);
            let id = fit.hypotheses[place].id().to_string();
            let is_twin = -2.0 * fit.score() - best_bic < TWINS;
            if is_twin || fit.hypotheses[place] == *hypothesis {
                class_weight += weight;
                if id != hypothesis.id() && !equivalent.contains(&id) {
                    equivalent.push(id);
                }
            } else if rest.len() < 3 {
                rest.push(cause(settings, fit, place, weight * sound, false, Vec::new()));
            }
        }
        let place = outcome.best.hypotheses.iter().position(|h| h == hypothesis).unwrap_or(0);
        all.push(cause(settings, &outcome.best, place, class_weight * sound, keep, equivalent));
        all.extend(rest);
    }
    // Stable: included effects stay in their order, the others follow by probability.
    all.sort_by(|a, b| {
        let by_probability =
            if a.included && b.included { Ordering::Equal } else { b.probability.total_cmp(&a.probability) };
        b.included.cmp(&a.included).then(by_probability)
    });
    all
}

fn cause(
    settings: &Diagnose,
    fit: &Fitted,
    place: usize,
    probability: f64,
    included: bool,
    equivalent: Vec<String>,
) -> Cause {
    let hypothesis = &fit.hypotheses[place];
    let model = fit.system.model();
    let z = normal_quantile(0.5 + 0.5 * settings.confidence);
    let parameters = fit.added[place]
        .iter()
        .map(|(index, added)| {
            let value = added.told(fit.refined.parameters[*index]);
            let deviation = fit.deviation(*index);
            Parameter {
                name: added.symbol.clone(),
                value,
                low: finite(value - z * deviation).map(|v| v.max(added.lower)),
                high: finite(value + z * deviation).map(|v| v.min(added.upper)),
                unit: added.unit.clone(),
            }
        })
        .collect();
    let next_experiment = equivalent.first().map(|other| separating_experiment(hypothesis.id(), other).to_string());
    Cause {
        effect: hypothesis.id().into(),
        state: model.states[hypothesis.moves()].name.clone(),
        place: hypothesis.place(),
        variables: hypothesis.variables.clone(),
        included,
        probability: probability.clamp(0.0, 1.0),
        form: hypothesis.form(),
        parameters,
        equivalent,
        next_experiment,
    }
}

fn normal_quantile(p: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    Normal::new(0.0, 1.0).map_or(1.96, |n| n.inverse_cdf(p))
}

/// The winner's model for readers: sizes positive, phases within a turn, edges as steps.
fn tidy(best: &Fitted) -> Model {
    let mut model = best.model();
    for (hypothesis, added) in best.hypotheses.iter().zip(&best.added) {
        for (index, parameter) in added {
            let value = &mut model.parameters[*index].value;
            *value = parameter.told(*value);
        }
        hypothesis.tell(&mut model);
    }
    model
}

fn equations(before: &Model, after: &Model) -> Vec<EquationFigure> {
    let mut all = Vec::new();
    for state in &after.states {
        let old = before.states.iter().find(|s| s.name == state.name);
        let right = old.map_or(String::new(), |s| s.equation.to_string());
        if right != state.equation.to_string() {
            all.push(EquationFigure {
                left: format!("{}'", state.name),
                before: right,
                after: state.equation.to_string(),
            });
        }
        let reads = |s: &crate::model::State| s.measured.as_ref().map_or(s.name.clone(), ToString::to_string);
        if let Some(old) = old.filter(|old| reads(old) != reads(state)) {
            all.push(EquationFigure { left: format!("{} reads", state.name), before: reads(old), after: reads(state) });
        }
    }
    all
}

/// Effects that these logs would have shown, had they been larger than a size.
fn excluded(contest: &Contest<'_>, outcome: &Outcome) -> Vec<Excluded> {
    // Sum of the one-sided 5 % point and of the 95 % power point of a normal variable.
    const POWER: f64 = 1.645 + 1.645;
    let model = outcome.best.system.model();
    let mut all: Vec<Excluded> = Vec::new();
    for (hypothesis, summary) in contest.hypotheses.iter().zip(&outcome.screened) {
        let Some((deviation, unit)) = &summary.resolution else { continue };
        let is_quiet = summary.gain < 9.0 && !outcome.best.hypotheses.contains(hypothesis);
        if is_quiet && deviation.is_finite() && *deviation > 0.0 && hypothesis.has_single_size() {
            let state = model.states[hypothesis.moves()].name.clone();
            let place = hypothesis.place();
            if !all.iter().any(|e| e.effect == hypothesis.id() && e.state == state && e.place == place) {
                all.push(Excluded {
                    effect: hypothesis.id().into(),
                    state,
                    place,
                    above: POWER * deviation,
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
    fn held_out_rollouts_show_a_rest_where_they_stay_above_the_floor_for_certain() {
        let closure = |after: Option<f64>, high: f64| Closure {
            metric: "rollout_rmse".into(),
            before: Some(10.0),
            after,
            floor: Some(1.0),
            floor_source: "sensor noise".into(),
            closed: after.map(|after| (10.0 - after) / 9.0),
            low: Some(0.9),
            high: Some(high),
            by_state: Vec::new(),
        };
        let rest = |after: f64, high: f64| held_out_rest(&closure(Some(after), high));
        assert_eq!(rest(1.0, 1.0), 0.0);
        // A fifth more of squared error may be chance, half more is not, unless the interval holds a whole closure.
        assert_eq!(rest(1.2_f64.sqrt(), 0.99), 0.0);
        assert_eq!(rest(1.5_f64.sqrt(), 1.01), 0.0);
        assert_eq!(rest(1.5_f64.sqrt(), 0.99), INCOMPLETE);
        // A corrected model that diverges explains nothing.
        assert!(held_out_rest(&closure(None, 1.0)) > 0.5);
    }
}
