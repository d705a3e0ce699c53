//! Accuracy of `identify` on the paper's simulated systems: median mean squared coefficient error and share of exact supports.
//!
//! `cargo run --release -p gpsindy-core --example identify_accuracy -- SYSTEM REGIME SEEDS SIGMA...`
//! SYSTEM: lv, unicycle, lorenz. REGIME: given10, free10, given5, free5, irregular. SEEDS: how many, or FROM..TO.
//! With FAULTS in the environment the terms of every wrong support are shown.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::library::LibrarySettings;
use gpsindy_core::systems::LORENZ_TERMS;
use gpsindy_core::{Channel, Dataset, Identify, Run, Silent};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::time::Instant;

struct Truth {
    states: Vec<&'static str>,
    controls: Vec<&'static str>,
    initial: Vec<f64>,
    span: f64,
    rate: fn(f64, &[f64], &[f64]) -> Vec<f64>,
    control: fn(f64) -> Vec<f64>,
    library: LibrarySettings,
    /// state, term, coefficient
    terms: Vec<(usize, &'static str, f64)>,
    train: f64,
}

fn truth(name: &str) -> Truth {
    match name {
        "lv" => Truth {
            states: vec!["x1", "x2"],
            controls: vec![],
            initial: vec![10.0, 5.0],
            span: 30.0,
            rate: |_, x, _| vec![1.1 * x[0] - 0.4 * x[0] * x[1], -x[1] + 0.4 * x[0] * x[1]],
            control: |_| vec![],
            library: LibrarySettings { degree: 3, products: true, ..LibrarySettings::default() },
            terms: vec![(0, "x1", 1.1), (0, "x1*x2", -0.4), (1, "x2", -1.0), (1, "x1*x2", 0.4)],
            train: 0.8,
        },
        "lorenz" => Truth {
            states: vec!["x", "y", "z"],
            controls: vec![],
            initial: vec![-8.0, 7.0, 27.0],
            span: 10.0,
            rate: |_, x, _| vec![10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]],
            control: |_| vec![],
            library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
            terms: LORENZ_TERMS.to_vec(),
            train: 1.0,
        },
        _ => Truth {
            states: vec!["x", "y", "v", "a"],
            controls: vec!["u1", "u2"],
            initial: vec![0.0, 0.0, 0.5, 0.5],
            span: 30.0,
            rate: |_, x, u| vec![x[2] * x[3].cos(), x[2] * x[3].sin(), u[0], u[1]],
            control: |t| vec![t.sin(), 0.5 * t.cos()],
            library: LibrarySettings { degree: 1, products: true, ..LibrarySettings::default() },
            terms: vec![(0, "v*cos(a)", 1.0), (1, "v*sin(a)", 1.0), (2, "u1", 1.0), (3, "u2", 1.0)],
            train: 0.8,
        },
    }
}

fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    ((rng.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v) = (uniform(rng), uniform(rng));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

fn simulate(truth: &Truth, times: &[f64]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let (mut x, mut t) = (truth.initial.clone(), 0.0);
    let rate = |t: f64, x: &[f64]| (truth.rate)(t, x, &(truth.control)(t));
    let along = |x: &[f64], k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<_>>();
    let (mut states, mut rates) = (Vec::new(), Vec::new());
    for &target in times {
        let steps = ((target - t) / 1e-3).ceil() as usize;
        for _ in 0..steps {
            let h = (target - t).min(1e-3);
            let k1 = rate(t, &x);
            let k2 = rate(t + 0.5 * h, &along(&x, &k1, 0.5 * h));
            let k3 = rate(t + 0.5 * h, &along(&x, &k2, 0.5 * h));
            let k4 = rate(t + h, &along(&x, &k3, h));
            x = (0..x.len()).map(|j| x[j] + h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])).collect();
            t += h;
        }
        t = target;
        rates.push(rate(t, &x));
        states.push(x.clone());
    }
    (states, rates)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (system, regime) = (arguments[0].as_str(), arguments[1].as_str());
    // A number of seeds, or the first and the one behind the last as FROM..TO.
    let (from, to): (u64, u64) = match arguments[2].split_once("..") {
        Some((from, to)) => (from.parse().unwrap(), to.parse().unwrap()),
        None => (0, arguments[2].parse().unwrap()),
    };
    let seeds = to - from;
    let sigmas: Vec<f64> = arguments[3..].iter().map(|a| a.parse().unwrap()).collect();
    let truth = truth(system);
    let given = regime.starts_with("given");
    let step = if system == "lorenz" {
        0.01
    } else if regime.ends_with('5') {
        0.2
    } else {
        0.1
    };
    for sigma in sigmas {
        let (mut errors, mut exact, mut cost) = (Vec::new(), 0, 0.0);
        for seed in from..to {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let count = (truth.span / step).round() as usize + 1;
            let mut time: Vec<f64> = (0..count).map(|i| step * i as f64).collect();
            if regime == "irregular" {
                time = (0..count).map(|_| truth.span * uniform(&mut rng)).collect();
                time.sort_by(f64::total_cmp);
                time.dedup();
            }
            let (states, rates) = simulate(&truth, &time);
            let n = truth.states.len();
            let m = truth.controls.len();
            // Lorenz: noise as a share of each state's standard deviation.
            let size: Vec<f64> = (0..n)
                .map(|j| {
                    let mean = states.iter().map(|x| x[j]).sum::<f64>() / states.len() as f64;
                    let variance = states.iter().map(|x| (x[j] - mean).powi(2)).sum::<f64>() / states.len() as f64;
                    if system == "lorenz" { variance.sqrt() } else { 1.0 }
                })
                .collect();
            let mut columns: Vec<Vec<f64>> = Vec::new();
            let mut names: Vec<String> = Vec::new();
            for j in 0..n {
                columns.push(states.iter().map(|x| x[j] + sigma * size[j] * normal(&mut rng)).collect());
                names.push(truth.states[j].into());
            }
            for k in 0..m {
                columns.push(time.iter().map(|&t| (truth.control)(t)[k]).collect());
                names.push(truth.controls[k].into());
            }
            if given {
                for j in 0..n {
                    columns.push(rates.iter().map(|x| x[j] + sigma * size[j] * normal(&mut rng)).collect());
                    names.push(format!("d{}", truth.states[j]));
                }
            }
            let values = faer::Mat::from_fn(time.len(), columns.len(), |i, j| columns[j][i]);
            let channels = names.iter().map(Channel::new).collect();
            let data = Dataset::new(channels, vec![Run { name: "a".into(), time, values }]).unwrap();
            let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
            let identify = Identify {
                states: own(&truth.states),
                controls: own(&truth.controls),
                derivatives: if given {
                    truth.states.iter().map(|s| (s.to_string(), format!("d{s}"))).collect()
                } else {
                    vec![]
                },
                library: truth.library.clone(),
                train_fraction: truth.train,
                refine: std::env::var("NO_REFINE").is_err(),
                ..Identify::default()
            };
            let clock = Instant::now();
            let result = identify.fit(&data, &Silent);
            cost += clock.elapsed().as_secs_f64();
            let Ok(result) = result.map_err(|e| println!("seed {seed}: {e}")) else {
                errors.push(f64::INFINITY);
                continue;
            };
            let record = result.model.identification.as_ref().unwrap();
            let mut square = 0.0;
            let mut right = true;
            for s in 0..n {
                for (j, name) in record.terms.iter().enumerate() {
                    let target = truth.terms.iter().find(|t| t.0 == s && t.1 == name).map_or(0.0, |t| t.2);
                    let found = record.coefficients[s][j];
                    square += (found - target).powi(2);
                    right &= (found != 0.0) == (target != 0.0);
                }
            }
            errors.push(square / (n * record.terms.len()) as f64);
            exact += usize::from(right);
            if !right && std::env::var("FAULTS").is_ok() {
                println!("  seed {seed}: {:?}", result.states.iter().map(|s| s.terms.join(" ")).collect::<Vec<_>>());
            }
            if std::env::var("VERBOSE").is_ok() {
                for state in &result.model.states {
                    println!("  {seed} {}' = {}", state.name, state.equation);
                }
                let of = |f: fn(&gpsindy_core::StateReport) -> f64| result.states.iter().map(f).collect::<Vec<_>>();
                println!(
                    "  window {:?} noise {:.3?} residual {:.2?} {:?}",
                    result.window,
                    of(|s| s.noise),
                    of(|s| s.residual.unwrap_or(f64::NAN)),
                    result.notes
                );
            }
        }
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        println!(
            "{system} {regime} sigma {sigma}: median {median:.1e}, exact {:.2}, worst {:.1e}, {:.2} s each",
            exact as f64 / seeds as f64,
            errors[errors.len() - 1],
            cost / seeds as f64
        );
    }
}
