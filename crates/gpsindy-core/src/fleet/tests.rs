//! Drawn fleets with known answers: who is odd, what spreads, what changed and when.
#![allow(clippy::unwrap_used)]

use super::*;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Normal numbers from an explicit seed (Box and Muller 1958).
struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform().max(1e-300), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

fn quantity(covariates: &[&str], observations: Vec<Observation>) -> Quantity {
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
fn fleet(seed: u64, off: f64) -> Quantity {
    let mut draw = Draw::new(seed);
    let one = |unit: usize| {
        let deviation = 0.03 + 0.05 * draw.uniform();
        let shift = if unit < 5 { off * 0.1 } else { 0.1 * draw.normal() };
        let value = 1.0 + shift + deviation * draw.normal();
        Observation { unit: format!("unit {unit}"), since: None, value, deviation, covariates: Vec::new() }
    };
    quantity(&[], (0..200).map(one).collect())
}

#[test]
fn units_that_are_far_off_are_found_and_hardly_any_other_is() {
    let (mut found, mut wrong) = (0, 0);
    for seed in 0..20 {
        let comparison = Compare::default().run(&[fleet(seed, 6.0)]).unwrap();
        let truly = |odd: &&Odd| ["unit 0", "unit 1", "unit 2", "unit 3", "unit 4"].contains(&odd.unit.as_str());
        found += comparison.odd.iter().filter(truly).count();
        wrong += comparison.odd.len() - comparison.odd.iter().filter(truly).count();
    }
    assert!(found >= 95, "{found} of 100");
    // At a rate of 5 %: 5 of 105 expected, 11 is beyond two deviations.
    assert!(wrong <= 11, "{wrong}");
}

#[test]
fn a_fleet_without_odd_units_has_none_in_nineteen_of_twenty() {
    let alarms = (100..200).filter(|&seed| {
        let mut alike = fleet(seed, 0.0);
        alike.observations.drain(..5);
        !Compare::default().run(&[alike]).unwrap().odd.is_empty()
    });
    let alarms = alarms.count();
    assert!(alarms <= 11, "{alarms} of 100, expected 5");
}

#[test]
fn the_spread_is_that_of_the_units_and_not_of_their_errors() {
    let of = |seed: u64| Compare::default().run(&[fleet(seed, 0.0)]).unwrap().population.remove(0);
    let spreads: Vec<f64> = (0..20).map(|seed| of(seed).spread).collect();
    let mean = spreads.iter().sum::<f64>() / 20.0;
    assert!((mean - 0.1).abs() < 0.005, "{mean}");
    let one = of(3);
    assert!(one.spread_p_value < 1e-6 && one.randomise.is_some());
    // Estimates drawn towards the mean scatter less than the raw ones do.
    let raw = fleet(3, 0.0);
    let raw: f64 = raw.observations.iter().map(|o| (o.value - one.mean).powi(2)).sum();
    let drawn: f64 = one.estimates.iter().map(|e| (e.value - one.mean).powi(2)).sum();
    assert!(drawn < 0.9 * raw, "{drawn} {raw}");
}

#[test]
fn units_that_are_alike_have_no_spread_to_randomise() {
    let mut draw = Draw::new(7);
    let one = |unit: usize| Observation {
        unit: format!("unit {unit}"),
        since: None,
        value: 1.0 + 0.05 * draw.normal(),
        deviation: 0.05,
        covariates: Vec::new(),
    };
    let found = Compare::default().run(&[quantity(&[], (0..60).map(one).collect())]).unwrap();
    assert!(found.population[0].randomise.is_none(), "{:?}", found.population[0]);
}

/// A year of 26 fortnights of `count` units: friction follows load and temperature; unit 0 is worn by `wear` of the mean from day 180 on.
fn year(seed: u64, count: usize, wear: f64) -> Quantity {
    let mut draw = Draw::new(seed);
    let mut all = Vec::new();
    for unit in 0..count {
        let own = 1.0 + 0.05 * draw.normal();
        let phase = draw.uniform();
        for k in 0..26 {
            let day = 14.0 * f64::from(k);
            let temperature = 20.0 + 8.0 * (std::f64::consts::TAU * (day / 365.0 + 0.1 * phase)).sin() + draw.normal();
            let load = 1.0 + 2.0 * draw.uniform();
            let worn = if unit == 0 && day >= 180.0 { wear } else { 0.0 };
            let value = own + worn - 0.02 * (temperature - 20.0) + 0.1 * (load - 2.0) + 0.03 * draw.normal();
            all.push(Observation {
                unit: format!("unit {unit}"),
                since: Some(day),
                value,
                deviation: 0.03,
                covariates: vec![temperature, load],
            });
        }
    }
    quantity(&["temperature", "load"], all)
}

#[test]
fn wear_is_dated_under_changing_load_and_temperature() {
    let mut dated = 0;
    for seed in 0..20 {
        let found = Compare::default().run(&[year(seed, 30, 0.2)]).unwrap();
        let change = found.changes.iter().find(|c| c.unit == "unit 0").unwrap();
        assert!((change.to - change.from - 0.2).abs() < 0.06, "{change:?}");
        dated += usize::from((change.since - 180.0).abs() <= 30.0);
    }
    assert!(dated >= 19, "{dated} of 20");
}

#[test]
fn a_fleet_without_wear_raises_no_alarm() {
    let alarms = (500..600).filter(|&seed| !Compare::default().run(&[year(seed, 20, 0.0)]).unwrap().changes.is_empty());
    let alarms = alarms.count();
    assert!(alarms <= 5, "{alarms} of 100");
}

#[test]
fn slopes_of_covariates_are_found_while_units_differ() {
    let found = Compare::default().run(&[year(3, 30, 0.0)]).unwrap();
    let slopes = &found.population[0].covariates;
    assert!((slopes[0].value + 0.02).abs() < 4.0 * slopes[0].deviation, "{slopes:?}");
    assert!((slopes[1].value - 0.1).abs() < 4.0 * slopes[1].deviation, "{slopes:?}");
}

#[test]
fn bad_numbers_are_refused_by_name() {
    let with = |change: fn(&mut Observation)| {
        let mut bad = fleet(0, 0.0);
        change(&mut bad.observations[3]);
        Compare::default().run(&[bad]).unwrap_err().to_string()
    };
    assert!(with(|o| o.value = f64::NAN).contains("unit `unit 3`"));
    assert!(with(|o| o.deviation = 0.0).contains("above 0"));
    assert!(with(|o| o.covariates.push(1.0)).contains("covariates of unit `unit 3`"));
    let rate = Compare { false_discovery_rate: 0.0 }.run(&[]).unwrap_err().to_string();
    assert!(rate.contains("false_discovery_rate"), "{rate}");
}
