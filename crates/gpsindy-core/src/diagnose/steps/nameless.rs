//! A generic smooth function in the augmented model for the remaining residual, on request.

use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::diagnose::fit::contestant::{Entrant, Searches};
use crate::diagnose::limits::nameless::CHANCE;
use crate::diagnose::limits::{Budget, STRUCTURE};
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::findings::{Judged, Left};
use crate::expression::Expression;

/// The id under which a report states a function without a name.
pub(crate) const FUNCTION: &str = "function";

/// The outcome with the best function of what is left in it; the same where nothing is left, or it can't be fitted.
pub(crate) fn kept(contest: &Contest<'_>, mut judged: Judged) -> Judged {
    let outcome = &mut judged.outcome;
    let is_there = |left: &&Left| left.p_value < CHANCE && left.energy > STRUCTURE;
    let Some(left) = outcome.left.as_ref().filter(is_there) else { return judged };
    let Some(rival) = contest.rivals.iter().find(|r| r.state == left.state && r.variables == left.depends_on) else {
        return judged;
    };
    let applied = rival.apply(outcome.best.system.model(), &contest.scene);
    let form = Expression::variable(format!("f({})", rival.variables.join(", ")));
    let state = outcome.best.system.model().states[rival.state].name.clone();
    let effect = CustomEffect { id: FUNCTION.into(), state, form, parameters: Vec::new() };
    let kind = Kind::Custom(Box::new(effect));
    let hypothesis = Hypothesis { kind, state: rival.state, variables: rival.variables.clone(), site: None };
    let start = vec![0.0; applied.fitted.len()];
    let entrant = Entrant { hypothesis: &hypothesis, searches: Searches::of(contest.rivals.len()) };
    if let Ok(fit) = contest.fitter.with(&outcome.best, &[entrant], &applied, &[start], Budget::Usual) {
        outcome.removed.push(left.energy);
        outcome.best = fit;
        outcome.left = None;
    }
    judged
}

/// Whether a hypothesis is a function without a name.
pub(crate) fn is_nameless(hypothesis: &Hypothesis) -> bool {
    hypothesis.id() == FUNCTION
}
