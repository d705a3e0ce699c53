//! Exact likelihood of a stationary kernel on uniform times in O(n^2): the covariance is a
//! symmetric Toeplitz matrix T.
//!
//! One pass of Levinson and Durbin gives `ln|T|`, `T^-1 y` and the first column x of `T^-1`; by
//! Gohberg and Semencul the sum of the d-th diagonal of `T^-1` is
//! `1/x_0 sum_k (n - d - 2 k) x_k x_(k+d)`, and the gradient is a sum over lags. With little noise that recursion loses its
//! digits; the same three then come from a Cholesky factor (see `schur`).
//! Source: Golub & Van Loan 2013, Matrix Computations, section 4.7; Gohberg & Semencul 1972.

use super::dense::split;
use super::dots::two_dots;
use super::kernel::Kernel;
use super::kernel::covariance::{Lags, contract, dot, values};
use super::leave_one_out::LeaveOneOut;
use super::points::Points;
use super::schur::Schur;

/// Noise variance over signal variance below which the recursion loses too many digits: relative
/// errors against the dense engine are 1e-9 at 6e-7, 1e-6 at 1e-8, 1e-3 at 1e-10. Schur's algorithm answers below.
const LOWEST_NOISE_RATIO: f64 = 1e-7;
/// Largest residual of `T a = y` that passes, relative to the largest target.
const LARGEST_RESIDUAL: f64 = 1e-7;
/// Rows on which the residual is looked at.
const CHECKED_ROWS: usize = 8;

/// Vectors that a fit uses again and again.
#[derive(Default)]
pub(crate) struct ToeplitzWorkspace {
    lags: [Vec<f64>; 1],
    /// First column of T backwards, so that every convolution is a dot product.
    reversed: Vec<f64>,
    /// Forward predictor; at the end `e_(n-1)` times the first column of `T^-1`.
    forward: Vec<f64>,
    /// Backward predictor, at the end of the buffer.
    backward: Vec<f64>,
    /// `T^-1 y`.
    solution: Vec<f64>,
    weights: Vec<f64>,
    schur: Schur,
}

/// What a pass over the matrix gives besides the vectors of the workspace.
struct Pass {
    /// `ln|T|`
    log_determinant: f64,
    /// Variance of the last point given the others; the first element of `T^-1` is its inverse.
    error: f64,
    /// `y' T^-1 y`
    fit: f64,
}

/// Negative log marginal likelihood and, where `gradient` is not empty, its gradient.
/// `None` where T is not positive definite to rounding or a number overflows.
pub(crate) fn likelihood(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    gradient: &mut [f64],
    workspace: &mut ToeplitzWorkspace,
) -> Option<f64> {
    let n = points.len();
    let Pass { log_determinant, error, fit } = workspace.pass(kernel, hyper, points, jitter, !gradient.is_empty())?;
    let nll = 0.5 * (fit + log_determinant + n as f64 * std::f64::consts::TAU.ln());
    if gradient.is_empty() {
        return nll.is_finite().then_some(nll);
    }
    let ToeplitzWorkspace { lags, forward, backward, solution, weights, .. } = workspace;
    // x = forward / error; the backward buffer is free now and takes k x_k.
    for (k, (b, f)) in backward.iter_mut().zip(&*forward).enumerate() {
        *b = 2.0 * k as f64 * f;
    }
    pulp::Arch::new().dispatch(DiagonalSums { forward, scaled: backward, solution, error, weights });
    let (kernel_hyper, noise) = split(hyper);
    let trace = weights[0];
    // The diagonal once, every other diagonal twice, and a half before the trace.
    weights[0] *= 0.5;
    gradient.fill(0.0);
    let (kernel_gradient, noise_gradient) = gradient.split_at_mut(kernel_hyper.len());
    contract(kernel, kernel_hyper, Lags { inputs: lags, first: 0, origin: &[0.0] }, weights, kernel_gradient);
    noise_gradient[0] = (2.0 * noise).exp() * trace;
    (nll.is_finite() && gradient.iter().all(|g| g.is_finite())).then_some(nll)
}

/// `T^-1 y` and the diagonal of `T^-1`.
pub(crate) fn leave_one_out(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    workspace: &mut ToeplitzWorkspace,
) -> Option<LeaveOneOut> {
    let n = points.len();
    let Pass { error, .. } = workspace.pass(kernel, hyper, points, jitter, true)?;
    let x = &workspace.forward;
    let mut diagonal = vec![1.0 / error; n];
    for i in 1..n {
        diagonal[i] = diagonal[i - 1] + (x[i] * x[i] - x[n - i] * x[n - i]) / error;
    }
    Some(LeaveOneOut { weights: workspace.solution.clone(), diagonal })
}

impl ToeplitzWorkspace {
    /// Fills the first column and runs the recursion, or Schur's algorithm where that is not to be trusted; `forward` and
    /// `solution` are filled where `solve` asks for them.
    fn pass(&mut self, kernel: &Kernel, hyper: &[f64], points: &Points, jitter: f64, solve: bool) -> Option<Pass> {
        let n = points.len();
        let step = points.uniform_step()?;
        let (kernel_hyper, noise) = split(hyper);
        for v in [
            &mut self.lags[0],
            &mut self.reversed,
            &mut self.forward,
            &mut self.backward,
            &mut self.solution,
            &mut self.weights,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.lags[0].iter_mut().enumerate().for_each(|(i, l)| *l = i as f64 * step);
        let lags = Lags { inputs: &self.lags, first: 0, origin: &[0.0] };
        values(kernel, kernel_hyper, lags, &mut self.reversed);
        let signal = self.reversed[0];
        let noise2 = (2.0 * noise).exp() + jitter * signal;
        self.reversed[0] += noise2;
        self.reversed.reverse();
        if noise2 > LOWEST_NOISE_RATIO * signal
            && let Some(pass) = self.recur(&points.targets)
        {
            return Some(pass);
        }
        self.factorise(&points.targets, solve)
    }

    /// The recursion of Levinson and Durbin; `None` where it is not accurate.
    fn recur(&mut self, targets: &[f64]) -> Option<Pass> {
        let recursion = Levinson {
            reversed: &self.reversed,
            targets,
            forward: &mut self.forward,
            backward: &mut self.backward,
            solution: &mut self.solution,
        };
        let (log_determinant, error) = pulp::Arch::new().dispatch(recursion)?;
        let fit = dot(&self.solution, targets);
        self.accurate(targets).then_some(Pass { log_determinant, error, fit })
    }

    /// The same by Schur's algorithm.
    fn factorise(&mut self, targets: &[f64], solve: bool) -> Option<Pass> {
        let first = self.reversed.iter().rev().copied();
        let (log_determinant, fit) = self.schur.factorise(first, targets, solve)?;
        let error = if solve { 1.0 / self.schur.inverse[0] } else { f64::NAN };
        if solve {
            self.solution.copy_from_slice(&self.schur.solution);
            self.forward.iter_mut().zip(&self.schur.inverse).for_each(|(f, x)| *f = x * error);
        }
        Some(Pass { log_determinant, error, fit })
    }

    /// Whether some rows of T times the solution give back the targets.
    fn accurate(&self, targets: &[f64]) -> bool {
        let n = targets.len();
        let largest = targets.iter().fold(0.0f64, |m, y| m.max(y.abs()));
        (0..CHECKED_ROWS.min(n)).all(|c| {
            let row = c * (n - 1) / CHECKED_ROWS.min(n).max(2).saturating_sub(1);
            let left = dot(&self.reversed[n - 1 - row..], &self.solution[..=row]);
            let right: f64 = (row + 1..n).map(|j| self.reversed[n - 1 - (j - row)] * self.solution[j]).sum();
            (left + right - targets[row]).abs() <= LARGEST_RESIDUAL * largest
        })
    }
}

struct Levinson<'a> {
    reversed: &'a [f64],
    targets: &'a [f64],
    forward: &'a mut [f64],
    backward: &'a mut [f64],
    solution: &'a mut [f64],
}

impl pulp::WithSimd for Levinson<'_> {
    type Output = Option<(f64, f64)>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
        let Self { reversed, targets, forward, backward, solution } = self;
        let n = targets.len();
        let mut error = reversed[n - 1];
        let mut log_determinant = error.ln();
        (forward[0], backward[n - 1], solution[0]) = (1.0, 1.0, targets[0] / error);
        for m in 1..n {
            // Covariances of the new point with the m before it, oldest first.
            let row = &reversed[n - 1 - m..n - 1];
            let [prediction, mean] = two_dots(row, &forward[..m], &solution[..m]);
            let reflection = -prediction / error;
            error *= 1.0 - reflection * reflection;
            if error.is_nan() || error <= 0.0 {
                return None;
            }
            log_determinant += error.ln();
            let gain = (targets[m] - mean) / error;
            let (a, b, z) = (&mut forward[..=m], &mut backward[n - 1 - m..], &mut solution[..=m]);
            for ((a, b), z) in a.iter_mut().zip(b).zip(z) {
                let (ahead, behind) = (*a, *b);
                *a = ahead + reflection * behind;
                *b = behind + reflection * ahead;
                *z += gain * *b;
            }
        }
        Some((log_determinant, error))
    }
}

/// Fills the weight of each lag: sum of that diagonal of `T^-1 - a a'`.
struct DiagonalSums<'a> {
    forward: &'a [f64],
    /// 2 k times the forward predictor.
    scaled: &'a [f64],
    solution: &'a [f64],
    error: f64,
    weights: &'a mut [f64],
}

impl pulp::WithSimd for DiagonalSums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let n = self.weights.len();
        for d in 0..n {
            let [plain, scaled] = two_dots(&self.forward[d..], &self.forward[..n - d], &self.scaled[..n - d]);
            let [outer, _] = two_dots(&self.solution[d..], &self.solution[..n - d], &[]);
            self.weights[d] = ((n - d) as f64 * plain - scaled) / self.error - outer;
        }
    }
}
