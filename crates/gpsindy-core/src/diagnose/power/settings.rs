//! Settings of a power study.

use crate::diagnose::limits::GAPS;
use crate::error::{Error, Result};

/// Settings of a power study.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `gap_to_noise` | 1, 3, 10 | above 0, rising | sizes of the planted effects; the middle one is tried first |
/// | `draws` | 2 | 1 and above | copies a size, each with noise of its own |
/// | `null_draws` | 20 | 0 and above | copies without any effect |
/// | `seed` | 0 | | of the noise |
#[derive(Debug, Clone, PartialEq)]
pub struct Power {
    /// Gaps of the planted effects in units of the noise, rising.
    pub gap_to_noise: Vec<f64>,
    /// Copies of the logs a size.
    pub draws: usize,
    /// Copies without any effect.
    pub null_draws: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Power {
    fn default() -> Self {
        Self { gap_to_noise: GAPS.to_vec(), draws: 2, null_draws: 20, seed: 0 }
    }
}

impl Power {
    pub(crate) fn check(&self) -> Result<()> {
        let rising = self.gap_to_noise.windows(2).all(|w| w[0] < w[1]);
        if self.gap_to_noise.is_empty() || !rising || !self.gap_to_noise.iter().all(|g| *g > 0.0 && g.is_finite()) {
            return Err(Error::range(
                "gap_to_noise",
                "one or more rising numbers above 0",
                format!("{:?}", self.gap_to_noise),
            ));
        }
        if self.draws == 0 {
            return Err(Error::range("draws", "at least 1", self.draws));
        }
        Ok(())
    }
}
