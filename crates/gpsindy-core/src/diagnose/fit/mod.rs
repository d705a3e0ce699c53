//! Contestants of the diagnosis, their fits to the logs, and their evidence.

pub(crate) mod autoregression;
pub(crate) mod basis;
pub(crate) mod bounded;
pub(crate) mod colour;
pub(crate) mod contestant;
pub(crate) mod elimination;
pub(crate) mod evidence;
pub(crate) mod filter;
pub(crate) mod fitter;
pub(crate) mod functions;
pub(crate) mod gains;
pub(crate) mod guide;
pub(crate) mod innovations;
pub(crate) mod lagging;
pub(crate) mod moved;
pub(crate) mod noise;
pub(crate) mod outputs;
pub(crate) mod outs;
pub(crate) mod peaks;
pub(crate) mod responses;
pub(crate) mod sampling;
pub(crate) mod substeps;
pub(crate) mod tolerance;
pub(crate) mod whitening;
