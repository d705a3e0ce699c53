//! Coverage of the 95 % intervals of `identify`: how often coefficient +- 1.96 standard errors holds the true coefficient.
//!
//! `cargo run --release -p gpsindy-core --example identify_coverage -- SEEDS NOISE...`
//! NOISE: shares of each state's standard deviation. Known systems, each noise level, seeds 0 to SEEDS - 1. Only terms that
//! are truly in the equation count, over all seeds in which they were found; next to it the share of exact supports, and the
//! median of the ratio of stated standard error to the spread of the estimates over the seeds.
//! ENSEMBLE=N in the environment also asks for inclusion probabilities (N bootstraps) and shows how many of the terms of each
//! probability are true, and how many of them the final equations hold.
//! ONLY=NAME in the environment takes the systems of that name; VERBOSE=1 shows (estimate - truth)/error of every seed.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::library::{Constraints, Fixed, LibrarySettings};
use gpsindy_core::systems::{self, SensorNoise, TestSystem};
use gpsindy_core::{Identify, Silent};

/// State, term, coefficient.
type Truth = Vec<(usize, &'static str, f64)>;

fn cases() -> Vec<(&'static str, TestSystem, LibrarySettings, Vec<&'static str>, Truth)> {
    let degree = |degree| LibrarySettings { degree, ..LibrarySettings::default() };
    let mut damped = systems::duffing();
    damped.controls = |t| vec![0.5 * (1.2 * t).cos() + 0.3 * (2.9 * t).sin()];
    let mut short = systems::lorenz();
    short.duration = 5.0;
    let extra = |terms: &[&str]| LibrarySettings {
        degree: 2,
        extra: terms.iter().map(ToString::to_string).collect(),
        ..LibrarySettings::default()
    };
    vec![
        (
            "lotka_volterra",
            systems::lotka_volterra(),
            degree(3),
            vec![],
            vec![(0, "x1", 1.1), (0, "x1*x2", -0.4), (1, "x2", -1.0), (1, "x1*x2", 0.4)],
        ),
        (
            "van_der_pol",
            systems::van_der_pol(),
            degree(3),
            vec![],
            vec![(0, "v", 1.0), (1, "x", -1.0), (1, "v", 2.0), (1, "x^2*v", -2.0)],
        ),
        (
            "duffing",
            damped,
            degree(3),
            vec!["x' = v"],
            vec![(1, "x", 1.0), (1, "v", -0.3), (1, "x^3", -1.0), (1, "u", 1.0)],
        ),
        (
            "pendulum",
            systems::pendulum(),
            extra(&["sin(phi)", "tanh(om/0.02)"]),
            vec!["phi' = om"],
            vec![(1, "u", 12.5), (1, "sin(phi)", -24.525), (1, "om", -0.125), (1, "tanh(om/0.02)", -0.25)],
        ),
        ("lorenz", short, degree(2), vec![], systems::LORENZ_TERMS.to_vec()),
    ]
}

fn main() {
    let arguments: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let seeds = arguments[0] as u64;
    let (mut all, mut covered_all) = (0, 0);
    let ensemble = std::env::var("ENSEMBLE").map_or(0, |n| n.parse().unwrap());
    // Upper end of a bin of inclusion probabilities; terms in it, their sum, true ones, ones in the final equations.
    let mut bins = [0.05, 0.2, 0.5, 0.8, 0.95, 1.0].map(|end| (end, 0usize, 0.0, 0usize, 0usize));
    let only = std::env::var("ONLY").unwrap_or_default();
    for (name, system, library, fixed, truth) in cases().into_iter().filter(|case| case.0.contains(&only)) {
        for &noise in &arguments[1..] {
            let (mut covered, mut count, mut exact) = (0, 0, 0);
            let mut found: Vec<Vec<(f64, f64)>> = vec![Vec::new(); truth.len()];
            for seed in 0..seeds {
                let data = system.sample_usual(SensorNoise::Relative(noise), seed).unwrap();
                let names = |list: Vec<&String>| list.into_iter().cloned().collect::<Vec<_>>();
                let identify = Identify {
                    states: names(system.model.states.iter().map(|s| &s.name).collect()),
                    controls: names(system.model.controls.iter().map(|c| &c.name).collect()),
                    library: library.clone(),
                    constraints: Constraints {
                        fixed: fixed.iter().map(|f| Fixed::parse(f).unwrap()).collect(),
                        ..Constraints::default()
                    },
                    ensemble,
                    ..Identify::default()
                };
                let Ok(result) = identify.fit(&data, &Silent) else { continue };
                let record = result.model.identification.as_ref().unwrap();
                let terms: usize = record.coefficients.iter().flatten().filter(|c| **c != 0.0).count();
                let mut right = terms == truth.len();
                for (state, row) in record.inclusion_probabilities.iter().enumerate() {
                    let given = truth.iter().all(|(other, ..)| *other != state);
                    for (j, &share) in row.iter().enumerate().filter(|_| !given) {
                        let Some(bin) = bins.iter_mut().find(|bin| share <= bin.0) else { continue };
                        bin.1 += 1;
                        bin.2 += share;
                        bin.3 += usize::from(truth.iter().any(|t| t.0 == state && t.1 == record.terms[j]));
                        bin.4 += usize::from(record.coefficients[state][j] != 0.0);
                    }
                }
                for (k, (state, term, value)) in truth.iter().enumerate() {
                    let place = record.terms.iter().position(|t| t == term).unwrap();
                    let (estimate, error) = (record.coefficients[*state][place], record.standard_errors[*state][place]);
                    right &= estimate != 0.0;
                    if estimate != 0.0 {
                        covered += usize::from((estimate - value).abs() <= 1.96 * error);
                        count += 1;
                        found[k].push((estimate, error));
                    }
                }
                exact += usize::from(right);
                if std::env::var("VERBOSE").is_ok() {
                    let of = |k: usize| {
                        let (state, term, value) = truth[k];
                        let place = record.terms.iter().position(|t| t == term).unwrap();
                        (record.coefficients[state][place] - value) / record.standard_errors[state][place]
                    };
                    let scores: Vec<f64> = (0..truth.len()).map(of).collect();
                    println!(
                        "  {name} {seed}: {scores:.1?} window {:?} {:?} {:?}",
                        result.window, result.hold, result.notes
                    );
                }
            }
            let mut ratios: Vec<f64> = found
                .iter()
                .filter(|f| f.len() > 2)
                .map(|f| {
                    let n = f.len() as f64;
                    let mean = f.iter().map(|(e, _)| e).sum::<f64>() / n;
                    let spread = (f.iter().map(|(e, _)| (e - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
                    f.iter().map(|(_, s)| s).sum::<f64>() / n / spread
                })
                .collect();
            ratios.sort_by(f64::total_cmp);
            let middle = ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN);
            println!(
                "{name} noise {noise}: covered {covered} of {count} = {:.3}, exact {:.2}, stated error to spread {middle:.2}",
                covered as f64 / count as f64,
                exact as f64 / seeds as f64
            );
            (all, covered_all) = (all + count, covered_all + covered);
        }
    }
    for (end, count, sum, right, kept) in bins.iter().filter(|bin| bin.1 > 0) {
        let share = |n: f64| n / *count as f64;
        let (mean, right, kept) = (share(*sum), share(*right as f64), share(*kept as f64));
        println!("inclusion up to {end}: {count} terms, mean {mean:.3}, true {right:.3}, in the equations {kept:.3}");
    }
    println!("all: covered {covered_all} of {all} = {:.3}", covered_all as f64 / all as f64);
}
