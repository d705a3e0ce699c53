//! Search: a beam search that adds effects as long as they improve the evidence enough.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{ALIKE, BEAM};
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::round::{Expansion, Tried};
use crate::error::Result;

/// The winner, and what was tried on the way; `first` is the round at the nominal model.
pub(crate) fn search(contest: &Contest<'_>, nominal: &Contestant, first: Expansion) -> Result<(Contestant, Tried)> {
    let mut best = nominal.clone();
    let mut tried = Tried::default();
    tried.keep(nominal, &first.fits);
    let mut beam = different(first.fits);
    for round in 1..=contest.most {
        let Some(leader) = beam.first() else { break };
        if !contest.is_convincing(leader, &best) {
            break;
        }
        best = leader.clone();
        // With as many effects as may be, or nothing left, no more are added.
        if round == contest.most || best.hypotheses.len() >= contest.most || best.evidence.misfit() < 1e-12 {
            break;
        }
        let mut next = Vec::new();
        for (place, contestant) in beam.iter().filter(|f| f.hypotheses.len() < contest.most).enumerate() {
            // Where nothing is left at the leader, the others need not be tried with more.
            if place > 0 && next.is_empty() {
                break;
            }
            let stage = format!("effects together: {}", round + 1);
            let fits = tried.expand(contest, contestant, &stage)?;
            next.extend(fits.into_iter().take(2 * BEAM));
        }
        contest.sort(&mut next);
        beam = different(keep_first_of_each(next));
    }
    Ok((best, tried))
}

/// The first contestants whose outputs differ: what cannot be told apart now need not be carried on twice, and
/// leaves room for another account of the logs. The final swaps bring the twins back.
fn different(fits: Vec<Contestant>) -> Vec<Contestant> {
    let mut kept: Vec<Contestant> = Vec::with_capacity(BEAM);
    for fit in fits {
        if kept.len() == BEAM {
            break;
        }
        let is_known =
            |other: &Contestant| other.distance(&fit) < ALIKE * other.evidence.misfit().min(fit.evidence.misfit());
        if !kept.iter().any(is_known) {
            kept.push(fit);
        }
    }
    kept
}
