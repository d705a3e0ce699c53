//! Runs with a size of their own: in a fit, and in another one with the same effect.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::by_run::{differing, size_of};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::limits::Budget;
use crate::error::{Result, unless_refused};
use crate::refine::{Experiment, Log};
use std::sync::Arc;

/// The `fit` with the sizes by recording of those of its effects that have them in `other`, fitted on within `budget`.
pub(crate) fn inherited(fitter: Fitter, other: &Contestant, fit: Contestant, budget: Budget) -> Result<Contestant> {
    let mut fit = fit;
    for parameter in differing(&other.experiment) {
        let effect = other.added.iter().position(|added| added.iter().any(|(index, _)| *index == parameter));
        let is_it = |h: &Hypothesis| effect.is_some_and(|place| other.hypotheses[place] == *h);
        let Some(place) = fit.hypotheses.iter().position(is_it) else { continue };
        let Some(own) = size_of(&fit, place).map(|i| fit.free[i].parameter) else { continue };
        let of = |log: &Log| log.own.iter().find(|(index, _)| *index == parameter).map_or(0.0, |(_, more)| *more);
        let more: Vec<f64> = other.experiment.logs.iter().map(of).collect();
        let moved = with_own(&fit, own, &more);
        if let Some(moved) = unless_refused(fitter.carried_on(moved, budget))? {
            fit = moved;
        }
    }
    Ok(fit)
}

/// The fit with a value of `parameter` that is by so much `more` in each log.
pub(crate) fn with_own(fit: &Contestant, parameter: usize, more: &[f64]) -> Contestant {
    let experiment = of_their_own(&fit.experiment, parameter, more);
    Contestant { experiment, beginnings: None, ..fit.clone() }
}

/// The logs with a value of `parameter` that is by so much `more` in each.
pub(crate) fn of_their_own(experiment: &Experiment, parameter: usize, more: &[f64]) -> Experiment {
    let mut logs: Vec<Log> = experiment.logs.to_vec();
    for (log, &more) in logs.iter_mut().zip(more) {
        log.own.retain(|(index, _)| *index != parameter);
        log.own.push((parameter, more));
    }
    Experiment { logs: Arc::new(logs), ..experiment.clone() }
}
