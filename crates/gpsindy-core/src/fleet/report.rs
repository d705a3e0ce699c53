//! The report of a fleet, schema `gpsindy.fleet/1`: plain data, the same names as in the JSON.

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The schema that [`FleetReport::schema`] names.
pub const SCHEMA: &str = "gpsindy.fleet/1";

/// The whole comparison of a fleet.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct FleetReport {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// One entry a unit and period, in the order of the manifest.
    pub units: Vec<Unit>,
    /// One entry an effect's or parameter's size.
    pub population: Vec<Population>,
    /// Units that the rest of the fleet does not predict, the clearest first.
    pub odd: Vec<Odd>,
    /// Steps and drifts, the surest first.
    pub changes: Vec<Change>,
    /// Tasks without a report.
    pub failed: Vec<Failed>,
    /// What a reader must know besides the numbers.
    pub notes: Vec<String>,
}

impl FleetReport {
    /// A report without entries.
    pub fn new() -> Self {
        Self {
            schema: SCHEMA.into(),
            units: Vec::new(),
            population: Vec::new(),
            odd: Vec::new(),
            changes: Vec::new(),
            failed: Vec::new(),
            notes: Vec::new(),
        }
    }
}

impl Default for FleetReport {
    fn default() -> Self {
        Self::new()
    }
}

/// One unit in one period.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Unit {
    /// The machine.
    pub unit: String,
    /// When the period began, as the manifest says it.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub since: Option<String>,
    /// The same as a day, counted as in [`Change::since`].
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub day: Option<f64>,
    /// Verdict of its diagnosis.
    pub verdict: String,
    /// Included causes: effect, state and sizes by name.
    pub causes: Vec<UnitCause>,
    /// Share of the held-out gap that the causes close; absent where nothing could be closed.
    pub closure: Option<f64>,
    /// Folder of its report below `tasks/`.
    pub key: String,
    /// Covariates of the period.
    pub covariates: BTreeMap<String, f64>,
}

/// An included cause of a unit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct UnitCause {
    /// Id of the effect.
    pub effect: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// Its probability.
    pub probability: f64,
    /// Sizes by name.
    pub sizes: BTreeMap<String, f64>,
    /// Standard errors of the sizes, where they are known.
    #[cfg_attr(feature = "serde", serde(default))]
    pub errors: BTreeMap<String, f64>,
}

/// One quantity over the fleet.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Population {
    /// Id of the effect; `parameter` for a parameter of the nominal model.
    pub effect: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// Name of the size.
    pub parameter: String,
    /// Unit of the size.
    pub unit: String,
    /// Mean over the units, odd ones left out, at the mean of every covariate.
    pub mean: f64,
    /// Standard deviation between units beyond the errors of their estimates.
    pub spread: f64,
    /// Chance of so much scatter if all units were alike.
    pub spread_p_value: f64,
    /// Scatter of a unit between its periods beyond the errors of the estimates; absent without a history.
    pub scatter: Option<f64>,
    /// How many units have it.
    pub units: usize,
    /// Change of the quantity for one unit of each covariate, with its standard error.
    pub covariates: Vec<Slope>,
    /// Range that a simulator should draw from: the mean and two spreads either side; absent where the units are alike.
    pub randomise: Option<(f64, f64)>,
    /// Every unit's estimate drawn towards the mean, with its standard error.
    pub estimates: Vec<Shrunk>,
}

/// What a covariate does to a quantity: `value * (x - mean)`, and a curve where the fleet shows one.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Slope {
    /// Name of the covariate.
    pub covariate: String,
    /// Change of the quantity for one unit of it, at its mean.
    pub value: f64,
    /// Standard error.
    pub deviation: f64,
    /// Mean of the covariate over the fleet.
    #[cfg_attr(feature = "serde", serde(default))]
    pub mean: f64,
    /// What the effect has besides the straight line; absent where a line is enough.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub curve: Option<Curve>,
}

impl Slope {
    /// What the covariate adds to the quantity at `x`, relative to its mean.
    pub fn effect(&self, x: f64) -> f64 {
        let bent = self.curve.as_ref().map_or(0.0, |curve| curve.size * curve.form(x, self.mean));
        self.value * (x - self.mean) + bent
    }
}

/// An effect that is steep at one end of a covariate's range and flat at the other, as of a warm-up: `size * exp(-(x - from) / scale)`,
/// less its value and its slope at the mean of the covariate.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Curve {
    /// The end at which it is steep.
    pub from: f64,
    /// Within what it falls to a share of 1/e; below 0 where `from` is the upper end.
    pub scale: f64,
    /// Its size.
    pub size: f64,
    /// Standard error.
    pub deviation: f64,
}

impl Curve {
    /// The curve of size 1.
    pub(super) fn form(&self, x: f64, mean: f64) -> f64 {
        let at = |x: f64| (-(x - self.from) / self.scale).exp();
        at(x) - at(mean) * (1.0 - (x - mean) / self.scale)
    }
}

/// A unit's estimate after it has borrowed from the fleet.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Shrunk {
    /// The machine.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Standard error.
    pub deviation: f64,
}

/// A unit that the rest of the fleet does not predict.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Odd {
    /// The machine.
    pub unit: String,
    /// Id of the effect.
    pub effect: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// Name of the size.
    pub parameter: String,
    /// Its value at the mean of every covariate.
    pub value: f64,
    /// Mean of the rest of the fleet.
    pub population: f64,
    /// Spread of the rest of the fleet.
    pub spread: f64,
    /// Smallest false discovery rate at which the unit is still listed.
    pub false_discovery_rate: f64,
}

/// How a quantity changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Shape {
    /// From one period to the next.
    Step,
    /// Steadily from some day on.
    Drift,
}

/// A step or a drift of one unit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Change {
    /// The machine.
    pub unit: String,
    /// Id of the effect.
    pub effect: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// Name of the size.
    pub parameter: String,
    /// Step or drift.
    pub shape: Shape,
    /// Since when, days; the surfaces write a date next to it where the manifest had dates.
    pub since: f64,
    /// The same as the manifest writes days; empty where it had numbers.
    #[cfg_attr(feature = "serde", serde(default))]
    pub date: String,
    /// Interval of 90 % of the day.
    pub interval: (f64, f64),
    /// Level before.
    pub from: f64,
    /// Level at the end of the history.
    pub to: f64,
    /// Probability that there was a change at all.
    pub probability: f64,
    /// Covariates that were held.
    pub held: Vec<String>,
}

/// A task without a report.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Failed {
    /// The machine.
    pub unit: String,
    /// When the period began, as the manifest says it.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub since: Option<String>,
    /// Why, in one line.
    pub error: String,
}
