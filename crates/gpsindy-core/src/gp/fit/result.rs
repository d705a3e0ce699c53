//! What a fit found, and what makes it weak.

use crate::gp::kernel::{Kernel, Role};
use crate::gp::likelihood::Engine;
use std::fmt;

/// A reason to trust a fit less.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Weakness {
    /// All targets are equal.
    Constant,
    /// Fewer than eight points: the priors decide.
    FewPoints,
    /// The noise explains nearly all; what is left is close to a constant.
    NoSignal,
    /// The process passes through every point but predicts none that is left out.
    Interpolates,
    /// A length or period ended at the end of its range.
    AtBound,
    /// The optimiser ran out of iterations.
    NotConverged,
    /// The covariance needed jitter.
    Jitter,
    /// There were more points than the wanted kernels can take; a Matern kernel replaces them.
    KernelReplaced,
    /// There were more points than the fit can take; an even part of them represents all.
    Thinned,
}

impl fmt::Display for Weakness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Constant => "all values are equal",
            Self::FewPoints => "fewer than 8 points, so the priors dominate",
            Self::NoSignal => "nearly all of the variation is explained as noise",
            Self::Interpolates => {
                "passes through every point but does not predict points that are left out; sample faster or give the noise"
            }
            Self::AtBound => "a length scale or period is at the bound of its range",
            Self::NotConverged => "the optimiser reached its iteration limit",
            Self::Jitter => "the covariance needed jitter",
            Self::KernelReplaced => "too many points for the requested kernels; a Matern kernel replaces them",
            Self::Thinned => "fitted to an evenly spaced subset, because there are too many points",
        })
    }
}

/// What one kernel reached.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The kernel.
    pub kernel: Kernel,
    /// Negative log marginal likelihood of the standardised targets; infinite where the fit failed.
    pub nll: f64,
    /// Root-mean-square leave-one-out error, relative to the standard deviation of the targets.
    pub leave_one_out: f64,
    /// Whether it passed the check against interpolation.
    pub predicts: bool,
    /// Likelihoods of all points with gradient that the optimiser asked for.
    pub evaluations: usize,
}

/// A kernel with its hyperparameters, as found in the data.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Fit {
    /// The kernel of the lowest negative log marginal likelihood.
    pub kernel: Kernel,
    /// Log hyperparameters of the kernel, in the units of inputs and targets; see [`Kernel`].
    pub hyper: Vec<f64>,
    /// Number of inputs.
    pub dimension: usize,
    /// Standard deviation of the noise, unit of the targets.
    pub noise: f64,
    /// The floor below which `noise` was not allowed to fall, unit of the targets.
    pub noise_floor: f64,
    /// Standard deviation of the targets about the means of their runs.
    pub scale: f64,
    /// Mean of all targets; used for a run without points.
    pub mean: f64,
    /// Negative log marginal likelihood of the standardised targets.
    pub nll: f64,
    /// Jitter that the covariance needed, relative to its diagonal; 0 nearly always.
    pub jitter: f64,
    /// How the likelihood of the first run was computed.
    pub engine: Engine,
    /// The optimiser reached a tolerance.
    pub converged: bool,
    /// Whatever makes the answer weak; empty is good.
    pub weak: Vec<Weakness>,
    /// All kernels tried, in the order asked for.
    pub candidates: Vec<Candidate>,
}

impl Fit {
    /// Value of each hyperparameter with its role, in the units of inputs and targets.
    pub fn parameters(&self) -> Vec<(Role, f64)> {
        self.kernel.roles(self.dimension).into_iter().zip(self.hyper.iter().map(|h| h.exp())).collect()
    }
}
