//! Logs whose columns come from topics of their own: no two sensors share a row, and the cause is that of the same log in one table.
#![allow(clippy::unwrap_used)]

use faer::Mat;
use gpsindy_beside::random::Random;
use gpsindy_core::diagnose::{Diagnose, Diagnosis, Verdict};
use gpsindy_core::{Channel, Control, Dataset, Excitation, Expression, Hold, Model, Run, Silent, Simulate, State};

/// Rows a second: of these, each column has every tenth.
const RATE: f64 = 500.0;
const EVERY: usize = 10;
const ROWS: usize = 9_000;

/// How a column's rows lie.
#[derive(Clone, Copy, PartialEq)]
enum Rows {
    /// Every column has a value in the same rows.
    Shared,
    /// Every column has rows of its own, none of them the command's.
    Own,
}

fn model(equations: &[(&str, &str)]) -> Model {
    Model {
        states: equations.iter().map(|(name, rate)| State::new(*name, Expression::parse(rate).unwrap())).collect(),
        controls: vec![Control::new("u")],
        ..Model::default()
    }
}

/// Four runs of a machine under a command that changes every half second; `reading` makes a sensor's value of the state's.
fn logs(machine: &Model, sensors: &[&str], rows: Rows, reading: &dyn Fn(f64, &mut Random) -> f64) -> Dataset {
    let system = machine.compile().unwrap();
    let time: Vec<f64> = (0..ROWS).map(|i| i as f64 / RATE).collect();
    let one = |seed: u64| {
        let mut random = Random::new(seed);
        let levels: Vec<f64> = (0..ROWS / 250 + 1).map(|_| 4.0 * random.uniform(0.0, 1.0) - 2.0).collect();
        let controls = Mat::from_fn(ROWS, 1, |i, _| levels[i / 250]);
        let excitation = Excitation::new(&system, &time, controls.as_ref(), Hold::Zero).unwrap();
        let start = vec![0.1; machine.states.len()];
        let states =
            Simulate { tolerance: 1e-6, ..Simulate::default() }.rollout(&system, &excitation, &start).unwrap().states;
        let offset = |c: usize| if rows == Rows::Own { 3 + 4 * c } else { 0 };
        let mut values = Mat::full(ROWS, sensors.len() + 1, f64::NAN);
        for (c, name) in sensors.iter().enumerate() {
            let j = machine.state_index(name).unwrap();
            for i in (offset(c)..ROWS).step_by(EVERY) {
                values[(i, c)] = reading(states[(i, j)], &mut random);
            }
        }
        for i in (0..ROWS).step_by(EVERY) {
            values[(i, sensors.len())] = levels[i / 250];
        }
        // What a table of topics has: the rows of any of them.
        let kept: Vec<usize> = (0..ROWS).filter(|&i| (0..=sensors.len()).any(|c| !values[(i, c)].is_nan())).collect();
        let values = Mat::from_fn(kept.len(), sensors.len() + 1, |i, c| values[(kept[i], c)]);
        Run { name: format!("run {seed}"), time: kept.iter().map(|&i| time[i]).collect(), values }
    };
    let channels = sensors.iter().chain(&["u"]).map(|name| Channel::new(*name)).collect();
    Dataset::new(channels, (1..=4).map(one).collect()).unwrap()
}

fn diagnosed(nominal: &Model, data: &Dataset) -> Diagnosis {
    let (train, holdout) = (data.with_runs(&[0, 1, 2]).unwrap(), data.with_runs(&[3]).unwrap());
    Diagnose::default().run(nominal, &train, &holdout, &Silent).unwrap().diagnosis
}

/// Both tables are explained by `effect` alone, of the size that the machine has, each to within its interval and a hundredth.
fn explained_in_both(
    machine: &Model,
    nominal: &Model,
    sensors: &[&str],
    reading: &dyn Fn(f64, &mut Random) -> f64,
    effect: &str,
    size: f64,
) {
    for rows in [Rows::Shared, Rows::Own] {
        let diagnosis = diagnosed(nominal, &logs(machine, sensors, rows, reading));
        let causes: Vec<&str> = diagnosis.included().map(|cause| cause.effect.as_str()).collect();
        let own = rows == Rows::Own;
        assert_eq!(
            (diagnosis.verdict, causes.as_slice()),
            (Verdict::Explained, &[effect][..]),
            "own rows: {own}, {:?}",
            diagnosis.closure
        );
        let value = diagnosis.causes[0].parameters[0].value;
        assert!((value / size - 1.0).abs() < 0.01, "own rows: {own}, {value}");
    }
}

#[test]
fn two_positions_on_topics_of_their_own_reveal_a_drag_on_a_speed_that_nobody_logs() {
    let plant = |drag: &str| {
        let first = format!("u - 1.5*x - 0.2*v + y - x{drag}");
        model(&[("x", "v"), ("v", &first), ("y", "w"), ("w", "x - y - 0.2*w")])
    };
    let reading = |value: f64, random: &mut Random| value + 0.005 * random.normal();
    explained_in_both(&plant(" - 0.3*v*abs(v)"), &plant(""), &["x", "y"], &reading, "quadratic_drag", 0.3);
}

#[test]
fn spikes_of_sensors_that_share_no_row_are_outliers_all_the_same() {
    let plant = |drag: &str| model(&[("x", "v"), ("v", &format!("u - 1.5*x - 0.2*v{drag}"))]);
    let reading = |value: f64, random: &mut Random| {
        let spike = if random.uniform(0.0, 1.0) < 0.004 { 0.8 } else { 0.0 };
        value + spike + 0.01 * random.normal()
    };
    explained_in_both(&plant(" - 0.35*v*abs(v)"), &plant(""), &["x", "v"], &reading, "quadratic_drag", 0.35);
}

#[test]
fn an_angle_that_wraps_is_unwrapped_although_another_topic_has_rows_between_its_own() {
    let plant = |drag: &str| model(&[("phi", "omega"), ("omega", &format!("4*u + 3 - 0.8*omega{drag}"))]);
    let mut machine = plant(" - 0.2*omega*abs(omega)");
    let mut nominal = plant("");
    for model in [&mut machine, &mut nominal] {
        model.states[0].unit = "rad".into();
        model.states[1].unit = "rad/s".into();
    }
    use std::f64::consts::{PI, TAU};
    let data = |rows| {
        let mut data = logs(&machine, &["phi", "omega"], rows, &|value, random| value + 0.01 * random.normal());
        data = Dataset::new(
            data.channels().to_vec(),
            data.runs()
                .iter()
                .map(|run| Run {
                    values: Mat::from_fn(run.n_samples(), 3, |i, c| {
                        let value = run.values[(i, c)];
                        if c == 0 { (value + PI).rem_euclid(TAU) - PI } else { value }
                    }),
                    ..run.clone()
                })
                .collect(),
        )
        .unwrap();
        data
    };
    for rows in [Rows::Shared, Rows::Own] {
        let diagnosis = diagnosed(&nominal, &data(rows));
        assert!(diagnosis.notes.iter().any(|note| note.contains("unwrapped")), "{:?}", diagnosis.notes);
        let causes: Vec<&str> = diagnosis.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!((diagnosis.verdict, causes.as_slice()), (Verdict::Explained, &["quadratic_drag"][..]));
    }
}
