//! Counts on drawn fleets what their comparison finds, for the tables of docs/results.md.
//!
//! `cargo run --release --example fleets -- [FIRST_SEED]`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::fleet::report::{Change, Odd};
use gpsindy_core::fleet::{Compare, Observation, Quantity};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Fleets of each kind.
const FLEETS: u64 = 200;
/// Years of each kind.
const YEARS: u64 = 100;
/// Spread between units.
const SPREAD: f64 = 0.1;
/// Odd units, of 200.
const ODD: usize = 5;
/// The day on which wear begins.
const WORN: f64 = 180.0;

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

    /// The standard error of an estimate.
    fn error(&mut self) -> f64 {
        0.03 + 0.05 * self.uniform()
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

fn number(unit: &str) -> usize {
    unit["unit ".len()..].parse().unwrap()
}

/// 200 units of mean 1; the first five are off by `off` spreads.
fn fleet(seed: u64, off: f64) -> Quantity {
    let mut draw = Draw::new(seed);
    let one = |unit: usize| {
        let deviation = draw.error();
        let shift = if unit < ODD { off * SPREAD } else { SPREAD * draw.normal() };
        let value = 1.0 + shift + deviation * draw.normal();
        Observation { unit: format!("unit {unit}"), since: None, value, deviation, covariates: Vec::new() }
    };
    quantity(&[], (0..200).map(one).collect())
}

/// Share of the odd units that the best rule finds of which one finding in twenty is false.
///
/// The rule knows mean, spread, errors, how many units are odd, how far and to which side, and takes units in the order of their likelihood
/// ratio.
fn best_possible(off: f64) -> f64 {
    let mut draw = Draw::new(9);
    let score = |draw: &mut Draw, is_odd: bool| {
        let error = draw.error();
        let total = SPREAD.hypot(error);
        let value = if is_odd { off * SPREAD + error * draw.normal() } else { total * draw.normal() };
        let density = |mean: f64, spread: f64| -0.5 * ((value - mean) / spread).powi(2) - spread.ln();
        density(off * SPREAD, error) - density(0.0, total)
    };
    let mut scores: Vec<(f64, bool)> = (0..1_000_000).map(|k| (score(&mut draw, k % 40 == 0), k % 40 == 0)).collect();
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut right, mut wrong, mut best) = (0usize, 0usize, 0usize);
    for (_, is_odd) in scores {
        right += usize::from(is_odd);
        wrong += usize::from(!is_odd);
        if wrong * 20 <= right + wrong {
            best = right;
        }
    }
    best as f64 / 25_000.0
}

fn odd_units(first: u64) {
    println!("| off by, spreads | found | false | mean share of false | fleets with a false one | best possible |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for off in [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
        let (mut found, mut wrong, mut share, mut alarms) = (0, 0, 0.0, 0);
        for seed in 0..FLEETS {
            let odd: Vec<Odd> = Compare::default().run(&[fleet(first + seed, off)]).unwrap().odd;
            let right = odd.iter().filter(|odd| off > 0.0 && number(&odd.unit) < ODD).count();
            let others = odd.len() - right;
            (found, wrong, alarms) = (found + right, wrong + others, alarms + usize::from(others > 0));
            share += others as f64 / odd.len().max(1) as f64 / FLEETS as f64;
        }
        let (share, best) = (100.0 * share, 100.0 * best_possible(off));
        let all = ODD as u64 * FLEETS;
        println!("| {off} | {found} of {all} | {wrong} | {share:.1} % | {alarms} of {FLEETS} | {best:.0} % |");
    }
}

/// What wear does to a unit until a day, as a share of all it does.
type Wear = fn(f64) -> f64;

/// A year of 26 fortnights: friction follows load and temperature; unit 0 wears by `wear` of the mean.
fn year(seed: u64, count: usize, (wear, shape): (f64, Wear)) -> Quantity {
    let mut draw = Draw::new(seed);
    let mut all = Vec::new();
    for unit in 0..count {
        let own = 1.0 + 0.05 * draw.normal();
        let phase = draw.uniform();
        for k in 0..26 {
            let day = 14.0 * f64::from(k);
            let temperature = 20.0 + 8.0 * (std::f64::consts::TAU * (day / 365.0 + 0.1 * phase)).sin() + draw.normal();
            let load = 1.0 + 2.0 * draw.uniform();
            let worn = if unit == 0 { wear * shape(day) } else { 0.0 };
            let value = own + worn - 0.02 * (temperature - 20.0) + 0.1 * (load - 2.0) + 0.03 * draw.normal();
            let covariates = vec![temperature, load];
            all.push(Observation {
                unit: format!("unit {unit}"),
                since: Some(day),
                value,
                deviation: 0.03,
                covariates,
            });
        }
    }
    quantity(&["temperature", "load"], all)
}

fn wear(first: u64) {
    // Name, course, and the day on which it is half begun.
    let shapes: [(&str, Wear, f64); 3] = [
        ("at once at mid-year", |day| if day >= WORN { 1.0 } else { 0.0 }, WORN),
        ("evenly from mid-year on", |day| ((day - WORN) / (350.0 - WORN)).max(0.0), WORN),
        ("within a month from mid-year on", |day| ((day - WORN) / 30.0).clamp(0.0, 1.0), WORN + 15.0),
    ];
    println!("\n| wear of 20 % | named | within 30 days | inside its 90 % interval | other units named |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, shape, day) in shapes {
        let (mut named, mut dated, mut covered, mut others) = (0, 0, 0, 0);
        for seed in 0..YEARS {
            let changes: Vec<Change> = Compare::default().run(&[year(first + seed, 30, (0.2, shape))]).unwrap().changes;
            others += changes.iter().filter(|c| c.unit != "unit 0").count();
            let Some(change) = changes.iter().find(|c| c.unit == "unit 0") else { continue };
            named += 1;
            dated += usize::from((change.since - day).abs() <= 30.0);
            // Days lie in the middle between two periods.
            covered += usize::from((change.interval.0 - 7.0..=change.interval.1 + 7.0).contains(&day));
        }
        println!("| {name} | {named} of {YEARS} | {dated} | {covered} | {others} |");
    }
    let without =
        |seed: &u64| !Compare::default().run(&[year(first + seed, 20, (0.0, |_| 0.0))]).unwrap().changes.is_empty();
    println!("\nfleets of 20 units without wear, with an alarm: {} of {YEARS}", (0..YEARS).filter(without).count());
}

fn main() {
    let first = std::env::args().nth(1).map_or(10_000, |text| text.parse().unwrap());
    odd_units(first);
    wear(first);
}
