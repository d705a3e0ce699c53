//! The refinement: equations searched for and fitted through the integrator on the raw measurements.

mod by_rollout;
mod consensus;
mod fit;
mod lengthen;
mod linear;
mod moves;
mod refine;
pub(crate) mod scope;
mod search;
mod sensitivity;
mod settle;
mod simplify;
pub(crate) mod starts;
