//! Tolerated parameters that turn out to be causes.

use super::detect::TOLERABLE;
use super::fitted::{Fitted, Moved};
use super::search::{CONVINCING, Contest, MATERIAL};
use super::settle::{again_with, values};
use crate::error::Result;

/// Tolerated parameters that the logs move clearly and materially are causes, and must win their place like any other.
///
/// Returns the nominal model without their tolerance, and the winner with them as hypotheses.
pub(super) fn charge_tolerated(
    contest: &Contest<'_>,
    nominal: Fitted,
    best: Fitted,
    notes: &mut Vec<String>,
) -> Result<(Fitted, Fitted)> {
    let count = best.count().max(2) as f64;
    let convincing = |moved: &Moved| {
        let material = if moved.is_believed { TOLERABLE } else { MATERIAL };
        moved.squared > 2.0 * CONVINCING + count.ln() && moved.squared > material * count * best.misfit().min(1.0)
    };
    let mut charged: Vec<usize> = best.moved().into_iter().filter(convincing).map(|m| m.parameter).collect();
    let strained =
        (0..best.free.len()).filter(|&place| best.is_strained(place)).map(|place| best.free[place].parameter);
    charged.extend(strained);
    charged.sort_unstable();
    charged.dedup();
    if charged.is_empty() {
        return Ok((nominal, best));
    }
    let free = nominal.free.iter().filter(|f| !charged.contains(&f.parameter)).cloned().collect();
    let fitted = Fitted::nominal(nominal.system.clone(), nominal.experiment.clone(), free, &contest.settings)?;
    let base = Fitted { model_error: nominal.model_error, ..fitted };
    let mut causes = Vec::new();
    for &index in &charged {
        let parameter = &nominal.system.model().parameters[index];
        let Some(hypothesis) =
            contest.hypotheses.iter().find(|h| h.id() == "parameter_error" && h.variables[0] == parameter.name)
        else {
            return Ok((nominal, best));
        };
        causes.push((hypothesis, vec![best.refined.parameters[index]]));
        let name = &parameter.name;
        notes.push(format!("the logs move parameter `{name}` from its nominal value; it is reported as a cause even where it stays within its tolerance"));
    }
    causes.extend((0..best.hypotheses.len()).map(|place| (&best.hypotheses[place], values(&best, place))));
    let fit = again_with(contest, &base, &best, &causes)?;
    Ok((base, fit))
}
