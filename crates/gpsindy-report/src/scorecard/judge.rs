//! One case: compares its diagnosis with its answer.

use super::answers::{Answer, Kind, TrueEffect};
use gpsindy_core::diagnose::report::{Cause, Diagnosis, Verdict};
use serde::Serialize;

/// Level of the gap test.
const LEVEL: f64 = 0.05;

/// What one diagnosis got right. `None` where the case does not ask it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// The case.
    pub id: String,
    /// What it asks.
    pub kind: Kind,
    /// Gap in units of the noise.
    pub snr: Option<f64>,
    /// What was put in, as text.
    pub truth: String,
    /// Verdict of the diagnosis; absent where there is none.
    pub verdict: Option<Verdict>,
    /// p value of the gap.
    pub p_value: Option<f64>,
    /// Best cause, as text.
    pub best: Option<String>,
    /// Its probability.
    pub probability: Option<f64>,
    /// The gap test rejects at 5 %.
    pub detected: bool,
    /// A cause is included.
    pub any_included: bool,
    /// The verdict is the right one of the contract's four.
    pub right_verdict: bool,
    /// The equation with the largest share is the right place.
    pub right_state: Option<bool>,
    /// The best cause acts at the right place.
    pub right_cause_state: Option<bool>,
    /// The best cause hits an effect, by name or by the group that it states.
    pub top_1: Option<bool>,
    /// One of the best three causes does.
    pub top_3: Option<bool>,
    /// The best cause hits by its own name.
    pub named: Option<bool>,
    /// Every effect is hit by an included cause of its own.
    pub all_found: Option<bool>,
    /// The same, and no further cause is included.
    pub exact: Option<bool>,
    /// Members of the best cause's group, with itself.
    pub group_size: Option<usize>,
    /// Closed part of the gap over the oracle's; what is not closed counts as 0.
    pub closure: Option<f64>,
    /// Stated probability and rightness of every cause; what covers a part of an effect outside the catalogue is right.
    pub stated: Vec<(f64, bool)>,
    /// The same, where only what was put in, or what these logs cannot distinguish from it, is right.
    pub stated_strictly: Vec<(f64, bool)>,
}

/// Judges one case; without a diagnosis everything that the case asks counts as missed.
pub(crate) fn judge(answer: &Answer, report: Option<&Diagnosis>) -> Judged {
    let kind = answer.kind();
    // Structure without a name that is only listed is no cause to be right or wrong about.
    let is_stated = |cause: &&Cause| cause.included || !cause.is_nameless();
    let causes: Vec<&Cause> = report.iter().flat_map(|r| r.causes.iter().filter(is_stated)).collect();
    let included: Vec<&Cause> = causes.iter().copied().filter(|c| c.included).collect();
    let known = matches!(kind, Kind::Single | Kind::Several);
    let first = |n: usize| causes.iter().take(n).any(|c| hits(answer, c));
    let all_found = distinct(answer, &included, 0, &mut vec![false; included.len()]);
    let places = answer.places();
    let largest = report.and_then(|r| r.gap.by_state.iter().max_by(|a, b| a.share.total_cmp(&b.share)));
    let closed = report.and_then(|r| r.closure.closed).unwrap_or(0.0);
    Judged {
        id: answer.id.clone(),
        kind,
        snr: answer.oracle.snr,
        truth: answer.effects.iter().map(short).collect::<Vec<_>>().join(" + "),
        verdict: report.map(|r| r.verdict),
        p_value: report.map(|r| r.gap.p_value),
        best: causes.first().map(|c| short(&stated(c))),
        probability: causes.first().map(|c| c.probability),
        detected: report.is_some_and(|r| r.gap.p_value < LEVEL),
        any_included: !included.is_empty(),
        right_verdict: report.is_some_and(|r| match kind {
            Kind::Null => r.verdict == Verdict::NoGap,
            Kind::Single | Kind::Several => r.verdict == Verdict::Explained,
            Kind::Outside => matches!(r.verdict, Verdict::Unexplained | Verdict::PartlyExplained),
        }),
        right_state: (kind != Kind::Null).then(|| largest.is_some_and(|s| places.contains(&s.state.as_str()))),
        right_cause_state: known.then(|| causes.first().is_some_and(|c| places.contains(&c.state.as_str()))),
        top_1: known.then(|| first(1)),
        top_3: known.then(|| first(3)),
        named: known.then(|| causes.first().is_some_and(|c| named(answer, c, None))),
        all_found: known.then_some(all_found),
        exact: known.then_some(all_found && included.len() == answer.effects.len()),
        group_size: causes.first().filter(|_| known).map(|c| c.equivalent.len() + 1),
        closure: answer.oracle.closure_oracle.filter(|o| known && *o > 0.0).map(|oracle| closed / oracle),
        stated: causes.iter().map(|c| (c.probability, hits(answer, c))).collect(),
        stated_strictly: causes.iter().map(|c| (c.probability, is_itself(answer, c))).collect(),
    }
}

/// The cause is an effect of the case, by name or by its group.
fn hits(answer: &Answer, cause: &Cause) -> bool {
    named(answer, cause, None) || is_itself(answer, cause)
}

/// The same, but what covers a part of an effect is no hit.
fn is_itself(answer: &Answer, cause: &Cause) -> bool {
    let mut all = answer.effects.iter().chain(answer.accept.iter().map(|a| &a.name));
    let is_it = |effect: &TrueEffect| same(effect, (&cause.effect, &cause.state, &cause.variables));
    all.any(is_it) || answer.effects.iter().any(|e| cause.equivalent.contains(&e.effect))
}

/// The cause has a name of effect `of`, or of any effect; what honestly covers a part counts outside the catalogue.
fn named(answer: &Answer, cause: &Cause, of: Option<usize>) -> bool {
    is_named(answer, (&cause.effect, &cause.state, &cause.variables), of)
}

/// The same of an effect's id, its state and what it depends on.
pub(super) fn is_named(answer: &Answer, named: (&str, &str, &[String]), of: Option<usize>) -> bool {
    let own = answer.effects.iter().enumerate();
    let other = answer.accept.iter().chain(&answer.partial).map(|a| (a.of, &a.name));
    own.chain(other).any(|(i, effect)| of.is_none_or(|of| of == i) && same(effect, named))
}

/// Effect, state and the set of variables agree.
fn same(effect: &TrueEffect, (id, state, variables): (&str, &str, &[String])) -> bool {
    effect.effect == id
        && effect.state == state
        && effect.variables.iter().all(|v| variables.contains(v))
        && variables.iter().all(|v| effect.variables.contains(v))
}

/// Effects from `effect` on each have an included cause of their own that is not taken yet.
fn distinct(answer: &Answer, included: &[&Cause], effect: usize, taken: &mut Vec<bool>) -> bool {
    let Some(truth) = answer.effects.get(effect) else { return true };
    for (i, cause) in included.iter().enumerate() {
        if taken[i] || !(named(answer, cause, Some(effect)) || cause.equivalent.contains(&truth.effect)) {
            continue;
        }
        taken[i] = true;
        if distinct(answer, included, effect + 1, taken) {
            return true;
        }
        taken[i] = false;
    }
    false
}

pub(super) fn stated(cause: &Cause) -> TrueEffect {
    TrueEffect { effect: cause.effect.clone(), state: cause.state.clone(), variables: cause.variables.clone() }
}

/// `coulomb_friction v(v)`.
pub(super) fn short(effect: &TrueEffect) -> String {
    let variables =
        if effect.variables.is_empty() { String::new() } else { format!("({})", effect.variables.join(",")) };
    format!("{} {}{variables}", effect.effect, effect.state)
}
