//! Posterior of a function of time, and of its derivative, given a fit and noisy points.
//!
//! With K the covariance of the noisy targets and C(a, b) the prior covariance of two quantities,
//! the mean is `C(a, f) K^-1 y` and the covariance `C(a, b) - C(a, f) K^-1 C(f, b)`.
//! Source: Rasmussen & Williams 2006, equations 2.22 to 2.24 and section 9.4 for derivatives.

use super::dense;
use super::fit::Fit;
use super::kernel::covariance::{Lags, derivatives, values};
use super::likelihood::Evaluation;
use super::points::Points;
use super::quantity::Quantity;
use super::state_space;
use crate::error::{Error, Result};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, Mat, Par};

/// Law of the quantities asked for, in the order asked: all times of the first, then of the second.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// Means.
    pub mean: Vec<f64>,
    /// Variances, never negative.
    pub variance: Vec<f64>,
    /// Joint covariance, where it was asked for.
    pub covariance: Option<Mat<f64>>,
}

/// A process conditioned on the points of one run.
pub struct Conditioned {
    evaluation: Owned,
    dimension: usize,
    /// Of the points, where the engine is dense.
    inputs: Vec<Vec<f64>>,
    offset: f64,
    scale: f64,
    engine: Prepared,
}

struct Owned {
    kernel: super::Kernel,
    /// Standardised log hyperparameters with the log noise last.
    hyper: Vec<f64>,
}

enum Prepared {
    /// No points: the prior.
    Prior,
    Dense {
        lower: Mat<f64>,
        weights: Vec<f64>,
    },
    /// The smoother runs at every prediction, over measurements and times asked for together.
    Smoother {
        points: Points,
        jitter: f64,
    },
}

impl Conditioned {
    /// Conditions the fitted process on `points` (of one run, mean of its own).
    ///
    /// # Errors
    /// Sizes that differ, values that are not finite, a covariance that stays indefinite.
    pub fn new(fit: &Fit, points: &Points) -> Result<Self> {
        let n = points.len();
        let mean = if n == 0 { fit.mean } else { points.targets.iter().map(|v| v / n as f64).sum() };
        Self::about(fit, points, mean)
    }

    /// The same about a mean that is known, such as that of a longer run of which `points` are a part.
    ///
    /// # Errors
    /// As [`Conditioned::new`].
    pub fn about(fit: &Fit, points: &Points, mean: f64) -> Result<Self> {
        points.check()?;
        if points.dimension() != fit.dimension {
            return Err(Error::shape("inputs of the points", fit.dimension, points.dimension()));
        }
        let (n, offset) = (points.len(), mean);
        let mut hyper = fit.hyper.clone();
        fit.kernel.rescale(fit.dimension, &mut hyper, -fit.scale.ln());
        hyper.push((fit.noise / fit.scale).ln());
        let standard = Points {
            inputs: points.inputs.clone(),
            targets: points.targets.iter().map(|v| (v - offset) / fit.scale).collect(),
            noise_weights: points.noise_weights.clone(),
        };
        let mut inputs = Vec::new();
        let engine = if n == 0 {
            Prepared::Prior
        } else if fit.kernel.has_state_space() && standard.ordered() {
            Prepared::Smoother { points: standard, jitter: fit.jitter }
        } else {
            let factor = |jitter: f64| {
                let evaluation = Evaluation { kernel: &fit.kernel, hyper: &hyper, jitter };
                dense::condition(evaluation.kernel, evaluation.hyper, &standard, evaluation.jitter)
            };
            let (workspace, weights) = [fit.jitter, 1e-10, 1e-8, 1e-6]
                .into_iter()
                .find_map(factor)
                .ok_or_else(|| Error::NotPositiveDefinite { what: "covariance".into(), size: n, jitter: 1e-6 })?;
            inputs = standard.inputs;
            Prepared::Dense { lower: workspace.lower().clone(), weights }
        };
        let evaluation = Owned { kernel: fit.kernel.clone(), hyper };
        Ok(Self { evaluation, dimension: fit.dimension, inputs, offset, scale: fit.scale, engine })
    }

    /// Law of `quantities` at `at` (columns of inputs; one column of times), with the joint
    /// covariance where `joint` asks for it.
    ///
    /// # Errors
    /// Sizes that differ; a derivative of a process that has none or that is not one of time.
    pub fn predict(&self, at: &[Vec<f64>], quantities: &[Quantity], joint: bool) -> Result<Posterior> {
        if at.len() != self.dimension {
            return Err(Error::shape("inputs to predict at", self.dimension, at.len()));
        }
        let kernel = &self.evaluation.kernel;
        if quantities.contains(&Quantity::Derivative) {
            if self.dimension != 1 {
                return Err(Error::settings(
                    "a derivative is defined for a process of time alone, not of several inputs",
                ));
            }
            if !kernel.differentiable() {
                return Err(Error::settings(format!(
                    "a process with kernel `{kernel}` has no derivative; take matern32 or a smoother one"
                )));
            }
        }
        let m = at[0].len();
        let size = m * quantities.len();
        // Law before anything is measured, dense.
        let prior = || {
            let variance = quantities.iter().flat_map(|&q| std::iter::repeat_n(self.prior_variance(q), m)).collect();
            (vec![0.0; size], variance, joint.then(|| self.covariance(at, quantities, at, quantities)))
        };
        let (mut mean, mut variance, mut covariance): (Vec<f64>, Vec<f64>, _) = match &self.engine {
            Prepared::Prior => prior(),
            Prepared::Smoother { points, jitter } => {
                let hyper = &self.evaluation.hyper;
                let asked = (at[0].as_slice(), quantities, joint);
                let unit = (self.offset, self.scale);
                let law = state_space::posterior(kernel, hyper, points, *jitter, asked, unit);
                law.ok_or_else(|| Error::NotPositiveDefinite {
                    what: "covariance".into(),
                    size: points.len(),
                    jitter: *jitter,
                })?
            }
            Prepared::Dense { lower, weights } => {
                let (mut mean, mut variance, mut covariance) = prior();
                // n x size: covariance of the targets with what is asked for.
                let mut cross = self.covariance(&self.inputs, &[Quantity::Value], at, quantities);
                for (j, mean) in mean.iter_mut().enumerate() {
                    *mean = super::kernel::covariance::dot(cross.col_as_slice(j), weights);
                }
                solve_lower_triangular_in_place(lower.as_ref(), cross.as_mut(), Par::Seq);
                for (j, v) in variance.iter_mut().enumerate() {
                    let column = cross.col_as_slice(j);
                    *v = (*v - super::kernel::covariance::dot(column, column)).max(0.0);
                }
                if let Some(covariance) = &mut covariance {
                    matmul(covariance.as_mut(), Accum::Add, cross.transpose(), cross.as_ref(), -1.0, Par::Seq);
                }
                (mean, variance, covariance)
            }
        };
        let scale2 = self.scale * self.scale;
        if !matches!(self.engine, Prepared::Smoother { .. }) {
            for (j, mean) in mean.chunks_mut(m.max(1)).enumerate() {
                let offset = if quantities[j] == Quantity::Value { self.offset } else { 0.0 };
                mean.iter_mut().for_each(|mean| *mean = offset + self.scale * *mean);
            }
            variance.iter_mut().for_each(|variance| *variance *= scale2);
        }
        if let Some(c) = &mut covariance {
            *c = Mat::from_fn(size, size, |i, j| {
                scale2 * if i == j { c[(i, i)].max(0.0) } else { 0.5 * (c[(i, j)] + c[(j, i)]) }
            });
        }
        Ok(Posterior { mean, variance, covariance })
    }

    /// Law of the value at the ascending times `at`, and its covariances with the values at the next two of them (0 beyond the
    /// last): in O(n) where the engine is, where a joint covariance would take the square of it.
    ///
    /// # Errors
    /// As [`Conditioned::predict`].
    pub(crate) fn with_neighbours(&self, at: &[f64]) -> Result<(Posterior, Vec<[f64; 2]>)> {
        let columns = [at.to_vec()];
        let Prepared::Smoother { points, jitter } = &self.engine else {
            let value = self.predict(&columns, &[Quantity::Value], true)?;
            let entry = |i: usize, j: usize| match &value.covariance {
                Some(c) if j < at.len() => c[(i, j)],
                _ => 0.0,
            };
            let neighbours = (0..at.len()).map(|i| [1, 2].map(|lag| entry(i, i + lag))).collect();
            return Ok((Posterior { covariance: None, ..value }, neighbours));
        };
        let value = self.predict(&columns, &[Quantity::Value], false)?;
        let Owned { kernel, hyper } = &self.evaluation;
        let mut neighbours = state_space::neighbours(kernel, hyper, points, *jitter, at).ok_or_else(|| {
            Error::NotPositiveDefinite { what: "covariance".into(), size: points.len(), jitter: *jitter }
        })?;
        neighbours.iter_mut().flatten().for_each(|c| *c *= self.scale * self.scale);
        Ok((value, neighbours))
    }

    fn kernel_hyper(&self) -> &[f64] {
        &self.evaluation.hyper[..self.evaluation.hyper.len() - 1]
    }

    fn prior_variance(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Value => {
                let inputs = vec![vec![0.0]; self.dimension];
                let lags = Lags { inputs: &inputs, first: 0, origin: &vec![0.0; self.dimension] };
                let mut value = [0.0];
                values(&self.evaluation.kernel, self.kernel_hyper(), lags, &mut value);
                value[0]
            }
            Quantity::Derivative => -derivatives(&self.evaluation.kernel, self.kernel_hyper(), 0.0)[2],
        }
    }

    /// Prior covariance of the quantities `of_a` at `a` (rows) with `of_b` at `b` (columns).
    fn covariance(&self, a: &[Vec<f64>], of_a: &[Quantity], b: &[Vec<f64>], of_b: &[Quantity]) -> Mat<f64> {
        let (rows, columns) = (a[0].len(), b[0].len());
        let (kernel, hyper) = (&self.evaluation.kernel, self.kernel_hyper());
        let mut out = Mat::zeros(rows * of_a.len(), columns * of_b.len());
        if of_a == [Quantity::Value] && of_b == [Quantity::Value] {
            let mut origin = vec![0.0; self.dimension];
            for j in 0..columns {
                origin.iter_mut().zip(b).for_each(|(o, column)| *o = column[j]);
                values(kernel, hyper, Lags { inputs: a, first: 0, origin: &origin }, out.col_as_slice_mut(j));
            }
            return out;
        }
        let mut fill = |i: usize, j: usize, [k, slope, curvature]: [f64; 3]| {
            for (bj, qb) in of_b.iter().enumerate() {
                for (ai, qa) in of_a.iter().enumerate() {
                    out[(ai * rows + i, bj * columns + j)] = match (qa, qb) {
                        (Quantity::Value, Quantity::Value) => k,
                        (Quantity::Derivative, Quantity::Value) => slope,
                        (Quantity::Value, Quantity::Derivative) => -slope,
                        (Quantity::Derivative, Quantity::Derivative) => -curvature,
                    };
                }
            }
        };
        // The value and the curvature are even in the lag, the slope is odd; on a clock every lag comes up often.
        let turned = |[k, slope, curvature]: [f64; 3]| [k, -slope, curvature];
        let same = a == b;
        let table: Vec<[f64; 3]> = match clock(&a[0]) {
            Some(step) if same => (0..rows).map(|d| derivatives(kernel, hyper, d as f64 * step)).collect(),
            _ => Vec::new(),
        };
        for j in 0..columns {
            for i in 0..rows {
                if !table.is_empty() {
                    fill(i, j, if i < j { turned(table[j - i]) } else { table[i - j] });
                } else if !same {
                    fill(i, j, derivatives(kernel, hyper, a[0][i] - b[0][j]));
                } else if i >= j {
                    let law = derivatives(kernel, hyper, a[0][i] - b[0][j]);
                    fill(i, j, law);
                    fill(j, i, turned(law));
                }
            }
        }
        out
    }
}

/// Step of times that are uniform but for their own rounding.
fn clock(time: &[f64]) -> Option<f64> {
    let (&[first, ..], &[.., last]) = (time, time) else { return None };
    let step = (last - first) / (time.len().max(2) - 1) as f64;
    let rounding = 4.0 * f64::EPSILON * first.abs().max(last.abs());
    let on = |(i, &t): (usize, &f64)| (t - first - i as f64 * step).abs() <= rounding;
    time.iter().enumerate().all(on).then_some(step)
}
