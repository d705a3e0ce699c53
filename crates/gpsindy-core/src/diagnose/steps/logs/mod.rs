//! The logs as they are compared: checked, thinned, cut into windows, and how noisy they are.

pub(crate) mod affordable;
pub(crate) mod check;
pub(crate) mod noise;
pub(crate) mod prepare;
pub(crate) mod sampled;
pub(crate) mod windows;
