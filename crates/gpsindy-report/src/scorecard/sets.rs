//! Prediction sets: how often they hold every missing effect, how large they are, and what calibrates them.

use super::answers::{Answer, Kind, Suite, TrueEffect};
use super::judge::is_named;
use super::rate::{Rate, mean};
use gpsindy_core::diagnose::Effect;
use gpsindy_core::diagnose::conformal::{COVERAGE, Credits, group, members, prediction_set, threshold};
use gpsindy_core::diagnose::report::{Cause, Diagnosis, PredictionSet, SetCause};
use serde::Serialize;
use std::collections::BTreeMap;

/// Prediction sets of the cases with an effect and a gap that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictionSets {
    /// Sets that hold every effect of the case. A report without one, as of an earlier version, gets the one that its numbers give.
    pub covered: Rate,
    /// Those that hold an effect that the report does not list.
    pub none_of_these: Rate,
    /// Mean number of named effects in a set; absent without sets.
    pub mean_size: Option<f64>,
    /// Cases whose report says why it states no set.
    pub abstained: usize,
    /// Cases with an effect in which no gap was found, so that there is no set.
    pub undetected: usize,
    /// Held-out rollout error of the nominal models, in units of the noise, least and most.
    pub gaps: (f64, f64),
    /// Most of the gap that included causes leave.
    pub rest: f64,
    /// The table that these cases would calibrate: all of them together first, then group by group.
    pub calibration: Vec<CalibrationGroup>,
    /// Every case that is in it.
    pub cases: Vec<CalibrationCase>,
}

/// A line of the calibration table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationGroup {
    /// `all`, the family of the leading included cause, or `unexplained`.
    pub group: String,
    /// Cases.
    pub cases: usize,
    /// The threshold; absent where the cases are too few for one.
    pub least: Option<f64>,
    /// Cases whose effects are all in the set that the other cases calibrate: of their group, or of all groups where these are too few.
    pub covered: Rate,
    /// Mean number of named effects in these sets.
    pub mean_size: Option<f64>,
    /// Those that hold an effect that the report does not list.
    pub none_of_these: Rate,
}

/// A case of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationCase {
    /// The case.
    pub id: String,
    /// Its group.
    pub group: &'static str,
    /// Least credit that the report gives to one of its effects.
    pub least: f64,
}

/// A case with its report.
struct Scored<'a> {
    answer: &'a Answer,
    report: &'a Diagnosis,
    group: &'static str,
    least: f64,
}

impl PredictionSets {
    /// Of reports that state a confidence: those of another tool have no probabilities to judge. Absent without one.
    pub fn new(suite: &Suite, diagnoses: &BTreeMap<String, Diagnosis>) -> Option<Self> {
        let asked = suite.cases.iter().filter(|answer| answer.kind() != Kind::Null);
        let own = |report: &&Diagnosis| report.confidence.is_some();
        let all: Vec<(&Answer, &Diagnosis)> =
            asked.filter_map(|answer| Some((answer, diagnoses.get(&answer.id).filter(own)?))).collect();
        let found = all.iter().filter(|(_, report)| report.gap.detected);
        let scored: Vec<Scored<'_>> = found
            .map(|&(answer, report)| Scored { answer, report, group: group(report), least: least(answer, report) })
            .collect();
        if scored.is_empty() {
            return None;
        }
        let stated = |one: &Scored<'_>| match &one.report.prediction_set {
            Some(set) => Some(set.clone()),
            None if one.report.no_prediction_set.is_some() => None,
            None => prediction_set(one.report),
        };
        let sets: Vec<(&Scored<'_>, PredictionSet)> =
            scored.iter().filter_map(|one| Some((one, stated(one)?))).collect();
        let covers = |(one, set): &(&Scored<'_>, PredictionSet)| covers(one, &set.causes, set.none_of_these);
        // JSON has no infinity: a model that diverges counts as the largest number.
        let gaps = || scored.iter().map(|one| one.report.closure.before.unwrap_or(f64::MAX));
        let named = scored.iter().filter(|one| one.report.included().any(|cause| !cause.is_nameless()));
        let rests = named.map(|one| one.report.unexplained.share);
        Some(Self {
            covered: Rate::count(sets.iter().map(covers)),
            none_of_these: Rate::count(sets.iter().map(|(_, set)| set.none_of_these)),
            mean_size: mean(sets.iter().map(|(_, set)| size(&set.causes))),
            abstained: scored.len() - sets.len(),
            undetected: all.len() - scored.len(),
            gaps: (gaps().fold(f64::INFINITY, f64::min), gaps().fold(0.0, f64::max)),
            rest: rests.fold(0.0, f64::max),
            calibration: calibration(&scored),
            cases: scored
                .iter()
                .map(|one| CalibrationCase { id: one.answer.id.clone(), group: one.group, least: one.least })
                .collect(),
        })
    }
}

/// The cause is effect `of` of the case, by its own or another right name, or by what the report says the logs cannot distinguish.
fn is_right(answer: &Answer, of: usize, effect: &TrueEffect, cause: &Cause) -> bool {
    // What covers a part of an effect outside the catalogue is not that effect.
    let is_known = Effect::from_id(&effect.effect).is_some();
    let named = (cause.effect.as_str(), cause.state.as_str(), &cause.variables[..]);
    is_known && (is_named(answer, named, Some(of)) || cause.equivalent.contains(&effect.effect))
}

/// Least credit that a report gives to an effect of the case; one that no listed cause is right about has that of an effect that is not listed.
fn least(answer: &Answer, report: &Diagnosis) -> f64 {
    let credits = Credits::of(report);
    let best = |(of, effect): (usize, &TrueEffect)| {
        let right = report.causes.iter().zip(&credits.causes).filter(|(cause, _)| is_right(answer, of, effect, cause));
        right.map(|(_, credit)| *credit).reduce(f64::max).unwrap_or(credits.unlisted)
    };
    answer.effects.iter().enumerate().map(best).fold(1.0, f64::min)
}

/// Whether a set holds every effect of the case.
fn covers(one: &Scored<'_>, causes: &[SetCause], none_of_these: bool) -> bool {
    let is_in = |cause: &Cause| {
        let own = (&cause.effect, &cause.state, &cause.place, &cause.variables);
        causes.iter().any(|member| (&member.effect, &member.state, &member.place, &member.variables) == own)
    };
    one.answer.effects.iter().enumerate().all(|(of, effect)| {
        let mut right = one.report.causes.iter().filter(|cause| is_right(one.answer, of, effect, cause)).peekable();
        if right.peek().is_none() { none_of_these } else { right.any(is_in) }
    })
}

/// Named effects of a set: a function without a name is none.
fn size(causes: &[SetCause]) -> f64 {
    causes.iter().filter(|cause| !cause.is_nameless()).count() as f64
}

/// The table: all cases, then each group.
fn calibration(scored: &[Scored<'_>]) -> Vec<CalibrationGroup> {
    let mut groups: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, one) in scored.iter().enumerate() {
        groups.entry(one.group).or_default().push(i);
    }
    let everyone: Vec<usize> = (0..scored.len()).collect();
    let credits = |places: &[usize], without: Option<usize>| -> Vec<f64> {
        places.iter().filter(|&&i| Some(i) != without).map(|&i| scored[i].least).collect()
    };
    // The set of everything that is listed, and more, where there are too few cases.
    let left_out = |i: usize| {
        let own = groups.get(scored[i].group).map_or(&[][..], |places| &places[..]);
        let pooled = || threshold(&credits(&everyone, Some(i)), COVERAGE);
        let least = threshold(&credits(own, Some(i)), COVERAGE).or_else(pooled).unwrap_or(0.0);
        members(scored[i].report, least)
    };
    let sets: Vec<(Vec<SetCause>, bool)> = everyone.iter().map(|&i| left_out(i)).collect();
    let line = |group: &str, places: &[usize]| CalibrationGroup {
        group: group.into(),
        cases: places.len(),
        least: threshold(&credits(places, None), COVERAGE),
        covered: Rate::count(places.iter().map(|&i| covers(&scored[i], &sets[i].0, sets[i].1))),
        mean_size: mean(places.iter().map(|&i| size(&sets[i].0))),
        none_of_these: Rate::count(places.iter().map(|&i| sets[i].1)),
    };
    std::iter::once(line("all", &everyone)).chain(groups.iter().map(|(group, places)| line(group, places))).collect()
}
