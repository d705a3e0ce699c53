//! The data of a Gaussian process: inputs, targets, relative noise.

use crate::error::{Error, Result};

/// Share of the step by which uniform times may be off, since files round them. A value that changes by its own standard deviation
/// in a step is off by 1e-5 of that, a tenth of the lowest noise that a fit allows.
const ROUNDED: f64 = 1e-5;

/// Noisy values of one function: n inputs of dimension d, n targets.
#[derive(Debug, Clone, Default)]
pub struct Points {
    /// d columns of n inputs; time alone is one column.
    pub inputs: Vec<Vec<f64>>,
    /// n targets.
    pub targets: Vec<f64>,
    /// Factor on the noise variance of each point; empty where all have the same.
    pub noise_weights: Vec<f64>,
}

impl Points {
    /// Values of a function of time, those that are missing (NaN) left out.
    pub fn in_time(time: &[f64], values: &[f64]) -> Self {
        let kept = || time.iter().zip(values).filter(|(_, v)| !v.is_nan());
        Self {
            inputs: vec![kept().map(|(t, _)| *t).collect()],
            targets: kept().map(|(_, v)| *v).collect(),
            noise_weights: Vec::new(),
        }
    }

    /// Number of points n.
    pub fn len(&self) -> usize {
        self.targets.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// Number of inputs d.
    pub fn dimension(&self) -> usize {
        self.inputs.len()
    }

    /// Factor on the noise variance of point i.
    pub(crate) fn noise_weight(&self, i: usize) -> f64 {
        self.noise_weights.get(i).copied().unwrap_or(1.0)
    }

    /// Step of times that are uniform within 1e-5 of it; `None` for anything else.
    pub fn uniform_step(&self) -> Option<f64> {
        let [time] = self.inputs.as_slice() else { return None };
        let (&[first, ..], &[.., last]) = (time.as_slice(), time.as_slice()) else { return None };
        let n = time.len();
        if n < 2 || !self.noise_weights.is_empty() {
            return None;
        }
        let step = (last - first) / (n - 1) as f64;
        let uniform = |(i, &t): (usize, &f64)| (t - first - i as f64 * step).abs() <= ROUNDED * step;
        (step > 0.0 && time.iter().enumerate().all(uniform)).then_some(step)
    }

    /// Whether the inputs are one column that never goes back, as the state-space engine needs.
    pub(crate) fn ordered(&self) -> bool {
        matches!(self.inputs.as_slice(), [time] if time.windows(2).all(|w| w[1] >= w[0]))
    }

    /// Sizes and values that the engines rely on.
    ///
    /// # Errors
    /// Columns of different lengths, a value that is not finite, a weight that is not positive.
    pub fn check(&self) -> Result<()> {
        let n = self.len();
        for (d, column) in self.inputs.iter().enumerate() {
            if column.len() != n {
                return Err(Error::shape(format!("input {} of the process", d + 1), n, column.len()));
            }
        }
        if self.inputs.is_empty() {
            return Err(Error::shape("inputs of the process", "at least one column", 0));
        }
        if !self.noise_weights.is_empty() && self.noise_weights.len() != n {
            return Err(Error::shape("noise weights of the process", n, self.noise_weights.len()));
        }
        if !self.inputs.iter().chain([&self.targets]).all(|column| all_finite(column)) {
            return Err(Error::NotFinite { what: "inputs and targets of the process".into() });
        }
        if !self.noise_weights.iter().all(|w| w.is_finite() && *w > 0.0) {
            return Err(Error::range("noise weight", "above 0", "a smaller one"));
        }
        Ok(())
    }
}

/// Whether no value is infinite or missing, looked at many at once.
pub(super) fn all_finite(values: &[f64]) -> bool {
    values.chunks(256).all(|part| part.iter().fold(true, |all, v| all & v.is_finite()))
}
