//! Refit: full fits of contestants with one more effect, for the effects with promising linearised gains.

use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::fit::fitter::unless_refused;
use crate::diagnose::fit::gains::Gain;
use crate::diagnose::limits::{
    Budget, CONVINCING, FINALISTS, IN_SIGHT, MATERIAL, MOST_PER_EQUATION, OF_FAMILY, PROMISING, SHORTLIST, STARTS,
    TOGETHER,
};
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::screen::Screened;
use crate::error::Result;
use crate::parallel::*;

/// Contestants one step on from `base`, best first, chosen by a screening of so many `searches`.
pub(crate) fn refit(
    contest: &Contest<'_>,
    base: &Contestant,
    screened: &[Option<Screened>],
    searches: Searches,
    stage: &str,
) -> Result<Vec<Contestant>> {
    if !screened.iter().flatten().any(|s| is_promising(base, s.best(0).max(s.best(1)))) {
        return Ok(Vec::new());
    }
    let fitter = contest.fitter;
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
        let fit = unless_refused(fitter.with(base, &entrants, &job.screened.applied, &job.values, Budget::Rough))?;
        stage.advance()?;
        Ok(fit)
    };
    // A simulator that steps is one for all: fits side by side would set its parameters in turn at every step.
    let in_turn = base.system.engine().is_some();
    let fits: Result<Vec<Option<Contestant>>> =
        if in_turn { jobs.iter().map(fit).collect() } else { jobs.par_iter().map(fit).collect() };
    let fits = fits?;
    let mut fits: Vec<Contestant> = fits.into_iter().flatten().collect();
    contest.sort(&mut fits);
    let fits = keep_first_of_each(fits);
    // Those that may still win are fitted to the end.
    let last = fits.get(FINALISTS - 1).map_or(f64::NEG_INFINITY, |f| contest.score(f));
    let near = fits.first().map_or(0.0, |f| contest.score(f)) - IN_SIGHT;
    let finish = |fit: Contestant| {
        let may_gain = !fit.refined.converged || fit.beyond().next().is_some();
        let may_win = contest.score(&fit) >= last.min(near) && may_gain;
        if may_win && !contest.run.is_out_of_time() { fitter.carried_on(fit, Budget::Usual) } else { Ok(fit) }
    };
    let fits: Result<Vec<Contestant>> =
        if in_turn { fits.into_iter().map(finish).collect() } else { fits.into_par_iter().map(finish).collect() };
    let mut fits = fits?;
    contest.sort(&mut fits);
    // The next round goes on from the leader, so its fit is worth every step.
    if let Some(leader) = fits.first_mut().filter(|_| !contest.run.is_out_of_time()) {
        let own = leader.clone();
        let own = if own.refined.converged { own } else { fitter.carried_on(own, Budget::Thorough)? };
        *leader = fitter.restarted(own, Budget::Usual)?;
    }
    Ok(fits)
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

/// Which hypotheses are refitted, and from which values: the best by either noise model, the best of each family,
/// and those that promise together what none of them does alone.
fn jobs<'a>(contest: &Contest<'_>, screened: &'a [Option<Screened>]) -> Vec<Job<'a>> {
    let mut chosen: Vec<usize> = Vec::new();
    let (alone, joint) = screened.split_at(contest.hypotheses.len());
    for basis in [0, 1] {
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
        order.sort_by(|a, b| b.1[0].gain.total_cmp(&a.1[0].gain));
        let job =
            move |(start, gains): (&Start, &Vec<Gain>)| Job { screened, values: start.shortened(&gains[0].values) };
        order.into_iter().take(STARTS).map(job).collect::<Vec<_>>()
    };
    chosen.into_iter().filter_map(|h| screened[h].as_ref()).flat_map(starts).collect()
}
