//! Leave one effect out: what is said of a case when its effect is taken out of the catalogue.
//!
//! Whatever is then called explained is explained by something else. It is wrong unless the diagnosis with the whole catalogue had
//! said that these logs can't distinguish the two.

use super::answers::{Answer, Suite};
use super::judge::{short, stated};
use super::rate::Rate;
use gpsindy_core::diagnose::report::{Diagnosis, Verdict};
use serde::Serialize;
use std::collections::BTreeMap;

/// What was said of all cases with an effect of the catalogue, each of their effects left out in turn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// Explained by an effect that the whole catalogue's diagnosis did not call equivalent.
    pub wrongly_explained: Rate,
    /// The same, where the held-out logs show it: they are missed by more than with the effect itself.
    pub visibly_wrong: Rate,
    /// Explained at all.
    pub explained: Rate,
    /// Every case, in the suite's order.
    pub cases: Vec<LeftOutCase>,
}

/// One case without one of its effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOutCase {
    /// The case.
    pub id: String,
    /// The effect that was left out, as text.
    pub left_out: String,
    /// Verdict; absent where there is no diagnosis.
    pub verdict: Option<Verdict>,
    /// The included causes, as text.
    pub named: Vec<String>,
    /// The whole catalogue's diagnosis had called one of them equivalent to the effect.
    pub equivalent: bool,
    /// The held-out logs are missed by no more than the diagnosis with the whole catalogue misses them.
    pub follows: bool,
}

/// Squared error (noise units) on held-out logs by which an imitation may exceed the effect itself and count as no worse: a twentieth of the
/// noise's deviation, as in the check of typicality.
const AS_GOOD: f64 = 0.0025;

impl Answer {
    /// The ids that have to go where effect number `of` is left out: its own, and those of other names that the suite accepts for it.
    pub fn ids_of(&self, of: usize) -> Vec<String> {
        let own = self.effects.get(of).map(|effect| effect.effect.clone());
        let others = self.accept.iter().filter(|a| a.of == of).map(|a| a.name.effect.clone());
        let mut ids: Vec<String> = own.into_iter().chain(others).collect();
        ids.sort();
        ids.dedup();
        ids
    }
}

impl LeftOut {
    /// From the diagnoses with the whole catalogue, by id of the case, and those `without` an effect, by id and number of the effect.
    pub fn new(
        suite: &Suite,
        whole: &BTreeMap<String, Diagnosis>,
        without: &BTreeMap<(String, usize), Diagnosis>,
    ) -> Self {
        let all = suite.cases.iter().filter(|answer| answer.in_catalogue);
        let all = all.flat_map(|answer| (0..answer.effects.len()).map(move |of| (answer, of)));
        let cases: Vec<LeftOutCase> = all
            .map(|(answer, of)| case(answer, of, whole.get(&answer.id), without.get(&(answer.id.clone(), of))))
            .collect();
        let explained = |c: &LeftOutCase| c.verdict == Some(Verdict::Explained);
        Self {
            wrongly_explained: Rate::count(cases.iter().map(|c| explained(c) && !c.equivalent)),
            visibly_wrong: Rate::count(cases.iter().map(|c| explained(c) && !c.equivalent && !c.follows)),
            explained: Rate::count(cases.iter().map(explained)),
            cases,
        }
    }
}

fn case(answer: &Answer, of: usize, whole: Option<&Diagnosis>, without: Option<&Diagnosis>) -> LeftOutCase {
    let ids = answer.ids_of(of);
    let named: Vec<_> = without.into_iter().flat_map(Diagnosis::included).collect();
    // What the whole catalogue's diagnosis said of the effect: it, and what can't be distinguished from it.
    let groups = whole.into_iter().flat_map(Diagnosis::included).map(|cause| {
        let mut group = cause.equivalent.clone();
        group.push(cause.effect.clone());
        group
    });
    let groups: Vec<Vec<String>> = groups.filter(|group| ids.iter().any(|id| group.contains(id))).collect();
    let missed = |diagnosis: Option<&Diagnosis>| Some(diagnosis?.closure.after?.powi(2));
    LeftOutCase {
        id: answer.id.clone(),
        left_out: short(&answer.effects[of]),
        verdict: without.map(|d| d.verdict),
        equivalent: named.iter().any(|cause| groups.iter().any(|group| group.contains(&cause.effect))),
        follows: missed(without).zip(missed(whole)).is_some_and(|(without, whole)| without <= whole + AS_GOOD),
        named: named.iter().map(|cause| short(&stated(cause))).collect(),
    }
}
