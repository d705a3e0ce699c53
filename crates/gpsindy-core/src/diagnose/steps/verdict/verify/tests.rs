//! Held-out rollouts, and what their floor holds.

use super::*;
use crate::data::{Channel, Run};
use crate::diagnose::fixture::drive;
use crate::diagnose::steps::logs::windows::whole_runs;
use crate::diagnose::{Diagnose, Verdict, hold_out};
use crate::expression::Expression;
use crate::model::{Control, Model, State};
use crate::progress::Silent;
use crate::random::normal;
use faer::Mat;

#[test]
fn the_floor_of_an_unstable_plant_holds_what_noise_does_to_its_starts() {
    // x' = 2x + 0.8u, held upright by its own noisy reading; the nominal model expects all of u.
    let (noise, step) = (0.02, 0.02_f64);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let runs = (0..4usize).map(|run| {
        let (mut x, mut values) = (0.1, Vec::new());
        for i in 0..500_usize {
            let wish = if (i / (40 + 7 * run)).is_multiple_of(2) { 0.5 } else { -0.5 };
            let read = x + noise * normal(&mut random);
            let u = -5.0 * (read - wish) - 2.5 * wish;
            values.push([read, u]);
            let rest = -0.4 * u;
            x = rest + (x - rest) * (2.0 * step).exp();
        }
        let time = (0..500).map(|i| step * f64::from(i)).collect();
        Run { name: format!("run {run}"), time, values: Mat::from_fn(500, 2, |i, c| values[i][c]) }
    });
    let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs.collect()).unwrap();
    let model = Model {
        states: vec![State::new("x", Expression::parse("2*x + u").unwrap())],
        controls: vec![Control::new("u")],
        ..Model::default()
    };
    let (train, holdout) = hold_out(&data).unwrap();
    let diagnosis = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
    assert_eq!(diagnosis.verdict, Verdict::Explained, "{:?} {:?}", diagnosis.causes, diagnosis.closure);
    // A linear plant of one state can't distinguish a weak input from a stretched scale.
    let cause = &diagnosis.causes[0];
    assert!(cause.effect == "input_gain" || cause.equivalent.iter().any(|e| e == "input_gain"), "{cause:?}");
    // Sensor noise alone leaves 0.02. A start from a quarter of a window, known to a third of the noise, grows over
    // the rest of it to about as much again.
    let floor = diagnosis.closure.by_state[0].floor.unwrap();
    assert!(floor > 1.2 * noise, "{floor}");
    assert!(diagnosis.closure.closed.unwrap() > 0.85, "{:?}", diagnosis.closure);
}

/// Two carriages under commands of their rate, by encoder: one runs to an end stop and stays there, one never moves.
fn rig() -> (Model, Dataset) {
    let (step, count) = (0.02, 1200_usize);
    let command = |i: usize| 0.5 * (1.3 * step * i as f64).sin() - 0.25;
    let encoder = |x: f64| (x / 1.5e-3).round() * 1.5e-3;
    let mut x = 0.4;
    let mut rows = Vec::new();
    for i in 0..count {
        // At rest the readings of the second differ by their rounding alone.
        let rounding = if i % 7 == 0 { 2.0 * f64::EPSILON } else { 0.0 };
        rows.push([encoder(x), 0.31 * (1.0 + rounding), command(i), 0.0]);
        x = f64::max(x + step * command(i), -1.03);
    }
    let time = (0..count).map(|i| step * i as f64).collect();
    let run = Run { name: "rig".into(), time, values: Mat::from_fn(count, 4, |i, c| rows[i][c]) };
    let channels = ["q", "r", "u", "w"].map(Channel::new);
    let model = Model {
        states: vec![
            State::new("q", Expression::parse("u").unwrap()),
            State::new("r", Expression::parse("w").unwrap()),
        ],
        controls: vec![Control::new("u"), Control::new("w")],
        ..Model::default()
    };
    (model, Dataset::new(channels.into(), vec![run]).unwrap())
}

#[test]
fn a_held_out_rollout_starts_where_the_log_does_and_what_rests_counts_nothing() {
    let (model, data) = rig();
    let (train, holdout) = hold_out(&data).unwrap();
    let diagnosis = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
    let figures = diagnosis.figures.unwrap();
    let curve = figures.rollouts.iter().find(|f| f.column == "q").unwrap();
    // The carriage stands at its stop, and the nominal model moves it on: its rollout starts at the stop all the same.
    for line in [&curve.before, &curve.after].into_iter().filter(|line| !line.is_empty()) {
        let apart = line[0].unwrap() - curve.measured[0].unwrap();
        assert!(apart.abs() < 3e-3, "{apart}");
    }
    let names: Vec<&str> = diagnosis.closure.by_state.iter().map(|s| s.state.as_str()).collect();
    assert_eq!(names, ["q"]);
    assert!(diagnosis.gap.by_state.iter().all(|s| s.state == "q"), "{:?}", diagnosis.gap.by_state);
    assert!(figures.rollouts.iter().all(|f| f.column == "q"));
    assert!(diagnosis.notes.iter().any(|n| n.starts_with("r: ")), "{:?}", diagnosis.notes);
}

/// Blocks of one column whose squared errors (noise units) after the correction are these; all are a hundred before.
fn blocks_of(after: &[f64]) -> Vec<Block> {
    let one = |&after: &f64| Block { before: vec![100.0], after: vec![after], count: vec![1.0] };
    after.iter().map(one).collect()
}

#[test]
fn a_floor_is_no_higher_than_what_corrected_rollouts_leave() {
    let blocks = blocks_of(&[4.0, 4.0, 4.0]);
    // Ten times the noise before, twice after.
    assert_eq!(reached(&blocks, vec![3.0]), [2.0]);
    assert_eq!(reached(&blocks, vec![1.5]), [1.5]);
    // No gap to close.
    assert_eq!(reached(&blocks, vec![11.0]), [11.0]);
}

#[test]
fn one_block_that_is_far_off_is_a_miss_and_a_loud_one_is_not() {
    let probability = |last: f64| {
        let after: Vec<f64> = [1.0; 15].into_iter().chain([last]).collect();
        missed(&blocks_of(&after), 1.0, 0.0, 0)
    };
    // Together 4 times the noise, 1.25 times, and the noise itself.
    assert!(probability(240.0) > 0.5, "{}", probability(240.0));
    assert!(probability(9.0) < 0.5, "{}", probability(9.0));
    assert!(probability(1.0) < 0.01, "{}", probability(1.0));
}

#[test]
fn held_out_rollouts_end_where_the_noise_of_their_starts_outgrows_that_of_the_sensors() {
    let runs = (0..2).map(|run| {
        let values =
            Mat::from_fn(400, 1, |i, _| 0.5 * (0.1 * i as f64 + f64::from(run)).sin() + 1e-3 * ((i * 7 % 5) as f64));
        Run { name: format!("run {run}"), time: (0..400).map(|i| 0.02 * f64::from(i)).collect(), values }
    });
    let data = Dataset::new(vec![Channel::new("x")], runs.collect()).unwrap();
    let length = |rate: &str| {
        let model = Model { states: vec![State::new("x", Expression::parse(rate).unwrap())], ..Model::default() };
        let (_, nominal) = crate::diagnose::fixture::fitted(&model, &data, 0.01);
        let nominal = Contestant { experiment: whole_runs(nominal.experiment.clone()), ..nominal };
        predictable(&nominal, held_out(&nominal, &data, &[]).unwrap()).experiment.longest_window()
    };
    // An error grows by e in a third of a second, and falls by as much.
    assert!(length("3*x") < 2.0, "{}", length("3*x"));
    assert!(length("-3*x") > 7.0, "{}", length("-3*x"));
}

#[test]
fn noise_that_remembers_a_sample_or_two_is_no_miss_of_the_right_cause() {
    // Its deviation is 0.02; fifth differences see 0.014 of it.
    let (model, quiet) = drive(None, |x| x + 0.3 * x * x.abs(), 1e-9, (4, 600));
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let noisy = quiet.runs().iter().map(|run| {
        let (mut run, mut noise) = (run.clone(), 0.0);
        for i in 0..run.time.len() {
            noise = 0.35 * noise + 0.02 * (1.0_f64 - 0.35 * 0.35).sqrt() * normal(&mut random);
            run.values[(i, 0)] += noise;
        }
        run
    });
    let data = Dataset::new(quiet.channels().to_vec(), noisy.collect()).unwrap();
    let (train, holdout) = hold_out(&data).unwrap();
    let diagnosis = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
    let named: Vec<&str> = diagnosis.included().map(|cause| cause.effect.as_str()).collect();
    assert_eq!((diagnosis.verdict, named), (Verdict::Explained, vec!["quadratic_drag"]), "{:?}", diagnosis.checks);
    let floor = diagnosis.closure.by_state[0].floor.unwrap();
    assert!((floor / 0.02 - 1.0).abs() < 0.15, "{floor}");
}

#[test]
fn a_slow_error_of_a_sensor_is_said_and_no_rollout_misses_by_more() {
    let (model, clean) = drive(None, |x| x, 1e-6, (4, 400));
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut runs = clean.runs().to_vec();
    for run in &mut runs {
        let mut slow = 0.0;
        for i in 0..run.n_samples() {
            slow = 0.92 * slow + 0.01 * normal(&mut random);
            run.values[(i, 0)] += slow;
        }
    }
    let data = Dataset::new(clean.channels().to_vec(), runs).unwrap();
    let (train, holdout) = hold_out(&data).unwrap();
    let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap();
    let closure = &found.diagnosis.closure;
    assert_eq!(found.diagnosis.verdict, Verdict::NoGap, "{:?}", found.diagnosis.causes);
    let several = |note: &Note| matches!(note, Note::SlowErrors { column, times } if column == "x" && *times > SEVERAL);
    assert!(found.notes.iter().any(several), "{:?}", found.notes);
    assert!(closure.before.unwrap() < 1.3 * closure.floor.unwrap(), "{closure:?}");
}

#[test]
fn nothing_is_quiet_below_a_floor_that_starts_have_raised() {
    assert!(is_quiet((1.05, 1.0), true) && !is_quiet((1.5, 1.0), true));
    // Of a friction whose rollouts may go anywhere; and runs that were seen to differ by as much.
    assert!(!is_quiet((2.6, 171.0), true) && is_quiet((2.6, 3.0), false));
}
