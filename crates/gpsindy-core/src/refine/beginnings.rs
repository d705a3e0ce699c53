//! Starts of a simulator that steps, found along ever longer beginnings of their windows.
//!
//! Servos saturate, friction sticks and contacts close, so that a start within the noise of its reading may still be several
//! of those events away from the true one, and a fit over the whole window stops at the first of them. Over three samples
//! there is nothing to stop at; each beginning that is a little longer starts where the last one ended.

use super::{Experiment, Refine, Window, guess_initial};
use crate::error::{Error, Result};
use crate::model::System;

/// Samples of the first beginning: three tell a place, a rate and what drives it.
const FIRST: usize = 3;

/// By how much each beginning is longer than the last. A six-joint arm with saturating servos, windows of 24 and of 96 samples:
/// 1.4 left none of 62 windows above 1.4 times the noise's variance, 2 left 6, and the whole window at once 27.
const LONGER: f64 = 1.4;

/// Steps on each: the next one goes on, so that a thousandth of the cost is not worth another.
const STEPS: Refine = Refine { max_iterations: 6, tolerance: 1e-3 };

/// Initial states of all windows at these parameters (all of the system's): what the first samples tell, and where the system
/// steps by itself also what its rollouts do.
///
/// # Errors
/// A computation that was asked to stop.
pub(crate) fn guess_starts(system: &System, experiment: &Experiment, parameters: &[f64]) -> Result<Vec<Vec<f64>>> {
    let mut starts = guess_initial(system, experiment);
    if system.engine().is_none() {
        return Ok(starts);
    }
    for (window, start) in experiment.windows.iter().zip(&mut starts) {
        for (c, &state) in experiment.columns.iter().enumerate() {
            let first = experiment.logs[window.log].measured[c][window.first];
            if first.is_finite() {
                start[state] = first;
            }
        }
    }
    let longest = experiment.windows.iter().map(|w| w.last - w.first + 1).max().unwrap_or(0);
    let mut count = FIRST;
    while count < longest {
        let beginning = |w: &Window| Window { last: w.last.min(w.first + count - 1), ..*w };
        let cut = Experiment { windows: experiment.windows.iter().map(beginning).collect(), ..experiment.clone() };
        match STEPS.fit(system, &cut, parameters, &[], Some(&starts)) {
            Ok(fit) => starts = fit.initial,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // Longer ones would leave all bounds, too.
            Err(_) => break,
        }
        count = (LONGER * count as f64).ceil() as usize;
    }
    Ok(starts)
}
