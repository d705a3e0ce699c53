//! Prediction sets: among which effects the missing ones are, with a stated coverage, by split conformal prediction within groups of reports.
//!
//! Every effect that a report lists has a *credit* between 0 and 1, and so has "an effect that it does not list". The set holds what has at
//! least the threshold. Of a drawn machine, whose effects are known, what counts is the least credit among those of its effects; the
//! threshold is the `ceil((n + 1) * coverage)`-th largest of these over the `n` machines of the group. Where a new machine is exchangeable with these, all
//! of its effects are then in the set in a share `coverage` of machines, at least.
//!
//! Source: Vovk, Gammerman and Shafer 2005, Algorithmic Learning in a Random World, sections 2.2 and 4.5 (Mondrian predictors); in this form Papadopoulos et al.
//! 2002, Inductive confidence machines for regression.

mod alike;

pub(crate) use alike::Conditions;
pub use alike::unlike;

use super::catalogue::list::Effect;
use super::limits::weigh::LIKELY;
pub use super::limits::weigh::conformal::COVERAGE;
use super::limits::weigh::conformal::{BY_FAMILY, POOLED};
use super::report::{Cause, Diagnosis, PredictionSet, SetCalibration, SetCause};

/// The group of reports in which no cause is included.
const UNEXPLAINED: &str = "unexplained";

/// The group of all reports.
const ALL: &str = "all";

/// How far a report stands behind each effect, in 0..1.
///
/// Included causes have a credit of 1 whatever their probability, and so has structure that is likelier than not: a set without them would
/// contradict the report that it is in. Everything else has its probability. Of an effect that is not listed this is the probability of structure,
/// or, where that is more, by how much the probabilities of all causes miss the number of the included ones: how many of these are imitations, on average.
#[derive(Debug, Clone, PartialEq)]
pub struct Credits {
    /// Of every cause, in the report's order.
    pub causes: Vec<f64>,
    /// Of an effect that the report does not list, in the catalogue or not.
    pub unlisted: f64,
}

impl Credits {
    /// Of a report's causes.
    pub fn of(report: &Diagnosis) -> Self {
        let named = || report.causes.iter().filter(|cause| !cause.is_nameless());
        let included = named().filter(|cause| cause.included).count();
        let stated: f64 = named().map(|cause| cause.probability).sum();
        let structure = report.unexplained.probability;
        let has_rest = structure > LIKELY || named().count() < report.causes.len();
        let imitations = (included as f64 - stated).clamp(0.0, 1.0);
        let unlisted = if has_rest || included == 0 { 1.0 } else { structure.max(imitations) };
        let credit = |cause: &Cause| if cause.included || cause.is_nameless() { 1.0 } else { cause.probability };
        Self { causes: report.causes.iter().map(credit).collect(), unlisted }
    }
}

/// The group of reports in which a set is calibrated: the family of the leading included cause, `unexplained` without one.
pub fn group(report: &Diagnosis) -> &'static str {
    let leading = report.included().find(|cause| !cause.is_nameless());
    let family = |cause: &Cause| Effect::from_id(&cause.effect).map_or("custom", |effect| effect.family().id());
    leading.map_or(UNEXPLAINED, family)
}

/// The threshold from the least credits of `n` calibration cases: the `ceil((n + 1) * coverage)`-th largest. `None` where they are too few, so that only the set of everything has the coverage.
pub fn threshold(credits: &[f64], coverage: f64) -> Option<f64> {
    let rank = ((credits.len() + 1) as f64 * coverage).ceil() as usize;
    let mut sorted = credits.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    sorted.get(rank.max(1) - 1).copied()
}

/// What of a report is in the set with this threshold: causes with their twins, and whether an effect that is not listed is.
pub fn members(report: &Diagnosis, least: f64) -> (Vec<SetCause>, bool) {
    let credits = Credits::of(report);
    let mut all: Vec<SetCause> = Vec::new();
    for (cause, _) in report.causes.iter().zip(&credits.causes).filter(|(_, credit)| **credit >= least) {
        let own = (&cause.effect, &cause.state, &cause.place, &cause.variables);
        let twins = cause.twins.iter().map(|twin| (&twin.effect, &twin.state, &twin.place, &twin.variables));
        for (effect, state, place, variables) in std::iter::once(own).chain(twins) {
            let (effect, state) = (effect.clone(), state.clone());
            let member = SetCause { effect, state, place: place.clone(), variables: variables.clone() };
            if !all.contains(&member) {
                all.push(member);
            }
        }
    }
    (all, credits.unlisted >= least)
}

/// The set of a report; `None` without a gap, and for a report that [`unlike`] says is unlike all that calibrate it.
pub fn prediction_set(report: &Diagnosis) -> Option<PredictionSet> {
    (report.gap.detected && unlike(report).is_none()).then(|| set_of(report))
}

/// The set by the report's own group.
fn set_of(report: &Diagnosis) -> PredictionSet {
    let (name, cases, least) = calibration(group(report));
    let (causes, none_of_these) = members(report, least);
    let calibration = SetCalibration { cases, group: name.into() };
    PredictionSet { coverage: COVERAGE, causes, none_of_these, calibration }
}

/// Name, number of cases and threshold of the group, or those of all.
fn calibration(group: &str) -> (&'static str, usize, f64) {
    let own = BY_FAMILY.iter().find(|(name, ..)| *name == group);
    own.copied().unwrap_or((ALL, POOLED.0, POOLED.1))
}

/// States the report's set, or why it has none.
pub(crate) fn state(report: &mut Diagnosis, conditions: &Conditions) {
    if report.gap.detected {
        report.no_prediction_set = alike::unlike_conditions(conditions).or_else(|| unlike(report));
        report.prediction_set = report.no_prediction_set.is_none().then(|| set_of(report));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
