//! Effects that a search picked up from what it can't explain are left out again.

use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::steps::attribute::without;
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::detect::rival_p_value;

/// Share of the gap below which an effect has no name while structure without one is left.
///
/// Where the whole is not explained, its residual is no noise, and evidence that counts it as noise finds a use for
/// any flexible effect.
pub(crate) const NAMED: f64 = 0.01;

/// Share of the gap that counts: a rest below it is none, and an effect that removes less is no cause of the gap.
pub(crate) const REST: f64 = 0.002;

/// The winner without effects that remove next to nothing of the gap; where structure without a name is left anyhow,
/// without those that remove little of it.
///
/// Also says whether such structure is left.
pub(crate) fn pruned(contest: &Contest<'_>, nominal: &Fitted, mut best: Fitted, rivals: &[Rival]) -> (Fitted, bool) {
    loop {
        let gains = contest.rivals(&best, rivals);
        let is_large = strongest(&best, &gains).is_some_and(|(_, energy)| energy > STRUCTURE);
        let is_significant = rival_p_value(&gains, &best) <= 0.01;
        let is_structured = is_large && is_significant || best.is_predictable();
        if best.hypotheses.len() < 2 {
            return (best, is_structured);
        }
        let share = if is_structured { NAMED } else { REST };
        // An effect without which nothing can be fitted is none to leave out.
        let rests = (0..best.hypotheses.len()).filter_map(|place| without(contest, nominal, &best, place).ok());
        let removed = |rest: &Fitted| rest.misfit() - best.misfit();
        match rests.min_by(|a, b| removed(a).total_cmp(&removed(b))) {
            Some(rest) if removed(&rest) < share * gap_size(nominal, &best) => best = rest,
            _ => return (best, is_structured),
        }
    }
}

/// Mean squared residual (noise units) that the nominal model leaves beyond noise.
pub(crate) fn gap_size(nominal: &Fitted, best: &Fitted) -> f64 {
    nominal.misfit() - best.misfit().min(1.0)
}

/// Mean squared structure (in noise units) above which a rest counts as more than the model's own roughness.
pub(crate) const STRUCTURE: f64 = 0.1;

/// The rival that gains most at `best`, and the mean squared residual that it would remove.
pub(crate) fn strongest(best: &Fitted, gains: &[(f64, usize)]) -> Option<(usize, f64)> {
    let count = best.count().max(1) as f64;
    let innovation = best.colours.iter().map(|c| c.innovation * c.count as f64).sum::<f64>() / count;
    let (place, &(gain, degrees)) = gains
        .iter()
        .enumerate()
        .max_by(|a, b| (a.1.0 - 2.0 * a.1.1 as f64).total_cmp(&(b.1.0 - 2.0 * b.1.1 as f64)))?;
    Some((place, (gain - degrees as f64).max(0.0) / count * innovation))
}
