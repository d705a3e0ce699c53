//! What is decided of an outcome: how credible each cause is, what is left unexplained, the checks and the verdict.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::weigh::{
    COUNTS, CROWDING, DIFFERS, FEW, LEAST_REST, LIKELY, MANY, PART, REAL, REST_LEFT, TYPICAL, UNMEASURED,
};
use crate::diagnose::limits::{REST, STRUCTURE};
use crate::diagnose::report::{Check, Unexplained, Verdict};
use crate::diagnose::run::Ending;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Detected, Judged, Outcome, crowding, gap_size};
use crate::diagnose::steps::verdict::checks::Checked;
use crate::diagnose::steps::verdict::stability::{self, Stability};
use crate::diagnose::steps::verdict::typicality::Typicality;
use crate::diagnose::steps::verdict::verify::Verification;
use crate::diagnose::steps::verdict::weigh::Found;

/// What the report states as decided.
pub(crate) struct Decided {
    /// Of every effect of the winner.
    pub(crate) stabilities: Vec<Option<Stability>>,
    /// Of every effect of the winner: the probability that it is one of the machine's and imitates none.
    pub(crate) credible: Vec<f64>,
    pub(crate) unexplained: Unexplained,
    pub(crate) checks: Vec<Check>,
    pub(crate) verdict: Verdict,
    /// Whether the winner's effects are in the corrected model.
    pub(crate) keep: bool,
}

impl Decided {
    pub(crate) fn of(contest: &Contest<'_>, found: &Found<'_>) -> Self {
        let Found { judged, typicality, verification, .. } = found;
        let Judged { nominal, detected, outcome, forcing, .. } = judged;
        let hypotheses = &outcome.best.hypotheses;
        let has_function = hypotheses.iter().any(Hypothesis::is_nameless);
        let model = nominal.system.model();
        let stability = |place: usize| {
            (!hypotheses[place].is_nameless()).then(|| stability::of(model, &outcome.best, place)).flatten()
        };
        let stabilities: Vec<Option<Stability>> = (0..hypotheses.len()).map(stability).collect();
        let unexplained = match forcing {
            // What is random is no structure, and rollouts miss the held-out runs by it.
            Some(forcing) => {
                Unexplained { probability: 1.0 - forcing.probability(), share: 0.0, depends_on: Vec::new() }
            }
            None => unexplained(nominal, outcome, detected, verification, typicality.as_ref()),
        };
        let gap = gap_size(nominal, &outcome.best);
        let named = hypotheses.len() - usize::from(has_function);
        let credible = |place: usize| {
            // A function without a name imitates nothing: it is what it is.
            if hypotheses[place].is_nameless() {
                return 1.0;
            }
            let share = outcome.seats[place].removed / gap;
            // What differs between recordings need not differ within them.
            let within = stabilities[place].as_ref().and_then(|s| s.within);
            let chance = within.or(stabilities[place].as_ref().map(|s| s.p_value)).unwrap_or(1.0);
            let credible = credible(share, unexplained.probability, named, (chance, within.is_some()));
            if outcome.best.unmeasured(place).is_empty() { credible } else { credible.min(UNMEASURED) }
        };
        let credible: Vec<f64> = (0..hypotheses.len()).map(credible).collect();
        let is_forced = forcing.as_ref().is_some_and(|forcing| !forcing.forces.is_empty());
        let checked = Checked {
            outcome,
            unexplained: &unexplained,
            stabilities: &stabilities,
            verification,
            typicality: typicality.as_ref(),
            forced: forcing.as_ref().filter(|_| is_forced).map(|forcing| forcing.p_value),
        };
        let has_causes = detected.gap && (is_forced || !hypotheses.is_empty());
        let checks = if has_causes { checked.all() } else { Vec::new() };
        let worth: Vec<(f64, f64)> =
            credible.iter().zip(&outcome.seats).map(|(&credible, seat)| (credible, seat.removed / gap)).collect();
        let are_credible = are_believed(&worth);
        let is_interrupted = contest.run.ending() != Ending::Complete;
        let verdict = match verdict(judged, &checks, are_credible, verification) {
            // A search that was cut short has not shown that nothing else is there.
            Verdict::Explained if is_interrupted => Verdict::PartlyExplained,
            Verdict::NoGap if is_interrupted => Verdict::Unexplained,
            verdict => verdict,
        };
        let keep = has_function || matches!(verdict, Verdict::Explained | Verdict::PartlyExplained);
        Self { stabilities, credible, unexplained, checks, verdict, keep }
    }
}

/// Probability that an effect is one of the machine's, and imitates none that the catalogue lacks: of one that removes `share` of
/// the gap, where a rest is left with probability `rest` and so many effects are `named`.
///
/// Its odds are those of [`REAL`] times the share, for a use that a search finds for one more effect is small; less where much
/// is left or many are named. Then by the `chance` of the disagreement of its sizes between parts of the logs: that of a true
/// cause is spread evenly, that of some imitations crowds near zero. Where the size `differs` between recordings it is that within them.
fn credible(share: f64, rest: f64, named: usize, (chance, differs): (f64, bool)) -> f64 {
    let many = if named < FEW { 1.0 } else { MANY };
    let disagreement = 1.0 - CROWDING + CROWDING * crowding(chance);
    let own = if differs { DIFFERS } else { 1.0 };
    let odds = REAL * share.clamp(0.0, 1.0) / (many * own * REST_LEFT.powf(rest) * disagreement);
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
    let missed = verification.form_missed;
    let Some(left) = &outcome.left else { return Unexplained { probability: missed, ..nothing } };
    if outcome.best.hypotheses.is_empty() {
        return Unexplained { probability: 1.0, share: 1.0, depends_on: left.depends_on.clone() };
    }
    let share = (left.energy / gap_size(nominal, &outcome.best)).min(1.0);
    // Both the significance and the size of the rest count: a long log finds the roughness of any model.
    let significant = 1.0 - left.p_value;
    let size = left.energy / STRUCTURE;
    let relative = share / REST;
    let odds = (size * size).min(relative * relative);
    // Simulated logs say how surely it is no noise, of whatever size; below that of rounding it is none all the same.
    let seen = typicality.filter(|_| share >= LEAST_REST).map_or(0.0, |t| 1.0 / (1.0 + (t.p_value / TYPICAL).powi(2)));
    let structure = (significant * odds / (1.0 + odds)).max(seen);
    let probability = 1.0 - (1.0 - structure) * (1.0 - missed);
    let depends_on = if structure > LIKELY { left.depends_on.clone() } else { Vec::new() };
    Unexplained { probability, share, depends_on }
}

/// Whether causes, each credible to such a degree and with such a share of the gap, are believed together.
///
/// One without which less than the verdict allows would be left need not be sure, besides one that is: of several that can stand for
/// each other none would be missed.
fn are_believed(causes: &[(f64, f64)]) -> bool {
    let is_sure = |&(credible, _): &(f64, f64)| credible > LIKELY;
    let all = causes.iter().all(|cause| is_sure(cause) || cause.1 < COUNTS);
    all && (causes.is_empty() || causes.iter().any(is_sure))
}

/// `are_credible`: whether every cause that counts is more likely one of the machine's than an imitation.
fn verdict(judged: &Judged, checks: &[Check], are_credible: bool, verification: &Verification) -> Verdict {
    let Judged { detected, outcome, forcing, .. } = judged;
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
    let is_closed = closed >= PART || verification.is_quiet() || is_forced;
    if checks.iter().all(|check| check.passed) && are_credible && !has_function && is_closed {
        return Verdict::Explained;
    }
    if closed >= PART || is_forced { Verdict::PartlyExplained } else { Verdict::Unexplained }
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
        assert!(credible(1.0, 0.0, 1, (0.5, false)) > 0.95);
        assert!(credible(0.001, 0.0, 2, (0.5, false)) < 0.3);
        // Dry friction that removes nearly all of a real drive's gap is as likely as not, where a rest is left besides it.
        assert!((0.5..0.7).contains(&credible(0.97, 1.0, 1, (0.5, false))));
        assert!(credible(0.2, 1.0, 1, (0.5, false)) < 0.3);
    }

    #[test]
    fn a_size_that_differs_between_parts_makes_an_imitation_likely() {
        assert!(credible(1.0, 0.0, 1, (1e-6, false)) < 0.05);
        let all: Vec<f64> = (0..60).map(|i| credible(1.0, 0.0, 1, (10f64.powf(-0.1 * f64::from(i)), false))).collect();
        assert!(all.windows(2).all(|w| w[1] <= w[0] && w[0] - w[1] < 0.15), "{all:?}");
    }
}
