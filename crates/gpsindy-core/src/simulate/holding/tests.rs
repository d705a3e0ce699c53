use crate::data::Hold;
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State, System};
use crate::refine::lanes::Lanes;
use crate::refine::{Log, Past};
use crate::simulate::{Excitation, Method, Simulate};
use faer::Mat;

fn model(states: &[(&str, &str)], controls: &[&str], parameters: &[(&str, f64)]) -> Model {
    Model {
        states: states.iter().map(|(name, rate)| State::new(*name, Expression::parse(rate).unwrap())).collect(),
        controls: controls.iter().map(|name| Control::new(*name)).collect(),
        parameters: parameters.iter().map(|(name, value)| Parameter::new(*name, *value)).collect(),
        ..Model::default()
    }
}

fn times(count: usize, period: f64) -> Vec<f64> {
    (0..count).map(|i| period * i as f64).collect()
}

/// States of the adaptive integrator at every sample, controls being straight lines between the samples.
fn simulated(system: &System, method: Method, time: &[f64], u: &dyn Fn(f64) -> f64, initial: &[f64]) -> Mat<f64> {
    let controls = Mat::from_fn(time.len(), system.n_controls(), |i, _| u(time[i]));
    let excitation = Excitation::new(system, time, controls.as_ref(), Hold::Linear).unwrap();
    let simulate = Simulate { method, tolerance: 1e-11, ..Simulate::default() };
    simulate.rollout(system, &excitation, initial).unwrap().states
}

/// The same of the fit's integrator, one lane for every set of parameters.
fn lanes<const L: usize>(
    system: &System,
    (time, substeps): (&[f64], usize),
    u: &dyn Fn(f64) -> f64,
    parameters: &[[f64; L]],
    initial: &[[f64; L]],
) -> Vec<Vec<[f64; L]>> {
    let controls = (0..system.n_controls()).map(|_| time.iter().map(|&t| u(t)).collect()).collect();
    let log = Log { name: "log".into(), time: time.to_vec(), controls, measured: Vec::new(), ..Log::default() };
    let mut lanes = Lanes::<L>::new(system, &log, (Hold::Linear, Past::Still), parameters);
    let mut states = vec![vec![[0.0; L]; system.n_states()]; time.len()];
    lanes.roll_states((0, time.len() - 1), initial, substeps, |i, j, values| states[i][j] = values);
    states
}

const METHODS: [Method; 3] = [Method::DormandPrince, Method::Rosenbrock, Method::RungeKutta4 { substeps: 20 }];

/// A mass under a force that grows by 2 N a second, held until it is `reach` times the friction in motion of 1 N.
fn pushed(friction: &str, reach: f64) {
    let system = model(&[("v", &format!("u - {friction}"))], &["u"], &[("r", reach)]).compile().unwrap();
    let time = times(31, 0.05);
    let start = 0.5 * reach;
    // v' = 2 t - 1 from there on.
    let exact = |t: f64| if t < start { 0.0 } else { t * t - start * start - (t - start) };
    let push = |t: f64| 2.0 * t;
    for method in METHODS {
        let found = simulated(&system, method, &time, &push, &[0.0]);
        for (i, &t) in time.iter().enumerate() {
            assert!((found[(i, 0)] - exact(t)).abs() < 1e-8, "{method:?} at {t}: {} {}", found[(i, 0)], exact(t));
            assert!(t > start || found[(i, 0)] == 0.0);
        }
    }
    let found = lanes(&system, (&time, 2), &push, &[[reach]], &[[0.0]]);
    for (i, &t) in time.iter().enumerate() {
        assert!((found[i][0][0] - exact(t)).abs() < 1e-8, "{t}: {} {}", found[i][0][0], exact(t));
    }
}

#[test]
fn a_mass_rests_until_the_force_exceeds_the_level_and_then_slides() {
    pushed("stick(v, 0)", 1.0);
    pushed("breakaway(v, r)", 1.37);
}

/// `x'' = -x - c sign(v)`: every half turn the amplitude falls by 2 c, until the spring is weaker than the friction.
#[test]
fn an_oscillator_stops_where_friction_holds_it() {
    let c = 0.15;
    let system = model(&[("x", "v"), ("v", "-x - c*stick(v, 0)")], &[], &[("c", c)]).compile().unwrap();
    let time = times(240, 0.05);
    let exact = |t: f64| {
        let turns = (t / std::f64::consts::PI).floor().min(3.0);
        let centre = if turns % 2.0 == 0.0 { c } else { -c };
        let amplitude = 1.0 - c - 2.0 * c * turns;
        match turns >= 3.0 {
            true => -0.1,
            false => centre + amplitude * t.cos(),
        }
    };
    for method in METHODS {
        let found = simulated(&system, method, &time, &|_| 0.0, &[1.0, 0.0]);
        for (i, &t) in time.iter().enumerate() {
            assert!((found[(i, 0)] - exact(t)).abs() < 1e-7, "{method:?} at {t}: {} {}", found[(i, 0)], exact(t));
            assert!(t < 3.0 * std::f64::consts::PI || found[(i, 1)] == 0.0);
        }
    }
    let found = lanes(&system, (&time, 2), &|_| 0.0, &[[c]], &[[1.0], [0.0]]);
    for (i, &t) in time.iter().enumerate() {
        // Steps of 0.025 s: h^4/120 a turn.
        assert!((found[i][0][0] - exact(t)).abs() < 1e-7, "{t}: {} {}", found[i][0][0], exact(t));
    }
}

/// A driven mass that stops, rests and reverses many times: how the outputs move with the parameters, by lanes side by side
/// and by the accurate integrator.
#[test]
fn sensitivities_go_through_the_changes_of_mode() {
    let states = [("x", "v"), ("v", "u - k*x - d*v - c*breakaway(v, r)")];
    let values = [("k", 1.3), ("d", 0.1), ("c", 1.1), ("r", 1.2)];
    let time = times(400, 0.05);
    let push = |t: f64| 2.0 * (0.9 * t).sin() + 0.3 * (3.1 * t).cos();
    let with = |moved: Option<(usize, f64)>| {
        let mut values = values;
        if let Some((which, by)) = moved {
            values[which].1 += by;
        }
        let system = model(&states, &["u"], &values).compile().unwrap();
        simulated(&system, Method::DormandPrince, &time, &push, &[0.2, 0.0])
    };
    let system = model(&states, &["u"], &values).compile().unwrap();
    let base = with(None);
    let rests = (0..400).filter(|&i| base[(i, 1)] == 0.0).count();
    assert!(rests > 20 && rests < 300, "{rests}");
    for which in 0..4 {
        let h = 1e-5;
        let (up, down) = (with(Some((which, h))), with(Some((which, -h))));
        let small = 1e-6;
        let parameters: Vec<[f64; 2]> =
            (0..4).map(|p| [values[p].1, values[p].1 + if p == which { small } else { 0.0 }]).collect();
        let found = lanes(&system, (&time, 4), &push, &parameters, &[[0.2; 2], [0.0; 2]]);
        let size = (0..400).map(|i| ((up[(i, 0)] - down[(i, 0)]) / (2.0 * h)).abs()).fold(0.0, f64::max);
        for i in 0..400 {
            assert!((found[i][0][0] - base[(i, 0)]).abs() < 1e-5, "{i}: {} {}", found[i][0][0], base[(i, 0)]);
            let exact = (up[(i, 0)] - down[(i, 0)]) / (2.0 * h);
            let own = (found[i][0][1] - found[i][0][0]) / small;
            assert!((own - exact).abs() < 1e-3 * size, "parameter {which} at {i}: {own} {exact}");
        }
    }
}

/// Two links under gravity, horizontal at the start, whose equations both joints' friction enters.
fn arm(friction: [&str; 2]) -> Model {
    let mass = "(2 + 1.2*cos(q2))*0.4 - (0.4 + 0.6*cos(q2))^2";
    let (m11, m12, m22) = ("(2 + 1.2*cos(q2))", "(0.4 + 0.6*cos(q2))", "0.4");
    let t1 = format!("(u - 9*cos(q1) - 3*cos(q1 + q2) - {} - 0.1*v1)", friction[0]);
    let t2 = format!("(-3*cos(q1 + q2) - {} - 0.1*v2)", friction[1]);
    let first = format!("({m22}*{t1} - {m12}*{t2})/({mass})");
    let second = format!("({m11}*{t2} - {m12}*{t1})/({mass})");
    model(
        &[("q1", "v1"), ("q2", "v2"), ("v1", &first), ("v2", &second)],
        &["u"],
        &[("a", 14.0), ("b", 4.0), ("w", 0.0)],
    )
}

#[test]
fn two_joints_that_are_coupled_hold_still_under_gravity() {
    let system = arm(["a*stick(v1, w)", "b*stick(v2, w)"]).compile().unwrap();
    let time = times(60, 0.05);
    for method in METHODS {
        let found = simulated(&system, method, &time, &|_| 0.0, &[0.0; 4]);
        assert!((0..60).all(|i| (0..4).all(|j| found[(i, j)] == 0.0)), "{method:?}");
    }
    let found = lanes(&system, (&time, 2), &|_| 0.0, &[[14.0], [4.0], [0.0]], &[[0.0]; 4]);
    assert!(found.iter().flatten().all(|v| v[0] == 0.0));
}

/// The same arm pushed about: held joints let go and are caught, alike in both integrators, and as friction with a corner
/// that is hardly there.
#[test]
fn coupled_joints_that_stop_and_start_agree_with_a_sharp_corner() {
    let holding = arm(["a*stick(v1, w)", "b*stick(v2, w)"]);
    let mut sharp = holding.clone();
    sharp.parameters[2].value = 1e-5;
    let time = times(80, 0.05);
    let push = |t: f64| 30.0 * (2.0 * t).sin();
    let initial = [0.1, -0.2, 0.0, 0.0];
    let found = simulated(&holding.compile().unwrap(), Method::DormandPrince, &time, &push, &initial);
    let corner = simulated(&sharp.compile().unwrap(), Method::Rosenbrock, &time, &push, &initial);
    let own =
        lanes(&holding.compile().unwrap(), (&time, 8), &push, &[[14.0], [4.0], [0.0]], &[[0.1], [-0.2], [0.0], [0.0]]);
    let held = |j: usize| (1..80).filter(|&i| found[(i, j)] == 0.0).count();
    assert!(held(2) > 3 && held(3) > 3 && held(2) < 70 && held(3) < 70, "{} {}", held(2), held(3));
    for i in 0..80 {
        for j in 0..4 {
            // The corner creeps by 1e-5 rad/s.
            assert!((found[(i, j)] - corner[(i, j)]).abs() < 1e-3, "{i} {j}: {} {}", found[(i, j)], corner[(i, j)]);
            assert!((found[(i, j)] - own[i][j][0]).abs() < 1e-4, "{i} {j}: {} {}", found[(i, j)], own[i][j][0]);
        }
    }
}

#[test]
fn with_a_corner_it_is_the_hyperbolic_tangent_to_the_last_bit() {
    let time = times(200, 0.05);
    let push = |t: f64| 2.0 * (0.9 * t).sin();
    let run = |friction: &str| {
        let states = [("x", "v"), ("v", &*format!("u - x - c*{friction}"))];
        let system = model(&states, &["u"], &[("c", 0.6), ("w", 0.03)]).compile().unwrap();
        let all = lanes(&system, (&time, 3), &push, &[[0.6, 0.7], [0.03, 0.02]], &[[0.1; 2], [0.0; 2]]);
        (all, simulated(&system, Method::DormandPrince, &time, &push, &[0.1, 0.0]))
    };
    let ((own, one), (theirs, other)) = (run("stick(v, w)"), run("tanh(v/w)"));
    assert_eq!(own, theirs);
    assert_eq!(one, other);
}

#[test]
fn lanes_with_and_without_a_corner_go_side_by_side() {
    let time = times(100, 0.05);
    let push = |t: f64| 2.0 * (0.9 * t).sin();
    let system = model(&[("x", "v"), ("v", "u - x - 0.6*stick(v, w)")], &["u"], &[("w", 0.0)]).compile().unwrap();
    let both = lanes(&system, (&time, 3), &push, &[[0.0, 0.05]], &[[0.1; 2], [0.0; 2]]);
    for (lane, width) in [0.0, 0.05].into_iter().enumerate() {
        let alone = lanes(&system, (&time, 3), &push, &[[width]], &[[0.1], [0.0]]);
        for i in 0..100 {
            assert!((both[i][0][lane] - alone[i][0][0]).abs() < 1e-9, "{width} at {i}");
        }
    }
}

#[test]
fn what_can_not_hold_is_refused_or_stays_a_corner() {
    let refused = |rate: &str| model(&[("v", rate)], &["u"], &[("c", 1.0)]).compile().unwrap_err().to_string();
    assert!(refused("-stick(2*v, 0)").contains("must be a state alone"));
    assert!(refused("-breakaway(u, 1)").contains("must be a state alone"));
    assert!(refused("-breakaway(v, 1 + t)").contains("numbers and parameters"));
    assert!(refused("-breakaway(v, 1 + v^2)").contains("numbers and parameters"));
    // A width that moves is no width of zero.
    let wide = model(&[("v", "-stick(v, 0.1 + u^2)")], &["u"], &[]).compile().unwrap();
    assert!(wide.sticks().is_none());
}
