//! The refinement: searches for equations and fits them by simulation to the raw measurements.

mod by_rollout;
mod consensus;
mod ended;
pub(crate) mod fit;
pub(crate) mod growth;
mod lengthen;
mod linear;
mod moves;
mod outlook;
mod refine;
mod roller;
pub(crate) mod scope;
mod search;
mod sensitivity;
mod settle;
mod simplify;
pub(crate) mod starts;
