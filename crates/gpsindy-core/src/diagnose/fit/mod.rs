//! Contestants of the diagnosis, their fits to the logs, and their evidence.

pub(crate) mod by_run;
pub(crate) mod colours;
pub(crate) mod contestant;
pub(crate) mod evidence;
pub(crate) mod filter;
pub(crate) mod fitter;
pub(crate) mod guide;
pub(crate) mod innovations;
pub(crate) mod lagging;
pub(crate) mod linear;
pub(crate) mod moved;
pub(crate) mod outputs;
pub(crate) mod own_sizes;
pub(crate) mod peaks;
pub(crate) mod sampling;
pub(crate) mod substeps;
pub(crate) mod tolerance;
pub(crate) mod tried;
