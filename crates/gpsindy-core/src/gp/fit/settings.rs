//! Settings of a fit.

/// Settings of a fit.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `noise` | `None` | above 0 | standard deviation of the noise, unit of the targets, where it is known |
/// | `noise_floor` | 1e-4 | 1e-6 to 0.5 | lowest noise, relative to the standard deviation of the targets |
/// | `isotropic` | false | | one length for all inputs |
/// | `dense_limit` | 2000 | at least 1 | points of one run above which only kernels of linear cost are tried |
#[derive(Debug, Clone)]
pub struct FitSettings {
    /// Known standard deviation of the noise, unit of the targets; `None` estimates it.
    pub noise: Option<f64>,
    /// Lowest noise, relative to the standard deviation of the targets.
    pub noise_floor: f64,
    /// One length for all inputs instead of one each.
    pub isotropic: bool,
    /// Points of one run above which kernels without a state-space form are not tried.
    pub dense_limit: usize,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self { noise: None, noise_floor: 1e-4, isotropic: false, dense_limit: 2000 }
    }
}
