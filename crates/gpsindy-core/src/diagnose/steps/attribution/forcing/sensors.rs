//! Sensors: columns of which the causes leave what is no gap, but an error of the sensor with a memory.

use super::account::Account;
use crate::diagnose::fit::colours::colour::Colour;
use crate::diagnose::limits::FAR;
use crate::diagnose::limits::weigh::LIKELY;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Judged, probability_of_random};
use crate::error::Result;

/// The verdict with the columns whose sensors err with a memory beside its causes: the logs speak of such an error, and no function of what moves
/// is left beside it. `plain`: the causes with coloured noise alone, where that is known.
pub(super) fn with_sensors(contest: &Contest<'_>, judged: Judged, plain: Option<Account>) -> Result<Judged> {
    let best = &judged.outcome.best;
    let has_causes = judged.detected.gap && !best.hypotheses.is_empty();
    if !has_causes || !best.evidence.colours.iter().any(is_doubted) || contest.run.is_out_of_time() {
        return Ok(judged);
    }
    let known = plain.filter(|plain| plain.fit.has_effects_of(best));
    let plain = known.map_or_else(|| Account::unforced(contest, best), |known| Ok(Some(known)))?;
    let Some(plain) = plain.filter(|plain| !doubted(&judged, plain).is_empty()) else { return Ok(judged) };
    let is_random = probability_of_random(plain.functions(contest)?) >= LIKELY;
    Ok(if is_random { beside_sensors(judged, &plain) } else { judged })
}

/// The verdict with the columns that have coloured noise in an account of its causes beside which no function is left.
pub(super) fn beside_sensors(mut judged: Judged, plain: &Account) -> Judged {
    judged.sensors = doubted(&judged, plain);
    judged
}

/// The columns of coloured noise of which the causes leave more than differences of samples show.
fn doubted(judged: &Judged, plain: &Account) -> Vec<usize> {
    let mut columns = plain.columns();
    columns.retain(|&column| is_doubted(&judged.outcome.best.evidence.colours[column]));
    columns
}

/// Whether the sensor's part in it is in doubt.
fn is_doubted(colour: &Colour) -> bool {
    !colour.is_of_a_sensor() && colour.variance() < FAR
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::report::Verdict;
    use crate::diagnose::steps::attribution::forcing::tests::logs_of_boat;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;

    #[test]
    fn a_sensor_that_errs_with_a_memory_does_not_stand_against_the_cause_beside_it() {
        // Its error lasts for six samples and is as large as twice its noise.
        let (model, data) = logs_of_boat(0.02, |w, _| -0.6 * w * w.abs());
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        assert_eq!(found.verdict, Verdict::Explained, "{:?}", found.checks);
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["quadratic_drag"]);
        assert!(found.notes.iter().any(|note| note.starts_with("what is left of w is ")), "{:?}", found.notes);
    }
}
