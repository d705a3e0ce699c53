//! Ends of a travel, found by short rollouts.
//!
//! Each time a machine hits a stop, what it does there decides where it is at the next. Over a long rollout a fit finds an end that suits one
//! of the hits and stays there; between starts of their own every hit stands for itself (multiple shooting, Bock 1983).

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::limits::{Budget, OF_A_HIT};
use crate::error::{Result, unless_refused};
use crate::model::System;
use crate::refine::{Experiment, Free, Point, costs, guess_initial};

/// Puts the parameters of `point` where short rollouts have them, if an end of a travel is among those `fitted` and the logs are missed by
/// less then.
pub(crate) fn settle(
    system: &System,
    experiment: &Experiment,
    (fitted, free): (&[(usize, Added)], &[Free]),
    point: &mut Point,
) -> Result<()> {
    let has_end = fitted.iter().any(|(_, added)| matches!(added.role, Role::Above | Role::Below));
    if !has_end || system.engine().is_some() {
        return Ok(());
    }
    let short = experiment.clone().with_windows_of(OF_A_HIT * experiment.longest_window());
    // Some of the windows stand for all of a long log.
    if short.n_samples() > experiment.n_samples() || short.windows.len() <= experiment.windows.len() {
        return Ok(());
    }
    let initial = guess_initial(system, &short);
    let fit = Budget::Usual.refine().fit_on(system, &short, (&point.parameters, free), &initial, None);
    let Some(found) = unless_refused(fit)? else { return Ok(()) };
    let other = Point { parameters: found.parameters, initial: point.initial.clone() };
    let both = costs(system, experiment, &[point.clone(), other.clone()], free);
    if both[1] < both[0] {
        *point = other;
    }
    Ok(())
}
