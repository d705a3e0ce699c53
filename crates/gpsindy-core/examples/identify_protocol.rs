//! The paper's protocol on the small car: each rollout learnt alone, its end predicted in one go.
//!
//! `cargo run --release -p gpsindy-core --example identify_protocol -- FOLDER RATE LIBRARY [EVERY [SIGMA...]]`
//! FOLDER holds rollout_01.csv ... with the columns t, x, y, v, heading, throttle, steering at 50 Hz. Both controls are shifted
//! 0.12 s later, the first second is cut, every 50/RATE-th row kept, white noise SIGMA added to all four states; learnt from the
//! first 70 %, tested on the rest from its first noisy sample. EVERY: every so-manieth rollout. The error is the paper's: the
//! Frobenius norm of prediction minus noisy log. LIBRARY: kinematic (position known, few terms for speed and heading), physical
//! (terms of a car and their signs known), paper (the authors' 91 terms). VERBOSE in the environment shows every model.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::library::{Constraints, Fixed, Forbidden, Kept, LibrarySettings, Signed};
use gpsindy_core::{Channel, Dataset, Excitation, Hold, Identify, Model, Run, Silent, Simulate};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::time::Instant;

const NAMES: [&str; 7] = ["t", "x", "y", "v", "heading", "throttle", "steering"];

/// Samples by which the controls are shifted, at 50 Hz.
const SHIFT: usize = 6;

/// Rollout `number` at `rate` Hz without noise; `None` where there is no such file.
fn rollout(folder: &str, number: usize, rate: usize) -> Option<Run> {
    let text = std::fs::read_to_string(format!("{folder}/rollout_{number:02}.csv")).ok()?;
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|line| line.split(',').map(|cell| cell.trim().parse().ok()).collect::<Option<Vec<f64>>>())
        .collect();
    let run = Run {
        name: number.to_string(),
        time: rows.iter().map(|r| r[0]).collect(),
        values: faer::Mat::from_fn(rows.len(), 6, |i, j| rows[i][j + 1]),
    };
    let channels = NAMES[1..].iter().map(|n| Channel::new(*n)).collect();
    let mut data = Dataset::new(channels, vec![run]).unwrap();
    data.unwrap_angle("heading").unwrap();
    let full = &data.runs()[0];
    let kept: Vec<usize> = (SHIFT..full.n_samples()).filter(|&i| full.time[i] > 1.0).step_by(50 / rate).collect();
    Some(Run {
        name: full.name.clone(),
        time: kept.iter().map(|&i| full.time[i]).collect(),
        values: faer::Mat::from_fn(kept.len(), 6, |i, j| {
            full.values[(if j < 4 { kept[i] } else { kept[i] - SHIFT }, j)]
        }),
    })
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || ((rng.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

fn part(run: &Run, from: usize, end: usize) -> Run {
    Run {
        name: run.name.clone(),
        time: run.time[from..end].to_vec(),
        values: faer::Mat::from_fn(end - from, 6, |i, j| run.values[(from + i, j)]),
    }
}

fn settings(name: &str) -> Identify {
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let extra = |terms: &[&str]| LibrarySettings { degree: 0, extra: own(terms), ..LibrarySettings::default() };
    let mut constraints = Constraints::default();
    let library = match name {
        "kinematic" => {
            let known = ["x' = v*cos(heading)", "y' = v*sin(heading)"];
            constraints.fixed = known.iter().map(|text| Fixed::parse(text).unwrap()).collect();
            extra(&["v", "throttle", "v*steering", "v*steering^2", "v*steering^3"])
        }
        "physical" => {
            let rows: [(&str, &[&str]); 4] = [
                ("x", &["v*cos(heading)", "v*steering*sin(heading)"]),
                ("y", &["v*sin(heading)", "v*steering*cos(heading)"]),
                ("v", &["1", "v", "throttle", "v*steering^2"]),
                ("heading", &["v", "v*steering", "v*steering^3"]),
            ];
            let all: Vec<&str> = rows.iter().flat_map(|(_, terms)| terms.iter().copied()).collect();
            for (state, terms) in rows {
                let open = all.iter().filter(|term| !terms.contains(term));
                constraints.forbidden.extend(open.map(|term| Forbidden::parse(&format!("{state}:{term}")).unwrap()));
                constraints.kept.extend(terms.iter().map(|term| Kept::parse(&format!("{state}:{term}")).unwrap()));
            }
            let signs = ["v:v=-", "v:throttle=+", "v:v*steering^2=-", "heading:v*steering=+"];
            constraints.signed = signs.iter().map(|text| Signed::parse(text).unwrap()).collect();
            extra(&all)
        }
        _ => LibrarySettings { degree: 1, products: true, ..LibrarySettings::default() },
    };
    Identify {
        states: own(&["x", "y", "v", "heading"]),
        controls: own(&["throttle", "steering"]),
        library,
        constraints,
        refine: std::env::var("NO_REFINE").is_err(),
        window: std::env::var("WINDOW").ok().map(|w| w.parse().unwrap()),
        ..Identify::default()
    }
}

/// Frobenius norm over states and samples of the rollout of the test part, and the root mean square position error, m.
fn errors(model: &Model, hold: Hold, run: &Run, channels: &[Channel]) -> (f64, f64) {
    let system = model.compile().unwrap();
    let excitation = Excitation::of_run(&system, run, channels, hold).unwrap();
    let initial: Vec<f64> = (0..4).map(|j| run.values[(0, j)]).collect();
    let simulate = Simulate { hold, ..Simulate::default() };
    let Ok(rollout) = simulate.rollout(&system, &excitation, &initial) else {
        return (f64::INFINITY, f64::INFINITY);
    };
    let square =
        |j: usize| (0..run.n_samples()).map(|i| (rollout.states[(i, j)] - run.values[(i, j)]).powi(2)).sum::<f64>();
    let squares: Vec<f64> = (0..4).map(square).collect();
    (squares.iter().sum::<f64>().sqrt(), ((squares[0] + squares[1]) / run.n_samples() as f64).sqrt())
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rate: usize = arguments[1].parse().unwrap();
    let every = arguments.get(3).map_or(1, |a| a.parse().unwrap());
    let mut sigmas: Vec<f64> = arguments.iter().skip(4).map(|a| a.parse().unwrap()).collect();
    if sigmas.is_empty() {
        sigmas = (0..=10).map(|i| 0.01 * f64::from(i)).collect();
    }
    let identify = settings(&arguments[2]);
    let channels: Vec<Channel> = NAMES[1..].iter().map(|n| Channel::new(*n)).collect();
    let verbose = std::env::var("VERBOSE").is_ok();
    let only: Option<Vec<usize>> =
        std::env::var("ONLY").ok().map(|own| own.split(',').map(|n| n.parse().unwrap()).collect());
    let (mut all, mut positions) = (Vec::new(), Vec::new());
    let clock = Instant::now();
    for &sigma in &sigmas {
        let mut own = Vec::new();
        for number in (1..=45).step_by(every).filter(|n| only.as_ref().is_none_or(|only| only.contains(n))) {
            let Some(mut run) = rollout(&arguments[0], number, rate) else { continue };
            let mut rng = ChaCha8Rng::seed_from_u64((number * 1000) as u64 + (sigma * 1000.0).round() as u64);
            for i in 0..run.n_samples() {
                (0..4).for_each(|j| run.values[(i, j)] += sigma * normal(&mut rng));
            }
            let n_train = (0.7 * run.n_samples() as f64).round() as usize;
            let train = Dataset::new(channels.clone(), vec![part(&run, 0, n_train)]).unwrap();
            let test = part(&run, n_train - 1, run.n_samples());
            let started = Instant::now();
            let (error, position) = match identify.fit(&train, &Silent) {
                Ok(found) => {
                    let result = errors(&found.model, found.hold, &test, &channels);
                    if verbose {
                        for state in &found.model.states {
                            println!("  {}' = {}", state.name, state.equation);
                        }
                        println!(
                            "  delays {:?} hold {:?} window {:.2?} notes {:?}",
                            found.delays, found.hold, found.window, found.notes
                        );
                    }
                    result
                }
                Err(error) => {
                    println!("rollout {number}: {error}");
                    (f64::INFINITY, f64::INFINITY)
                }
            };
            if verbose {
                println!(
                    "rollout {number} sigma {sigma}: {error:.2}, position {position:.3} m, {:.2} s",
                    started.elapsed().as_secs_f64()
                );
            }
            own.push(error);
            all.push(error);
            positions.push(position);
        }
        println!("  sigma {sigma}: {}", quartiles(&mut own));
    }
    println!(
        "{} {rate} Hz, {} runs: Frobenius {}, position rms m {}, {:.2} s each",
        arguments[2],
        all.len(),
        quartiles(&mut all),
        quartiles(&mut positions),
        clock.elapsed().as_secs_f64() / all.len() as f64
    );
}

fn quartiles(values: &mut [f64]) -> String {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    format!("{:.2} / {:.2} / {:.2}", at(0.25), at(0.5), at(0.75))
}
