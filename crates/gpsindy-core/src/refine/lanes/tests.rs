use super::*;
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State};

#[test]
fn a_rollout_from_within_a_log_finds_a_lagging_input_where_one_from_its_beginning_has_it() {
    let state = |name: &str, rate: &str| State::new(name, Expression::parse(rate).unwrap());
    let model = Model {
        states: vec![state("x", "late - x"), state("late", "(2*u - late)/tau")],
        controls: vec![Control::new("u")],
        parameters: vec![Parameter::new("tau", 0.4)],
        ..Model::default()
    };
    let system = System::new(&model).unwrap().with_followers(1).unwrap();
    let log = Log {
        name: "steps".into(),
        time: (0..80).map(|i| 0.05 * f64::from(i)).collect(),
        controls: vec![(0..80).map(|i| f64::from(i / 7 % 3)).collect()],
        measured: Vec::new(),
    };
    for hold in [Hold::Zero, Hold::Linear] {
        let mut lanes = Lanes::<1>::new(&system, &log, (hold, Past::Still), &[[0.4]]);
        let mut whole = vec![[0.0; 2]; 80];
        lanes.roll_states((0, 79), &[[0.3], [0.0]], 4, |i, j, v| whole[i][j] = v[0]);
        let start = whole[50][0];
        let mut part = vec![[0.0; 2]; 80];
        // Whatever start of its own the lag is given.
        lanes.roll_states((50, 79), &[[start], [-9.0]], 4, |i, j, v| part[i][j] = v[0]);
        // Exact for held inputs; within a step an interpolated one acts as its mean, (h/tau)^2/12 of a change.
        let tolerance = if hold == Hold::Zero { 1e-6 } else { 3e-3 };
        for i in 50..80 {
            for j in 0..2 {
                assert!((part[i][j] - whole[i][j]).abs() < tolerance, "{hold:?} {i} {j}");
            }
        }
    }
}

#[test]
fn a_late_sensor_sees_the_start_or_the_tangent_before_a_log_and_the_tangent_within() {
    let model = Model {
        states: vec![State {
            measured: Some(Expression::parse("delay(x, tau)").unwrap()),
            ..State::new("x", Expression::parse("2").unwrap())
        }],
        parameters: vec![Parameter::new("tau", 0.25)],
        ..Model::default()
    };
    let system = System::new(&model).unwrap();
    let log = Log {
        name: "ramp".into(),
        time: (0..20).map(|i| 0.1 * f64::from(i)).collect(),
        controls: Vec::new(),
        measured: Vec::new(),
    };
    let reading = |past: Past, first: usize, start: f64| {
        let mut lanes = Lanes::<1>::new(&system, &log, (Hold::Zero, past), &[[0.25]]);
        let mut values = Vec::new();
        lanes.roll((first, first + 4), &[[start]], &[0], 1, |_, _, v| values.push(v[0]));
        values
    };
    let is = |found: Vec<f64>, expected: [f64; 5]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
    };
    is(reading(Past::Still, 0, 1.0), [1.0, 1.0, 1.0, 1.1, 1.3]);
    is(reading(Past::Moving, 0, 1.0), [0.5, 0.7, 0.9, 1.1, 1.3]);
    is(reading(Past::Still, 5, 2.0), [1.5, 1.7, 1.9, 2.1, 2.3]);
}
