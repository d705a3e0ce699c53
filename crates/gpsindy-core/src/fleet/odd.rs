//! Which unit differs: finds units that the rest of the fleet does not predict, with a bound on the false discovery rate.
//!
//! `t_i = (level_i - prediction of the others) / sqrt(tau^2 + error^2)`. Several odd units widen the spread and hide each other, so those
//! found are taken out of the fleet that predicts, until no other is found.
//!
//! Source: Benjamini and Hochberg 1995, section 3.1; Storey 2002 (the smallest rate at which a finding is still listed).

use super::Quantity;
use super::limits::{FEWEST_UNITS, ROUNDS};
use super::population::{Level, Table};
use super::report::Odd;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// How unlikely a unit is compared with the others.
struct Surprise {
    place: usize,
    p_value: f64,
    value: f64,
    population: f64,
    spread: f64,
}

/// Places of the units of one quantity that the others do not predict, at this rate of false discoveries.
pub(super) fn odd(table: &Table, rate: f64) -> Vec<usize> {
    let mut found: Vec<usize> = Vec::new();
    for _ in 0..ROUNDS {
        let surprises = surprises(table, &found);
        let p_values: Vec<f64> = surprises.iter().map(|s| s.p_value).collect();
        let rates = discovery_rates(&p_values);
        let now: Vec<usize> = surprises.iter().zip(&rates).filter(|(_, q)| **q <= rate).map(|(s, _)| s.place).collect();
        // More than half of a fleet can't be odd: then the fleet is two fleets, and nobody is the odd one.
        if now == found || 2 * now.len() > table.groups.len() {
            break;
        }
        found = now;
    }
    found
}

/// Every unit compared with the fit to the others, the odd ones left out of it.
fn surprises(table: &Table, odd: &[usize]) -> Vec<Surprise> {
    let count = table.groups.len();
    if count < FEWEST_UNITS {
        return Vec::new();
    }
    let others = table.without(odd);
    let one = |place: usize| {
        let fit = others.fit(Some(place))?;
        let Level { residual, own, mean } = table.level(place, &fit);
        let t = residual / (fit.between + own + mean).sqrt();
        let tail = StudentsT::new(0.0, 1.0, fit.freedom as f64).ok()?.sf(t.abs());
        let (population, spread) = (fit.beta[0], fit.between.sqrt());
        Some(Surprise { place, p_value: (2.0 * tail).min(1.0), value: population + residual, population, spread })
    };
    (0..count).filter_map(one).collect()
}

/// The odd units over all quantities, the clearest first.
pub(super) fn discoveries(quantities: &[Quantity], tables: &[Table], unusual: &[Vec<usize>], rate: f64) -> Vec<Odd> {
    let mut all: Vec<(usize, Surprise)> = Vec::new();
    for (q, (table, unusual)) in tables.iter().zip(unusual).enumerate() {
        all.extend(surprises(table, unusual).into_iter().map(|s| (q, s)));
    }
    let p_values: Vec<f64> = all.iter().map(|(_, s)| s.p_value).collect();
    let rates = discovery_rates(&p_values);
    let mut found: Vec<Odd> = all
        .iter()
        .zip(&rates)
        .filter(|(_, found)| **found <= rate)
        .map(|((q, surprise), &false_discovery_rate)| Odd {
            unit: tables[*q].groups[surprise.place].unit.clone(),
            effect: quantities[*q].effect.clone(),
            state: quantities[*q].state.clone(),
            parameter: quantities[*q].parameter.clone(),
            value: surprise.value,
            population: surprise.population,
            spread: surprise.spread,
            false_discovery_rate,
        })
        .collect();
    found.sort_by(|a, b| a.false_discovery_rate.total_cmp(&b.false_discovery_rate));
    found
}

/// For every p-value the smallest rate of false discoveries at which it is one of them.
pub(super) fn discovery_rates(p_values: &[f64]) -> Vec<f64> {
    let count = p_values.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut rates = vec![1.0; count];
    let mut least = 1.0_f64;
    for (rank, &i) in order.iter().enumerate().rev() {
        least = least.min(p_values[i] * count as f64 / (rank + 1) as f64);
        rates[i] = least;
    }
    rates
}
