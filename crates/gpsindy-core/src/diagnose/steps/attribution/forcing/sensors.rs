//! Sensors: columns of which the causes leave what is no gap, but an error of the sensor with a memory.

use super::account::Account;
use crate::diagnose::fit::colours::colour::Colour;
use crate::diagnose::limits::FAR;
use crate::diagnose::limits::weigh::LIKELY;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Judged, probability_of_random};
use crate::error::Result;

/// The verdict with the columns whose sensors err with a memory beside its causes: the logs speak of such an error, and no function of what moves
/// is left beside it. `coloured`: the causes with coloured noise on the columns, where that is known.
pub(super) fn with_sensors(contest: &Contest<'_>, mut judged: Judged, coloured: Option<Account>) -> Result<Judged> {
    let best = &judged.outcome.best;
    let is_doubted = |c: &Colour| !c.is_of_a_sensor() && c.variance() < FAR;
    let has_causes = judged.detected.gap && !best.hypotheses.is_empty();
    if !has_causes || !best.evidence.colours.iter().any(is_doubted) || contest.run.is_out_of_time() {
        return Ok(judged);
    }
    let Some(account) = coloured.map_or_else(|| Account::unforced(contest, best), |known| Ok(Some(known)))? else {
        return Ok(judged);
    };
    let mut columns = account.columns();
    columns.retain(|&column| is_doubted(&best.evidence.colours[column]));
    if !columns.is_empty() && probability_of_random(account.functions(contest)?) >= LIKELY {
        judged.sensors = columns;
    }
    Ok(judged)
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
    }
}
