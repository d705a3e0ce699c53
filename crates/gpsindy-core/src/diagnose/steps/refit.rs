//! Refit: full fits of contestants with one more effect, for the effects with promising linearised gains.

use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::fit::fitter::unless_refused;
use crate::diagnose::fit::gains::Gain;
use crate::diagnose::limits::{
    Budget, CONVINCING, FINALISTS, IN_SIGHT, MATERIAL, MOST_PER_EQUATION, OF_FAMILY, PROMISING, SHORTLIST, STARTS,
    TOGETHER,
};
use crate::diagnose::steps::contained::contained;
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::screen::{BASES, Screened};
use crate::error::Result;
use crate::parallel::each;

/// Contestants one step on from `base`, best first, chosen by a screening of so many `searches`.
pub(crate) fn refit(
    contest: &Contest<'_>,
    base: &Contestant,
    screened: &[Option<Screened>],
    searches: Searches,
    stage: &str,
) -> Result<Vec<Contestant>> {
    let best = |s: &Screened| (0..BASES).map(|basis| s.best(basis)).fold(0.0, f64::max);
    if !screened.iter().flatten().any(|s| is_promising(base, best(s))) {
        return Ok(Vec::new());
    }
    let fitter = contest.fitter;
    let in_turn = base.fits_in_turn();
    let budget = if in_turn { Budget::Glance } else { Budget::Rough };
    let mut jobs = jobs(contest, screened);
    jobs.retain(|job| has_room(contest, base, &job.screened.members));
    let stage = contest.run.stage(stage, jobs.len())?;
    let fit = |job: &Job<'_>| {
        if contest.run.is_out_of_time() {
            return Ok(None);
        }
        let members = job.screened.members.iter();
        let entrant = |&h: &usize| Entrant { hypothesis: &contest.hypotheses[h], searches };
        let entrants: Vec<Entrant<'_>> = members.map(entrant).collect();
        let fit = unless_refused(fitter.with(base, &entrants, &job.screened.applied, &job.values, budget))?;
        stage.advance()?;
        Ok(fit)
    };
    let fits = each(in_turn, jobs.iter().collect(), fit)?;
    let mut fits: Vec<Contestant> = fits.into_iter().flatten().collect();
    if in_turn {
        let carry = |(fit, leads): (Contestant, bool)| match leads && !contest.run.is_out_of_time() {
            true => fitter.carried_on(fit, Budget::Rough),
            false => Ok(fit),
        };
        fits = each(true, leading(contest, fits, (SHORTLIST, SHORTLIST)), carry)?;
    }
    contest.sort(&mut fits);
    let fits = keep_first_of_each(fits);
    // Those that may still win are fitted to the end.
    let near = fits.first().map_or(0.0, |f| contest.score(f)) - IN_SIGHT;
    let finish = |(fit, leads): (Contestant, bool)| {
        let may_gain = !fit.refined.converged || fit.beyond().next().is_some();
        let may_win = (leads || contest.score(&fit) >= near) && may_gain;
        if may_win && !contest.run.is_out_of_time() { fitter.carried_on(fit, Budget::Usual) } else { Ok(fit) }
    };
    let mut fits = each(in_turn, leading(contest, fits, (FINALISTS, 1)), finish)?;
    contest.sort(&mut fits);
    if contest.run.is_out_of_time() {
        return Ok(fits);
    }
    // The next round goes on from the leader, so its fit is worth every step.
    carry_first(contest, &mut fits)?;
    if let Some(leader) = fits.first().cloned() {
        let simpler = contained(contest, base, &leader, base.hypotheses.len(), &[])?;
        let is_new = |simple: &Contestant| !fits.iter().any(|fit| fit.has_effects_of(simple));
        let simpler: Vec<Contestant> = simpler.into_iter().filter(is_new).collect();
        if !simpler.is_empty() {
            fits.extend(simpler);
            contest.sort(&mut fits);
            carry_first(contest, &mut fits)?;
        }
    }
    Ok(fits)
}

/// Fits the first to the end, and once more from the starts that the logs show.
fn carry_first(contest: &Contest<'_>, fits: &mut [Contestant]) -> Result<()> {
    let Some(leader) = fits.first_mut() else { return Ok(()) };
    let fitter = contest.fitter;
    let own = leader.clone();
    let own = if own.refined.converged { own } else { fitter.carried_on(own, Budget::Thorough)? };
    *leader = fitter.restarted(own, Budget::Usual)?;
    Ok(())
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

/// One fit that is to be made.
struct Job<'a> {
    screened: &'a Screened,
    /// The values to start from; the nearest is taken.
    values: Vec<Vec<f64>>,
}

/// Whether a straight-line gain is large enough for one more effect to be convincing and material.
fn is_promising(base: &Contestant, gain: f64) -> bool {
    let evidence = &base.evidence;
    // What tolerated parameters have taken up may be this effect's.
    let hidden = evidence.strain > MATERIAL;
    let needed = PROMISING * MATERIAL * evidence.count() as f64 * evidence.misfit().min(1.0);
    gain > CONVINCING && (hidden || gain > needed)
}

/// Whether the equations of the members take that many more effects.
fn has_room(contest: &Contest<'_>, base: &Contestant, members: &[usize]) -> bool {
    members.iter().all(|&m| {
        let state = contest.hypotheses[m].state;
        let more = members.iter().filter(|&&h| contest.hypotheses[h].state == state).count();
        let room = base.hypotheses.iter().filter(|h| h.state == state).count() + more <= MOST_PER_EQUATION;
        // Frictions that only show together are one law of that equation.
        room || (members.len() > 1 && base.hypotheses.is_empty())
    })
}

/// Which hypotheses are refitted, and from which values: the best by each noise model, the best of each family, and those that
/// promise together what none of them does alone.
fn jobs<'a>(contest: &Contest<'_>, screened: &'a [Option<Screened>]) -> Vec<Job<'a>> {
    let mut chosen: Vec<usize> = Vec::new();
    let (alone, joint) = screened.split_at(contest.hypotheses.len());
    let telling = screened.iter().flatten().map(Screened::telling).next().unwrap_or_default();
    for basis in telling {
        let best = |h: usize| screened[h].as_ref().map_or(0.0, |s| s.best(basis));
        let mut together: Vec<(usize, f64)> = Vec::new();
        for (place, suspect) in joint.iter().enumerate() {
            let Some(suspect) = suspect else { continue };
            let members = suspect.members.iter().map(|&h| best(h)).fold(0.0, f64::max);
            if suspect.best(basis) > members + CONVINCING {
                together.push((alone.len() + place, suspect.best(basis)));
            }
        }
        together.sort_by(|a, b| b.1.total_cmp(&a.1));
        chosen.extend(together.iter().take(TOGETHER).map(|t| t.0));
        let mut order: Vec<(usize, f64)> =
            alone.iter().enumerate().filter_map(|(h, s)| Some((h, s.as_ref()?.best(basis)))).collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let largest = order.first().map_or(0.0, |o| o.1);
        chosen.extend(order.iter().take(SHORTLIST).filter(|o| o.1 > 0.0).map(|o| o.0));
        let mut families = Vec::new();
        for (h, gain) in order {
            if gain > OF_FAMILY * largest && !families.contains(&contest.hypotheses[h].family()) {
                families.push(contest.hypotheses[h].family());
                chosen.push(h);
            }
        }
    }
    chosen.sort_unstable();
    chosen.dedup();
    let starts = |screened: &'a Screened| {
        let mut order: Vec<(&Start, &Vec<Gain>)> = screened.applied.starts.iter().zip(&screened.gains).collect();
        let first = screened.telling().start;
        order.sort_by(|a, b| b.1[first].gain.total_cmp(&a.1[first].gain));
        let job =
            move |(start, gains): (&Start, &Vec<Gain>)| Job { screened, values: start.shortened(&gains[first].values) };
        order.into_iter().take(STARTS).map(job).collect::<Vec<_>>()
    };
    chosen.into_iter().filter_map(|h| screened[h].as_ref()).flat_map(starts).collect()
}
