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

/// `best` with sharp corners in place of friction that holds at rest, on integration steps that are short enough for them; none where that is
/// no better, or nothing is left to explain.
pub(crate) fn sharpened(contest: &Contest<'_>, best: &Contestant) -> Result<Option<Contestant>> {
    let held: Vec<Free> = best.held().collect();
    if held.is_empty() || best.system.engine().is_some() || contest.run.is_out_of_time() {
        return Ok(None);
    }
    // Beside one effect that leaves nothing there is nothing to gain.
    if best.hypotheses.len() == 1 && nameless_p_value(&nameless(contest, best)?, best) > CHANCE {
        return Ok(None);
    }
    let mut sharp = best.clone();
    for free in held {
        sharp.refined.parameters[free.parameter] = SHARP * free.scale;
        sharp.free.push(free);
    }
    let (parameters, initial) = (&sharp.refined.parameters, &sharp.refined.initial);
    sharp.experiment = choose_substeps(&sharp.system, sharp.experiment.clone(), parameters, initial, INTEGRATION);
    let ranked = contest.fitter.carried_on(sharp, Budget::Rough)?;
    if contest.score(&ranked) <= contest.score(best) {
        return Ok(None);
    }
    Ok(Some(contest.fitter.carried_on(ranked, Budget::Thorough)?))
}
