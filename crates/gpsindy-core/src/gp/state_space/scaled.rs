//! Hyperparameters as the state-space form takes them, and products of its small matrices.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::matern::{Matrix, Vector};

/// Log hyperparameters as the filter needs them.
pub(super) struct Scaled {
    /// Variance of the process.
    pub(super) s2: f64,
    pub(super) lambda: f64,
    /// Noise variance over the variance of the process.
    pub(super) rho: f64,
    /// Relative jitter, added to every noise ratio.
    pub(super) jitter: f64,
}

impl Scaled {
    pub(super) fn new(hyper: &[f64], rate: f64, jitter: f64) -> Option<Self> {
        let &[amplitude, length, noise] = hyper else { return None };
        let s2 = (2.0 * amplitude).exp();
        let out = Self { s2, lambda: rate * (-length).exp(), rho: (2.0 * noise).exp() / s2, jitter };
        (out.s2.is_normal() && out.lambda.is_normal() && out.rho.is_normal()).then_some(out)
    }
}

/// `a b + c`; `FUSED` only where the processor has it, or it is slow.
#[inline(always)]
fn plus<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[inline(always)]
pub(super) fn times<const M: usize, const FUSED: bool>(a: &Matrix<M>, x: &Vector<M>) -> Vector<M> {
    std::array::from_fn(|i| (1..M).fold(a[i][0] * x[0], |sum, k| plus::<FUSED>(a[i][k], x[k], sum)))
}

/// `A P A'` for a symmetric P.
#[inline(always)]
pub(super) fn sandwich<const M: usize, const FUSED: bool>(a: &Matrix<M>, p: &Matrix<M>) -> Matrix<M> {
    let left: Matrix<M> = std::array::from_fn(|i| {
        std::array::from_fn(|j| (1..M).fold(a[i][0] * p[0][j], |sum, k| plus::<FUSED>(a[i][k], p[k][j], sum)))
    });
    let mut out = [[0.0; M]; M];
    for i in 0..M {
        for j in i..M {
            let sum = (1..M).fold(left[i][0] * a[j][0], |sum, k| plus::<FUSED>(left[i][k], a[j][k], sum));
            (out[i][j], out[j][i]) = (sum, sum);
        }
    }
    out
}
