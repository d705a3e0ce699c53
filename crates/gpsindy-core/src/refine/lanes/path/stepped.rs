//! Differences from the path of a simulator that steps: from sample to sample, for every suspect together.
//!
//! The steps of a sample are multiplied once, so that a difference goes from one sample to the next by one matrix, and a signal by
//! one vector a step. Along the logs, the readings correct what is predicted, and every difference with it.

use super::L;
use crate::model::System;
use crate::model::change::Entry;
use crate::refine::lanes::tangent::{DIFFERENCE, Step, Tangent, answers};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// The steps of one window.
pub(super) struct Stepped {
    tangent: Arc<Tangent>,
    /// Which of its windows.
    window: usize,
    /// Number of states.
    n: usize,
    /// Step by step: by how much a difference at its end moves the next sample (n x n, row after row).
    behind: Vec<f64>,
    /// Sample by sample: the same of a difference as it is predicted there, and of what is read otherwise (n x c); the latter of a
    /// filter only.
    carried: Vec<f64>,
    corrected: Vec<f64>,
    /// By argument and then by rate: by how much one of it in a step moves the next sample (n a step); made where first asked for.
    pushed: Vec<OnceLock<Vec<f64>>>,
}

impl Stepped {
    /// Of one of the windows of `tangent`, of whose steps `before` lie before each sample; `slopes` are the derivatives of its readings by the
    /// states, sample by sample (c x n).
    pub(super) fn new((tangent, window): (Arc<Tangent>, usize), n: usize, before: &[usize], slopes: &[f64]) -> Self {
        let steps = &tangent.steps[window];
        let mut behind = vec![0.0; steps.len() * n * n];
        let mut carried = Vec::with_capacity(before.len().saturating_sub(1) * n * n);
        let mut corrected = Vec::new();
        let unit: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i / n == i % n))).collect();
        for (sample, range) in before.windows(2).map(|pair| pair[0]..pair[1]).enumerate() {
            let mut whole = unit.clone();
            for step in range.rev() {
                behind[step * n * n..(step + 1) * n * n].copy_from_slice(&whole);
                whole = product(&whole, &steps[step].by_states, n);
            }
            if let Some(corrections) = &tangent.corrections {
                let gain = &corrections[window][sample].gain;
                let c = gain.len() / n;
                let back: Vec<f64> = product(&whole, gain, n).into_iter().map(|by| -by).collect();
                let moved = product(&back, &slopes[sample * c * n..(sample + 1) * c * n], c);
                whole.iter_mut().zip(moved).for_each(|(whole, moved)| *whole += moved);
                corrected.extend(back);
            }
            carried.extend(whole);
        }
        let arguments = steps.first().map_or(0, |step| step.arguments.len());
        let pushed = (0..arguments + n).map(|_| OnceLock::new()).collect();
        Self { tangent, window, n, behind, carried, corrected, pushed }
    }

    /// Length of a step, s.
    pub(super) fn length(&self, step: usize) -> f64 {
        self.steps()[step].dt
    }

    fn steps(&self) -> &[Step] {
        &self.tangent.steps[self.window]
    }

    /// By how much one of an entry moves the next sample, step by step.
    fn pushes(&self, system: &System, entry: Entry) -> &[f64] {
        let n = self.n;
        let place = match entry {
            Entry::Argument(i) => i,
            Entry::Rate(j) => self.pushed.len() - n + j,
        };
        let steps = || self.behind.chunks_exact(n * n);
        self.pushed[place].get_or_init(|| match entry {
            Entry::Argument(i) => {
                let slopes = self.tangent.by_argument(system, self.window, i).chunks_exact(n);
                steps().zip(slopes).flat_map(|(behind, slopes)| product(behind, slopes, n)).collect()
            }
            // What acts beside a simulator acts over all of a step.
            Entry::Rate(j) => {
                let over = |(behind, step): (&[f64], &Step)| {
                    behind.chunks_exact(n).map(|row| step.dt * row[j]).collect::<Vec<f64>>()
                };
                steps().zip(self.steps()).flat_map(over).collect()
            }
        })
    }

    /// What the simulator itself answers to commands that a filter's suspects change by more than a difference: by how much that moves
    /// the next samples, lane by lane. These commands are no longer among the signals.
    ///
    /// A servo that is driven to its limits does not feel a little more of its command, and is moved by one that comes late.
    fn answered(
        &self,
        system: &System,
        before: &[usize],
        (entries, signals): (&[Entry], &mut [Vec<Vec<f64>>]),
    ) -> Vec<[f64; L]> {
        let (Some(simulator), Some(_)) = (system.simulator(), &self.tangent.corrections) else { return Vec::new() };
        let command = |(place, entry): (usize, &Entry)| match entry {
            Entry::Argument(i) if *i < simulator.n_controls() => Some((place, *i)),
            _ => None,
        };
        let commands: Vec<(usize, usize)> = entries.iter().enumerate().filter_map(command).collect();
        let mut asked: Vec<(usize, usize)> = Vec::new();
        for (lane, signals) in signals.iter().enumerate() {
            // Nearer than that it is the same command, but for rounding.
            let is_other = |step: &usize| commands.iter().any(|(place, _)| signals[*place][*step].abs() > DIFFERENCE);
            asked.extend((0..self.steps().len()).filter(is_other).map(|step| (lane, step)));
        }
        let mut moved = Vec::new();
        if !asked.is_empty() {
            moved.resize((before.len() - 1) * self.n, [0.0; L]);
        }
        let ask = |&(lane, step): &(usize, usize)| {
            let changed = commands.iter().map(|&(place, i)| (i, signals[lane][place][step]));
            (&self.steps()[step], changed.collect::<Vec<_>>())
        };
        let answers = answers(system, asked.iter().map(ask));
        for (&(lane, step), next) in asked.iter().zip(answers.chunks_exact(self.n)) {
            let off: Vec<f64> = next.iter().zip(&self.steps()[step].next).map(|(a, b)| a - b).collect();
            let sample = before.partition_point(|&first| first <= step) - 1;
            let behind = &self.behind[step * self.n * self.n..][..self.n * self.n];
            for (moved, by) in moved[sample * self.n..].iter_mut().zip(product(behind, &off, self.n)) {
                moved[lane] += by;
            }
        }
        for signals in signals.iter_mut() {
            commands.iter().for_each(|(place, _)| signals[*place].fill(0.0));
        }
        moved
    }

    /// Differences from the path at every sample, state by state, as they are predicted there: of signals in `entries` and of readings
    /// that are others by `shown` (column, and its values by sample), one lane for each set of both.
    pub(super) fn moved(
        &self,
        system: &System,
        before: &[usize],
        (entries, signals): (&[Entry], &mut [Vec<Vec<f64>>]),
        (columns, shown): (&[usize], &[Vec<Vec<f64>>]),
    ) -> Vec<[f64; L]> {
        let answered = self.answered(system, before, (entries, signals));
        let pushes: Vec<&[f64]> = entries.iter().map(|entry| self.pushes(system, *entry)).collect();
        let columns = if self.corrected.is_empty() { &[] } else { columns };
        let (signals, answered) = (&*signals, &answered[..]);
        pulp::Arch::new().dispatch(Moved { stepped: self, before, pushes, signals, columns, shown, answered })
    }
}

/// The product of a matrix (rows x `inner`) and another one (`inner` x columns), both row after row.
fn product(a: &[f64], b: &[f64], inner: usize) -> Vec<f64> {
    let columns = b.len() / inner.max(1);
    let mut all = vec![0.0; a.len() / inner.max(1) * columns];
    for (all, row) in all.chunks_exact_mut(columns.max(1)).zip(a.chunks_exact(inner.max(1))) {
        for (by, other) in row.iter().zip(b.chunks_exact(columns.max(1))) {
            all.iter_mut().zip(other).for_each(|(sum, other)| *sum += by * other);
        }
    }
    all
}

/// The recursion, compiled for every kind of vector instructions.
struct Moved<'s> {
    stepped: &'s Stepped,
    before: &'s [usize],
    pushes: Vec<&'s [f64]>,
    signals: &'s [Vec<Vec<f64>>],
    columns: &'s [usize],
    shown: &'s [Vec<Vec<f64>>],
    answered: &'s [[f64; L]],
}

impl Moved<'_> {
    /// Adds what the signals of some steps push.
    #[inline(always)]
    fn push(&self, steps: Range<usize>, next: &mut [[f64; L]]) {
        let n = next.len();
        for (place, pushes) in self.pushes.iter().enumerate() {
            for step in steps.clone() {
                let mut push = [0.0; L];
                push.iter_mut().zip(self.signals).for_each(|(push, signals)| *push = signals[place][step]);
                for (next, by) in next.iter_mut().zip(&pushes[step * n..(step + 1) * n]) {
                    next.iter_mut().zip(&push).for_each(|(next, push)| *next += by * push);
                }
            }
        }
    }
}

impl pulp::WithSimd for Moved<'_> {
    type Output = Vec<[f64; L]>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
        let (Self { stepped, before, columns, .. }, n) = (&self, self.stepped.n);
        let samples = before.len() - 1;
        let mut moved = vec![[0.0; L]; (samples + 1) * n];
        let c = stepped.corrected.len() / (samples * n).max(1);
        for sample in 0..samples {
            let (now, next) = moved[sample * n..(sample + 2) * n].split_at_mut(n);
            for (next, carried) in next.iter_mut().zip(stepped.carried[sample * n * n..].chunks_exact(n)) {
                let mut sum = [0.0; L];
                for (by, now) in carried.iter().zip(&*now) {
                    sum.iter_mut().zip(now).for_each(|(sum, now)| *sum += by * now);
                }
                *next = sum;
            }
            for (place, &column) in columns.iter().enumerate() {
                let mut shown = [0.0; L];
                shown.iter_mut().zip(self.shown).for_each(|(value, shown)| *value = shown[place][sample]);
                for (next, by) in next.iter_mut().zip(stepped.corrected[sample * n * c..].chunks_exact(c)) {
                    next.iter_mut().zip(&shown).for_each(|(next, shown)| *next += by[column] * shown);
                }
            }
            self.push(before[sample]..before[sample + 1], next);
            if let Some(answered) = self.answered.get(sample * n..(sample + 1) * n) {
                for (next, by) in next.iter_mut().zip(answered) {
                    next.iter_mut().zip(by).for_each(|(next, by)| *next += by);
                }
            }
        }
        moved
    }
}
