//! Hold: whether the control is held or interpolated between its samples.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::unless_refused;
use crate::diagnose::limits::{Budget, HOLD};
use crate::diagnose::notes::Note;
use crate::diagnose::steps::attribution::attribute::attribute;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::detect::detect;
use crate::diagnose::steps::findings::Judged;
use crate::diagnose::steps::logs::prepare::Prepared;
use crate::error::Result;
use crate::refine::{Experiment, Hold};

/// The verdict under interpolated controls, where that is clearly the better account of the logs; the user does not say which.
///
/// Decided with the causes in place: a gap of any kind can make one hold look better than the other, and
/// interpolation with a delay of half a sample is nearly a held control.
pub(crate) fn reconsider_hold(contest: &Contest<'_>, prepared: &Prepared, held: Judged) -> Result<Judged> {
    let start = &prepared.nominal;
    let is_moot = !prepared.may_interpolate || contest.run.is_out_of_time();
    if is_moot || !held.detected.gap || held.nominal.system.n_controls() == 0 {
        return Ok(held);
    }
    let linear = |fit: &Contestant| {
        let experiment = Experiment { hold: Hold::Linear, ..fit.experiment.clone() };
        contest.fitter.on(fit, &experiment, Budget::Usual)
    };
    let is_better = |fit: &Contestant| -> Result<bool> {
        let other = unless_refused(linear(fit))?;
        Ok(other.is_some_and(|other| contest.score(&other) > contest.score(fit) + HOLD))
    };
    let attempt = || -> Result<Option<Judged>> {
        if is_better(&held.outcome.best)? {
            return Ok(Some(attribute(contest, detect(contest, linear(start)?)?)?));
        }
        if !is_better(start)? {
            return Ok(None);
        }
        // Causes that take the control as it is held look no better when it is not: only that no gap is left would count.
        let suspected = detect(contest, linear(start)?)?;
        Ok((!suspected.detected.gap).then(|| suspected.without_gap()))
    };
    let (interpolated, said) = contest.run.notes.of_attempt(attempt);
    let Some(interpolated) = interpolated? else { return Ok(held) };
    let delayed = |judged: &Judged| judged.outcome.best.hypotheses.iter().any(|h| h.is_imitated_by_hold());
    let wins = contest.score(&interpolated.outcome.best) > contest.score(&held.outcome.best) + HOLD;
    // A delay under interpolation that the held control does not need is the phantom of half a sample.
    let phantom = delayed(&interpolated) && !delayed(&held);
    let still_gaping = interpolated.detected.gap && !wins;
    if phantom || still_gaping {
        return Ok(held);
    }
    said.into_iter().chain([Note::Interpolated]).for_each(|note| contest.run.notes.say(note));
    Ok(interpolated)
}
