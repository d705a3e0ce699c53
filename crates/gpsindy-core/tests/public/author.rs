//! The authors' pipeline against the errors that they recorded, on two of their logs at 5 Hz.
//!
//! The logs of the car are not part of this repository: without them in `../shared/data/jetracer` the test is skipped and says so.
//! The noise that the authors added is, since it cannot be drawn again: their scripts state no seed. Recorded values:
//! test/results/jake_car_csvs_ctrlshift_no_trans/5hz_noise_0.01/dfs of github.com/mis0butter/gpsindy.
#![allow(clippy::unwrap_used)]

use gpsindy_core::{Author, AuthorResult, Channel, Dataset, Run, Silent};

const NAMES: [&str; 6] = ["x", "y", "v", "heading", "throttle", "steering"];

fn numbers(text: &str, separator: char) -> Vec<Vec<f64>> {
    text.lines()
        .filter_map(|line| line.split(separator).map(|cell| cell.trim().parse().ok()).collect::<Option<Vec<f64>>>())
        .collect()
}

/// The log as the authors prepared it: headings without jumps, controls 6 samples (0.12 s) later, every tenth row, nothing
/// before 1 s, their noise.
fn prepared(log: &str, noise: &str) -> Option<Dataset> {
    let path = gpsindy_beside::shared(&format!("data/jetracer/{log}"))?;
    let rows = numbers(&std::fs::read_to_string(path).unwrap(), ',');
    let run = Run {
        name: log.into(),
        time: rows.iter().map(|r| r[0]).collect(),
        values: faer::Mat::from_fn(rows.len(), 6, |i, j| rows[i][j + 1]),
    };
    let mut data = Dataset::new(NAMES.iter().map(|n| Channel::new(*n)).collect(), vec![run]).unwrap();
    data.unwrap_angle("heading").unwrap();
    let full = &data.runs()[0];
    let kept: Vec<usize> = (6..full.n_samples()).step_by(10).filter(|&i| full.time[i] > 1.0).collect();
    let noise = numbers(noise, ' ');
    assert_eq!(noise.len(), kept.len());
    let value = |i: usize, j: usize| match j {
        0..4 => full.values[(kept[i], j)] + 1e-6 * noise[i][j],
        _ => full.values[(kept[i] - 6, j)],
    };
    let time = kept.iter().map(|&i| full.time[i]).collect();
    let run = Run { name: log.into(), time, values: faer::Mat::from_fn(kept.len(), 6, value) };
    Some(Dataset::new(data.channels().to_vec(), vec![run]).unwrap())
}

fn fit(data: &Dataset, gp: bool) -> AuthorResult {
    let own = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let inputs = vec![vec![], vec![], own(&["throttle"]), own(&["steering"])];
    let author = Author {
        states: own(&NAMES[..4]),
        controls: own(&NAMES[4..]),
        inputs: gp.then_some(inputs),
        ..Author::default()
    };
    author.fit(data, &Silent).unwrap()
}

fn relative(found: f64, recorded: f64) -> f64 {
    (found / recorded - 1.0).abs()
}

/// What the authors recorded.
struct Record {
    log: &'static str,
    noise: &'static str,
    /// Lambda, training and test error.
    sindy: (f64, f64, f64),
    gpsindy: (f64, f64, f64),
}

const RECORDS: [Record; 2] = [
    Record {
        log: "rollout_01.csv",
        noise: include_str!("author/rollout_10.txt"),
        sindy: (6.0, 50.1939, 30.4946),
        gpsindy: (0.1, 10.168, 10.047),
    },
    Record {
        log: "rollout_21.csv",
        noise: include_str!("author/rollout_12.txt"),
        sindy: (0.1, 40.7689, 15.6390),
        gpsindy: (0.1, 14.335, 7.478),
    },
];

#[test]
fn errors_that_the_authors_recorded_come_out_again() {
    for record in RECORDS {
        let Some(data) = prepared(record.log, record.noise) else { return };
        let sindy = fit(&data, false);
        assert_eq!(sindy.lambda, record.sindy.0, "{}", record.log);
        // Another order of sums changes where their loose ADMM stops; found within 1e-5 on the test.
        let off = (relative(sindy.train_error, record.sindy.1), relative(sindy.test_error, record.sindy.2));
        assert!(off.0 < 1e-3 && off.1 < 1e-3, "{}: {off:?}", record.log);
        // Their Gaussian processes end in optima that depend on start and line search: theirs moved by more than 5 % in 8
        // of 44 runs when repeated, an independent fit came within 14 % of the test errors.
        let gpsindy = fit(&data, true);
        assert_eq!(gpsindy.lambda, record.gpsindy.0, "{}", record.log);
        assert!(relative(gpsindy.test_error, record.gpsindy.2) < 0.25, "{}: {}", record.log, gpsindy.test_error);
        assert!(gpsindy.test_error < 0.6 * sindy.test_error, "{}", record.log);
    }
}
