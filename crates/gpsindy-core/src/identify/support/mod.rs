//! Which terms: the search by evidence through the integrator.

pub(crate) mod consensus;
pub(crate) mod equations;
pub(crate) mod lengthen;
pub(crate) mod linear;
pub(crate) mod search;
pub(crate) mod sensitivity;
