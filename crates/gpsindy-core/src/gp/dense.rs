//! Exact likelihood of any kernel on any inputs: one Cholesky factorisation and one inverse, O(n^3).
//!
//! `nll = 1/2 y' K^-1 y + 1/2 ln|K| + n/2 ln 2 pi`, `K = k(X, X) + noise^2 W`, and
//! `d nll/d theta = 1/2 tr((K^-1 - a a') dK/d theta)` with `a = K^-1 y`.
//! Source: Rasmussen & Williams 2006, algorithm 2.1 and equation 5.9.

use super::kernel::Kernel;
use super::kernel::covariance::{Lags, contract, dot, values};
use super::leave_one_out::LeaveOneOut;
use super::points::Points;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, inverse};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Mat, Par};

/// Matrices that a fit uses again and again.
pub(crate) struct DenseWorkspace {
    factor: Mat<f64>,
    inverse: Mat<f64>,
    memory: Option<(usize, MemBuffer)>,
    weights: Vec<f64>,
}

impl Default for DenseWorkspace {
    fn default() -> Self {
        Self { factor: Mat::new(), inverse: Mat::new(), memory: None, weights: Vec::new() }
    }
}

impl DenseWorkspace {
    fn resize(&mut self, n: usize) {
        if self.factor.nrows() != n {
            self.factor = Mat::zeros(n, n);
            self.inverse = Mat::zeros(n, n);
        }
        if self.memory.as_ref().is_none_or(|(size, _)| *size < n) {
            let factor = factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
            let both = factor.or(inverse::inverse_scratch::<f64>(n, Par::Seq));
            self.memory = Some((n, MemBuffer::new(both)));
        }
        self.weights.resize(n, 0.0);
    }

    /// Factor of K with `jitter` (relative to the variance of the process) added; `false` where K is not positive definite.
    fn factorise(&mut self, kernel: &Kernel, hyper: &[f64], points: &Points, jitter: f64) -> bool {
        let n = points.len();
        if n == 0 {
            return true;
        }
        self.resize(n);
        let (kernel_hyper, noise) = split(hyper);
        let noise2 = (2.0 * noise).exp();
        let mut matrix = std::mem::replace(&mut self.factor, Mat::new());
        let mut origin = vec![0.0; points.dimension()];
        for j in 0..n {
            let lags = lags(points, j, &mut origin);
            values(kernel, kernel_hyper, lags, &mut matrix.col_as_slice_mut(j)[j..]);
        }
        let extra = jitter * matrix[(0, 0)];
        for i in 0..n {
            matrix[(i, i)] += noise2 * points.noise_weight(i) + extra;
        }
        let done = match &mut self.memory {
            Some((_, memory)) => {
                let stack = MemStack::new(memory);
                factor::cholesky_in_place(matrix.as_mut(), Default::default(), Par::Seq, stack, Default::default())
                    .is_ok()
            }
            None => false,
        };
        self.factor = matrix;
        done
    }

    fn invert(&mut self) {
        if let Some((_, memory)) = &mut self.memory {
            inverse::inverse(self.inverse.as_mut(), self.factor.as_ref(), Par::Seq, MemStack::new(memory));
        }
    }

    fn solve(&self, targets: &[f64]) -> Vec<f64> {
        let mut a = Mat::from_fn(targets.len(), 1, |i, _| targets[i]);
        solve_lower_triangular_in_place(self.factor.as_ref(), a.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(self.factor.transpose(), a.as_mut(), Par::Seq);
        a.col_as_slice(0).to_vec()
    }

    /// The lower Cholesky factor of the last factorisation; what is above the diagonal has no meaning.
    pub(super) fn lower(&self) -> &Mat<f64> {
        &self.factor
    }
}

/// Differences between the inputs of the points j, j+1, .. and that of point j.
fn lags<'a>(points: &'a Points, j: usize, origin: &'a mut [f64]) -> Lags<'a> {
    origin.iter_mut().zip(&points.inputs).for_each(|(o, column)| *o = column[j]);
    Lags { inputs: &points.inputs, first: j, origin }
}

/// Kernel hyperparameters and the log noise, which comes last.
pub(super) fn split(hyper: &[f64]) -> (&[f64], f64) {
    match hyper {
        [kernel @ .., noise] => (kernel, *noise),
        [] => (&[], f64::NAN),
    }
}

/// Negative log marginal likelihood and, where `gradient` is not empty, its gradient.
/// `None` where K with this jitter is not positive definite or a number overflows.
pub(crate) fn likelihood(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    gradient: &mut [f64],
    workspace: &mut DenseWorkspace,
) -> Option<f64> {
    let n = points.len();
    if n == 0 {
        gradient.fill(0.0);
        return Some(0.0);
    }
    if !workspace.factorise(kernel, hyper, points, jitter) {
        return None;
    }
    let a = workspace.solve(&points.targets);
    let log_determinant: f64 = 2.0 * (0..n).map(|i| workspace.factor[(i, i)].ln()).sum::<f64>();
    let nll = 0.5 * (dot(&a, &points.targets) + log_determinant + n as f64 * std::f64::consts::TAU.ln());
    if gradient.is_empty() {
        return nll.is_finite().then_some(nll);
    }
    workspace.invert();
    let (kernel_hyper, noise) = split(hyper);
    gradient.fill(0.0);
    let (kernel_gradient, noise_gradient) = gradient.split_at_mut(kernel_hyper.len());
    let mut trace = 0.0;
    let mut weights = std::mem::take(&mut workspace.weights);
    let mut origin = vec![0.0; points.dimension()];
    for j in 0..n {
        let column = &workspace.inverse.col_as_slice(j)[j..];
        let aj = a[j];
        for ((w, &inverse), &ai) in weights.iter_mut().zip(column).zip(&a[j..]) {
            *w = inverse - ai * aj;
        }
        trace += weights[0] * points.noise_weight(j);
        // The lower triangle counts for both, the diagonal once: 1/2 (2 sum + diagonal).
        weights[0] *= 0.5;
        contract(kernel, kernel_hyper, lags(points, j, &mut origin), &weights[..n - j], kernel_gradient);
    }
    workspace.weights = weights;
    noise_gradient[0] = (2.0 * noise).exp() * trace;
    (nll.is_finite() && gradient.iter().all(|g| g.is_finite())).then_some(nll)
}

/// `K^-1 y` and the diagonal of `K^-1`, from which all leave-one-out predictions follow.
pub(crate) fn leave_one_out(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    workspace: &mut DenseWorkspace,
) -> Option<LeaveOneOut> {
    if !workspace.factorise(kernel, hyper, points, jitter) {
        return None;
    }
    let weights = workspace.solve(&points.targets);
    workspace.invert();
    let diagonal = (0..points.len()).map(|i| workspace.inverse[(i, i)]).collect();
    Some(LeaveOneOut { weights, diagonal })
}

/// The factorisation of K with `K^-1 y`, for predictions.
pub(crate) fn condition(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
) -> Option<(DenseWorkspace, Vec<f64>)> {
    let mut workspace = DenseWorkspace::default();
    if !workspace.factorise(kernel, hyper, points, jitter) {
        return None;
    }
    let weights = workspace.solve(&points.targets);
    weights.iter().all(|w| w.is_finite()).then_some((workspace, weights))
}
