//! The result of a power study: which effects the user's logs could reveal, and from what size.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Which effects these logs could reveal: each was planted in simulated copies of the logs and withheld.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerReport {
    /// Of the noise.
    pub seed: u64,
    /// Noise of every logged column in the copies.
    pub noise: Vec<PowerNoise>,
    /// Copies without any effect.
    pub null: PowerNull,
    /// One entry an effect and place, in the order of the catalogue.
    pub effects: Vec<PowerEffect>,
}

/// Noise of one logged column in the copies.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerNoise {
    /// The column.
    pub state: String,
    /// Standard deviation, in `unit`.
    pub rms: f64,
    /// Neighbouring samples err alike, as the winner's residual says.
    pub coloured: bool,
    /// Empty where unknown.
    pub unit: String,
}

/// Copies without any effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerNull {
    /// How many.
    pub draws: usize,
    /// In how many a gap was detected.
    pub alarms: usize,
    /// In how many a cause was included.
    pub included: usize,
}

/// How well the logs would reveal one effect.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerEffect {
    /// Id of the catalogue.
    pub effect: String,
    /// The state in whose equation (or column) it was planted.
    pub state: String,
    /// What it depends on.
    pub variables: Vec<String>,
    /// The parameter of the form whose size was varied; of `parameter_error` the distance from the nominal value.
    pub parameter: String,
    /// Of the sizes.
    pub unit: String,
    /// Smallest size tried from which a gap was detected in every draw; `None`: at none.
    pub detected_from: Option<f64>,
    /// Smallest size tried from which the effect, or a group with it, was named in every draw; `None`: at none.
    pub named_from: Option<f64>,
    /// Ids of the other members of groups in which it was named.
    pub group: Vec<String>,
    /// What was named in its place where it was not, most often first.
    pub confused_with: Vec<PowerRival>,
    /// The experiment that would part it from the group's first member, or from what it was most often taken for.
    pub next_experiment: Option<String>,
    /// Why a larger effect was not tried, where that is so.
    pub limit: Option<String>,
    /// The sizes that were tried, smallest gap first.
    pub trials: Vec<PowerTrial>,
}

/// Another effect that was named in the planted one's place.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerRival {
    /// Id of the effect; `none` where a gap was found and no cause included.
    pub effect: String,
    /// The state in whose equation (or column) it was said to act; empty for `none`.
    pub state: String,
    /// What it was said to depend on.
    pub variables: Vec<String>,
    /// In how many draws.
    pub draws: usize,
}

/// One size of a planted effect.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct PowerTrial {
    /// Root mean square over samples and columns of what the nominal model misses without noise, in units of the noise.
    pub gap_to_noise: f64,
    /// In the effect's unit. A smaller saturation limit is a larger effect.
    pub size: f64,
    /// Copies with noise of their own.
    pub draws: usize,
    /// In how many of them a gap was detected.
    pub detected: usize,
    /// In how many the effect, or a group with it, was the first included cause.
    pub named: usize,
}
