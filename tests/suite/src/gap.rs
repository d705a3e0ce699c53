//! The clean gap: how far the nominal rollout stays from the noise-free readings, its start being fitted.

use crate::effect::Effect;
use crate::plant::Plant;
use crate::simulate::{Commands, Machine, Setup, Trace};

/// A gap over some runs.
#[derive(Debug, Clone)]
pub struct Gap {
    /// Root mean square over samples and logged columns, in units of the noise.
    pub snr: f64,
    /// Root mean square by logged column, in its unit.
    pub by_column: Vec<f64>,
}

/// What is compared: the log of one run without noise.
pub struct Log<'a> {
    /// Sample times.
    pub times: &'a [f64],
    /// The run.
    pub trace: &'a Trace,
}

/// Settings of a comparison.
pub struct Ruler<'a> {
    /// The plant.
    pub plant: &'a Plant,
    /// Noise of each logged column.
    pub noise: &'a [f64],
    /// Sizes of the states.
    pub scale: &'a [f64],
    /// Seconds after which a rollout starts afresh; 0: never.
    pub reset: f64,
}

impl Ruler<'_> {
    /// Gap between runs and the model with `effects` (nominal: none); `None` when no rollout stays finite.
    pub fn gap(&self, logs: &[Log], effects: &[Effect]) -> Option<Gap> {
        let columns = self.plant.logged.len();
        let mut squares = vec![0.0; columns];
        let mut count = 0.0;
        for log in logs {
            for window in self.windows(log.times) {
                let residual = self.fitted(log, window.clone(), effects)?;
                for (k, r) in residual.iter().enumerate() {
                    squares[k % columns] += r * r;
                }
                count += window.len() as f64;
            }
        }
        let snr = (squares.iter().sum::<f64>() / (count * columns as f64)).sqrt();
        let by_column = squares.iter().zip(self.noise).map(|(s, n)| n * (s / count).sqrt()).collect();
        Some(Gap { snr, by_column })
    }

    /// The pieces of a run on which a rollout runs through.
    pub fn windows(&self, times: &[f64]) -> Vec<std::ops::Range<usize>> {
        let mut list = Vec::new();
        let mut first = 0;
        for k in 0..times.len() {
            if self.reset > 0.0 && times[k] - times[first] >= self.reset && times.len() - k > 5 {
                list.push(first..k);
                first = k;
            }
        }
        list.push(first..times.len());
        list
    }

    /// Residuals in units of the noise, row by row, after the start is fitted by Gauss-Newton.
    fn fitted(&self, log: &Log, window: std::ops::Range<usize>, effects: &[Effect]) -> Option<Vec<f64>> {
        let machine = Machine::new(self.plant, effects, self.scale, 1e-7);
        let roll = |start: &[f64]| {
            let setup = Setup {
                times: log.times[window.clone()].to_vec(),
                start: start.to_vec(),
                commands: Commands::Open(log.trace.controls[window.clone()].to_vec()),
                linear: false,
            };
            let trace = machine.run(&setup)?;
            let mut residual = Vec::new();
            for (model, real) in trace.readings.iter().zip(&log.trace.readings[window.clone()]) {
                for (&i, noise) in self.plant.logged.iter().zip(self.noise) {
                    residual.push((real[i] - model[i]) / noise);
                }
            }
            Some(residual)
        };
        let mut start = log.trace.states[window.start].clone();
        let mut best = roll(&start)?;
        for _ in 0..4 {
            let n = start.len();
            let mut slopes = Vec::new();
            for i in 0..n {
                let h = 1e-4 * self.scale[i];
                let mut moved = start.clone();
                moved[i] += h;
                let there = roll(&moved)?;
                slopes.push(there.iter().zip(&best).map(|(a, b)| (a - b) / h * self.scale[i]).collect::<Vec<f64>>());
            }
            let Some(step) = least_squares(&slopes, &best) else { break };
            let moved: Vec<f64> = (0..n).map(|i| start[i] - step[i] * self.scale[i]).collect();
            let Some(residual) = roll(&moved) else { break };
            let (old, new) = (sum(&best), sum(&residual));
            if new >= old {
                break;
            }
            (start, best) = (moved, residual);
            if new > 0.99 * old {
                break;
            }
        }
        Some(best)
    }
}

fn sum(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

/// Solves `min |A s - b|` for few columns by the normal equations with a touch of ridge.
pub(crate) fn least_squares(columns: &[Vec<f64>], b: &[f64]) -> Option<Vec<f64>> {
    let n = columns.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut a: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| dot(&columns[i], &columns[j])).collect()).collect();
    let mut right: Vec<f64> = columns.iter().map(|c| dot(c, b)).collect();
    for (i, row) in a.iter_mut().enumerate() {
        row[i] = row[i] * (1.0 + 1e-10) + 1e-12;
    }
    for i in 0..n {
        let pivot = (i..n).max_by(|&p, &q| a[p][i].abs().total_cmp(&a[q][i].abs()))?;
        a.swap(i, pivot);
        right.swap(i, pivot);
        if a[i][i].abs() < 1e-300 || !a[i][i].is_finite() {
            return None;
        }
        for r in i + 1..n {
            let f = a[r][i] / a[i][i];
            let lead = a[i].clone();
            for (value, lead) in a[r].iter_mut().zip(&lead).skip(i) {
                *value -= f * lead;
            }
            right[r] -= f * right[i];
        }
    }
    for i in (0..n).rev() {
        let rest: f64 = (i + 1..n).map(|j| a[i][j] * right[j]).sum();
        right[i] = (right[i] - rest) / a[i][i];
    }
    right.iter().all(|v| v.is_finite()).then_some(right)
}
