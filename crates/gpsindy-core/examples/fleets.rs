//! Counts on drawn fleets what their comparison finds, for the tables of docs/results_fleets.md.
//!
//! `cargo run --release --example fleets -- [FIRST_SEED [odd|year|warm]]`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::fleet::report::{Change, Odd};
use gpsindy_core::fleet::{Compare, Observation, Quantity};

#[path = "../src/fleet/drawn.rs"]
mod drawn;
use drawn::{Draw, ODD, SPREAD, WORN, Wear, at_once, fleet, no_wear, warm_year, year};

/// Fleets of each kind.
const FLEETS: u64 = 200;
/// Years of each kind.
const YEARS: u64 = 100;

fn number(unit: &str) -> usize {
    unit["unit ".len()..].parse().unwrap()
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

/// Counts over the years of one kind of fleet, of 30 units of which one wears, and of 20 units without wear.
fn years(first: u64, drawn: impl Fn(u64, usize, Wear) -> Quantity) {
    // Name, course, and the day on which it is half begun.
    let shapes: [(&str, Wear, f64); 3] = [
        ("at once at mid-year", at_once, WORN),
        ("evenly from mid-year on", |day| 0.2 * ((day - WORN) / (350.0 - WORN)).max(0.0), WORN),
        ("within a month from mid-year on", |day| 0.2 * ((day - WORN) / 30.0).clamp(0.0, 1.0), WORN + 15.0),
    ];
    println!("| wear of 20 % | named | within 30 days | inside its 90 % interval | other units named |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, wear, day) in shapes {
        let (mut named, mut dated, mut covered, mut others) = (0, 0, 0, 0);
        for seed in 0..YEARS {
            let changes: Vec<Change> = Compare::default().run(&[drawn(first + seed, 30, wear)]).unwrap().changes;
            others += changes.iter().filter(|c| c.unit != "unit 0").count();
            let Some(change) = changes.iter().find(|c| c.unit == "unit 0") else { continue };
            named += 1;
            dated += usize::from((change.since - day).abs() <= 30.0);
            // Days lie in the middle between two periods.
            covered += usize::from((change.interval.0 - 7.0..=change.interval.1 + 7.0).contains(&day));
        }
        println!("| {name} | {named} of {YEARS} | {dated} | {covered} | {others} |");
    }
    let without = |seed: &u64| !Compare::default().run(&[drawn(first + seed, 20, no_wear)]).unwrap().changes.is_empty();
    println!("| none | {} of {YEARS} fleets | | | |", (0..YEARS).filter(without).count());
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let first = arguments.next().map_or(10_000, |text| text.parse().unwrap());
    let only = arguments.next();
    let wanted = |what: &str| only.as_deref().is_none_or(|only| only == what);
    if wanted("odd") {
        odd_units(first);
    }
    if wanted("year") {
        println!("\nload and temperature:");
        years(first, year);
    }
    for apart in [0.0, 0.2] {
        if wanted("warm") {
            println!("\nwarm-up, of a height that differs by {apart} of itself between units:");
            years(first, |seed, count, wear| warm_year(seed, count, wear, apart));
        }
    }
}
