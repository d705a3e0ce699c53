//! A signal that is sampled and held, in one lane.

use crate::model::{ROUNDING, SHORTEST_HOLD, sampled_at};

/// What a sample-and-hold has sampled over a part of a log.
pub(super) struct Held {
    /// The last moment at or before the log's begin at which it samples: moment number 0. Time from one to the next, s.
    first: f64,
    period: f64,
    /// Number of the first moment that is kept.
    from: usize,
    /// The value that is held from each moment on.
    values: Vec<f64>,
    /// Its integral up to each moment.
    integral: Vec<f64>,
}

impl Held {
    /// Has sampled nothing yet. `time`: that of the whole log, s.
    pub(super) fn new(time: &[f64], phase: f64, period: f64) -> Self {
        let (begin, last) = (time[0], time[time.len() - 1]);
        let shortest = (last - begin) / time.len() as f64 * SHORTEST_HOLD;
        let period = if shortest > 0.0 { period.max(shortest) } else { 1.0 };
        Self { first: sampled_at(begin, phase, period), period, from: 0, values: Vec::new(), integral: vec![0.0] }
    }

    /// Time from one moment to the next, s.
    pub(super) fn period(&self) -> f64 {
        self.period
    }

    /// Forgets all. The next moment is the last one at or before `begin`, s.
    pub(super) fn restart(&mut self, begin: f64) {
        self.from = self.number(begin);
        self.values.clear();
        self.integral = vec![0.0];
    }

    /// Forgets the moments before the last one at or before `begin`, s.
    pub(super) fn forget(&mut self, begin: f64) {
        let gone = self.number(begin).saturating_sub(self.from).min(self.values.len().saturating_sub(1));
        self.values.drain(..gone);
        self.integral.drain(..gone);
        self.from += gone;
    }

    /// Samples at every moment up to `last`, s. `at(moment, later)`: the signal, where one that jumps until `later` has done so.
    pub(super) fn extend(&mut self, last: f64, at: impl Fn(f64, f64) -> f64) {
        let nudge = ROUNDING * self.period;
        loop {
            let moment = self.first + self.period * (self.from + self.values.len()) as f64;
            // One value there must be.
            if moment > last + nudge && !self.values.is_empty() {
                return;
            }
            let value = at(moment, moment + nudge);
            self.integral.push(self.integral[self.values.len()] + self.period * value);
            self.values.push(value);
        }
    }

    /// The value at `t`.
    pub(super) fn value_at(&self, t: f64) -> f64 {
        self.values[self.locate(t + ROUNDING * self.period).0]
    }

    /// The integral from a moment that stays the same until a restart up to `t`.
    pub(super) fn integral_at(&self, t: f64) -> f64 {
        let (place, since) = self.locate(t);
        self.integral[place] + self.values[place] * since
    }

    fn number(&self, t: f64) -> usize {
        ((t - self.first) / self.period).floor().max(0.0) as usize
    }

    /// Place of the value that holds at `t`, and how long it has held, s.
    fn locate(&self, t: f64) -> (usize, f64) {
        let number = ((t - self.first) / self.period).floor();
        let (from, last) = (self.from as f64, (self.values.len() - 1) as f64);
        let number = number.clamp(from, from + last);
        ((number - from) as usize, t - self.first - self.period * number)
    }
}
