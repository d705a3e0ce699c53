//! Held or interpolated: what the control does between its samples.

use crate::diagnose::Diagnose;
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::steps::attribute::{Judged, judge, suspect};
use crate::diagnose::steps::contest::Contest;
use crate::error::Result;
use crate::refine::{Experiment, Hold};

/// The verdict under interpolated controls, where that is clearly the better account of the logs.
///
/// Decided with the causes in place: a gap of any kind can make one hold look better than the other, and
/// interpolation with a delay of half a sample is nearly a held control.
pub(crate) fn reconsider_hold(
    contest: &Contest<'_>,
    held: Judged,
    rivals: &[Rival],
    settings: &Diagnose,
    notes: &mut Vec<String>,
) -> Result<Judged> {
    /// Far beyond what chance gives one binary choice, in nats.
    const CLEARLY: f64 = 10.0;
    if !held.detected.gap || held.nominal.system.n_controls() == 0 {
        return Ok(held);
    }
    let linear = |fit: &Fitted| {
        let experiment = Experiment { hold: Hold::Linear, ..fit.experiment.clone() };
        fit.on(&experiment, &contest.settings)
    };
    let is_better = |fit: &Fitted| linear(fit).is_ok_and(|other| contest.score(&other) > contest.score(fit) + CLEARLY);
    let mut own_notes = Vec::new();
    let interpolated = if is_better(&held.outcome.best) {
        judge(contest, linear(&held.nominal)?, rivals, settings, &mut own_notes)?
    } else if is_better(&held.nominal) {
        // Causes that take the control as it is held look no better when it is not: only that no gap is left would count.
        let suspected = suspect(contest, linear(&held.nominal)?, rivals)?;
        if suspected.detected.gap {
            return Ok(held);
        }
        suspected.without_gap()
    } else {
        return Ok(held);
    };
    let delayed = |judged: &Judged| judged.outcome.best.hypotheses.iter().any(|h| h.is_imitated_by_hold());
    let wins = contest.score(&interpolated.outcome.best) > contest.score(&held.outcome.best) + CLEARLY;
    // A delay under interpolation that the held control does not need is the phantom of half a sample.
    let phantom = delayed(&interpolated) && !delayed(&held);
    let still_gaping = interpolated.detected.gap && !wins;
    if phantom || still_gaping {
        return Ok(held);
    }
    notes.append(&mut own_notes);
    notes.push("the control looks interpolated between samples, not held: no delay below one sample is claimed".into());
    Ok(interpolated)
}
