//! Online identification compared with the batch: differences in standard errors over seeds, and the cost of a sample as the log grows.
//!
//! `cargo run --release -p gpsindy-core --example online -- 12 100000` (seeds, longest log)
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use gpsindy_core::library::LibrarySettings;
use gpsindy_core::systems::{SensorNoise, TestSystem, duffing, lotka_volterra, pendulum, van_der_pol};
use gpsindy_core::{Channel, Dataset, Identification, Online, OnlineSettings};
use std::time::Instant;

fn settings(system: &TestSystem, degree: usize, terms: &[&str]) -> OnlineSettings {
    OnlineSettings {
        states: system.model.states.iter().map(|s| Channel::new(&s.name)).collect(),
        controls: system.model.controls.iter().map(|c| Channel::new(&c.name)).collect(),
        library: LibrarySettings {
            degree,
            extra: terms.iter().map(ToString::to_string).collect(),
            ..LibrarySettings::default()
        },
        ..OnlineSettings::default()
    }
}

fn data(system: &TestSystem, n: usize, period: f64, noise: f64, seed: u64) -> Dataset {
    let times: Vec<f64> = (0..n).map(|i| period * i as f64).collect();
    system.sample(&times, &system.initial(), SensorNoise::Relative(noise), seed).unwrap()
}

/// Feeds samples `from..to` of the first run.
fn feed(online: &mut Online, data: &Dataset, n: usize, from: usize, to: usize) {
    let run = &data.runs()[0];
    for i in from..to {
        let row: Vec<f64> = (0..run.values.ncols()).map(|j| run.values[(i, j)]).collect();
        online.update(run.time[i], &row[..n], &row[n..]).unwrap();
    }
}

/// The largest difference of two models in standard errors of the first; `None` where their terms differ.
fn distance(one: &Identification, other: &Identification) -> Option<f64> {
    let (a, b) = (one.model.identification.as_ref()?, other.model.identification.as_ref()?);
    let mut worst = 0.0f64;
    for s in 0..one.states.len() {
        if one.states[s].terms != other.states[s].terms {
            return None;
        }
        for (j, error) in a.standard_errors[s].iter().enumerate().filter(|(_, e)| **e > 0.0) {
            worst = worst.max((a.coefficients[s][j] - b.coefficients[s][j]).abs() / error);
        }
    }
    Some(worst)
}

fn main() {
    let arguments: Vec<usize> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let (seeds, longest) = (arguments.first().copied().unwrap_or(12), arguments.get(1).copied().unwrap_or(100_000));
    println!("system, samples, window: logs with the terms of the batch, largest difference in standard errors");
    let systems = [
        (lotka_volterra(), 0.1, 0.05, settings(&lotka_volterra(), 2, &[])),
        (van_der_pol(), 0.05, 0.05, settings(&van_der_pol(), 3, &[])),
        (duffing(), 0.05, 0.05, settings(&duffing(), 3, &[])),
        (pendulum(), 0.02, 0.01, settings(&pendulum(), 2, &["sin(phi)", "tanh(om/0.02)"])),
    ];
    for (system, period, noise, settings) in &systems {
        for (n, window) in [(900, 1000), (3000, 1000), (1500, 200)] {
            let settings = OnlineSettings { window, ..settings.clone() };
            let (mut same, mut worst) = (0, 0.0f64);
            for seed in 0..seeds as u64 {
                let data = data(system, n, *period, *noise, seed);
                let mut online = Online::new(settings.clone()).unwrap();
                feed(&mut online, &data, settings.states.len(), 0, n);
                if let Some(d) = distance(&settings.fit(&data).unwrap(), &online.identification().unwrap()) {
                    (same, worst) = (same + 1, worst.max(d));
                }
            }
            println!("{}, {n}, {window}: {same} of {seeds}, {worst:.4}", system.model.name);
        }
    }
    println!("\nsamples before: microseconds a sample (Lotka-Volterra, 6 terms, window 1000), samples kept");
    let (system, period, noise, settings) = &systems[0];
    let data = data(system, longest, *period, *noise, 1);
    let mut online = Online::new(settings.clone()).unwrap();
    let (mut from, mut to) = (0, 1000);
    while from < longest {
        to = to.min(longest);
        let start = Instant::now();
        feed(&mut online, &data, 2, from, to);
        let each = start.elapsed().as_secs_f64() * 1e6 / (to - from) as f64;
        println!("{from}: {each:.1}, {}", online.n_kept());
        (from, to) = (to, 2 * to);
    }
    let start = Instant::now();
    let found = online.identification().unwrap();
    println!("a look at the model: {:.0} us", start.elapsed().as_secs_f64() * 1e6);
    println!("{:?}", found.model.states.iter().map(|s| s.equation.to_string()).collect::<Vec<_>>());
}
