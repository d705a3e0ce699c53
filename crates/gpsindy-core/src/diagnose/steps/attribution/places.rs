//! Places: what else may replace each effect of the winner, and what the winner is without it.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, CONVINCING, IN_SIGHT};
use crate::diagnose::steps::attribution::contained::contained;
use crate::diagnose::steps::attribution::contest::{Contest, keep_first_of_each};
use crate::error::Result;

/// The place of one effect of the winner.
pub(crate) struct Place {
    /// The winner without the effect; none where the others can't be simulated without it.
    pub(crate) rest: Option<Contestant>,
    /// Contestants with one effect in its place, the winner among them, best first.
    pub(crate) fits: Vec<Contestant>,
    /// Mean squared residual (noise units) that the effect removes, taken last.
    pub(crate) removed: f64,
}

/// Every place of `best`, of the `fits` one move away from it; `rests`: what it is without each of its effects, where that is known.
pub(crate) fn places(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    fits: &[Contestant],
    rests: Option<Vec<Option<Contestant>>>,
) -> Result<Vec<Place>> {
    contest.run.begin("places of the winner's effects");
    let rests = match rests {
        Some(rests) => rests,
        None if best.hypotheses.len() == 1 => vec![Some(nominal.clone())],
        None => contest.without_each(nominal, best, if is_moot(best) { Budget::Rough } else { Budget::Usual })?,
    };
    // It stands in every place, and is the same in all.
    let whole = finished(contest, best, best.clone(), contest.score(best))?;
    let one = |(place, rest)| at(contest, nominal, (best, &whole), fits, (place, rest));
    rests.into_iter().enumerate().map(one).collect()
}

/// A fit in a place of `best` carried on, where it is not at rest and in sight of the score of a `leader`.
fn finished(contest: &Contest<'_>, best: &Contestant, fit: Contestant, leader: f64) -> Result<Contestant> {
    let is_open = |f: &Contestant, within: f64| !f.refined.converged && contest.score(f) > leader - within;
    if !is_open(&fit, IN_SIGHT) {
        return Ok(fit);
    }
    let fit = contest.fitter.carried_on(fit, if is_moot(best) { Budget::Rough } else { Budget::Usual })?;
    // To the end goes only what may be a twin, or better.
    match is_open(&fit, CONVINCING) && !is_moot(best) {
        true => contest.fitter.carried_on(fit, Budget::Thorough),
        false => Ok(fit),
    }
}

/// Whether none of its effects is believed much, because more than noise is left: a few steps then say what stands beside each.
fn is_moot(best: &Contestant) -> bool {
    best.evidence.leaves_a_rest()
}

fn at(
    contest: &Contest<'_>,
    nominal: &Contestant,
    (best, whole): (&Contestant, &Contestant),
    fits: &[Contestant],
    (place, rest): (usize, Option<Contestant>),
) -> Result<Place> {
    let others: Vec<_> = best.hypotheses.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, h)| h).collect();
    let stands_there = |fit: &&Contestant| {
        fit.hypotheses.len() == best.hypotheses.len() && others.iter().all(|h| fit.hypotheses.contains(h))
    };
    let mut fits: Vec<Contestant> = fits.iter().filter(stands_there).cloned().collect();
    fits.extend(contained(contest, nominal, best, place, &best.entrants_without(&[place]))?);
    let scores = fits.iter().chain([whole]).map(|f| contest.score(f));
    let leader = scores.fold(f64::NEG_INFINITY, f64::max);
    let mut fits = best.each(fits, |fit| finished(contest, best, fit, leader))?;
    fits.push(whole.clone());
    contest.sort(&mut fits);
    let without = rest.as_ref().map_or(nominal, |rest| rest);
    let removed = (without.evidence.misfit() - best.evidence.misfit()).max(0.0);
    Ok(Place { rest, fits: keep_first_of_each(fits), removed })
}
