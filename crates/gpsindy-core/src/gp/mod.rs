//! Gaussian processes over time or over states: kernels, exact likelihoods by several engines,
//! hyperparameters by evidence, and the joint posterior of a function and its derivative.
//!
//! Knows slices and matrices only. Source: Rasmussen & Williams 2006; the paper's section on
//! Gaussian process regression.

#[cfg(test)]
mod agreement;
#[cfg(test)]
mod contract;
mod dense;
mod dots;
mod fit;
mod kernel;
mod leave_one_out;
mod likelihood;
mod points;
mod posterior;
mod quantity;
mod schur;
mod state_space;
mod toeplitz;

pub use fit::{Candidate, Fit, FitSettings, Weakness, fit};
pub use kernel::{Kernel, Role};
pub use leave_one_out::LeaveOneOut;
pub use likelihood::{Engine, Evaluation, Workspace};
pub use points::Points;
pub use posterior::{Conditioned, Posterior};
pub use quantity::Quantity;
