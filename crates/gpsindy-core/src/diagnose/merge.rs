//! Two effects for which one other stands.

use super::fitted::Fitted;
use super::search::{Contest, Known};
use super::settle::without;
use crate::error::Result;

/// The winner with one effect in the place of two, where the two say nothing that convinces beyond it. One of the two is
/// the effect that removes least (`removed`, by effect).
///
/// A search that adds one effect at a time, beside tolerated parameters that give way, can come to several where one
/// alone would do: taking one out at a time does not lead back.
pub(super) fn merged(
    contest: &Contest<'_>,
    nominal: &Fitted,
    best: &Fitted,
    removed: &[f64],
    known: &mut Vec<Known>,
) -> Result<Option<Fitted>> {
    let count = best.hypotheses.len();
    let mut simplest: Option<Fitted> = None;
    let Some(weakest) = (0..removed.len()).min_by(|&a, &b| removed[a].total_cmp(&removed[b])) else { return Ok(None) };
    for other in (0..count).filter(|&o| o != weakest) {
        let Ok(one_less) = without(contest, nominal, best, weakest.max(other)) else { continue };
        let Ok(rest) = without(contest, nominal, &one_less, weakest.min(other)) else { continue };
        let fits = contest.expand_once(&rest, "one for two", known)?;
        let fits = fits.iter().filter(|f| f.hypotheses.len() == count - 1);
        if let Some(fit) = fits.max_by(|a, b| contest.score(a).total_cmp(&contest.score(b)))
            && simplest.as_ref().is_none_or(|s| contest.score(fit) > contest.score(s))
        {
            simplest = Some(fit.clone());
        }
    }
    Ok(simplest.map(|s| s.again(&contest.settings)).filter(|s| !contest.is_convincing(best, s)))
}
