//! Identification of a small car from its logs, judged by the position error after rollouts of 1 s on other runs.
//!
//! `cargo run --release -p gpsindy-core --example identify_jetracer -- FOLDER LIBRARY DELAY [STRIDE]`
//! FOLDER holds rollout_01.csv ... with the columns t, x, y, v, heading, throttle, steering at 50 Hz; learnt from runs
//! 1, 6, 11, ..., 41, tested on 3, 8, ..., 43. LIBRARY: kinematic, slip, poly2, poly3, paper. DELAY: none, auto, fixed.
//! STRIDE: every so-manieth sample is learnt from.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::library::{Constraints, Fixed, LibrarySettings};
use gpsindy_core::{Channel, Dataset, Delay, Excitation, Hold, Identify, Model, Run, Silent, Simulate};
use std::time::Instant;

const NAMES: [&str; 7] = ["t", "x", "y", "v", "heading", "throttle", "steering"];

fn load(folder: &str, numbers: impl Iterator<Item = usize>, stride: usize) -> Dataset {
    let runs = numbers.map(|k| {
        let text = std::fs::read_to_string(format!("{folder}/rollout_{k:02}.csv")).unwrap();
        let rows: Vec<Vec<f64>> = text
            .lines()
            .filter_map(|line| line.split(',').map(|cell| cell.trim().parse().ok()).collect::<Option<Vec<f64>>>())
            .collect();
        assert!(rows.len() > 1000 && rows[0].len() == NAMES.len());
        Run {
            name: k.to_string(),
            time: rows.iter().map(|r| r[0]).collect(),
            values: faer::Mat::from_fn(rows.len(), 6, |i, j| rows[i][j + 1]),
        }
    });
    let mut data = Dataset::new(NAMES[1..].iter().map(|n| Channel::new(*n)).collect(), runs.collect()).unwrap();
    data.unwrap_angle("heading").unwrap();
    let runs = data.runs().iter().map(|run| {
        let kept: Vec<usize> = (0..run.n_samples()).step_by(stride).collect();
        Run {
            name: run.name.clone(),
            time: kept.iter().map(|&i| run.time[i]).collect(),
            values: faer::Mat::from_fn(kept.len(), 6, |i, j| run.values[(kept[i], j)]),
        }
    });
    Dataset::new(data.channels().to_vec(), runs.collect()).unwrap()
}

/// Distances in m between log and rollout 1 s after every whole second of every run, sorted; infinite where one diverges.
fn errors(model: &Model, data: &Dataset) -> Vec<f64> {
    let system = model.compile().unwrap();
    let mut all = Vec::new();
    for run in data.runs() {
        let excitation = Excitation::of_run(&system, run, data.channels(), Hold::Zero).unwrap();
        for first in (0..run.n_samples()).step_by(50) {
            let end = run.time.partition_point(|&t| t < run.time[first] + 0.9999);
            if end >= run.n_samples() {
                continue;
            }
            let initial: Vec<f64> = (0..4).map(|j| run.values[(first, j)]).collect();
            let rollout = Simulate::default().rollout_range(&system, &excitation, &initial, first..end + 1);
            all.push(rollout.map_or(f64::INFINITY, |rollout| {
                let last = rollout.states.nrows() - 1;
                let off = |j: usize| rollout.states[(last, j)] - run.values[(end, j)];
                off(0).hypot(off(1))
            }));
        }
    }
    all.sort_by(f64::total_cmp);
    all
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let stride = arguments.get(3).map_or(2, |s| s.parse().unwrap());
    let train = load(&arguments[0], (1..=41).step_by(5), stride);
    let test = load(&arguments[0], (3..=43).step_by(5), 1);
    let fixed = |texts: &[&str]| texts.iter().map(|t| Fixed::parse(t).unwrap()).collect::<Vec<_>>();
    let products = |names: &[&str], degree: usize| {
        let mut terms: Vec<(String, usize)> = vec![(String::new(), 0)];
        for _ in 0..degree {
            let longer: Vec<_> = terms
                .iter()
                .flat_map(|(t, from)| (*from..names.len()).map(move |j| (format!("{t}*{}", names[j]), j)))
                .collect();
            terms.extend(longer);
        }
        terms.sort();
        terms.dedup();
        terms.iter().filter(|t| !t.0.is_empty()).map(|t| t.0[1..].to_string()).collect::<Vec<_>>()
    };
    let inner = ["v", "throttle", "steering"];
    let unicycle = fixed(&["x' = v*cos(heading)", "y' = v*sin(heading)"]);
    let text = |terms: &[&str]| terms.iter().map(ToString::to_string).collect::<Vec<_>>();
    let (extra, fixed) = match arguments[1].as_str() {
        "kinematic" => (text(&["v", "throttle", "v*steering", "v*steering^2", "v*steering^3"]), unicycle),
        "poly2" => (products(&inner, 2), unicycle),
        "poly3" => (products(&inner, 3), unicycle),
        "slip" => {
            let mut terms = products(&inner, 3);
            for f in ["cos(heading)", "sin(heading)"] {
                terms.extend(
                    ["v", "v*steering", "v^2*steering", "v^3*steering", "v*steering^2"].map(|t| format!("{t}*{f}")),
                );
            }
            (terms, vec![])
        }
        _ => (vec![], vec![]),
    };
    let library = match arguments[1].as_str() {
        "paper" => LibrarySettings { degree: 1, products: true, ..LibrarySettings::default() },
        _ => LibrarySettings { degree: 0, extra, ..LibrarySettings::default() },
    };
    let delays = match arguments[2].as_str() {
        "auto" => [Delay::Auto(Some(0.4)), Delay::Auto(Some(0.4))],
        "fixed" => [Delay::Fixed(0.2), Delay::Fixed(0.12)],
        _ => [Delay::Fixed(0.0); 2],
    };
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let identify = Identify {
        states: own(&["x", "y", "v", "heading"]),
        controls: own(&["throttle", "steering"]),
        library,
        constraints: Constraints { fixed, ..Constraints::default() },
        smoother: None,
        delays: vec![("throttle".into(), delays[0]), ("steering".into(), delays[1])],
        refine: std::env::var("NO_REFINE").is_err(),
        window: std::env::var("WINDOW").ok().map(|w| w.parse().unwrap()),
        ..Identify::default()
    };
    let clock = Instant::now();
    let found = identify.fit(&train, &Silent).unwrap();
    let seconds = clock.elapsed().as_secs_f64();
    for state in &found.model.states {
        println!("{}' = {}", state.name, state.equation);
    }
    println!("delays {:?}, window {:?} s, notes {:?}", found.delays, found.window, found.notes);
    let all = errors(&found.model, &test);
    let at = |share: f64| all[(share * (all.len() - 1) as f64) as usize];
    println!(
        "{} {}: position error after 1 s: quartiles {:.3} {:.3} {:.3} m of {} rollouts, {seconds:.1} s",
        arguments[1],
        arguments[2],
        at(0.25),
        at(0.5),
        at(0.75),
        all.len()
    );
}
