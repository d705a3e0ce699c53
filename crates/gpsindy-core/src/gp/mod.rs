//! Gaussian processes over time or over states: kernels, exact likelihoods by several engines,
//! hyperparameters by evidence, and the joint posterior of a function and its derivative.
//!
//! Knows slices and matrices only. Source: Rasmussen & Williams 2006; the paper's section on
//! Gaussian process regression.

#[cfg(test)]
mod agreement;
mod blocks;
#[cfg(test)]
mod contract;
mod cost;
mod covariance;
mod dense;
mod events;
mod exp;
mod fit;
mod joint;
mod kernel;
mod lanes;
mod likelihood;
mod matern;
mod one;
mod overlap;
mod points;
mod posterior;
mod profile;
mod scale;
mod schur;
mod search;
mod start;
mod state_smoother;
mod state_space;
mod steps;
mod stretches;
mod tile;
mod toeplitz;

pub use fit::{Candidate, Fit, FitSettings, Weakness, fit};
pub use kernel::{Kernel, Role};
pub use likelihood::{Engine, Evaluation, LeaveOneOut, Workspace};
pub use points::Points;
pub use posterior::{Conditioned, Posterior, Quantity};
