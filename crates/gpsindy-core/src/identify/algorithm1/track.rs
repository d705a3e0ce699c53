//! One run as the regression sees it: smoothed states, their slopes, and controls with their delays.

use crate::data::Run;
use crate::error::{Error, Result};
use crate::identify::prepare::Logs;
use crate::refine::Hold;
use crate::smooth::SmoothedRun;
use faer::Mat;

/// Weight of a step's slopes in the middle of the cubic through values and slopes of both ends. Exact.
const SLOPES: f64 = 0.125;

/// A run, cut to what is trained on.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    /// Sample times, s, r of them.
    pub(crate) time: Vec<f64>,
    /// (r x n), the states as logged; NaN is missing.
    pub(crate) raw: Mat<f64>,
    /// (r x n), the states smoothed.
    pub(crate) mean: Mat<f64>,
    /// (r x n), their time derivatives.
    pub(crate) slope: Mat<f64>,
    /// (r x n), derivatives as logged; NaN where there are none.
    pub(crate) given: Mat<f64>,
    /// (r x m), the controls; a missing value holds the last known one.
    pub(crate) controls: Mat<f64>,
}

impl Track {
    /// From a run of the logs and its smoothed states.
    pub(crate) fn new(logs: &Logs, run: &Run, smoothed: &SmoothedRun) -> Result<Self> {
        let (r, n) = (run.n_samples(), logs.n_states());
        let controls = logs.controls();
        let given = |i: usize, j: usize| logs.rates[j].map_or(f64::NAN, |c| run.values[(i, c)]);
        let mut held = Mat::zeros(r, controls.len());
        for (k, &c) in controls.iter().enumerate() {
            let mut last =
                run.column(c).iter().copied().find(|v| v.is_finite()).ok_or_else(|| Error::TooFewSamples {
                    what: format!("control `{}` in run `{}`", logs.data.channels()[c].name, run.name),
                    needed: 1,
                    found: 0,
                })?;
            for i in 0..r {
                let value = run.values[(i, c)];
                if value.is_finite() {
                    last = value;
                }
                held[(i, k)] = last;
            }
        }
        Ok(Self {
            time: run.time.clone(),
            raw: Mat::from_fn(r, n, |i, j| run.values[(i, j)]),
            mean: smoothed.mean.clone(),
            slope: smoothed.derivative.clone(),
            given: Mat::from_fn(r, n, given),
            controls: held,
        })
    }

    /// Number of samples r.
    pub(crate) fn n_samples(&self) -> usize {
        self.time.len()
    }

    /// Mean of control `control`, held between samples and `delay` seconds late, over `from..to` (s).
    pub(crate) fn control_mean(&self, control: usize, delay: f64, from: f64, to: f64) -> f64 {
        let held = self.controls.col_as_slice(control);
        let (from, to) = (from - delay, to - delay);
        let mut sample = self.time.partition_point(|&t| t <= from).saturating_sub(1);
        if to <= from {
            return held[sample];
        }
        let (mut at, mut sum) = (from, 0.0);
        while at < to {
            let next = self.time.get(sample + 1).copied().unwrap_or(f64::INFINITY).min(to);
            sum += held[sample] * (next - at);
            at = next;
            sample = (sample + 1).min(held.len() - 1);
        }
        sum / (to - from)
    }

    /// Control `control` at time `t` (s), `delay` seconds late, interpolated.
    fn control_between(&self, control: usize, delay: f64, t: f64) -> f64 {
        let values = self.controls.col_as_slice(control);
        let t = t - delay;
        let after = self.time.partition_point(|&other| other <= t);
        if after == 0 || after == values.len() {
            return values[after.saturating_sub(1)];
        }
        let part = (t - self.time[after - 1]) / (self.time[after] - self.time[after - 1]);
        values[after - 1] + part * (values[after] - values[after - 1])
    }

    /// Control `control` at time `t` within a step over `span`, `delay` seconds late: held, its mean over the step.
    pub(crate) fn control(&self, control: usize, delay: f64, hold: Hold, span: (f64, f64), t: f64) -> f64 {
        match hold {
            Hold::Zero => self.control_mean(control, delay, span.0, span.1),
            Hold::Linear => self.control_between(control, delay, t),
        }
    }

    /// States and controls at the start, middle and end of every step between samples, one matrix each ((r - 1) x (n + m)).
    ///
    /// The middle follows the cubic through values and slopes of both ends; a held control enters by its mean over the step.
    pub(crate) fn steps(&self, hold: Hold, delays: &[f64]) -> [Mat<f64>; 3] {
        let (n, m, r) = (self.mean.ncols(), self.controls.ncols(), self.n_samples());
        let mut parts = [0, 1, 2].map(|_| Mat::<f64>::zeros(r.saturating_sub(1), n + m));
        for i in 0..r.saturating_sub(1) {
            let h = self.time[i + 1] - self.time[i];
            for j in 0..n {
                let (a, b) = (self.mean[(i, j)], self.mean[(i + 1, j)]);
                parts[0][(i, j)] = a;
                parts[1][(i, j)] = 0.5 * (a + b) + SLOPES * h * (self.slope[(i, j)] - self.slope[(i + 1, j)]);
                parts[2][(i, j)] = b;
            }
            for k in 0..m {
                let (from, to) = (self.time[i], self.time[i + 1]);
                let values = match hold {
                    Hold::Zero => [self.control_mean(k, delays[k], from, to); 3],
                    Hold::Linear => [from, 0.5 * (from + to), to].map(|t| self.control_between(k, delays[k], t)),
                };
                parts.iter_mut().zip(values).for_each(|(part, value)| part[(i, n + k)] = value);
            }
        }
        parts
    }

    /// States and controls at the samples (r x (n + m)); a held control enters by its mean over the half
    /// steps next to a sample.
    pub(crate) fn samples(&self, hold: Hold, delays: &[f64]) -> Mat<f64> {
        let (n, r) = (self.mean.ncols(), self.n_samples());
        let half = |i: usize, k: usize| {
            if hold == Hold::Linear {
                return self.control_between(k, delays[k], self.time[i]);
            }
            let before = if i > 0 { 0.5 * (self.time[i] - self.time[i - 1]) } else { 0.0 };
            let after = if i + 1 < r { 0.5 * (self.time[i + 1] - self.time[i]) } else { 0.0 };
            self.control_mean(k, delays[k], self.time[i] - before, self.time[i] + after)
        };
        Mat::from_fn(r, n + self.controls.ncols(), |i, j| if j < n { self.mean[(i, j)] } else { half(i, j - n) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track() -> Track {
        let time = vec![0.0, 1.0, 2.0, 4.0];
        let column = |values: [f64; 4]| Mat::from_fn(4, 1, |i, _| values[i]);
        Track {
            raw: column([0.0, 1.0, 8.0, 64.0]),
            mean: column([0.0, 1.0, 8.0, 64.0]),
            slope: column([0.0, 3.0, 12.0, 48.0]),
            given: column([f64::NAN; 4]),
            controls: column([1.0, 3.0, -1.0, 5.0]),
            time,
        }
    }

    #[test]
    fn a_late_control_is_averaged_over_the_step() {
        let track = track();
        assert_eq!(track.control_mean(0, 0.0, 1.0, 2.0), 3.0);
        assert_eq!(track.control_mean(0, 0.5, 1.0, 2.0), 2.0);
        // Before the log the first value counts, behind it the last.
        assert_eq!(track.control_mean(0, 3.0, 0.0, 1.0), 1.0);
        assert_eq!(track.control_mean(0, -1.0, 2.0, 4.0), 2.0);
    }

    #[test]
    fn an_interpolated_control_is_read_late() {
        let track = track();
        assert_eq!(track.control_between(0, 0.0, 0.5), 2.0);
        assert_eq!(track.control_between(0, 0.5, 3.5), 2.0);
        assert_eq!(track.control_between(0, 5.0, 3.5), 1.0);
        assert_eq!(track.steps(Hold::Linear, &[0.0]).map(|part| part[(2, 1)]), [-1.0, 2.0, 5.0]);
    }

    #[test]
    fn the_middle_of_a_step_is_exact_for_cubics() {
        let parts = track().steps(Hold::Zero, &[0.0]);
        for (i, middle) in [0.5f64, 1.5, 3.0].into_iter().enumerate() {
            assert!((parts[1][(i, 0)] - middle.powi(3)).abs() < 1e-12);
        }
    }
}
