//! Parameters, starts and windows that come back.

use super::*;
use crate::data::{Channel, Dataset, Run};
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State};
use faer::Mat;

fn cart(force: &str) -> Model {
    Model {
        states: vec![
            State::new("x", Expression::parse("v").unwrap()),
            State::new("v", Expression::parse(&format!("{force} - k*x - b*v")).unwrap()),
        ],
        controls: vec![Control::new("u")],
        parameters: [("k", 4.0), ("b", 0.3), ("tau", 0.033)].map(|(n, v)| Parameter::new(n, v)).into(),
        ..Model::default()
    }
}

/// Logs of the model itself, position only, made with a far finer step.
fn logs(model: &Model, values: &[f64]) -> Dataset {
    let system = model.compile().unwrap();
    let fine = 20;
    let runs = (0..2)
        .map(|r| {
            let time: Vec<f64> = (0..200).map(|i| 0.05 * i as f64).collect();
            let u = |i: usize| (0.7 * time[i] + r as f64).sin() + f64::from((i / 37).is_multiple_of(2));
            let log = Log {
                name: "truth".into(),
                time: time.clone(),
                controls: vec![(0..200).map(u).collect()],
                measured: vec![vec![0.0; 200]],
                ..Log::default()
            };
            let parameters: Vec<[f64; 1]> = values.iter().map(|&v| [v]).collect();
            let mut lanes = lanes::Lanes::<1>::new(&system, &log, (Hold::Zero, Past::Still), &parameters);
            let mut values = Mat::zeros(200, 2);
            lanes.roll((0, 199), &[[0.5], [0.0]], &[0], fine, |i, _, v| values[(i, 0)] = v[0]);
            for i in 0..200 {
                values[(i, 1)] = u(i);
            }
            Run { name: format!("{r}"), time, values }
        })
        .collect();
    Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs).unwrap()
}

#[test]
fn parameters_and_hidden_initial_velocity_come_back_from_positions() {
    let model = cart("u");
    let data = logs(&model, &[4.0, 0.3, 0.0]);
    let system = model.compile().unwrap();
    let mut experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
    experiment.substeps = 4;
    let free = [Free::new(0, 1.0), Free::new(1, 1.0)];
    let fit = Refine::default().fit(&system, &experiment, &[3.0, 1.0, 0.0], &free, None).unwrap();
    // Both integrators are exact to about 1e-8 here.
    assert!((fit.parameters[0] - 4.0).abs() < 1e-5, "{:?}", fit.parameters);
    assert!((fit.parameters[1] - 0.3).abs() < 1e-5, "{:?}", fit.parameters);
    assert!(fit.initial[0][1].abs() < 1e-4, "{:?}", fit.initial);
    assert!(fit.converged);
}

#[test]
fn a_delay_between_samples_comes_back() {
    let model = cart("delay(u, tau)");
    let data = logs(&model, &[4.0, 0.3, 0.083]);
    let system = model.compile().unwrap();
    let mut experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
    experiment.substeps = 2;
    let free = [Free { lower: 0.0, ..Free::new(2, 0.05) }, Free::new(0, 1.0)];
    let fit = Refine::default().fit(&system, &experiment, &[3.9, 0.3, 0.01], &free, None).unwrap();
    // The mean of a switched control over a step leaves an error of h^2/8 = 8e-5 a switch.
    assert!((fit.parameters[2] - 0.083).abs() < 5e-4, "{:?}", fit.parameters);
}

/// The cart and its logs in windows of 2 s.
fn in_windows() -> (System, Experiment) {
    let model = cart("u");
    let data = logs(&model, &[4.0, 0.3, 0.0]);
    let system = model.compile().unwrap();
    let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap().with_windows_of(2.0);
    (system, Experiment { substeps: 4, ..experiment })
}

#[test]
fn windows_give_the_same_answer_as_whole_runs() {
    let (system, experiment) = in_windows();
    assert_eq!(experiment.windows.len(), 10);
    let fit =
        Refine::default().fit(&system, &experiment, &[3.0, 1.0, 0.0], &[Free::new(0, 1.0), Free::new(1, 1.0)], None);
    let fit = fit.unwrap();
    assert!((fit.parameters[0] - 4.0).abs() < 1e-4, "{:?}", fit.parameters);
}

#[test]
fn first_samples_that_count_more_hold_the_starts_of_a_wrong_model() {
    let (system, experiment) = in_windows();
    // Too soft a spring, and nothing to fit but the starts.
    let fit = |starts: Starts| {
        let experiment = Experiment { starts, ..experiment.clone() };
        Refine::default().fit(&system, &experiment, &[2.0, 0.3, 0.0], &[], None).unwrap()
    };
    let first = |fit: &Refined| fit.residuals.iter().map(|window| window[0].abs()).fold(0.0, f64::max);
    let free = fit(Starts::default());
    let held = fit(Starts { samples: 1, more: 1e8 });
    assert!(first(&free) > 1.0, "{}", first(&free));
    assert!(first(&held) < 1e-3, "{}", first(&held));
    // The cost is the one that the search saw: every first value counts 1e8 times more.
    let squares: f64 = held.residuals.iter().flatten().map(|e| e * e).sum();
    let firsts: f64 = held.residuals.iter().map(|window| window[0] * window[0]).sum();
    assert!((held.cost / (squares + 1e8 * firsts) - 1.0).abs() < 1e-12, "{}", held.cost);
}

#[test]
fn a_belief_holds_what_the_data_do_not_tell() {
    let model = cart("u");
    let data = logs(&model, &[4.0, 0.3, 0.0]);
    let system = model.compile().unwrap();
    let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
    // tau does not enter: only its prior can place it.
    let free = [Free { prior: Some((0.2, 0.1)), ..Free::new(2, 1.0) }];
    let fit = Refine::default().fit(&system, &experiment, &[4.0, 0.3, 0.9], &free, None).unwrap();
    assert!((fit.parameters[2] - 0.2).abs() < 1e-6);
    assert!((fit.covariance[0][0] - 0.01).abs() < 1e-6);
}

#[test]
fn derivatives_of_an_earlier_fit_fill_the_columns_that_it_has() {
    let (system, experiment) = in_windows();
    let at = |k: f64| Point { parameters: vec![k, 0.3, 0.0], initial: vec![vec![0.5, 0.0]; experiment.windows.len()] };
    let (one, both) = ([Free::new(0, 1.0)], [Free::new(1, 1.0), Free::new(0, 1.0)]);
    let earlier = Jacobian::new(&system, &experiment, &at(4.0), &one).unwrap();
    let kept = Kept::new(earlier.clone(), &system, &experiment, &one);
    let made = |kept: Option<&Kept>| Jacobian::beside(&system, &experiment, &at(3.0), &both, kept).unwrap();
    let (own, beside) = (made(None), made(Some(&kept)));
    for ((own, beside), earlier) in own.blocks.iter().zip(&beside.blocks).zip(&earlier.blocks) {
        assert_eq!(own.residual, beside.residual);
        // The starts and `k` as they were at the earlier point, `b` as it is here.
        let off = |column: usize, other: &Block, of: usize| {
            let known = other.derivative.column(of);
            (beside.derivative.column(column) - known).norm() / known.norm()
        };
        assert!(off(0, earlier, 0) < 1e-12 && off(1, earlier, 1) < 1e-12 && off(3, earlier, 2) < 1e-12);
        assert!(off(2, own, 2) < 1e-12 && off(3, own, 3) > 0.01);
    }
    // Parameters that a system lacks are not handed on, though another of their name were there.
    let other = cart("u").compile().unwrap();
    assert_eq!(kept.of_parameters_in(&other).parameters(), [Some("k")]);
    let bare = Model { parameters: vec![Parameter::new("b", 0.3), Parameter::new("tau", 0.0)], ..cart("u") };
    let bare = Model {
        states: vec![
            State::new("x", Expression::parse("v").unwrap()),
            State::new("v", Expression::parse("u - b*v").unwrap()),
        ],
        ..bare
    };
    assert_eq!(kept.of_parameters_in(&bare.compile().unwrap()).parameters(), [None]);
}

#[test]
fn a_fit_that_is_hopeless_ends_once_its_steps_are_slow() {
    let (system, experiment) = in_windows();
    // The damping is wrong and fixed, so that a residual stays.
    let fit = |hopeless: f64| {
        let settings = Refine { hopeless, tolerance: 1e-12, ..Refine::default() };
        settings.fit(&system, &experiment, &[3.0, 1.0, 0.0], &[Free::new(0, 1.0)], None).unwrap()
    };
    let patient = fit(f64::INFINITY);
    assert!(patient.converged && patient.cost > 100.0, "{}", patient.cost);
    let hopeless = fit(0.5 * patient.cost);
    assert!(
        !hopeless.converged && hopeless.iterations < patient.iterations,
        "{} {}",
        hopeless.iterations,
        patient.iterations
    );
    assert!(hopeless.cost < 1.1 * patient.cost / (0.9 * 0.9), "{} {}", hopeless.cost, patient.cost);
    assert_eq!(fit(2.0 * patient.cost).iterations, patient.iterations);
}

#[test]
fn a_run_with_a_value_of_its_own_is_rolled_out_with_it() {
    let model = cart("u");
    let data = logs(&model, &[4.0, 0.3, 0.0]);
    let system = model.compile().unwrap();
    let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
    let shifted = |more: f64| {
        let mut shifted = experiment.clone();
        let mut all = shifted.logs.to_vec();
        all[1].own = vec![(0, more)];
        shifted.logs = all.into();
        shifted
    };
    let point = |k: f64| Point { parameters: vec![k, 0.3, 0.0], initial: vec![vec![0.5, 0.0]; 2] };
    let at = |experiment: &Experiment, k: f64| Jacobian::new(&system, experiment, &point(k), &[]).unwrap().blocks;
    let (own, joint, other) = (at(&shifted(0.5), 4.0), at(&experiment, 4.0), at(&experiment, 4.5));
    assert!(own[0].residual == joint[0].residual && own[1].residual == other[1].residual);
    assert_ne!(own[1].residual, joint[1].residual);
    let cost = |experiment: &Experiment, k: f64| costs(&system, experiment, &[point(k)], &[])[0];
    assert!((cost(&shifted(0.5), 4.0) - own.iter().map(|b| b.residual.norm_squared()).sum::<f64>()).abs() < 1e-6);
}

#[test]
fn an_unlogged_speed_in_another_unit_begins_with_the_slope_of_its_place() {
    let of = |place: &str| {
        let angle = State { unit: place.into(), ..State::new("a", Expression::parse("6*n").unwrap()) };
        let speed = State { unit: "rpm".into(), ..State::new("n", Expression::parse("0").unwrap()) };
        Model { states: vec![angle, speed], ..Model::default() }
    };
    let model = of("deg");
    assert_eq!((model.integral_of(1), model.is_kinematic(0)), (Some(0), true));
    assert_eq!((of("rad").integral_of(1), of("m").integral_of(1), of("").integral_of(1)), (None, None, None));
    let time: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
    let values = Mat::from_fn(40, 1, |i, _| 5.0 + 12.0 * time[i]);
    let data = Dataset::new(vec![Channel::new("a")], vec![Run { name: "turn".into(), time, values }]).unwrap();
    let system = model.compile().unwrap();
    let experiment = Experiment::new(&system, &data, Some(&[1e-3])).unwrap();
    let start = &guess_initial(&system, &experiment)[0];
    assert!((start[0] - 5.0).abs() < 1e-9 && (start[1] - 2.0).abs() < 1e-9, "{start:?}");
    assert!((experiment.scale[1] - 2.0).abs() < 1e-9, "{:?}", experiment.scale);
}

#[test]
fn a_fit_follows_a_curved_valley() {
    // Where x moves little, a size and an exponent make up for one another along a bent line.
    let model = Model {
        states: vec![State::new("x", Expression::parse("1 - a*exp(b*x)").unwrap())],
        parameters: vec![Parameter::new("a", 0.002), Parameter::new("b", 4.0)],
        ..Model::default()
    };
    let system = model.compile().unwrap();
    let time: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i)).collect();
    let mut x = 1.4_f64;
    let values = Mat::from_fn(200, 1, |_, _| {
        let before = x;
        for _ in 0..20 {
            x += 0.001 * (1.0 - 0.002 * (4.0 * x).exp());
        }
        before
    });
    let data = Dataset::new(vec![Channel::new("x")], vec![Run { name: "bent".into(), time, values }]).unwrap();
    let experiment = Experiment::new(&system, &data, Some(&[1e-4])).unwrap();
    let free = [Free { lower: 0.0, ..Free::new(0, 0.001) }, Free { lower: 0.0, ..Free::new(1, 1.0) }];
    // Steps that are not bent are still in the valley after 60, at a = 0.05.
    let refine = Refine { max_iterations: 60, ..Refine::default() };
    let fit = refine.fit(&system, &experiment, &[0.3, 0.8], &free, None).unwrap();
    assert!(fit.converged, "{:?}", fit.parameters);
    // The logs are made by Euler's steps of a millisecond.
    assert!((fit.parameters[0] / 0.002 - 1.0).abs() < 0.02, "{:?}", fit.parameters);
    assert!((fit.parameters[1] - 4.0).abs() < 0.01, "{:?}", fit.parameters);
}
