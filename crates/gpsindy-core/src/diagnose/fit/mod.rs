//! A contestant of the diagnosis, what fits it to the logs, and what judges it.

pub(crate) mod bounded;
pub(crate) mod evidence;
pub(crate) mod fitted;
pub(crate) mod lagging;
pub(crate) mod tolerance;
pub(crate) mod whitening;
