//! The events of a smoother: measurements and requested times, in order.

use crate::gp::points::Points;
use std::borrow::Cow;

/// Times in order, each with a measurement or without.
pub(super) struct Events<'a> {
    pub(super) time: Cow<'a, [f64]>,
    /// NaN where there is no measurement.
    pub(super) target: Cow<'a, [f64]>,
    /// Empty where all are 1.
    noise_weights: Cow<'a, [f64]>,
    /// Step of a uniform clock, all of it measured.
    pub(super) clock: Option<f64>,
}

impl<'a> Events<'a> {
    /// Measurements and the times `at` without one.
    pub(super) fn new(points: &'a Points, at: &[f64]) -> Self {
        let measured = &points.inputs[0];
        if at.is_empty() || at == measured {
            return Self {
                time: Cow::Borrowed(measured),
                target: Cow::Borrowed(&points.targets),
                noise_weights: Cow::Borrowed(&points.noise_weights),
                clock: points.uniform_step(),
            };
        }
        let mut extra: Vec<f64> = at.to_vec();
        extra.sort_by(f64::total_cmp);
        extra.dedup();
        let size = points.len() + extra.len();
        let weighted = !points.noise_weights.is_empty();
        let (mut time, mut target) = (Vec::with_capacity(size), Vec::with_capacity(size));
        let mut noise_weights = Vec::with_capacity(if weighted { size } else { 0 });
        let mut push = |t: f64, y: f64, weight: f64| {
            time.push(t);
            target.push(y);
            if weighted {
                noise_weights.push(weight);
            }
        };
        let mut next = 0;
        for (i, &now) in measured.iter().enumerate() {
            while next < extra.len() && extra[next] < now {
                push(extra[next], f64::NAN, 1.0);
                next += 1;
            }
            if next < extra.len() && extra[next] == now {
                next += 1;
            }
            push(now, points.targets[i], points.noise_weight(i));
        }
        extra[next..].iter().for_each(|&now| push(now, f64::NAN, 1.0));
        let clock = if time.len() == points.len() { points.uniform_step() } else { None };
        Self { time: Cow::Owned(time), target: Cow::Owned(target), noise_weights: Cow::Owned(noise_weights), clock }
    }

    /// Factor on the noise variance of event i.
    #[inline(always)]
    pub(super) fn noise_weight(&self, i: usize) -> f64 {
        self.noise_weights.get(i).copied().unwrap_or(1.0)
    }

    /// Where each of `at` is; neighbours are looked for near each other.
    pub(super) fn places(&self, at: &[f64]) -> Vec<usize> {
        let mut last = 0;
        let find = |&t: &f64| {
            let near = |i: usize| self.time[i] >= t && (i == 0 || self.time[i - 1] < t);
            let ahead = last..(last + 3).min(self.time.len());
            last = ahead.into_iter().find(|&i| near(i)).unwrap_or_else(|| self.time.partition_point(|e| *e < t));
            last
        };
        at.iter().map(find).collect()
    }
}

/// What becomes of a number before it is kept: `factor` times it and `offset`, at least `lowest`.
#[derive(Clone, Copy)]
pub(super) struct Unit {
    pub(super) factor: f64,
    pub(super) offset: f64,
    pub(super) lowest: f64,
}

/// One number an event, in its unit.
pub(super) struct Column<'a> {
    pub(super) values: &'a mut [f64],
    pub(super) unit: Unit,
}

impl<'a> Column<'a> {
    pub(super) fn new(values: &'a mut [f64], unit: Unit) -> Self {
        Self { values, unit }
    }

    pub(super) fn put(&mut self, i: usize, found: f64) {
        self.values[i] = (self.unit.offset + self.unit.factor * found).max(self.unit.lowest);
    }
}
