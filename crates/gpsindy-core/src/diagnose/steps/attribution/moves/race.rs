//! Race of the fits of a round, each carried on as far as it is worth it.

use super::{achieved, falls_short, promised};
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::begun::limited;
use crate::diagnose::limits::{BEHIND, Budget, CHAINED, FINALISTS, HELD_BACK, IN_SIGHT, OUT_OF_REACH, RACED};
use crate::diagnose::steps::attribution::contest::{Contest, keep_first_of_each};
use crate::error::Result;

/// Places of the fits with one more effect that promised most, of those whose first step fell short of it and which promised more than
/// any step of one more achieved: where a straight line holds but the size is far off, as at a rate limit, it is the step that misled.
fn held_back(base: &Contestant, fits: &[Contestant], promises: &[(Vec<&Hypothesis>, f64)]) -> Vec<usize> {
    let is_one_more = |fit: &Contestant| fit.hypotheses.len() == base.hypotheses.len() + 1;
    let most = fits.iter().filter(|fit| is_one_more(fit)).map(|fit| achieved(base, fit)).fold(0.0, f64::max);
    let short = |(place, fit): (usize, &Contestant)| {
        let promised = promised(fit, promises)?;
        let is_short = falls_short(achieved(base, fit), promised) && promised > most;
        (is_one_more(fit) && is_short).then_some((place, promised))
    };
    let mut found: Vec<(usize, f64)> = fits.iter().enumerate().filter_map(short).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.into_iter().take(HELD_BACK).map(|(place, _)| place).collect()
}

/// Fits after their first step, carried on as far as each is worth it beside their `base` and the best that is `known`; best first, one for each
/// set of effects. Those with a friction that is `holding` the machine go on in any case: it gets there in many steps.
pub(super) fn raced(
    contest: &Contest<'_>,
    (base, known): (&Contestant, Option<&Contestant>),
    fits: Vec<Contestant>,
    (promises, holding): (&[(Vec<&Hypothesis>, f64)], &[&Hypothesis]),
) -> Result<Vec<Contestant>> {
    let fitter = contest.fitter;
    let held_back = held_back(base, &fits, promises);
    let mut runners = leading(contest, fits, (RACED, RACED));
    held_back.into_iter().for_each(|place| runners[place].1 = true);
    let holds = |fit: &Contestant| fit.hypotheses.iter().any(|h| holding.contains(&h));
    runners.iter_mut().for_each(|(fit, runs)| *runs |= holds(fit));
    let mut fits = chained(contest, base, runners)?;
    contest.sort(&mut fits);
    let fits = keep_first_of_each(fits);
    let standing = || std::iter::once(base).chain(known);
    let best = standing().chain(fits.first()).map(|fit| contest.score(fit)).fold(f64::NEG_INFINITY, f64::max);
    let reach = OUT_OF_REACH * standing().map(|fit| fit.evidence.squares()).fold(f64::INFINITY, f64::min);
    let finish = |(place, (fit, leads)): (usize, (Contestant, bool))| {
        let may_gain = !fit.refined.converged || fit.beyond().next().is_some();
        // A leader that is far behind what stands already leads among what is no use.
        let leads =
            (leads || holds(&fit)) && fit.hypotheses.len() > base.hypotheses.len() && fit.evidence.squares() <= reach;
        // Beside a large residual few values count alone, and everything would be in sight.
        let is_in_sight = place < RACED && contest.score(&fit) >= best - IN_SIGHT;
        let may_win = (leads || is_in_sight) && may_gain;
        if !may_win || contest.run.is_out_of_time() {
            return Ok(fit);
        }
        // Starts are sought anew once the sizes are about right: a straight line underrates a curved effect.
        let fit = fitter.carried_on(fitter.refollowed(fit, Budget::Rough)?, Budget::Usual)?;
        // Beside what has a limited control already its place is known.
        let is_new = limited(&fit.system) != limited(&base.system);
        if is_new { fitter.with_begun(fit, Budget::Usual) } else { Ok(fit) }
    };
    let runners = leading(contest, fits, (FINALISTS, 1)).into_iter().enumerate().collect();
    let mut fits = base.each(runners, finish)?;
    contest.sort(&mut fits);
    Ok(fits)
}

/// Whether each is among the first so many by score, or by sum of squares: a fit that is not at rest leaves what no noise would,
/// and its score then says less of it than its sum of squares.
fn leading(
    contest: &Contest<'_>,
    fits: Vec<Contestant>,
    (by_score, by_squares): (usize, usize),
) -> Vec<(Contestant, bool)> {
    let first = |count: usize, value: &dyn Fn(&Contestant) -> f64| {
        let mut order: Vec<usize> = (0..fits.len()).collect();
        order.sort_by(|&a, &b| value(&fits[a]).total_cmp(&value(&fits[b])));
        order.truncate(count);
        order
    };
    let mut leaders = first(by_score, &|f| -contest.score(f));
    leaders.extend(first(by_squares, &|f| f.evidence.squares()));
    fits.into_iter().enumerate().map(|(place, fit)| (fit, leaders.contains(&place))).collect()
}

/// The `runners` that run carried on roughly. Of a simulator that steps, whose fits form chains, none goes on to the next fit that would end
/// behind `base`, or behind where another one with as many effects is, even if every fit to come gained as much as the last.
fn chained(contest: &Contest<'_>, base: &Contestant, mut runners: Vec<(Contestant, bool)>) -> Result<Vec<Contestant>> {
    let on = |(fit, runs): (Contestant, bool)| match runs && !contest.run.is_out_of_time() {
        true => contest.fitter.linked(fit, Budget::Rough),
        false => Ok((fit, false)),
    };
    for left in (0..CHAINED).rev() {
        let before: Vec<Option<f64>> = runners.iter().map(|(fit, runs)| runs.then(|| fit.evidence.squares())).collect();
        if before.iter().all(Option::is_none) {
            break;
        }
        runners = base.each(runners, on)?;
        let after: Vec<f64> = runners.iter().map(|(fit, _)| fit.evidence.squares()).collect();
        let effects: Vec<usize> = runners.iter().map(|(fit, _)| fit.hypotheses.len()).collect();
        for (place, (_, runs)) in runners.iter_mut().enumerate() {
            let Some(gain) = before[place].map(|before| before - after[place]) else { continue };
            let peers = (0..after.len()).filter(|&peer| effects[peer] == effects[place]);
            let ahead = peers.map(|peer| after[peer]).fold(f64::INFINITY, f64::min);
            *runs &= may_catch_up((after[place], gain), left, ahead.min(base.evidence.squares()));
        }
    }
    Ok(runners.into_iter().map(|(fit, _)| fit).collect())
}

/// Whether fits to come, of which so many are `left`, may reach what is `ahead` if each of them lowers the sum of squares by the last `gain`.
fn may_catch_up((squares, gain): (f64, f64), left: usize, ahead: f64) -> bool {
    squares - left as f64 * gain <= BEHIND * ahead
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_runner_goes_on_while_its_last_gain_may_bring_it_to_the_leader() {
        // Of an arm: the right friction and a damping, each after two fits of five, where the friction ends at 23,000.
        assert!(may_catch_up((37_000.0, 15_500.0), 3, 37_000.0));
        assert!(may_catch_up((61_500.0, 30_000.0), 3, 37_000.0));
        // The damping after three, and what takes the place of a right cause that left 20,700.
        assert!(!may_catch_up((56_200.0, 5300.0), 2, 27_200.0));
        assert!(!may_catch_up((62_300.0, 3500.0), 3, 20_700.0));
        // What comes no nearer, and what diverged.
        assert!(!may_catch_up((30_000.0, 0.0), 4, 20_000.0) && !may_catch_up((f64::NAN, f64::NAN), 4, 20_000.0));
    }
}
