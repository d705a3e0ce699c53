//! Control signals within the rig's limits: multisines, chirps, steps and free forms, drawn and varied.

use crate::diagnose::design::open::Open;
use crate::diagnose::design::settings::Design;
use crate::diagnose::limits::{BENDS, LEAST_REACH, LONGEST_STEP, OCTAVES, SHORTEST_STEP, SINES, STRETCHES_BY};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// What a signal is drawn as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    Multisine,
    Chirp,
    Steps,
    Free,
}

impl Form {
    pub(crate) const ALL: [Self; 4] = [Self::Multisine, Self::Chirp, Self::Steps, Self::Free];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Multisine => "multisine",
            Self::Chirp => "chirp",
            Self::Steps => "steps",
            Self::Free => "free form",
        }
    }
}

/// A signal of every control.
#[derive(Debug, Clone)]
pub(crate) struct Signal {
    pub(crate) form: Form,
    /// One row a control.
    pub(crate) values: Vec<Vec<f64>>,
}

/// Limits of one control.
struct Limits {
    low: f64,
    high: f64,
    /// Largest change from one sample to the next.
    change: f64,
}

/// What all signals share: times, names and limits.
pub(crate) struct Frame {
    pub(crate) time: Vec<f64>,
    pub(crate) names: Vec<String>,
    limits: Vec<Limits>,
    period: f64,
    seed: u64,
}

impl Frame {
    pub(crate) fn new(design: &Design, open: &Open) -> Self {
        let period = 1.0 / design.rate;
        let names: Vec<String> = open.candidates[0].model.controls.iter().map(|c| c.name.clone()).collect();
        let limits = |name: &String| {
            let (low, high) = design.limits.iter().find(|l| l.0 == *name).map_or((0.0, 0.0), |l| (l.1, l.2));
            let rate = design.rate_limits.iter().find(|r| r.0 == *name).map_or(f64::INFINITY, |r| r.1);
            Limits { low, high, change: rate * period }
        };
        let limits = names.iter().map(limits).collect();
        let time = (0..design.samples()).map(|i| i as f64 * period).collect();
        Self { time, names, limits, period, seed: design.seed }
    }

    /// Signal number `draw` of a form.
    pub(crate) fn draw(&self, form: Form, draw: usize) -> Signal {
        let mut random = self.random(form as u64, draw);
        let values = self.limits.iter().map(|limits| {
            let shape = match form {
                Form::Multisine => self.multisine(&mut random),
                Form::Chirp => self.chirp(&mut random),
                Form::Steps => self.steps(&mut random),
                Form::Free => self.knots(&mut random),
            };
            // Half of the signals use the whole range, the others a part of it around a level.
            let reach = if random.next_u64().is_multiple_of(2) { 1.0 } else { uniform(&mut random, LEAST_REACH, 1.0) };
            let level = uniform(&mut random, -1.0 + reach, 1.0 - reach);
            let scaled = shape.iter().map(|s| level + reach * s);
            limits.keep(scaled.map(|s| limits.low + 0.5 * (s + 1.0) * (limits.high - limits.low)))
        });
        Signal { form, values: values.collect() }
    }

    /// `signal` with one stretch of it bent, shifted or scaled.
    pub(crate) fn vary(&self, signal: &Signal, round: usize, draw: usize) -> Signal {
        let mut random = self.random(Form::ALL.len() as u64 + round as u64, draw);
        let n = self.time.len();
        let varied = signal.values.iter().zip(&self.limits).map(|(values, limits)| {
            let half = 0.5 * (limits.high - limits.low);
            let middle = uniform(&mut random, 0.0, n as f64);
            let width = n as f64 * log_uniform(&mut random, BENDS.0, BENDS.1);
            let lift = half * uniform(&mut random, -1.0, 1.0);
            let scale = uniform(&mut random, STRETCHES_BY.0, STRETCHES_BY.1);
            let kind = random.next_u64() % 3;
            let centre = 0.5 * (limits.high + limits.low);
            let bump = |i: usize| (1.0 - ((i as f64 - middle) / width).abs()).max(0.0);
            let one = |(i, &value): (usize, &f64)| match kind {
                0 => value + lift * bump(i),
                1 => value + if bump(i) > 0.0 { lift } else { 0.0 },
                _ => centre + (value - centre) * (1.0 + (scale - 1.0) * bump(i).min(0.5) * 2.0),
            };
            limits.keep(values.iter().enumerate().map(one))
        });
        Signal { form: signal.form, values: varied.collect() }
    }

    /// `signal` with `share` of its distance from the value within the limits that is nearest to rest.
    pub(crate) fn shrunk(&self, signal: &Signal, share: f64) -> Signal {
        let shrink = |(values, limits): (&Vec<f64>, &Limits)| {
            let rest = 0.0_f64.clamp(limits.low, limits.high);
            values.iter().map(|value| rest + share * (value - rest)).collect()
        };
        Signal { form: signal.form, values: signal.values.iter().zip(&self.limits).map(shrink).collect() }
    }

    /// Streams do not overlap, so that no signal depends on which others were made.
    fn random(&self, stage: u64, draw: usize) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream((stage << 32) | draw as u64);
        random
    }

    fn duration(&self) -> f64 {
        self.time.len() as f64 * self.period
    }

    /// Lowest and highest frequency that the run can carry, Hz.
    fn band(&self) -> (f64, f64) {
        let low = 1.0 / self.duration();
        (low, (1.0 / (SHORTEST_STEP * self.period)).max(2.0 * low))
    }

    /// All shapes lie within -1 and 1.
    fn multisine(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let (low, high) = self.band();
        let top = log_uniform(random, OCTAVES * low, high.max(OCTAVES * low));
        let sines: Vec<[f64; 3]> = (0..SINES)
            .map(|_| {
                let frequency = log_uniform(random, low, top);
                // Equal speeds: a high sine is small, as drives are.
                [frequency, uniform(random, 0.0, TAU), (low / frequency).powf(uniform(random, 0.0, 1.0))]
            })
            .collect();
        let value = |t: &f64| sines.iter().map(|[f, phase, size]| size * (TAU * f * t + phase).sin()).sum::<f64>();
        let values: Vec<f64> = self.time.iter().map(value).collect();
        let largest = values.iter().fold(1e-12, |a: f64, v| a.max(v.abs()));
        values.iter().map(|v| v / largest).collect()
    }

    fn chirp(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let (low, high) = self.band();
        let (from, to) = (log_uniform(random, low, high), log_uniform(random, low, high));
        let growth = (to / from).ln() / self.duration();
        let phase = uniform(random, 0.0, TAU);
        let cycles = |t: f64| if growth.abs() < 1e-9 { from * t } else { from * ((growth * t).exp() - 1.0) / growth };
        self.time.iter().map(|&t| (TAU * cycles(t) + phase).sin()).collect()
    }

    fn steps(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let n = self.time.len() as f64;
        let shortest = SHORTEST_STEP.min(LONGEST_STEP * n);
        let usual = log_uniform(random, shortest, (LONGEST_STEP * n).max(shortest));
        let (mut level, mut left) = (uniform(random, -1.0, 1.0), 0.0);
        let mut next = || {
            if left <= 0.0 {
                level = uniform(random, -1.0, 1.0);
                left = usual * log_uniform(random, 0.5, 2.0);
            }
            left -= 1.0;
            level
        };
        (0..self.time.len()).map(|_| next()).collect()
    }

    /// Straight lines between levels.
    fn knots(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let corners = self.steps(random);
        let mut values = corners.clone();
        let mut begin = 0;
        for i in 1..=corners.len() {
            if i == corners.len() || corners[i] != corners[begin] {
                let (from, to) = (corners[begin], corners.get(i).copied().unwrap_or(corners[begin]));
                (begin..i).for_each(|k| values[k] = from + (to - from) * (k - begin) as f64 / (i - begin) as f64);
                begin = i;
            }
        }
        values
    }
}

impl Limits {
    /// Values within the limits that change no faster than allowed.
    fn keep(&self, values: impl Iterator<Item = f64>) -> Vec<f64> {
        // A run begins at rest.
        let mut last: Option<f64> = self.change.is_finite().then(|| 0.0_f64.clamp(self.low, self.high));
        let one = |value: f64| {
            let value = value.clamp(self.low, self.high);
            let value = last.map_or(value, |last: f64| value.clamp(last - self.change, last + self.change));
            last = Some(value);
            value
        };
        values.map(one).collect()
    }
}

fn uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * crate::random::uniform(random)
}

fn log_uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    uniform(random, low.ln(), high.ln()).exp()
}
