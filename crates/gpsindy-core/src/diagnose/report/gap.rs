//! Where the gap is, and what of it remains: schema `gpsindy.diagnosis/1`, `gap` and `unexplained`.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Is there a gap, and where. Shares are of the summed squared, noise-scaled gap.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Gap {
    /// The nominal model plus measurement noise does not explain the logs, at 5 %.
    pub detected: bool,
    /// Of the hypothesis that it does, in 0..1.
    pub p_value: f64,
    /// Largest share first.
    pub by_state: Vec<GapState>,
    /// State by state as in `by_state`, along the variable's axis; neighbours that are alike are one region.
    pub by_region: Vec<GapRegion>,
    /// Run by run along time, of the equation with the largest share; neighbours that are alike are one stretch.
    pub by_window: Vec<GapWindow>,
}

/// The gap in one equation.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapState {
    /// The state whose equation it is.
    pub state: String,
    /// In 0..1.
    pub share: f64,
    /// Of the hypothesis that this equation is right, in 0..1.
    pub p_value: f64,
    /// Root mean square of what the equation lacks, in `unit`.
    pub residual_rms: f64,
    /// Root mean square that noise alone would give there, in `unit`.
    pub noise_rms: f64,
    /// Unit of the equation's right side; empty where unknown.
    pub unit: String,
}

/// The gap in one band of one variable.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapRegion {
    /// The state whose equation it is.
    pub state: String,
    /// State or control that the band is of.
    pub variable: String,
    /// Lower end, in the variable's unit.
    pub from: f64,
    /// Upper end, in the variable's unit.
    pub to: f64,
    /// In 0..1.
    pub share: f64,
}

/// The gap in one stretch of time of one run.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct GapWindow {
    /// Name of the run.
    pub run: String,
    /// Begin, s.
    pub from: f64,
    /// End, s.
    pub to: f64,
    /// In 0..1.
    pub share: f64,
}

/// What remains after the included causes.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Unexplained {
    /// That it is structure and not noise, in 0..1.
    pub probability: f64,
    /// Of the gap, in 0..1.
    pub share: f64,
    /// Variables that it depends on; empty where none shows.
    pub depends_on: Vec<String>,
}
