//! Search: from one set of effects to a better one, a move at a time, on rollouts that grow as the model gets better.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{MENDED, MOST_MOVES, NAMED, NO_REST, PILED, SWAP};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::lengthen::lengthen;
use crate::diagnose::steps::attribution::moves::scatter::with_scattered;
use crate::diagnose::steps::attribution::round::{Expansion, expand};
use crate::diagnose::steps::attribution::simplify::is_superfluous;
use crate::diagnose::steps::findings::counts;
use crate::error::Result;

/// What a search ends with.
pub(crate) struct Found {
    /// The nominal model on the rollouts that the search ended on.
    pub(crate) nominal: Contestant,
    /// The set of effects from which no move leads to a better one.
    pub(crate) best: Contestant,
    /// The round that found none.
    pub(crate) round: Expansion,
    /// Whether the rollouts are longer than those of the first round.
    pub(crate) is_lengthened: bool,
}

/// Moves from the nominal model to better sets of effects until none is left; `first` is the round at the nominal model.
pub(crate) fn search(contest: &Contest<'_>, nominal: Contestant, first: Expansion) -> Result<Found> {
    let (mut nominal, mut best, mut round, mut is_lengthened) = (nominal.clone(), nominal, first, false);
    round.fits = with_scattered(contest, &nominal, round.fits)?;
    let mut looked_at = nominal.evidence.misfit();
    for number in 1..=MOST_MOVES {
        let Some(next) = better(contest, &best, &round.fits) else { break };
        let is_richer = next.hypotheses.len() > best.hypotheses.len();
        // What would be left out again at the end is not taken, for there may be no time for that.
        let leaves_a_rest = || next.evidence.leaves_a_rest() && !counts(&nominal, next, &best, NAMED);
        if is_richer && (leaves_a_rest() || is_superfluous(contest, &nominal, next, &best)?) {
            break;
        }
        // A round that was cut short has fitted neither its leaders nor what they stand beside to the end.
        if is_richer && !best.hypotheses.is_empty() && contest.run.is_out_of_time() {
            round.fits.clear();
            break;
        }
        best = next.clone();
        if contest.run.is_out_of_time() || best.evidence.misfit() < NO_REST {
            round.fits.clear();
            break;
        }
        // What is left of a gap that is mended for the most part shows better in longer rollouts.
        if best.evidence.misfit() < MENDED * looked_at {
            if let Some(longer) = lengthen(contest, &nominal, &best, PILED)? {
                (nominal, best) = longer;
                is_lengthened = true;
            }
            looked_at = best.evidence.misfit();
        }
        round = expand(contest, &nominal, &best, &format!("move {number}"))?;
    }
    Ok(Found { nominal, best, round, is_lengthened })
}

/// The best move: one more effect that convinces or another one that explains more, else one in the place of two that convince no more.
pub(crate) fn better<'f>(contest: &Contest<'_>, best: &Contestant, fits: &'f [Contestant]) -> Option<&'f Contestant> {
    let own = best.hypotheses.len();
    let is_other = |fit: &&Contestant| fit.hypotheses.len() == own && contest.lead(fit, best) > SWAP;
    let other = contest.best(fits.iter().filter(is_other));
    let is_simpler = |fit: &&Contestant| fit.hypotheses.len() < own && !contest.is_convincing(best, fit);
    let richer = richer(contest, other.unwrap_or(best), fits.iter());
    richer.or(other).or_else(|| contest.best(fits.iter().filter(is_simpler)))
}

/// The best of the fits with more effects that convince beside `leader`, the best with as many as there are: two in the place of a
/// wrong one must say more than the right one does.
pub(crate) fn richer<'f>(
    contest: &Contest<'_>,
    leader: &Contestant,
    fits: impl Iterator<Item = &'f Contestant>,
) -> Option<&'f Contestant> {
    let own = leader.hypotheses.len();
    let is_richer = |fit: &&Contestant| fit.hypotheses.len() > own && contest.is_convincing(fit, leader);
    contest.best(fits.filter(is_richer))
}
