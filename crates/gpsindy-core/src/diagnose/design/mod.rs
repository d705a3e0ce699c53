//! The next experiment: the control signal, within the rig's limits, that best distinguishes the simulators which logs left open.
//!
//! T-optimality (Atkinson and Fedorov 1975, The design of experiments for discriminating between two rival models,
//! Biometrika 62): a signal is as good as its separation of the pair that is hardest to distinguish, where each rival may
//! adjust its parameters as far as the earlier logs allow.

pub(crate) mod open;
pub(crate) mod separation;
pub(crate) mod settings;
pub(crate) mod signals;

use crate::diagnose::limits::{DESIGN_ROUNDS, DRAWN_SIGNALS, SEPARATE, VARIATIONS};
use crate::error::{Error, Result};
use crate::model::Dynamics;
use crate::progress::{Progress, step};
use open::Open;
use separation::{Bench, Part};
use settings::{Design, Designed, Separation};
use signals::{Form, Frame, Signal};
use std::sync::Arc;
use std::sync::atomic::Ordering;

impl Design {
    /// The signal that best distinguishes the candidates of `open`; `simulator` where they call one.
    ///
    /// # Errors
    /// A setting out of range, a control without a limit, limits within which every candidate leaves the bounds of a
    /// state, candidates that no signal moves, and a request to stop.
    pub fn run(&self, open: &Open, simulator: Option<Arc<dyn Dynamics>>, progress: &dyn Progress) -> Result<Designed> {
        self.check(open)?;
        let frame = Frame::new(self, open);
        let bench = Bench::new(self, open, simulator, &frame)?;
        let total = Form::ALL.len() + DESIGN_ROUNDS;
        let mut best: Option<(Signal, f64)> = None;
        let enough = progress.enough();
        let begun = progress.seconds().unwrap_or(0.0);
        let is_over = || {
            let limit = self.time_limit.zip(progress.seconds());
            limit.is_some_and(|(limit, now)| now - begun >= limit)
                || enough.as_ref().is_some_and(|enough| enough.load(Ordering::Relaxed))
        };
        let mut is_complete = true;
        for (done, form) in Form::ALL.into_iter().enumerate() {
            step(progress, "experiment: drawing", done, total)?;
            // One form at least: without a signal there is no answer.
            if best.is_some() && is_over() {
                is_complete = false;
                break;
            }
            let drawn = (0..DRAWN_SIGNALS).map(|draw| frame.draw(form, draw)).collect();
            keep_best(&mut best, &bench, drawn)?;
        }
        for round in 0..DESIGN_ROUNDS {
            step(progress, "experiment: refining", Form::ALL.len() + round, total)?;
            let Some((signal, _)) = &best else { break };
            if is_over() {
                is_complete = false;
                break;
            }
            let varied = (0..VARIATIONS).map(|draw| frame.vary(signal, round, draw)).collect();
            keep_best(&mut best, &bench, varied)?;
        }
        step(progress, "experiment: refining", total, total)?;
        let Some((signal, _)) = best else {
            return Err(Error::settings(
                "no signal within these limits keeps every state within its bounds; lower the limits or widen the bounds",
            ));
        };
        let separated = bench.part(std::slice::from_ref(&signal))?.swap_remove(0).unwrap_or_default();
        let mut pairs: Vec<Separation> = separated.iter().map(|part| self.separation(open, part)).collect();
        pairs.sort_by(|a, b| a.nats.total_cmp(&b.nats));
        let (time, controls, form, values) = (frame.time, frame.names, signal.form.name(), signal.values);
        Ok(Designed { time, controls, form, values, pairs, is_complete })
    }

    fn separation(&self, open: &Open, part: &Part) -> Separation {
        let label = |candidate: usize| open.candidates[candidate].label.clone();
        let reached = part.growth.iter().position(|&nats| nats >= SEPARATE);
        let share = |index: usize| (index + 1) as f64 / part.growth.len() as f64;
        Separation {
            one: label(part.pair.0),
            other: label(part.pair.1),
            nats: part.nats(),
            seconds: reached.map(|index| self.duration * share(index)),
        }
    }
}

/// Keeps the signal that separates its least separated pair most.
fn keep_best(best: &mut Option<(Signal, f64)>, bench: &Bench, signals: Vec<Signal>) -> Result<()> {
    let signals = bench.within_bounds(signals);
    let separated = bench.part(&signals)?;
    for (signal, parts) in signals.into_iter().zip(separated) {
        let Some(parts) = parts else { continue };
        let least = parts.iter().map(Part::nats).fold(f64::INFINITY, f64::min);
        if best.as_ref().is_none_or(|(_, so_far)| least > *so_far) {
            *best = Some((signal, least));
        }
    }
    Ok(())
}
