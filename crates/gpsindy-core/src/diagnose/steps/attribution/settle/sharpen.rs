//! Sharpen: dry friction whose sign is smoothed over a small speed, where friction that holds at rest leaves something.
//!
//! Between a blunt corner, which a search fits, and friction that holds at rest lie sharp corners, which turn around within a step of the
//! integration. A fit from a blunt one does not get there, and what they leave of friction that holds is taken for further effects.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::substeps::choose_substeps;
use crate::diagnose::limits::{Budget, CHANCE, INTEGRATION, SHARP};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::detect::nameless_p_value;
use crate::diagnose::steps::attribution::screen::nameless;
use crate::error::Result;
use crate::refine::Free;

/// What became of friction that holds at rest.
#[derive(Default)]
pub(super) struct Sharpened {
    /// The winner with sharp corners in its place, on integration steps that are short enough for them; none where that is no better.
    pub(super) best: Option<Contestant>,
    /// Gain and degrees of freedom of every function without a name beside the winner as it was, where they were asked for.
    pub(super) left: Option<Vec<(f64, usize)>>,
}

/// `best` with sharp corners in place of friction that holds at rest, where something is left to explain.
pub(super) fn sharpened(contest: &Contest<'_>, best: &Contestant) -> Result<Sharpened> {
    let held: Vec<Free> = best.held().collect();
    if held.is_empty() || best.system.engine().is_some() || contest.run.is_out_of_time() {
        return Ok(Sharpened::default());
    }
    // Of several effects one may stand for what the corner leaves; a single one that leaves nothing has nothing to gain.
    let left = if best.hypotheses.len() == 1 { Some(nameless(contest, best)?) } else { None };
    if left.as_ref().is_some_and(|left| nameless_p_value(left, best) > CHANCE) {
        return Ok(Sharpened { best: None, left });
    }
    let mut sharp = best.clone();
    for free in held {
        sharp.refined.parameters[free.parameter] = SHARP * free.scale;
        sharp.free.push(free);
    }
    let (parameters, initial) = (&sharp.refined.parameters, &sharp.refined.initial);
    sharp.experiment = choose_substeps(&sharp.system, sharp.experiment.clone(), parameters, initial, INTEGRATION);
    let ranked = contest.fitter.carried_on(sharp, Budget::Rough)?;
    let is_better = contest.score(&ranked) > contest.score(best);
    let best = if is_better { Some(contest.fitter.carried_on(ranked, Budget::Thorough)?) } else { None };
    Ok(Sharpened { best, left })
}
