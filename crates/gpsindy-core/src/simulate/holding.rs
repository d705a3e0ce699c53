//! Changes of mode inside a step: where dry friction stops a state, and where it lets one go.

use super::dense::DenseStep;
use super::rates::Rates;
use crate::model::sticking::{Kept, Mode};

/// Parts of a step at whose ends a change is looked for.
const PARTS: usize = 8;
/// Halvings of such a part, down to the rounding of the time.
const HALVINGS: usize = 60;

/// A slot whose mode changes at the time `at`, s.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub(super) at: f64,
    pub(super) slot: usize,
    /// What it becomes where it was held; none where its state comes to zero.
    pub(super) let_go: Option<Mode>,
}

/// The first change within a step from the states `x` (n), where their rates are `slope` (n).
pub(super) fn first_change(rates: &mut Rates<'_>, step: &DenseStep, x: &[f64], slope: &[f64]) -> Option<Change> {
    let mut first: Option<Change> = None;
    for slot in 0..rates.n_slots() {
        let found = match rates.mode(slot) {
            Mode::Smooth => None,
            Mode::Held => leaves(rates, step, slot),
            mode => comes_to_rest(step, slot, (rates.held_state(slot), mode), x, slope),
        };
        first = match (first, found) {
            (Some(a), Some(b)) if a.at <= b.at => Some(a),
            (a, b) => b.or(a),
        };
    }
    first
}

/// Where the state of a slot in motion comes to zero.
fn comes_to_rest(
    step: &DenseStep,
    slot: usize,
    (state, mode): (usize, Mode),
    x: &[f64],
    slope: &[f64],
) -> Option<Change> {
    let side = if mode == Mode::Forward { 1.0 } else { -1.0 };
    let value = |t: f64| side * step.value(t, state);
    let time = |i: usize| step.start + step.length * i as f64 / PARTS as f64;
    let i = (1..=PARTS).find(|&i| value(time(i)) <= 0.0)?;
    let (mut low, mut high) = (time(i - 1), time(i));
    if i == 1 && x[state] == 0.0 {
        // It starts at zero: the place where it is back lies behind some time at which it was away.
        let away = (1..HALVINGS).map(|k| step.start + (high - step.start) * 0.5_f64.powi(k as i32));
        let left = (side * slope[state] > 0.0).then(|| away.into_iter().find(|&t| value(t) > 0.0)).flatten();
        match left {
            Some(t) => low = t,
            None => return Some(Change { at: step.start, slot, let_go: None }),
        }
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if value(middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(Change { at: high, slot, let_go: None })
}

/// Where the force that a held slot needs leaves its reach.
fn leaves(rates: &mut Rates<'_>, step: &DenseStep, slot: usize) -> Option<Change> {
    if rates.kept(slot) == Kept::Held {
        return None;
    }
    let n = step.coefficients[0].len();
    let (mut x, mut dx) = (vec![0.0; n], vec![0.0; n]);
    let mut excess = |t: f64| {
        x.iter_mut().enumerate().for_each(|(j, value)| *value = step.value(t, j));
        rates.rate(t, &x, &mut dx);
        let (force, reach) = rates.force(slot);
        (force.abs() - reach, force)
    };
    let time = |i: usize| step.start + step.length * i as f64 / PARTS as f64;
    let i = (1..=PARTS).find(|&i| excess(time(i)).0 > 0.0)?;
    let (mut low, mut high) = (time(i - 1), time(i));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if excess(middle).0 > 0.0 { high = middle } else { low = middle }
    }
    let mode = if excess(high).1 > 0.0 { Mode::Forward } else { Mode::Backward };
    Some(Change { at: high, slot, let_go: Some(mode) })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
