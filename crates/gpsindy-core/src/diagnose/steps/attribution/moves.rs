//! Moves: fits of what lies one step from a contestant, chosen by straight lines and raced.
//!
//! One more effect, another one in the place of one, or one in the place of two. Straight lines say what each would bring; those that
//! promise most take a step each, the better ones a few more, and those that may still win are fitted to the end: successive halving,
//! Jamieson and Talwalkar 2016, AISTATS, "Non-stochastic best arm identification and hyperparameter optimization".

mod choice;
mod race;
pub(crate) mod scatter;

use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::contestant::{Contestant, Entrant, Searches};
use crate::diagnose::handed::{Handed, Member};
use crate::diagnose::limits::{Budget, IN_SIGHT, SUBSTITUTE};
use crate::diagnose::steps::attribution::contained::contained;
use crate::diagnose::steps::attribution::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::attribution::gross::{Gross, gross};
use crate::diagnose::steps::attribution::survey::Survey;
use crate::error::{Result, unless_refused};
use choice::{chosen, has_room, is_worth_a_fit};
use race::raced;
use scatter::with_scattered;

/// A fit that is to be made: suspects in the place of some effects of the contestant.
struct Move<'a> {
    members: Vec<usize>,
    /// The places that are given up; none for one more effect.
    out: Vec<usize>,
    /// The contestant's model with the suspects, where they come beside its effects.
    applied: Option<&'a Applied>,
    /// Values of the suspects to start from; the nearest is taken.
    values: Vec<Vec<f64>>,
    /// By how much the sum of squares would fall.
    promised: f64,
}

/// Contestants one move away from `base`, best first, chosen by a survey of so many `searches`; none of them is carried to the end that is
/// out of sight of what is `known` already.
pub(crate) fn moves(
    contest: &Contest<'_>,
    nominal: &Contestant,
    base: &Contestant,
    (survey, searches): (&Survey, Searches),
    (stage, known): (&str, Option<&Contestant>),
) -> Result<Vec<Contestant>> {
    let bare = contest.fitter.with_beginnings(base)?;
    let base = &bare.clone().with_derivatives(survey.kept.as_ref());
    let mut moves = chosen(contest, base, survey);
    let gross = gross(contest, base, survey)?;
    let holds = |gross: &&Gross| contest.hypotheses[gross.hypothesis].is(Effect::CoulombFriction);
    let holding: Vec<&Hypothesis> =
        gross.iter().filter(holds).map(|gross| &contest.hypotheses[gross.hypothesis]).collect();
    moves.extend(gross.into_iter().filter_map(|gross| {
        let applied = &survey.suspects[gross.hypothesis].as_ref()?.applied;
        let (members, values, promised) = (vec![gross.hypothesis], vec![gross.values], gross.gain);
        Some(Move { members, out: Vec::new(), applied: Some(applied), values, promised })
    }));
    if survey.is_behind {
        // They were asked for because of an effect that is there; what marks a place, because of what is left.
        let is_for = |m: &Move<'_>, place: &usize| {
            let leading = &base.hypotheses[*place];
            let mut suspects = m.members.iter().map(|&h| &contest.hypotheses[h]);
            suspects.any(|h| h.stands_behind(leading) || h.is_elsewhere(leading))
        };
        let marks = |m: &Move<'_>| m.members.iter().any(|&h| contest.hypotheses[h].marks_a_place());
        moves.retain(|m| marks(m) || m.out.iter().any(|place| is_for(m, place)));
    }
    moves.retain(|m| has_room(contest, base, &m.members, &m.out) && is_worth_a_fit(contest, base, m));
    let promises: Vec<(Vec<&Hypothesis>, f64)> =
        moves.iter().map(|m| (members(contest, base, m), m.promised)).collect();
    let stage = contest.run.stage(stage, moves.len())?;
    let first = |m: &Move<'_>| {
        if contest.run.is_out_of_time() {
            return Ok(None);
        }
        let fit = made(contest, nominal, base, m, searches)?;
        stage.advance()?;
        Ok(fit)
    };
    let fits = base.each(moves.iter().collect(), first)?;
    let count = |m: &Move<'_>| base.hypotheses.len() - m.out.len() + m.members.len();
    let most = |effects: usize| {
        let of = fits.iter().flatten().filter(|fit| fit.hypotheses.len() <= effects);
        of.map(|fit| achieved(base, fit)).fold(0.0, f64::max)
    };
    // A move that changes much has derivatives of its own. Where there are several effects already, and as many places for a move, they are worth it
    // where it may still lead among as many effects: a straight line underrates a curved effect by half.
    let are_few = base.hypotheses.len() < 2;
    let is_worth_more = |m: &Move<'_>, fit: &Option<Contestant>| {
        let is_short = fit.as_ref().is_none_or(|fit| falls_short(achieved(base, fit), m.promised));
        survey.kept.is_some() && is_short && (are_few || m.promised > SUBSTITUTE * most(count(m)))
    };
    let again: Vec<(&Move<'_>, bool)> = moves.iter().zip(&fits).map(|(m, fit)| (m, is_worth_more(m, fit))).collect();
    let own = base.each(again, |(m, is_worth_more)| match is_worth_more && !contest.run.is_out_of_time() {
        true => made(contest, nominal, &bare, m, searches),
        false => Ok(None),
    })?;
    let better = |fits: [Option<Contestant>; 2]| {
        fits.into_iter().flatten().min_by(|a, b| a.evidence.squares().total_cmp(&b.evidence.squares()))
    };
    let fits = fits.into_iter().zip(own).filter_map(|(fit, own)| better([fit, own]));
    // What can't be followed to the end of the logs is no account of them.
    let fits: Vec<Contestant> = fits.filter(|fit| fit.evidence.misfit().is_finite()).collect();
    let fits = raced(contest, (base, known), fits, (&promises, &holding))?;
    contest.run.handed.add(fits.iter().filter_map(|fit| handed(base, fit, &promises)));
    let ahead = known.map_or(f64::NEG_INFINITY, |known| contest.score(known));
    let is_in_sight = fits.first().is_some_and(|leader| contest.score(leader) > ahead - IN_SIGHT);
    if contest.run.is_out_of_time() || !is_in_sight {
        return Ok(fits);
    }
    let fits = with_simpler(contest, nominal, base, fits)?;
    // Beside the nominal model once all suspects are known: a size by recording leaves no rest that would call those that wait.
    if base.hypotheses.is_empty() { Ok(fits) } else { with_scattered(contest, base, fits) }
}

/// The effects of a move, those that stay first.
fn members<'c>(contest: &'c Contest<'_>, base: &'c Contestant, m: &Move<'_>) -> Vec<&'c Hypothesis> {
    let kept = base.hypotheses.iter().enumerate().filter(|(place, _)| !m.out.contains(place)).map(|(_, h)| h);
    kept.chain(m.members.iter().map(|&h| &contest.hypotheses[h])).collect()
}

/// By how much the sum of squares was to fall, by the largest of the `promises` for the effects of a fit.
fn promised(fit: &Contestant, promises: &[(Vec<&Hypothesis>, f64)]) -> Option<f64> {
    let is_it =
        |set: &Vec<&Hypothesis>| set.len() == fit.hypotheses.len() && set.iter().all(|h| fit.hypotheses.contains(h));
    promises.iter().filter(|(set, _)| is_it(set)).map(|(_, promised)| *promised).reduce(f64::max)
}

/// By how much it fell.
fn achieved(base: &Contestant, fit: &Contestant) -> f64 {
    base.evidence.squares() - fit.evidence.squares()
}

/// Whether a sum of squares fell by much less than was promised.
fn falls_short(achieved: f64, promised: f64) -> bool {
    achieved < promised - (1.0 - SUBSTITUTE) * promised.abs()
}

/// What a fit of one of the moves came to, of the `promises` of all.
fn handed(base: &Contestant, fit: &Contestant, promises: &[(Vec<&Hypothesis>, f64)]) -> Option<Handed> {
    let promised = promised(fit, promises)?;
    let newest = fit.hypotheses.iter().rfind(|h| !base.hypotheses.contains(h))?;
    let states = &base.system.model().states;
    let member = |h: &Hypothesis| Member {
        effect: h.id().into(),
        state: states[h.moves()].name.clone(),
        variables: h.stated().to_vec(),
    };
    Some(Handed {
        members: fit.hypotheses.iter().map(member).collect(),
        family: format!("{:?}", newest.family()),
        promised,
        achieved: achieved(base, fit),
        at_rest: fit.refined.converged,
    })
}

/// The first step of a move's fit.
fn made(
    contest: &Contest<'_>,
    nominal: &Contestant,
    base: &Contestant,
    m: &Move<'_>,
    searches: Searches,
) -> Result<Option<Contestant>> {
    let new: Vec<Entrant<'_>> = m.members.iter().map(|&h| Entrant::new(&contest.hypotheses[h], searches)).collect();
    if let Some(applied) = m.applied.filter(|_| m.out.is_empty()) {
        let fit = contest.fitter.with(base, &new, applied, &m.values, Budget::Glance);
        return unless_refused(fit);
    }
    let kept = base.entrants_without(&m.out);
    let kept_on = kept.iter().map(|k| Entrant { is_tried: true, ..k.0 });
    let entrants: Vec<Entrant<'_>> = kept_on.chain(new).collect();
    let own: Vec<f64> = kept.iter().flat_map(|k| k.1.iter().copied()).collect();
    let values: Vec<Vec<f64>> = m.values.iter().map(|values| [own.as_slice(), values].concat()).collect();
    contest.with_values(nominal, base, &entrants, &values, Budget::Glance)
}

/// The fits with the leader at rest, and with the simpler effects that the leader's newest one contains.
fn with_simpler(
    contest: &Contest<'_>,
    nominal: &Contestant,
    base: &Contestant,
    mut fits: Vec<Contestant>,
) -> Result<Vec<Contestant>> {
    let is_ahead = |fit: &Contestant| contest.score(fit) > contest.score(base);
    if !fits.first().is_some_and(is_ahead) {
        return Ok(fits);
    }
    let leader = at_rest(contest, sought_again(contest, base, fits[0].clone())?)?;
    fits[0].clone_from(&leader);
    let Some(place) = leader.hypotheses.iter().rposition(|h| !base.hypotheses.contains(h)) else { return Ok(fits) };
    let mut simpler = contained(contest, nominal, &leader, place, &leader.entrants_without(&[place]))?;
    // Of several that came together each may do alone. Where the simulator steps, a single one may have lost for want of steps or good starts,
    // and time may end the search before the end of it leaves one out.
    let new: Vec<usize> =
        (0..leader.hypotheses.len()).filter(|&p| !base.hypotheses.contains(&leader.hypotheses[p])).collect();
    if new.len() > 1 && leader.system.engine().is_some() {
        let without = |place| contest.again_with(nominal, &leader, &leader.entrants_without(&[place]));
        simpler.extend(base.each(new, without)?.into_iter().flatten());
    }
    let is_known = |simple: &Contestant| {
        fits.iter().any(|fit| fit.has_effects_of(simple) && contest.score(fit) >= contest.score(simple))
    };
    let simpler: Vec<Contestant> = simpler.into_iter().filter(|simple| !is_known(simple)).collect();
    // From where the leader came to rest, by as many steps: else they would lose to it for want of those.
    fits.extend(base.each(simpler, |fit| at_rest(contest, fit))?);
    contest.sort(&mut fits);
    Ok(keep_first_of_each(fits))
}

/// The fit after another look for what the effects that it shares with `base` have by trial: its new effect may have moved that.
fn sought_again(contest: &Contest<'_>, base: &Contestant, mut fit: Contestant) -> Result<Contestant> {
    let is_shared = |place: &usize| base.hypotheses.contains(&fit.hypotheses[*place]);
    let shared: Vec<usize> = (0..fit.hypotheses.len()).filter(is_shared).collect();
    shared.into_iter().for_each(|place| fit.tried[place] = false);
    let has_more = fit.untried().any(|(_, added)| added.is_sought());
    if !has_more || contest.run.is_out_of_time() {
        return Ok(fit);
    }
    contest.fitter.carried_on(fit, Budget::Rough)
}

/// The fit carried on to the end, and once more from the starts that the logs show: others go on from it.
fn at_rest(contest: &Contest<'_>, fit: Contestant) -> Result<Contestant> {
    if contest.run.is_out_of_time() {
        return Ok(fit);
    }
    let fitter = contest.fitter;
    let is_done = fit.refined.converged && fit.beyond().next().is_none();
    let fit = if is_done { fit } else { fitter.carried_on(fit, Budget::Thorough)? };
    let fit = fitter.with_begun(fit, Budget::Usual)?;
    fitter.redrawn(fitter.restarted(fit, Budget::Usual)?, Budget::Usual)
}
