//! One interface over the three engines, and the choice between them.

use super::dense::{self, DenseWorkspace};
use super::kernel::Kernel;
use super::leave_one_out::LeaveOneOut;
use super::points::Points;
use super::state_space;
use super::toeplitz::{self, ToeplitzWorkspace};

/// How a likelihood or posterior is computed. All three are exact and agree where they apply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Engine {
    /// Any kernel, any inputs; O(n^3).
    Dense,
    /// Any kernel on uniform times (within 1e-5 of a step) without weights; O(n^2).
    Toeplitz,
    /// `Matern12`, `Matern32`, `Matern52` on ordered times; O(n).
    StateSpace,
}

/// A kernel with its log hyperparameters (the log noise last) and a relative jitter.
#[derive(Debug, Clone, Copy)]
pub struct Evaluation<'a> {
    /// The kernel.
    pub kernel: &'a Kernel,
    /// Its log hyperparameters, then the log of the noise's standard deviation.
    pub hyper: &'a [f64],
    /// Added to the diagonal, relative to the variance of the process; 0 unless a factorisation needed it.
    pub jitter: f64,
}

/// Memory that one thread reuses over the evaluations of a fit.
#[derive(Default)]
pub struct Workspace {
    dense: DenseWorkspace,
    toeplitz: ToeplitzWorkspace,
}

impl Evaluation<'_> {
    /// The engine of lowest cost for these points.
    pub fn engine(&self, points: &Points) -> Engine {
        if self.kernel.has_state_space() && points.ordered() {
            Engine::StateSpace
        } else if points.uniform_step().is_some() {
            Engine::Toeplitz
        } else {
            Engine::Dense
        }
    }

    /// Negative log marginal likelihood of zero-mean targets; fills `gradient` (with respect to
    /// `hyper`) unless it is empty.
    ///
    /// `None` where the covariance is not positive definite in floating point or a number overflows.
    pub fn likelihood(&self, points: &Points, gradient: &mut [f64], workspace: &mut Workspace) -> Option<f64> {
        self.likelihood_by(self.engine(points), points, gradient, workspace)
    }

    /// [`Evaluation::likelihood`] by the engine that the caller names; `None` also where that
    /// engine does not apply.
    pub fn likelihood_by(
        &self,
        engine: Engine,
        points: &Points,
        gradient: &mut [f64],
        workspace: &mut Workspace,
    ) -> Option<f64> {
        let Self { kernel, hyper, jitter } = *self;
        if points.is_empty() {
            gradient.fill(0.0);
            return Some(0.0);
        }
        match engine {
            Engine::Dense => dense::likelihood(kernel, hyper, points, jitter, gradient, &mut workspace.dense),
            Engine::Toeplitz => toeplitz::likelihood(kernel, hyper, points, jitter, gradient, &mut workspace.toeplitz),
            Engine::StateSpace => state_space::likelihood(kernel, hyper, points, jitter, gradient),
        }
    }

    /// Leave-one-out quantities of zero-mean targets; `None` as for the likelihood.
    pub fn leave_one_out(&self, points: &Points, workspace: &mut Workspace) -> Option<LeaveOneOut> {
        self.leave_one_out_by(self.engine(points), points, workspace)
    }

    /// [`Evaluation::leave_one_out`] by the engine that the caller names.
    pub fn leave_one_out_by(&self, engine: Engine, points: &Points, workspace: &mut Workspace) -> Option<LeaveOneOut> {
        let Self { kernel, hyper, jitter } = *self;
        match engine {
            Engine::Dense => dense::leave_one_out(kernel, hyper, points, jitter, &mut workspace.dense),
            Engine::Toeplitz => toeplitz::leave_one_out(kernel, hyper, points, jitter, &mut workspace.toeplitz),
            Engine::StateSpace => state_space::leave_one_out(kernel, hyper, points, jitter),
        }
    }
}
