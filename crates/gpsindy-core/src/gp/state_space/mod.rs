//! The Matern kernels in O(n): the process is the output of a linear stochastic differential equation.
//!
//! `filter` has the likelihood, `smoother` the posterior and what is left out, `stretches` the same for long series.

mod events;
mod filter;
mod filtered;
mod joint;
mod lanes;
mod matern;
mod overlap;
mod scaled;
mod smoother;
mod steps;
mod stretches;
mod tile;

pub(super) use filter::likelihood;
pub(super) use smoother::{leave_one_out, neighbours, posterior};
