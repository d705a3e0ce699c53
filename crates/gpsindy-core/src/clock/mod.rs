//! The offset between the clocks of two topics, from what their columns say of each other.
//!
//! Two kinds of relation are looked at, in weak form, so that no noise is differentiated: with the bump `psi` of a window,
//! `<x> = int psi x`, and derivatives of `x` move to `psi` by parts.
//!
//! - Two states that measure one motion: `<x^(a)> = c0 + c1 <z^(b)>` with `a`, `b` derivatives of order 0 to 2.
//! - A control that drives a state: `<x^(a)>`, `a` = 1 or 2, from low powers, sines and cosines of all states and the moved
//!   control, alone and times each state.
//!
//! Of each kind the relation that explains most is kept. The offset is the shift that leaves the smallest sum of squares. Its
//! interval is a block jackknife over time, which needs no model of the noise (Efron and Tibshirani 1993, chapter 11).

use crate::error::{Error, Result};
use crate::progress::{Progress, step};
use statrs::distribution::{ContinuousCDF, StudentsT};

mod relation;
mod windows;

use relation::{Fit, Relation};
use windows::{Trace, Windows};

/// Largest offset that is looked for, s, and as a share of the time that all columns have in common.
const REACH: f64 = 2.0;
const SHARE: f64 = 0.2;

/// Half widths of windows, in periods of the slowest column.
const WIDTHS: [f64; 3] = [4.0, 8.0, 16.0];

/// Positions between which the coarse search looks, in half widths, and most of them.
const COARSE: f64 = 0.5;
const MOST_SHIFTS: f64 = 400.0;

/// Parts of time that the jackknife leaves out one after the other.
const BLOCKS: usize = 20;

/// Least share of the changes of a column that another one must explain. Below it something else moves the column, and what
/// is common to both may have a lag of its own.
const SAME: f64 = 0.8;
const DRIVEN: f64 = 0.4;

/// By how many standard errors the best shift must fit better than any other isolated one.
const CLEAR: f64 = 3.0;

/// A column on the stamps of its topic.
#[derive(Debug, Clone, Copy)]
pub struct Signal<'a> {
    /// Name for the report.
    pub name: &'a str,
    /// s, strictly increasing, r of them.
    pub times: &'a [f64],
    /// r values; NaN is a missing value.
    pub values: &'a [f64],
    /// Whether it is a control, which keeps its value between its stamps.
    pub control: bool,
}

/// An estimated offset between clocks.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockOffset {
    /// s to add to the stamps of the topic.
    pub seconds: f64,
    /// Limits of its interval, s.
    pub low: f64,
    /// Upper limit, s.
    pub high: f64,
    /// Confidence of the interval.
    pub level: f64,
    /// The column of the topic that determined it.
    pub column: String,
    /// The column of another topic.
    pub other: String,
    /// Whether one drives the other; then a delay between both counts in the offset.
    pub driven: bool,
}

/// Estimates what to add to the stamps of one topic so that its columns agree with those of the others.
///
/// Offsets of up to 2 s, and up to a fifth of the common time, are looked for. `level` is the confidence of the interval.
///
/// ```
/// use gpsindy_core::{Signal, Silent, clock_offset};
/// let times: Vec<f64> = (0..2000).map(|i| i as f64 * 0.01).collect();
/// let angle = |t: f64| (2.0 * t).sin() + 0.5 * (4.7 * t).cos() + 0.3 * (0.71 * t).sin();
/// let early: Vec<f64> = times.iter().map(|t| angle(t + 0.05)).collect();
/// let right: Vec<f64> = times.iter().map(|t| angle(*t)).collect();
/// let a = Signal { name: "a", times: &times, values: &early, control: false };
/// let b = Signal { name: "b", times: &times, values: &right, control: false };
/// let found = clock_offset(&[a], &[b], 0.95, &Silent)?;
/// assert!((found.seconds - 0.05).abs() < 1e-3);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
///
/// # Errors
/// Columns that say too little of each other, that fit as well at another shift, a common time that is too short for an
/// interval, and a request to stop.
pub fn clock_offset(
    own: &[Signal<'_>],
    others: &[Signal<'_>],
    level: f64,
    progress: &dyn Progress,
) -> Result<ClockOffset> {
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::Range {
            name: "level".into(),
            expected: "above 0 and below 1".into(),
            found: level.to_string(),
        });
    }
    let (own, others) = (traces(own), traces(others));
    let span = |traces: &[Trace]| traces.iter().map(Trace::span).fold(None, common);
    let (Some((begin, end)), Some(other)) = (span(&own), span(&others)) else {
        return Err(Error::data("a topic has no column that changes, so its offset cannot be estimated"));
    };
    let (begin, end) = (begin.max(other.0), end.min(other.1));
    let reach = REACH.min(SHARE * (end - begin));
    let (states, controls): (Vec<&Trace>, Vec<&Trace>) = own.iter().partition(|t| !t.control);
    let (other_states, other_controls): (Vec<&Trace>, Vec<&Trace>) = others.iter().partition(|t| !t.control);
    // What moves, what stays, and whether a move of the first is one of the own topic.
    let sides = [
        (&states, &other_states, false, 1.0),
        (&controls, &other_states, true, 1.0),
        (&other_controls, &states, true, -1.0),
    ];
    let mut best: Option<(Fit, f64)> = None;
    let mut refused = String::from("no column of one topic says anything of a column of another");
    for (side, (moved, fixed, driven, sign)) in sides.into_iter().enumerate() {
        if moved.is_empty() || fixed.is_empty() {
            continue;
        }
        for (i, factor) in WIDTHS.into_iter().enumerate() {
            step(progress, "clock offset", side * WIDTHS.len() + i, 3 * WIDTHS.len())?;
            let period = moved.iter().chain(fixed).map(|t| t.period()).fold(0.0, f64::max);
            let width = (factor * period).max(2.0 * reach / (MOST_SHIFTS * COARSE));
            let Some(windows) = Windows::new(begin, end, reach, width, fixed) else { continue };
            match Relation::of(&windows, moved, fixed, driven).and_then(|relation| relation.fit(&windows)) {
                Ok(fit) if best.as_ref().is_none_or(|(known, _)| fit.error < known.error) => best = Some((fit, sign)),
                Ok(_) => {}
                Err(why) => refused = why,
            }
        }
    }
    let Some((fit, sign)) = best else {
        return Err(Error::data(format!("{refused}; give the offset in seconds")));
    };
    let quantile = StudentsT::new(0.0, 1.0, (BLOCKS - 1) as f64).map_or(f64::NAN, |t| t.inverse_cdf(0.5 + level / 2.0));
    let (half, seconds) = (quantile * fit.error, sign * fit.shift);
    if !(half < 0.5 * reach) || fit.shift.abs() + half > reach {
        return Err(Error::data(format!(
            "an offset of {seconds:.3} s fits best, give or take {half:.3} s, where up to {reach:.3} s were looked for; \
             give the offset in seconds"
        )));
    }
    let (column, other) = if sign > 0.0 { (fit.moved, fit.fixed) } else { (fit.fixed, fit.moved) };
    Ok(ClockOffset { seconds, low: seconds - half, high: seconds + half, level, column, other, driven: fit.driven })
}

fn traces(signals: &[Signal<'_>]) -> Vec<Trace> {
    signals.iter().filter_map(Trace::of).collect()
}

/// The time that both spans have.
fn common(a: Option<(f64, f64)>, b: (f64, f64)) -> Option<(f64, f64)> {
    Some(a.map_or(b, |a| (a.0.max(b.0), a.1.min(b.1))))
}

#[cfg(test)]
mod tests;
