//! The authors' pipeline on one of their logs: prints lambda, training and test error to compare with their records.
//!
//! `cargo run --release -p gpsindy-core --example author -- FILE [gp]`
//! FILE: rows of time, x, y, speed, heading, throttle, steering, such as
//! test/data/jake_car_csvs_ctrlshift_no_trans/5hz_noise_0.01/rollout_12.csv of github.com/mis0butter/gpsindy, for which they
//! recorded 0.1, 40.7689, 15.6390 (SINDy) and 0.1, 14.335, 7.478 (GPSINDy).
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use gpsindy_core::{Author, Channel, Dataset, Run, Silent};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let text = std::fs::read_to_string(&arguments[0]).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter_map(|line| line.split(',').map(|cell| cell.trim().parse().ok()).collect::<Option<Vec<f64>>>())
        .collect();
    let names = ["x", "y", "v", "heading", "throttle", "steering"];
    let run = Run {
        name: arguments[0].clone(),
        time: rows.iter().map(|r| r[0]).collect(),
        values: faer::Mat::from_fn(rows.len(), 6, |i, j| rows[i][j + 1]),
    };
    let data = Dataset::new(names.iter().map(|n| Channel::new(*n)).collect(), vec![run]).unwrap();
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let inputs = vec![vec![], vec![], own(&["throttle"]), own(&["steering"])];
    let author = Author {
        states: own(&names[..4]),
        controls: own(&names[4..]),
        inputs: (arguments.get(1).map(String::as_str) == Some("gp")).then_some(inputs),
        ..Author::default()
    };
    let found = author.fit(&data, &Silent).unwrap();
    println!("lambda {}, training error {:.4}, test error {:.4}", found.lambda, found.train_error, found.test_error);
}
