//! Drawn fleets with known answers, for the tests and for the counts of the example `fleets`, which takes this file in by its path.

use super::{Observation, Quantity};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// Spread between units.
pub(crate) const SPREAD: f64 = 0.1;
/// Odd units, of 200.
pub(crate) const ODD: usize = 5;
/// The day on which wear begins.
pub(crate) const WORN: f64 = 180.0;
/// Fortnights of a year.
const PERIODS: u32 = 26;

/// Normal numbers from an explicit seed (Box and Muller 1958).
pub(crate) struct Draw(ChaCha8Rng);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform().max(1e-300), self.uniform());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }

    /// The standard error of an estimate.
    pub(crate) fn error(&mut self) -> f64 {
        0.03 + 0.05 * self.uniform()
    }
}

pub(crate) fn quantity(covariates: &[&str], observations: Vec<Observation>) -> Quantity {
    Quantity {
        effect: "coulomb_friction".into(),
        state: "v".into(),
        parameter: "c".into(),
        unit: "N".into(),
        covariates: covariates.iter().map(|c| (*c).to_string()).collect(),
        observations,
    }
}

/// 200 units of mean 1 and spread 0.1, each with its own error of 0.03 to 0.08; the first five are off by `off` spreads.
pub(crate) fn fleet(seed: u64, off: f64) -> Quantity {
    let mut draw = Draw::new(seed);
    let one = |unit: usize| {
        let deviation = draw.error();
        let shift = if unit < ODD { off * SPREAD } else { SPREAD * draw.normal() };
        let value = 1.0 + shift + deviation * draw.normal();
        Observation { unit: format!("unit {unit}"), since: None, value, deviation, covariates: Vec::new() }
    };
    quantity(&[], (0..200).map(one).collect())
}

/// What wear does to the first unit until a day, in units of the mean.
pub(crate) type Wear = fn(f64) -> f64;

pub(crate) fn no_wear(_: f64) -> f64 {
    0.0
}

/// A fifth of the mean, all at once at mid-year.
pub(crate) fn at_once(day: f64) -> f64 {
    if day >= WORN { 0.2 } else { 0.0 }
}

fn period(unit: usize, day: f64, value: f64, covariates: Vec<f64>) -> Observation {
    Observation { unit: format!("unit {unit}"), since: Some(day), value, deviation: 0.03, covariates }
}

/// A year of fortnights in which friction follows load and temperature.
pub(crate) fn year(seed: u64, count: usize, wear: Wear) -> Quantity {
    let mut draw = Draw::new(seed);
    let mut all = Vec::new();
    for unit in 0..count {
        let own = 1.0 + 0.05 * draw.normal();
        let phase = draw.uniform();
        for k in 0..PERIODS {
            let day = 14.0 * f64::from(k);
            let temperature = 20.0 + 8.0 * (TAU * (day / 365.0 + 0.1 * phase)).sin() + draw.normal();
            let load = 1.0 + 2.0 * draw.uniform();
            let worn = if unit == 0 { wear(day) } else { 0.0 };
            let value = own + worn - 0.02 * (temperature - 20.0) + 0.1 * (load - 2.0) + 0.03 * draw.normal();
            all.push(period(unit, day, value, vec![temperature, load]));
        }
    }
    quantity(&["temperature", "load"], all)
}

/// A year of fortnights in which machines warm up: friction is higher by 0.4 when they are switched on, and loses that within 1.5 hours.
/// The logs of a period begin some time after the switch, later in the busy half of the year. Machines differ in the height of their
/// warm-up by the share `apart`.
pub(crate) fn warm_year(seed: u64, count: usize, wear: Wear, apart: f64) -> Quantity {
    let mut draw = Draw::new(seed);
    let mut all = Vec::new();
    for unit in 0..count {
        let own = 1.0 + 0.05 * draw.normal();
        let height = 0.4 * (1.0 + apart * draw.normal());
        let phase = draw.uniform();
        for k in 0..PERIODS {
            let day = 14.0 * f64::from(k);
            let season = (TAU * (day / 365.0 + 0.1 * phase)).sin();
            let hours = 2.0 * (season + 0.4 * draw.normal()).exp();
            let load = 1.0 + 2.0 * draw.uniform();
            let worn = if unit == 0 { wear(day) } else { 0.0 };
            let warm = height * (-hours / 1.5).exp();
            let value = own + worn + warm + 0.1 * (load - 2.0) + 0.03 * draw.normal();
            all.push(period(unit, day, value, vec![hours, load]));
        }
    }
    quantity(&["hours_on", "load"], all)
}
