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
        ..Log::default()
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
        ..Log::default()
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

/// Of a motion of constant acceleration, at times of its own.
#[test]
fn a_slow_clock_shows_the_state_at_its_own_time_in_a_rollout_and_in_a_simulation() {
    let state = |name: &str, rate: &str| State::new(name, Expression::parse(rate).unwrap());
    let measured = Some(Expression::parse("delay(x, 0.1 - e*t)").unwrap());
    let model = Model {
        states: vec![State { measured, ..state("x", "v") }, state("v", "2")],
        parameters: vec![Parameter::new("e", -0.25)],
        ..Model::default()
    };
    let system = System::new(&model).unwrap();
    let time: Vec<f64> = (0..30).map(|i| 0.1 * f64::from(i)).collect();
    let log =
        Log { name: "fall".into(), time: time.clone(), controls: Vec::new(), measured: Vec::new(), ..Log::default() };
    let mut lanes = Lanes::<2>::new(&system, &log, (Hold::Zero, Past::Still), &[[-0.25, 0.0]]);
    let mut rolled = vec![[f64::NAN; 2]; time.len()];
    lanes.roll((0, time.len() - 1), &[[0.0; 2], [0.0; 2]], &[0], 1, |i, _, v| rolled[i] = v);
    let excitation =
        crate::simulate::Excitation::new(&system, &time, faer::Mat::zeros(time.len(), 0).as_ref(), Hold::Zero).unwrap();
    let simulated = crate::simulate::Simulate::default().rollout(&system, &excitation, &[0.0, 0.0]).unwrap();
    for (i, t) in time.iter().enumerate() {
        let [slow, right] = [0.75 * t - 0.1, t - 0.1].map(|seen| seen.max(0.0).powi(2));
        assert!((rolled[i][0] - slow).abs() < 1e-9 && (rolled[i][1] - right).abs() < 1e-9, "{t}: {:?}", rolled[i]);
        assert!((simulated.outputs[(i, 0)] - slow).abs() < 1e-6, "{t}: {}", simulated.outputs[(i, 0)]);
    }
}

#[test]
fn a_sensor_that_is_early_shows_nothing_of_the_control_that_its_own_reading_has_set() {
    let model = Model {
        states: vec![State {
            measured: Some(Expression::parse("delay(x, 0 - 0.04)").unwrap()),
            ..State::new("x", Expression::parse("u").unwrap())
        }],
        controls: vec![Control::new("u")],
        ..Model::default()
    };
    let system = System::new(&model).unwrap();
    let reading = |last: f64| {
        let controls = (0..6).map(|i| if i == 5 { last } else { 1.0 }).collect();
        let time = (0..6).map(|i| 0.1 * f64::from(i)).collect();
        let log = Log { time, controls: vec![controls], ..Log::default() };
        let mut lanes = Lanes::<1>::new(&system, &log, (Hold::Zero, Past::Moving), &[]);
        let mut values = Vec::new();
        lanes.roll((0, 5), &[[0.0]], &[0], 1, |_, _, v| values.push(v[0]));
        values
    };
    for last in [1.0, 100.0] {
        assert!(reading(last).iter().enumerate().all(|(i, v)| (v - 0.1 * i as f64 - 0.04).abs() < 1e-12), "{last}");
    }
}

#[test]
fn sampled_and_held_inputs_and_sensors_are_those_of_the_simulator() {
    let held = State {
        measured: Some(Expression::parse("sample_hold(x, every, phase)").unwrap()),
        ..State::new("x", Expression::parse("v").unwrap())
    };
    let force = Expression::parse("sample_hold(u, T, start) - 4*x - 0.3*v").unwrap();
    let model = |values: &[f64]| Model {
        states: vec![held.clone(), State::new("v", force.clone())],
        controls: vec![Control::new("u")],
        parameters: ["every", "phase", "T", "start"].iter().zip(values).map(|(n, v)| Parameter::new(*n, *v)).collect(),
        ..Model::default()
    };
    let count = 200;
    let time: Vec<f64> = (0..count).map(|i| 7.0 + 0.05 * i as f64).collect();
    let u: Vec<f64> = time.iter().map(|t| (1.7 * t).sin() + (3.1 * t).cos()).collect();
    let controls = faer::Mat::from_fn(count, 1, |i, _| u[i]);
    let log = Log {
        name: "log".into(),
        time: time.clone(),
        controls: vec![u.clone()],
        measured: Vec::new(),
        ..Log::default()
    };
    for hold in [Hold::Zero, Hold::Linear] {
        for values in [[0.25, 0.0, 0.15, 0.0], [0.13, 0.07, 0.17, -0.04], [0.05, 0.0, 0.55, 0.3]] {
            let system = System::new(&model(&values)).unwrap();
            let excitation = crate::simulate::Excitation::new(&system, &time, controls.as_ref(), hold).unwrap();
            let exact = crate::simulate::Simulate { tolerance: 1e-10, ..Default::default() }
                .rollout(&system, &excitation, &[0.4, -0.2])
                .unwrap();
            let parameters: Vec<[f64; 1]> = values.iter().map(|&v| [v]).collect();
            let mut lanes = Lanes::<1>::new(&system, &log, (hold, Past::Still), &parameters);
            let mut worst = 0.0f64;
            lanes.roll((0, count - 1), &[[0.4], [-0.2]], &[0, 1], 8, |i, j, v| {
                worst = worst.max((v[0] - exact.outputs[(i, j)]).abs());
            });
            // An input that switches within a step acts as its mean: an error of the square of the step.
            assert!(worst < 1e-4, "{hold:?} {values:?}: {worst}");
        }
    }
}
