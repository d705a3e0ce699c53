//! Settings of a designed experiment, and what comes out of it.

use crate::diagnose::design::open::Open;
use crate::diagnose::limits::{DURATION, RATE};
use crate::error::{Error, Result};

/// Settings of a designed experiment.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `limits` | none | low at most high | every control's, in its unit; equal ones hold it still |
/// | `rate_limits` | none | above 0 | largest change of a control in a second |
/// | `bounds` | none | low below high | of states, which no candidate may leave |
/// | `duration` | 10 | above 0 | s |
/// | `rate` | 50 | above 0 | samples a second; at least 16 in all |
/// | `start` | the logs' own | | states where the run begins |
/// | `seed` | 0 | | of the signals that are tried |
/// | `time_limit` | none | above 0 | s on the listener's clock, after which the best signal so far is taken |
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Control, lowest and highest value.
    pub limits: Vec<(String, f64, f64)>,
    /// Control, and its largest change in a second.
    pub rate_limits: Vec<(String, f64)>,
    /// State, lowest and highest value.
    pub bounds: Vec<(String, f64, f64)>,
    /// Length of the run, s.
    pub duration: f64,
    /// Samples a second.
    pub rate: f64,
    /// State and value where the run begins; others begin where the logs did.
    pub start: Vec<(String, f64)>,
    /// Seed of the signals that are tried.
    pub seed: u64,
    /// Seconds on the listener's clock, after which the best signal so far is taken.
    pub time_limit: Option<f64>,
}

impl Default for Design {
    fn default() -> Self {
        Self {
            limits: Vec::new(),
            rate_limits: Vec::new(),
            bounds: Vec::new(),
            duration: DURATION,
            rate: RATE,
            start: Vec::new(),
            seed: 0,
            time_limit: None,
        }
    }
}

/// A designed experiment.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Designed {
    /// Sample times from zero, s, r of them.
    pub time: Vec<f64>,
    /// Names of the controls.
    pub controls: Vec<String>,
    /// One row a control, r values each, in its unit, held between samples.
    pub values: Vec<Vec<f64>>,
    /// What the signal began as: `multisine`, `chirp`, `steps` or `free form`.
    pub form: &'static str,
    /// How far every pair is separated, the least first.
    pub pairs: Vec<Separation>,
    /// Whether all signals were tried: time was not up, and nobody had waited long enough.
    pub is_complete: bool,
}

/// How far a pair of simulators is separated.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Separation {
    /// One of the pair.
    pub one: String,
    /// The other.
    pub other: String,
    /// Expected log odds in favour of the right one, whichever it is, nats.
    pub nats: f64,
    /// After how many seconds the right one is expected at 95 %; `None`: not within the run.
    pub seconds: Option<f64>,
}

impl Design {
    pub(crate) fn samples(&self) -> usize {
        (self.duration * self.rate).round() as usize + 1
    }

    pub(crate) fn check(&self, open: &Open) -> Result<()> {
        for (name, value) in [("duration", self.duration), ("rate", self.rate)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::range(name, "above 0", value));
            }
        }
        if let Some(limit) = self.time_limit.filter(|limit| !(*limit > 0.0)) {
            return Err(Error::range("time limit", "above 0", limit));
        }
        if !(16..=1_000_000).contains(&self.samples()) {
            return Err(Error::range("duration times rate", "between 16 and 1,000,000 samples", self.samples()));
        }
        if open.pairs.is_empty() {
            return Err(Error::settings("there is no pair of simulators to distinguish; hand in at least two"));
        }
        let model = &open.candidates[0].model;
        let controls = || model.controls.iter().map(|c| &c.name);
        for name in self.limits.iter().map(|l| &l.0).chain(self.rate_limits.iter().map(|l| &l.0)) {
            if model.control_index(name).is_none() {
                return Err(Error::unknown("control", name, controls()));
            }
        }
        for name in self.bounds.iter().map(|b| &b.0).chain(self.start.iter().map(|s| &s.0)) {
            if model.state_index(name).is_none() {
                return Err(Error::unknown("state", name, model.states.iter().map(|s| &s.name)));
            }
        }
        if let Some((name, low, high)) =
            self.limits.iter().find(|l| !(l.1 <= l.2 && l.1.is_finite() && l.2.is_finite()))
        {
            return Err(Error::range(&format!("limits of `{name}`"), "low at most high", format!("{low}:{high}")));
        }
        if let Some((name, low, high)) = self.bounds.iter().find(|b| !(b.1 < b.2)) {
            return Err(Error::range(&format!("bounds of `{name}`"), "low below high", format!("{low}:{high}")));
        }
        if let Some((name, rate)) = self.rate_limits.iter().find(|r| !(r.1 > 0.0)) {
            return Err(Error::range(&format!("rate limit of `{name}`"), "above 0", rate));
        }
        match controls().find(|name| self.limits.iter().all(|l| l.0 != **name)) {
            Some(name) => {
                Err(Error::settings(format!("control `{name}` has no limit; say its lowest and highest value")))
            }
            None => Ok(()),
        }
    }
}
