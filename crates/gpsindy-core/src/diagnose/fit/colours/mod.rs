//! The noise of the sensors: autoregressions of residuals, and what becomes of values that are whitened by them.

pub(crate) mod autoregression;
pub(crate) mod cells;
pub(crate) mod coherence;
pub(crate) mod colour;
pub(crate) mod noise;
pub(crate) mod whitening;
