//! Whether a machine is like those that calibrate the prediction sets. Where it is not, no coverage is known, and none is stated.
//!
//! What is compared is what the errors of a diagnosis depend on: how the suspects were chosen, how many states there are to mistake for each other,
//! how many samples decide, how large the gap is above the noise, and how much of it is left.

use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::limits::verify::PERCENT;
use crate::diagnose::limits::weigh::conformal::{DRAWN_GAPS, DRAWN_REST, DRAWN_SAMPLES, DRAWN_STATES};
use crate::diagnose::report::Diagnosis;

/// What a report does not show of its diagnosis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Conditions {
    /// All effects of the catalogue, by its own rules, were the suspects, and no other.
    pub(crate) has_usual_suspects: bool,
    /// The simulator is no set of equations: it steps.
    pub(crate) steps: bool,
    /// Of the model.
    pub(crate) states: usize,
    /// Of the training logs.
    pub(crate) samples: usize,
}

/// Why they are not those of the machines that calibrate the sets.
pub(super) fn unlike_conditions(conditions: &Conditions) -> Option<String> {
    if !conditions.has_usual_suspects {
        return Some("its coverage is known only where exactly the catalogue is the suspects".into());
    }
    if conditions.steps {
        return Some("its coverage is known only for simulators that are equations, and this one steps".into());
    }
    let outside = |what: &str, count: usize, (fewest, most): (usize, usize)| {
        let is_outside = count < fewest || count > most;
        is_outside.then(|| {
            format!("the machines that its coverage is known for have {fewest} to {most} {what}, this one {count}")
        })
    };
    outside("states", conditions.states, DRAWN_STATES)
        .or_else(|| outside("training samples", conditions.samples, DRAWN_SAMPLES))
}

/// Why a report is not like those of all machines that calibrate the sets, as far as it shows that; `None` where it is like them.
pub fn unlike(report: &Diagnosis) -> Option<String> {
    if report.is_cut() {
        return Some("its coverage is known only for searches that were not cut short".into());
    }
    if report.included().any(|cause| !cause.is_nameless() && Effect::from_id(&cause.effect).is_none()) {
        return Some("its coverage is known only for effects of the catalogue".into());
    }
    let (least, most) = DRAWN_GAPS;
    if !report.closure.before.is_some_and(|before| (least..=most).contains(&before)) {
        return Some(format!(
            "the machines that its coverage is known for miss the held-out logs by {least} to {most} times the noise, {}",
            report.closure.before.map_or("this one diverges".into(), |before| format!("this one by {before:.3}"))
        ));
    }
    let has_named = report.included().any(|cause| !cause.is_nameless());
    let rest = report.unexplained.share;
    (has_named && rest > DRAWN_REST).then(|| {
        let percent = |share: f64| (PERCENT * share).ceil();
        format!(
            "the causes of the machines that its coverage is known for leave {} % of the gap at most, these {} %",
            percent(DRAWN_REST),
            percent(rest)
        )
    })
}
