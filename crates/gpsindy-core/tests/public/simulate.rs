//! Simulation against solutions that are known in closed form, and its properties.
#![allow(clippy::unwrap_used)]

use faer::Mat;
use gpsindy_core::{
    Channel, Control, Error, Excitation, Expression, Hold, Method, Model, Parameter, Rollout, Run, Simulate, State,
    System, initial_state, unmeasure,
};

fn model(states: &[(&str, &str)], controls: &[&str]) -> Model {
    Model {
        name: "test".into(),
        states: states.iter().map(|(name, f)| State::new(*name, Expression::parse(f).unwrap())).collect(),
        controls: controls.iter().map(|name| Control::new(*name)).collect(),
        ..Model::default()
    }
}

fn grid(n: usize, dt: f64) -> Vec<f64> {
    (0..n).map(|i| dt * i as f64).collect()
}

fn drive(system: &System, time: &[f64], hold: Hold, u: impl Fn(f64) -> f64) -> Excitation {
    let controls = Mat::from_fn(time.len(), system.n_controls(), |i, _| u(time[i]));
    Excitation::new(system, time, controls.as_ref(), hold).unwrap()
}

fn rollout(system: &System, excitation: &Excitation, initial: &[f64]) -> Rollout {
    Simulate::default().rollout(system, excitation, initial).unwrap()
}

fn worst(rollout: &Rollout, j: usize, wanted: impl Fn(f64) -> f64) -> f64 {
    (0..rollout.time.len()).map(|i| (rollout.states[(i, j)] - wanted(rollout.time[i])).abs()).fold(0.0, f64::max)
}

#[test]
fn decay_and_oscillation_follow_their_closed_forms() {
    let system = model(&[("x", "-0.7*x"), ("p", "v"), ("v", "-9*p")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(101, 0.1), Hold::Zero, |_| 0.0);
    let found = rollout(&system, &excitation, &[2.0, 1.0, 0.0]);
    // Local errors of 1e-8 add up over 10 s.
    assert!(worst(&found, 0, |t| 2.0 * (-0.7 * t).exp()) < 1e-7);
    assert!(worst(&found, 1, |t| (3.0 * t).cos()) < 2e-6);
    assert!(worst(&found, 2, |t| -3.0 * (3.0 * t).sin()) < 6e-6);
    assert_eq!(found.n_coarse, 0);
    assert!(found.stiff_from.is_none());
}

#[test]
fn a_delayed_step_arrives_exactly_late() {
    // The delay is no multiple of the sampling period, and the first sample holds before the log.
    let system = model(&[("x", "delay(u, 0.237) - x")], &["u"]).compile().unwrap();
    let excitation = drive(&system, &grid(201, 0.02), Hold::Zero, |t| if t > 0.999 { 3.0 } else { 1.0 });
    let settings = Simulate { tolerance: 1e-12, ..Simulate::default() };
    let found = settings.rollout(&system, &excitation, &[1.0]).unwrap();
    let jump = 1.0 + 0.237;
    let error = worst(&found, 0, |t| if t < jump { 1.0 } else { 3.0 - 2.0 * (-(t - jump)).exp() });
    assert!(error < 1e-9, "{error}");
}

#[test]
fn a_held_and_an_interpolated_ramp_differ_by_half_a_step() {
    let system = model(&[("x", "u")], &["u"]).compile().unwrap();
    let time = grid(11, 0.1);
    let held = rollout(&system, &drive(&system, &time, Hold::Zero, |t| t), &[0.0]);
    let linear = rollout(&system, &drive(&system, &time, Hold::Linear, |t| t), &[0.0]);
    assert!(worst(&linear, 0, |t| 0.5 * t * t) < 1e-12);
    assert!(worst(&held, 0, |t| 0.5 * t * (t - 0.1)) < 1e-12);
}

#[test]
fn a_play_moves_only_when_it_is_pushed() {
    let system = model(&[("x", "play(u, 0.4)")], &["u"]).compile().unwrap();
    // The triangle 0, 1, 0, ... : after the first rise to 0.8 it waits until the signal has gone back to 0.6.
    let excitation = drive(&system, &[0.0, 1.0, 2.0], Hold::Linear, |t| if t < 1.5 { t } else { 0.0 });
    let found = rollout(&system, &excitation, &[0.0]);
    // Rise from 0.2 s: integral 0.8^2/2 = 0.32. Then 0.8 for 0.4 s, and down to 0.2 over 0.6 s.
    assert!((found.states[(1, 0)] - 0.32).abs() < 1e-7);
    // The corner where the play begins to move is not a break point: as for the event in time below.
    assert!((found.states[(2, 0)] - (0.32 + 0.32 + 0.3)).abs() < 1e-6, "{}", found.states[(2, 0)]);
}

#[test]
fn an_event_in_time_is_found_by_the_error_control() {
    let system = model(&[("x", "step(t - 0.503) - step(t - 0.507)")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(11, 0.01), Hold::Zero, |_| 0.0);
    let time: Vec<f64> = grid(101, 0.01);
    let excitation_long = drive(&system, &time, Hold::Zero, |_| 0.0);
    assert_eq!(worst(&rollout(&system, &excitation, &[1.0]), 0, |_| 1.0), 0.0);
    let found = rollout(&system, &excitation_long, &[1.0]);
    // Where a jump lies at the start of a step the estimate sees a seventieth of its error.
    assert!((found.states[(100, 0)] - 1.004).abs() < 1e-6, "{}", found.states[(100, 0)]);
}

#[test]
fn errors_fall_with_the_order_of_the_method() {
    let system = model(&[("x", "-2*x*t + sin(t)"), ("y", "x - y")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(11, 0.2), Hold::Zero, |_| 0.0);
    let exact = Simulate { tolerance: 1e-13, ..Simulate::default() };
    let exact = exact.rollout(&system, &excitation, &[1.0, 0.5]).unwrap().states;
    for (order, method) in [
        (1.0, &(|substeps| Method::Euler { substeps }) as &dyn Fn(usize) -> Method),
        (4.0, &|substeps| Method::RungeKutta4 { substeps }),
    ] {
        let error = |substeps| {
            let settings = Simulate { method: method(substeps), ..Simulate::default() };
            let states = settings.rollout(&system, &excitation, &[1.0, 0.5]).unwrap().states;
            (states - &exact).norm_max()
        };
        let found = (error(8) / error(16)).log2();
        assert!((found - order).abs() < 0.15, "order {found}, not {order}");
    }
}

#[test]
fn both_adaptive_methods_reach_what_their_tolerance_says() {
    let system = model(&[("x", "y"), ("y", "3*(1 - x^2)*y - x + sin(t)")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(101, 0.1), Hold::Zero, |_| 0.0);
    let run = |method, tolerance| {
        Simulate { method, tolerance, ..Simulate::default() }.rollout(&system, &excitation, &[1.0, 0.0]).unwrap().states
    };
    let exact = run(Method::DormandPrince, 1e-13);
    for method in [Method::DormandPrince, Method::Rosenbrock] {
        for tolerance in [1e-5, 1e-7, 1e-9] {
            let error = (run(method, tolerance) - &exact).norm_max();
            // A van der Pol oscillator magnifies local errors on its fast parts.
            assert!(error < 1e3 * tolerance, "{method:?} {tolerance:e}: {error:e}");
        }
    }
}

#[test]
fn a_split_run_is_the_same_run() {
    let mut m = model(&[("x", "v"), ("v", "-4*x - 0.3*v*abs(v) + delay(u, 0.13) + play(u, 0.3)")], &["u"]);
    m.states[0].measured = Some(Expression::parse("2*x + 1").unwrap());
    let system = m.compile().unwrap();
    let excitation = drive(&system, &grid(301, 0.02), Hold::Zero, |t| (3.0 * t).sin());
    let whole = rollout(&system, &excitation, &[0.3, -0.2]);
    let middle = [whole.states[(120, 0)], whole.states[(120, 1)]];
    let rest = Simulate::default().rollout_range(&system, &excitation, &middle, 120..301).unwrap();
    for i in 0..rest.time.len() {
        assert_eq!(rest.time[i], whole.time[120 + i]);
        for j in 0..2 {
            assert!((rest.states[(i, j)] - whole.states[(120 + i, j)]).abs() < 1e-8);
        }
        assert_eq!(rest.outputs[(i, 0)], 2.0 * rest.states[(i, 0)] + 1.0);
    }
}

#[test]
fn a_late_sensor_reads_the_past_state() {
    let mut m = model(&[("x", "-x")], &[]);
    m.states[0].measured = Some(Expression::parse("delay(x, 0.25) + 1").unwrap());
    let system = m.compile().unwrap();
    let found = rollout(&system, &drive(&system, &grid(21, 0.1), Hold::Zero, |_| 0.0), &[1.0]);
    for (i, &t) in found.time.iter().enumerate() {
        let wanted = if t < 0.25 { 2.0 } else { 1.0 + (-(t - 0.25)).exp() };
        assert!((found.outputs[(i, 0)] - wanted).abs() < 1e-7);
    }
}

#[test]
fn a_blow_up_is_told_with_its_time_and_state() {
    let system = model(&[("calm", "0"), ("wild", "wild^2")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(31, 0.1), Hold::Zero, |_| 0.0);
    match Simulate::default().rollout(&system, &excitation, &[1.0, 1.0]).unwrap_err() {
        Error::Diverged { time, state, .. } => {
            assert!((time - 1.0).abs() < 1e-3, "{time}");
            assert_eq!(state, "wild");
        }
        other => panic!("{other}"),
    }
    let unstable = model(&[("x", "8*x")], &[]).compile().unwrap();
    let excitation = drive(&unstable, &grid(101, 0.1), Hold::Zero, |_| 0.0);
    for method in [Method::DormandPrince, Method::RungeKutta4 { substeps: 2 }] {
        let settings = Simulate { method, ..Simulate::default() };
        let error = settings.rollout(&unstable, &excitation, &[1.0]).unwrap_err();
        assert!(matches!(error, Error::Diverged { .. }), "{error}");
    }
    let root = model(&[("x", "-sqrt(x) - 1")], &[]).compile().unwrap();
    let excitation = drive(&root, &grid(101, 0.1), Hold::Zero, |_| 0.0);
    let error = Simulate::default().rollout(&root, &excitation, &[1.0]).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }), "{error}");
}

#[test]
fn a_stiff_model_is_noticed_and_solved() {
    // x follows cos t with 1e6/s; the explicit method would need 3e5 steps a second.
    let system = model(&[("x", "-1e6*(x - cos(t))"), ("y", "x")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(51, 0.2), Hold::Zero, |_| 0.0);
    let found = rollout(&system, &excitation, &[0.0, 0.0]);
    assert!(found.stiff_from.is_some());
    assert!(found.n_steps < 20_000, "{}", found.n_steps);
    assert!(worst(&found, 1, |t| t.sin()) < 3e-6, "{}", worst(&found, 1, |t| t.sin()));
}

#[test]
fn dry_friction_comes_to_rest_instead_of_stopping_the_clock() {
    let system = model(&[("x", "v"), ("v", "-0.5*sign(v) + 0.2")], &[]).compile().unwrap();
    let excitation = drive(&system, &grid(201, 0.05), Hold::Zero, |_| 0.0);
    let found = rollout(&system, &excitation, &[0.0, 1.0]);
    // 1/0.3 s of braking, then rest.
    assert!((found.states[(200, 0)] - 0.5 / 0.3).abs() < 1e-3, "{}", found.states[(200, 0)]);
    assert!(found.states[(200, 1)].abs() < 1e-3);
    assert!(found.n_steps < 1_000_000, "{}", found.n_steps);
}

#[test]
fn missing_controls_are_held_from_the_last_known_value() {
    let system = model(&[("x", "u")], &["u"]).compile().unwrap();
    let gaps = drive(&system, &grid(5, 1.0), Hold::Zero, |t| if t == 2.0 { f64::NAN } else { t });
    assert!((rollout(&system, &gaps, &[0.0]).states[(4, 0)] - 5.0).abs() < 1e-12);
    let empty = Mat::from_fn(3, 1, |_, _| f64::NAN);
    let error = Excitation::new(&system, &grid(3, 1.0), empty.as_ref(), Hold::Zero).unwrap_err();
    assert!(error.to_string().contains("control `u` has no value"), "{error}");
}

fn run(columns: &[(&str, &dyn Fn(f64) -> f64)], time: Vec<f64>) -> (Run, Vec<Channel>) {
    let values = Mat::from_fn(time.len(), columns.len(), |i, j| columns[j].1(time[i]));
    let channels = columns.iter().map(|(name, _)| Channel::new(*name)).collect();
    (Run { name: "log".into(), time, values }, channels)
}

#[test]
fn the_initial_state_is_measured_differentiated_or_at_rest() {
    let mut m = model(&[("x", "v"), ("v", "f - x"), ("f", "(u - f)/0.2"), ("z", "x - z")], &["u"]);
    m.states[0].measured = Some(Expression::parse("1.02*x + b").unwrap());
    m.parameters = vec![Parameter::new("b", 0.3)];
    m.initial.insert("z".into(), 7.0);
    let system = m.compile().unwrap();
    let (run, channels) =
        run(&[("x", &|t| if t == 0.0 { f64::NAN } else { 1.02 * t.sin() + 0.3 }), ("u", &|_| 4.0)], grid(100, 0.02));
    let initial = initial_state(&system, &run, &channels).unwrap();
    assert!((initial[0] - 0.02_f64.sin()).abs() < 1e-12);
    // A local cubic errs by about h^3/4 = 2e-6 times the fourth power of a few samples.
    assert!((initial[1] - 1.0).abs() < 1e-3, "{}", initial[1]);
    assert!((initial[2] - 4.0).abs() < 1e-9);
    assert_eq!(initial[3], 7.0);
    m.initial.clear();
    let error = initial_state(&m.compile().unwrap(), &run, &channels).unwrap_err();
    assert!(error.to_string().contains("state `z` is not in run `log`"), "{error}");
}

#[test]
fn a_sensor_is_taken_back_to_the_state() {
    let mut m = model(&[("x", "0"), ("y", "0"), ("s", "0")], &[]);
    m.states[0].measured = Some(Expression::parse("0.9*delay(x, 0.05) - 0.2").unwrap());
    m.states[1].measured = Some(Expression::parse("y + 0.1*x").unwrap());
    m.states[2].measured = Some(Expression::parse("sin(s)").unwrap());
    m.initial.insert("s".into(), 0.0);
    let system = m.compile().unwrap();
    let (run, channels) = run(&[("x", &|t| 0.9 * (t - 0.05) - 0.2), ("y", &|t| t), ("s", &|_| 0.3)], grid(50, 0.1));
    let states = unmeasure(&system, &run, &channels).unwrap();
    for i in 1..49 {
        assert!((states[(i, 0)] - run.time[i]).abs() < 1e-12);
        assert!(states[(i, 2)].is_nan());
    }
    assert!((states[(10, 1)] - (1.0 - 0.1 * 0.95)).abs() < 1e-12);
}

#[test]
fn wrong_sizes_and_settings_are_stated() {
    let system = model(&[("x", "u")], &["u"]).compile().unwrap();
    let excitation = drive(&system, &grid(5, 1.0), Hold::Zero, |t| t);
    let run =
        |settings: Simulate, initial: &[f64]| settings.rollout(&system, &excitation, initial).unwrap_err().to_string();
    assert!(run(Simulate::default(), &[1.0, 2.0]).contains("initial state: expected 1 states, found 2"));
    assert!(run(Simulate::default(), &[f64::NAN]).contains("initial value of state `x`"));
    assert!(run(Simulate { tolerance: 0.5, ..Simulate::default() }, &[1.0]).contains("tolerance"));
    let few = Simulate { max_steps: 1, ..Simulate::default() };
    assert!(run(few, &[1.0]).contains("more than 1 steps"));
}

/// A simulator of the user's own that knows no negative state.
struct Own;

impl gpsindy_core::Dynamics for Own {
    fn n_states(&self) -> usize {
        1
    }

    fn n_controls(&self) -> usize {
        0
    }

    fn derivative(&self, _: f64, x: &[f64], _: &[f64], dx: &mut [f64]) -> gpsindy_core::Result<()> {
        if x[0] < 0.0 {
            return Err(Error::Callback("below zero".into()));
        }
        dx[0] = -1.0;
        Ok(())
    }
}

#[test]
fn the_error_of_the_users_own_simulator_is_passed_on() {
    let call = Expression::Simulator(0, vec![Expression::Time, Expression::variable("x")]);
    let m = Model { states: vec![State::new("x", call)], ..Model::default() };
    let system = System::with_simulator(&m, Some(std::sync::Arc::new(Own))).unwrap();
    let excitation = drive(&system, &grid(21, 0.1), Hold::Zero, |_| 0.0);
    assert!(
        (Simulate::default().rollout_range(&system, &excitation, &[1.0], 0..5).unwrap().states[(4, 0)] - 0.6).abs()
            < 1e-9
    );
    let error = Simulate::default().rollout(&system, &excitation, &[1.0]).unwrap_err();
    assert_eq!(error.to_string(), "below zero");
}
