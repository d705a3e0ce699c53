//! Causes as the report states them: the winner's effects, what else may stand in their places, and random forces.

use crate::diagnose::catalogue::effect::separating_experiment;
use crate::diagnose::catalogue::hypothesis::{Added, Hypothesis};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::by_run;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::evidence::normal_quantile;
use crate::diagnose::fit::moved::deviation;
use crate::diagnose::fit::sampling;
use crate::diagnose::fit::tried::{breakaway, late};
use crate::diagnose::limits::NO_REST;
use crate::diagnose::limits::weigh::UNLIKELY;
use crate::diagnose::report::{Cause, Parameter, Twin, finite};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Outcome, Seat, StatedProcess, gap_size};
use crate::diagnose::steps::verdict::stability::Stability;
use crate::model::{Model, unit};
use std::cmp::Ordering;

/// What causes are stated from.
pub(crate) struct Causes<'a> {
    pub(crate) confidence: f64,
    pub(crate) contest: &'a Contest<'a>,
    pub(crate) nominal: &'a Contestant,
    pub(crate) outcome: &'a Outcome,
    pub(crate) stabilities: &'a [Option<Stability>],
    /// Probability of each of the winner's effects of being no imitation.
    pub(crate) credible: &'a [f64],
    pub(crate) keep: bool,
}

/// Probability that an effect that removes the mean square `removed` (noise units) is more than a use for the rest of `fit`.
fn is_real(fit: &Contestant, removed: f64, parameters: usize) -> f64 {
    let count = fit.evidence.effective_count();
    let gain = 0.5 * count * (removed.max(0.0) / fit.evidence.misfit().max(NO_REST)).ln_1p();
    let evidence = gain - 0.5 * parameters as f64 * count.ln();
    1.0 / (1.0 + (-evidence).exp())
}

/// Posterior weights of contestants that differ in one effect, the evidence counted as often as `at` leaves values that
/// count alone.
fn weights(contest: &Contest<'_>, fits: &[Contestant], at: &Contestant) -> Vec<f64> {
    let alone = at.evidence.alone();
    let scores: Vec<f64> = fits.iter().map(|f| contest.score_of(f, alone)).collect();
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let raw: Vec<f64> = scores.iter().map(|s| (s - best).exp()).collect();
    let total: f64 = raw.iter().sum();
    raw.iter().map(|r| r / total).collect()
}

impl Causes<'_> {
    /// All causes, best first.
    pub(crate) fn all(&self) -> Vec<Cause> {
        let outcome = self.outcome;
        if outcome.seats.is_empty() {
            return self.singles();
        }
        let mut all: Vec<Cause> = Vec::new();
        // The effect that removes most comes first.
        let mut seats: Vec<(usize, &Seat)> = outcome.seats.iter().enumerate().collect();
        seats.sort_by(|(_, a), (_, b)| b.removed.total_cmp(&a.removed));
        for (place, seat) in seats {
            self.at(place, seat, &mut all);
        }
        // Stable: included effects stay in their order, the others follow by probability.
        all.sort_by(|a, b| {
            let by_probability =
                if a.included && b.included { Ordering::Equal } else { b.probability.total_cmp(&a.probability) };
            b.included.cmp(&a.included).then(by_probability)
        });
        all
    }

    /// Single effects of which none convinces: their weights, as far as what each removes is more than a use for the rest.
    fn singles(&self) -> Vec<Cause> {
        let singles = &self.outcome.singles;
        let Some(first) = singles.first() else { return Vec::new() };
        let gap = gap_size(self.nominal, &self.outcome.best);
        let one = |(fit, weight): (&Contestant, f64)| {
            let removed = self.nominal.evidence.misfit() - fit.evidence.misfit();
            // Of a gap that a single effect leaves most of, it is hardly the cause.
            let share = (removed / gap).clamp(0.0, 1.0);
            let probability = weight * share * is_real(fit, removed, fit.evidence.complexity());
            cause(self.confidence, fit, 0, probability, false, Vec::new())
        };
        singles.iter().zip(weights(self.contest, singles, first)).map(one).take(5).collect()
    }

    /// The winner's effect at `place`, and what else may stand there.
    fn at(&self, place: usize, seat: &Seat, all: &mut Vec<Cause>) {
        let best = &self.outcome.best;
        let Seat { hypothesis, alternatives: fits, removed } = seat;
        if hypothesis.is_nameless() {
            // Whatever is left is it.
            let real = is_real(best, *removed, 1);
            return all.push(cause(self.confidence, best, place, real, self.keep, Vec::new()));
        }
        let sound = self.credible[place] * is_real(best, *removed, best.added[place].len());
        let weights = weights(self.contest, fits, best);
        let state = best.system.model().states[hypothesis.moves()].name.as_str();
        // The effect that each contestant has in this one's place.
        let differing = |fit: &Contestant| {
            let others: Vec<&Hypothesis> = best.hypotheses.iter().filter(|h| *h != hypothesis).collect();
            fit.hypotheses.iter().position(|h| !others.contains(&h)).unwrap_or(0)
        };
        let mut class_weight = 0.0;
        let mut equivalent: Vec<String> = Vec::new();
        let mut twins: Vec<Twin> = Vec::new();
        let mut rest: Vec<Cause> = Vec::new();
        for (fit, weight) in fits.iter().zip(&weights) {
            let is_twin = seat.is_twin(fit, best.evidence.alone());
            let place = differing(fit);
            let id = fit.hypotheses[place].id().to_string();
            if is_twin || fit.hypotheses[place] == *hypothesis {
                class_weight += weight;
                if fit.hypotheses[place] == *hypothesis {
                    continue;
                }
                // One effect at two places, as a wrong damping of a joint and of its servo, is its own equivalent.
                twins.push(twin(self.confidence, fit, place));
                if !equivalent.contains(&id) {
                    equivalent.push(id);
                }
            } else if rest.len() < 3 {
                let other = cause(self.confidence, fit, place, weight * sound, false, Vec::new());
                let twins = twins.iter().map(|t| (&*t.effect, &*t.state, &*t.variables));
                let others = rest.iter().map(|c| (&*c.effect, &*c.state, &*c.variables));
                let own = (hypothesis.id(), state, hypothesis.stated());
                if !std::iter::once(own).chain(twins).chain(others).any(|known| is_again(&other, known)) {
                    rest.push(other);
                }
            }
        }
        let mut stated = cause(self.confidence, best, place, class_weight * sound, self.keep, equivalent);
        stated.twins = twins;
        stated.between_runs = self.stabilities[place].as_ref().map_or(Vec::new(), |s| s.between(self.confidence));
        let by_run = by_run::differing(&best.experiment);
        for size in &stated.between_runs {
            let is_own = |added: &Added| added.symbol == size.parameter;
            let differs = best.added[place].iter().any(|(index, added)| is_own(added) && by_run.contains(index));
            // What differs between runs is known as well as their mean.
            if let Some(parameter) = stated.parameters.iter_mut().find(|p| differs && p.name == size.parameter) {
                (parameter.value, parameter.low, parameter.high) = (size.pooled, finite(size.low), finite(size.high));
            }
        }
        stated.stability = self.stabilities[place].as_ref().map(|s| crate::diagnose::report::Stability {
            runs: s.parts,
            agree: s.agree,
            p_value: s.p_value,
            disagree: s.disagree.clone(),
        });
        all.push(stated);
        all.extend(rest);
    }
}

/// Whether a cause is only another port for an effect that is listed already, and hardly likely there.
fn is_again(cause: &Cause, (effect, state, variables): (&str, &str, &[String])) -> bool {
    let is_same = cause.effect == effect && cause.state == state && cause.variables == variables;
    is_same && cause.probability <= UNLIKELY
}

fn cause(
    confidence: f64,
    fit: &Contestant,
    place: usize,
    probability: f64,
    included: bool,
    equivalent: Vec<String>,
) -> Cause {
    let hypothesis = &fit.hypotheses[place];
    let model = fit.system.model();
    let z = normal_quantile(0.5 + 0.5 * confidence);
    let parameters = fit.added[place]
        .iter()
        .filter(|(index, added)| added.out_of_reach(fit.refined.parameters[*index]).is_none())
        .map(|(index, added)| {
            let value = added.stated(fit.refined.parameters[*index]);
            let least_distinguished = || {
                let tried = (*index, added.clone());
                sampling::least_distinguished(&fit.experiment, added, value)
                    .or_else(|| breakaway::least_distinguished(fit, &tried, z * z))
                    .or_else(|| late::least_distinguished(fit, &tried, z * z))
            };
            let width = deviation(fit, *index).map(|d| z * d).or_else(least_distinguished).unwrap_or(f64::NAN);
            Parameter {
                name: added.symbol.clone(),
                value,
                low: finite(value - width).map(|v| v.max(added.lower)),
                high: finite(value + width).map(|v| v.min(added.upper)),
                unit: added.unit.clone(),
            }
        })
        .collect();
    let next_experiment = equivalent.first().map(|other| separating_experiment(hypothesis.id(), other).to_string());
    Cause {
        effect: hypothesis.id().into(),
        state: model.states[hypothesis.moves()].name.clone(),
        place: hypothesis.place(),
        variables: hypothesis.stated().to_vec(),
        included,
        probability: probability.clamp(0.0, 1.0),
        form: hypothesis.form(),
        parameters,
        equivalent,
        next_experiment,
        stability: None,
        twins: Vec::new(),
        between_runs: Vec::new(),
    }
}

/// The effect at `place` of `fit` as another account of a cause.
fn twin(confidence: f64, fit: &Contestant, place: usize) -> Twin {
    let Cause { effect, state, place, variables, parameters, .. } =
        cause(confidence, fit, place, 0.0, false, Vec::new());
    Twin { effect, state, place, variables, parameters }
}

/// A random force as a cause: its intensity is the spectral density at low frequency, `2 deviation^2 tau`.
pub(crate) fn random_force(confidence: f64, model: &Model, probability: f64, process: &StatedProcess) -> Cause {
    let effect = Effect::ProcessNoise;
    let (state, z) = (&model.states[process.state], normal_quantile(0.5 + 0.5 * confidence));
    let rate = state.rate_unit();
    let [[a, b], [_, c]] = process.covariance;
    // Each is a product of powers of the two, and its logarithm is nearly normal.
    let one = |name: &str, value: f64, variance: f64, unit: String| {
        let factor = (z * variance.sqrt()).exp();
        Parameter { name: name.into(), value, low: finite(value / factor), high: finite(value * factor), unit }
    };
    let intensity = 2.0 * process.deviation.powi(2) * process.time;
    Cause {
        included: true,
        form: effect.form().into(),
        parameters: vec![
            one("q", intensity, 2.0 * (2.0 * a) + c + 2.0 * (2.0 * b), unit::product(&[(&rate, 2), ("s", 1)])),
            one("tau", process.time, c, "s".into()),
            one("rms", process.deviation, a, rate),
        ],
        ..Cause::bare(effect.id(), &state.name, probability)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_listed_again_through_another_port_only_where_it_is_likely_there() {
        let model = Model {
            states: vec![crate::model::State::new("w", crate::expression::Expression::Number(0.0))],
            ..Model::default()
        };
        let process = StatedProcess { state: 0, deviation: 1.0, time: 1.0, covariance: [[0.1, 0.0], [0.0, 0.1]] };
        let at = |probability: f64| random_force(0.95, &model, probability, &process);
        let own = ("process_noise", "w", &[][..]);
        assert!(is_again(&at(1e-9), own) && is_again(&at(0.01), own));
        assert!(!is_again(&at(0.2), own));
        assert!(!is_again(&at(1e-9), ("drift", "w", &[][..])));
        assert!(!is_again(&at(1e-9), ("process_noise", "w", &["w".to_string()][..])));
    }
}
