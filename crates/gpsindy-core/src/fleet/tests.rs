//! Drawn fleets with known answers: who is odd, what spreads, what changed and when.
#![allow(clippy::unwrap_used)]

use super::*;
use gpsindy_beside::{at_most, draws};

#[path = "drawn.rs"]
mod drawn;
use drawn::{Draw, SPREAD, WORN, at_once, fleet, no_wear, quantity, warm_year, year};

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
    let count = draws(30, 100);
    let alarms = (100..100 + count).filter(|&seed| {
        let mut alike = fleet(seed, 0.0);
        alike.observations.drain(..5);
        !Compare::default().run(&[alike]).unwrap().odd.is_empty()
    });
    let alarms = alarms.count();
    assert!(alarms <= at_most(0.05, count), "{alarms} of {count}, expected one in twenty");
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

#[test]
fn wear_is_dated_under_changing_load_and_temperature() {
    let (mut dated, count) = (0, draws(8, 20));
    for seed in 0..count {
        let found = Compare::default().run(&[year(seed, 30, at_once)]).unwrap();
        let change = found.changes.iter().find(|c| c.unit == "unit 0").unwrap();
        assert!((change.to - change.from - 0.2).abs() < 0.06, "{change:?}");
        dated += u64::from((change.since - 180.0).abs() <= 30.0);
    }
    assert!(20 * dated >= 19 * count, "{dated} of {count}");
}

#[test]
fn a_fleet_without_wear_raises_no_alarm() {
    let count = draws(20, 100);
    let is_alarmed = |&seed: &u64| !Compare::default().run(&[year(seed, 20, no_wear)]).unwrap().changes.is_empty();
    let alarms = (500..500 + count).filter(is_alarmed).count();
    assert!(20 * alarms <= count as usize, "{alarms} of {count}");
}

#[test]
fn a_warm_up_is_not_called_wear_and_wear_under_it_is_dated() {
    let (mut dated, count) = (0, draws(6, 20));
    for seed in 0..count {
        // Machines that all warm up alike, and machines that differ in it by a fifth.
        let apart = if seed % 2 == 0 { 0.0 } else { 0.2 };
        let without = Compare::default().run(&[warm_year(seed, 20, no_wear, apart)]).unwrap();
        assert!(without.changes.is_empty(), "{seed}: {:?}", without.changes);
        let found = Compare::default().run(&[warm_year(seed, 30, at_once, apart)]).unwrap();
        let change = found.changes.iter().find(|c| c.unit == "unit 0").unwrap();
        assert!((change.to - change.from - 0.2).abs() < 0.08, "{change:?}");
        dated += u64::from((change.since - WORN).abs() <= 30.0);
    }
    assert!(20 * dated >= 19 * count, "{dated} of {count}");
}

#[test]
fn a_curve_is_named_where_there_is_one_and_a_line_stays_a_line() {
    let slopes = |quantity: Quantity| Compare::default().run(&[quantity]).unwrap().population.remove(0).covariates;
    let warm = slopes(warm_year(3, 30, no_wear, 0.0));
    // From half an hour to six hours, with a mean of about 2.7.
    for hours in [0.5, 1.0, 2.0, 4.0, 6.0] {
        let drawn = 0.4 * ((-hours / 1.5_f64).exp() - (-warm[0].mean / 1.5).exp());
        assert!((warm[0].effect(hours) - drawn).abs() < 0.03, "{hours}: {warm:?}");
    }
    assert!(warm[1].curve.is_none(), "{warm:?}");
    let count = draws(8, 20);
    let bent = (0..count).flat_map(|seed| slopes(year(seed, 30, no_wear))).filter(|slope| slope.curve.is_some());
    // At a gain above the logarithm of the curves tried and half that of the periods, fewer than one in twenty is expected.
    assert!(bent.count() as u64 <= count / 20);
}

#[test]
fn one_odd_unit_at_the_end_of_a_range_bends_no_curve() {
    let mut draw = Draw::new(11);
    let one = |unit: usize| Observation {
        unit: format!("unit {unit}"),
        since: None,
        value: if unit == 0 { 2.0 } else { 1.0 + SPREAD * draw.normal() },
        deviation: 0.05,
        covariates: vec![unit as f64],
    };
    let found = Compare::default().run(&[quantity(&["age"], (0..100).map(one).collect())]).unwrap();
    assert!(found.population[0].covariates[0].curve.is_none(), "{:?}", found.population[0].covariates);
    assert_eq!(found.odd.iter().map(|o| o.unit.as_str()).collect::<Vec<_>>(), ["unit 0"]);
}

#[test]
fn slopes_of_covariates_are_found_while_units_differ() {
    let found = Compare::default().run(&[year(3, 30, no_wear)]).unwrap();
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
