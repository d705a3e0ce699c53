//! Systems with known equations come back from their noisy logs.

use super::*;
use crate::data::{Channel, Run};
use crate::differentiate::Differentiation;
use crate::gp::Kernel;
use crate::library::{Constraints, Fixed, Forbidden, Kept, LibrarySettings, Signed};
use crate::progress::Silent;
use crate::random::normal;
use crate::regress::{Lasso, Regressor, Subset};
use crate::smooth::Smoother;
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use std::sync::Arc;

/// Samples of `rate(t, x)` by Runge-Kutta steps of a fiftieth of a period, with noise; `extra` columns of time behind them.
pub(super) fn log(
    names: &[&str],
    initial: &[f64],
    rate: &dyn Fn(f64, &[f64]) -> Vec<f64>,
    (period, count): (f64, usize),
    noise: f64,
    extra: &dyn Fn(f64) -> Vec<f64>,
    seed: u64,
) -> Dataset {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let along = |x: &[f64], k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<_>>();
    let mut x = initial.to_vec();
    let mut rows = Vec::new();
    for i in 0..count {
        let mut row: Vec<f64> = x.iter().map(|v| v + noise * normal(&mut rng)).collect();
        row.extend(extra(period * i as f64));
        rows.push(row);
        for part in 0..50 {
            let (t, h) = (period * (i as f64 + f64::from(part) / 50.0), period / 50.0);
            let k1 = rate(t, &x);
            let k2 = rate(t + 0.5 * h, &along(&x, &k1, 0.5 * h));
            let k3 = rate(t + 0.5 * h, &along(&x, &k2, 0.5 * h));
            let k4 = rate(t + h, &along(&x, &k3, h));
            x = (0..x.len()).map(|j| x[j] + h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])).collect();
        }
    }
    let time = (0..count).map(|i| period * i as f64).collect();
    let values = Mat::from_fn(count, names.len(), |i, j| rows[i][j]);
    let channels = names.iter().map(|n| Channel::new(*n)).collect();
    Dataset::new(channels, vec![Run { name: format!("{seed}"), time, values }]).unwrap()
}

fn lotka_volterra(seed: u64) -> Dataset {
    let rate = |_: f64, x: &[f64]| vec![1.1 * x[0] - 0.4 * x[0] * x[1], -x[1] + 0.4 * x[0] * x[1]];
    log(&["x1", "x2"], &[10.0, 5.0], &rate, (0.1, 120), 0.1, &|_| vec![], seed)
}

fn settings(states: &[&str], controls: &[&str]) -> Identify {
    Identify {
        states: states.iter().map(ToString::to_string).collect(),
        controls: controls.iter().map(ToString::to_string).collect(),
        smoother: Some(Smoother { kernels: vec![Kernel::SquaredExponential], ..Smoother::default() }),
        ..Identify::default()
    }
}

#[test]
fn lotka_volterra_comes_back_term_by_term() {
    let identify = Identify {
        library: LibrarySettings { products: true, ..LibrarySettings::default() },
        ..settings(&["x1", "x2"], &[])
    };
    let found = identify.fit(&lotka_volterra(1), &Silent).unwrap();
    assert_eq!(found.states[0].terms, ["x1", "x1*x2"]);
    assert_eq!(found.states[1].terms, ["x2", "x1*x2"]);
    let record = found.model.identification.as_ref().unwrap();
    let place = |name: &str| record.terms.iter().position(|t| t == name).unwrap();
    let truth = [[("x1", 1.1), ("x1*x2", -0.4)], [("x2", -1.0), ("x1*x2", 0.4)]];
    for (s, terms) in truth.iter().enumerate() {
        for (name, value) in terms {
            let (c, e) = (record.coefficients[s][place(name)], record.standard_errors[s][place(name)]);
            // Four standard errors are right in all but 6 of 100,000 cases.
            assert!((c - value).abs() < 4.0 * e && e < 0.02, "{name}: {c} +- {e}");
        }
    }
    // The noise of 0.1 is known within 7 % (one sigma) by 120 samples.
    assert!(found.states.iter().all(|s| (s.noise - 0.1).abs() < 0.03));
    found.model.compile().unwrap();
}

#[test]
fn a_cart_with_a_late_control_shows_its_delay() {
    let u = |t: f64| if t < 0.0 { 0.0 } else { f64::from((t / 0.7) as i32 * 7 % 5) - 2.0 };
    let held = |t: f64| u((t / 0.05 + 1e-9).floor() * 0.05);
    let rate = move |t: f64, x: &[f64]| vec![x[1], 3.0 * held(t - 0.12) - 2.0 * x[0] - 0.5 * x[1]];
    let data = log(&["x", "v", "u"], &[0.5, 0.0], &rate, (0.05, 300), 0.01, &|t| vec![u(t + 1e-9)], 2);
    let identify = Identify {
        library: LibrarySettings { degree: 1, ..LibrarySettings::default() },
        constraints: Constraints { fixed: vec![Fixed::parse("x' = v").unwrap()], ..Constraints::default() },
        delays: vec![("u".into(), Delay::Auto(Some(0.4)))],
        ..settings(&["x", "v"], &["u"])
    };
    let found = identify.fit(&data, &Silent).unwrap();
    assert_eq!(found.states[1].terms, ["x", "v", "u"]);
    let (delay, error) = (found.delays[0].delay, found.delays[0].standard_error.unwrap());
    assert!((delay - 0.12).abs() < 4.0 * error + 2e-3 && error < 0.01, "{delay} +- {error}");
    assert!(found.model.states[1].equation.to_string().contains("delay(u, 0.1"), "{}", found.model.states[1].equation);
    assert_eq!(found.model.states[0].equation.to_string(), "v");
}

#[test]
fn without_refinement_and_smoother_the_regression_alone_answers() {
    let methods: [(Target, Arc<dyn Regressor>); 2] = [
        (Target::Weak, Arc::new(Subset::default())),
        (Target::Derivative(Differentiation::Central), Arc::new(Lasso::default())),
    ];
    for (target, regressor) in methods {
        let identify = Identify {
            library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
            smoother: None,
            refine: false,
            ensemble: 20,
            target,
            regressor,
            ..settings(&["x1", "x2"], &[])
        };
        let found = identify.fit(&lotka_volterra(3), &Silent).unwrap();
        assert_eq!(found.window, None);
        let record = found.model.identification.as_ref().unwrap();
        let product = record.terms.iter().position(|t| t == "x1*x2").unwrap();
        for s in 0..2 {
            assert!(record.coefficients[s][product] != 0.0);
            assert!(record.inclusion_probabilities[s][product] > 0.5, "{:?}", record.inclusion_probabilities);
        }
    }
}

#[test]
fn inclusion_probabilities_are_those_of_the_final_equations() {
    let library = LibrarySettings { degree: 2, ..LibrarySettings::default() };
    let identify = Identify { library, smoother: None, ensemble: 1, ..settings(&["x1", "x2"], &[]) };
    let found = identify.fit(&lotka_volterra(3), &Silent).unwrap();
    let record = found.model.identification.as_ref().unwrap();
    for (coefficients, shares) in record.coefficients.iter().zip(&record.inclusion_probabilities) {
        for (coefficient, share) in coefficients.iter().zip(shares) {
            // A wrong term enters at odds of 40 or so: the price of a term is about 2 ln 40.
            assert!(if *coefficient != 0.0 { *share > 0.9 } else { *share < 0.3 }, "{shares:?}");
        }
    }
}

#[test]
fn the_papers_own_way_finds_the_terms_among_few() {
    let mut identify = Identify {
        states: vec!["x1".into(), "x2".into()],
        library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
        ..Identify::paper()
    };
    identify.smoother = settings(&[], &[]).smoother;
    let found = identify.fit(&lotka_volterra(7), &Silent).unwrap();
    for (s, wanted) in [["x1", "x1*x2"], ["x2", "x1*x2"]].iter().enumerate() {
        assert!(wanted.iter().all(|t| found.states[s].terms.contains(&t.to_string())), "{:?}", found.states[s].terms);
    }
}

#[test]
fn constraints_hold_in_the_answer() {
    let identify = Identify {
        library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
        constraints: Constraints {
            forbidden: vec![Forbidden::parse("x1:x1").unwrap()],
            signed: vec![Signed::parse("x2:x1*x2=-").unwrap()],
            ..Constraints::default()
        },
        ..settings(&["x1", "x2"], &[])
    };
    let found = identify.fit(&lotka_volterra(4), &Silent).unwrap();
    assert!(!found.states[0].terms.contains(&"x1".to_string()));
    let record = found.model.identification.as_ref().unwrap();
    let product = record.terms.iter().position(|t| t == "x1*x2").unwrap();
    assert!(record.coefficients[1][product] <= 0.0);
}

#[test]
fn a_kept_term_is_in_however_little_it_brings() {
    for refine in [true, false] {
        let identify = Identify {
            library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
            constraints: Constraints { kept: vec![Kept::parse("x1:x2").unwrap()], ..Constraints::default() },
            refine,
            ..settings(&["x1", "x2"], &[])
        };
        let found = identify.fit(&lotka_volterra(4), &Silent).unwrap();
        assert!(found.states[0].terms.contains(&"x2".to_string()), "{:?}", found.states[0].terms);
        if refine {
            assert_eq!(found.states[0].terms, ["x1", "x2", "x1*x2"]);
            let record = found.model.identification.as_ref().unwrap();
            let place = record.terms.iter().position(|t| t == "x2").unwrap();
            // It is truly 0: four standard errors are right in all but 6 of 100,000 cases.
            assert!(record.coefficients[0][place].abs() < 4.0 * record.standard_errors[0][place]);
        }
    }
}

/// A cart whose force is interpolated between the samples of its log.
fn interpolated() -> Dataset {
    let u = |t: f64| ((t / 0.2).round() * 12.9898).sin() * 2.0;
    let between = move |t: f64| {
        let (from, part) = ((t / 0.2 + 1e-9).floor() * 0.2, (t / 0.2 + 1e-9).fract());
        u(from) + part * (u(from + 0.2) - u(from))
    };
    let rate = move |t: f64, x: &[f64]| vec![x[1], 3.0 * between(t) - 2.0 * x[0] - 0.5 * x[1]];
    log(&["x", "v", "u"], &[0.5, 0.0], &rate, (0.2, 150), 0.01, &|t| vec![u(t)], 8)
}

#[test]
fn interpolated_controls_are_seen_without_refinement() {
    let identify = Identify {
        library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
        refine: false,
        ..settings(&["x", "v"], &["u"])
    };
    let found = identify.fit(&interpolated(), &Silent).unwrap();
    assert_eq!(found.hold, Hold::Linear);
    assert!(found.notes.contains(&Note::Interpolated));
    for term in ["x", "v", "u"] {
        assert!(found.states[1].terms.contains(&term.to_string()), "{:?}", found.states[1].terms);
    }
}

#[test]
fn a_delay_stays_below_its_bound() {
    let data = interpolated();
    let identify = Identify {
        library: LibrarySettings { degree: 1, ..LibrarySettings::default() },
        // The control acts at once, but it is logged 0.3 s early: the delay wants to lie beyond the bound.
        delays: vec![("u".into(), Delay::Auto(Some(0.1)))],
        ..settings(&["x", "v"], &["u"])
    };
    let early = data.runs().iter().map(|run| {
        let values = Mat::from_fn(run.n_samples() - 2, 3, |i, j| run.values[(if j == 2 { i + 2 } else { i }, j)]);
        Run { name: run.name.clone(), time: run.time[..run.n_samples() - 2].to_vec(), values }
    });
    let data = Dataset::new(data.channels().to_vec(), early.collect()).unwrap();
    let found = identify.fit(&data, &Silent).unwrap();
    assert!(found.delays[0].delay <= 0.1 + 1e-12, "{:?}", found.delays);
}

#[test]
fn the_answer_does_not_depend_on_threads() {
    let identify = Identify {
        library: LibrarySettings { degree: 2, ..LibrarySettings::default() },
        ..settings(&["x1", "x2"], &[])
    };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| identify.fit(&lotka_volterra(5), &Silent).unwrap().model)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn the_errors_of_an_unstable_plant_are_those_of_rollouts_that_can_be_foretold() {
    // x' = 3 x + u on a bounded path, as a controller keeps it: over 20 s a difference grows by exp(60).
    let path = |t: f64| (t.sin() + 0.5 * (2.3 * t).sin(), t.cos() + 1.15 * (2.3 * t).cos());
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut row = |t: f64| [path(t).0 + 0.05 * normal(&mut rng), path(t).1 - 3.0 * path(t).0];
    let rows: Vec<[f64; 2]> = (0..1000).map(|i| row(0.02 * f64::from(i))).collect();
    let time = (0..1000).map(|i| 0.02 * f64::from(i)).collect();
    let run = Run { name: "a".into(), time, values: Mat::from_fn(1000, 2, |i, j| rows[i][j]) };
    let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], vec![run]).unwrap();
    let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
    let found = Identify { library, ..settings(&["x"], &["u"]) }.fit(&data, &Silent).unwrap();
    assert!(found.window.unwrap() < 10.0, "{:?}", found.window);
    assert!(found.notes.iter().any(|note| matches!(note, Note::Unpredictable { .. })), "{:?}", found.notes);
    let record = found.model.identification.as_ref().unwrap();
    for (term, truth) in [("x", 3.0), ("u", 1.0)] {
        let k = record.terms.iter().position(|t| t == term).unwrap();
        let (off, error) = ((record.coefficients[0][k] - truth).abs(), record.standard_errors[0][k]);
        assert!(off < 3.0 * error && error < 0.2, "{term}: {off} of {error}");
    }
}

#[test]
fn contradictions_are_named() {
    let data = lotka_volterra(6);
    let text = |identify: Identify| identify.fit(&data, &Silent).unwrap_err().to_string();
    assert!(text(Identify::default()).contains("no state named"));
    assert!(text(settings(&["x3"], &[])).contains("column `x3` is unknown"));
    let few = text(Identify { train_fraction: 0.01, ..settings(&["x1"], &[]) });
    assert!(few.contains("found 2"), "{few}");
    assert!(text(Identify { train_fraction: 0.0, ..settings(&["x1"], &[]) }).contains("train_fraction"));
    let delays = vec![("u".to_string(), Delay::Fixed(0.1))];
    assert!(text(Identify { delays, ..settings(&["x1"], &[]) }).contains("control `u`"));
    let derivatives = vec![("x1".to_string(), "dx1".to_string())];
    assert!(text(Identify { derivatives, ..settings(&["x1"], &[]) }).contains("`dx1`"));
}

#[test]
fn a_refinement_never_predicts_worse_than_what_it_began_with() {
    // No term of the library: chlorine dioxide and iodine as Strogatz has them (section 8.3), number 42 of ODEBench
    // (d'Ascoli et al. 2024). Without noise the residuals of every model are slow, and the evidence counts few of them.
    let rate = |_: f64, x: &[f64]| {
        let shared = x[0] * x[1] / (1.0 + x[0] * x[0]);
        vec![8.9 - x[0] - 4.0 * shared, 1.4 * x[0] - 1.4 * shared]
    };
    let data = log(&["x", "y"], &[0.2, 0.35], &rate, (0.02, 500), 0.0, &|_| vec![], 1);
    let library = LibrarySettings { trig: true, ..LibrarySettings::default() };
    let regressed = Identify { library: library.clone(), refine: false, ..settings(&["x", "y"], &[]) };
    let refined = Identify { refine: true, ..regressed.clone() };
    let error = |identify: &Identify| identify.fit(&data, &Silent).unwrap().fidelity.unwrap().error.unwrap();
    let (before, after) = (error(&regressed), error(&refined));
    assert!(before < 0.3 && after < 1.3 * before, "{before} {after}");
}

#[test]
fn terms_below_the_error_of_the_integration_stay_out() {
    // Exact logistic growth, number 3 of ODEBench: x' = 0.79 x (1 - x / 74.3). Nothing but rounding is left to explain.
    let exact = |t: f64| 74.3 / (1.0 + (74.3 / 7.3 - 1.0) * (-0.79 * t).exp());
    let run = Run {
        name: "a".into(),
        time: (0..200).map(|i| 0.05 * f64::from(i)).collect(),
        values: Mat::from_fn(200, 1, |i, _| exact(0.05 * i as f64)),
    };
    let data = Dataset::new(vec![Channel::new("x")], vec![run]).unwrap();
    let library = LibrarySettings { trig: true, ..LibrarySettings::default() };
    let found = Identify { library, ..settings(&["x"], &[]) }.fit(&data, &Silent).unwrap();
    assert_eq!(found.states[0].terms, ["x", "x^2"], "{:?}", found.model.states[0].equation.to_string());
}

/// A resonance of nine samples a period, y'' = -40 y - 0.4 y' + 30 u under a held control, with y and u alone logged.
fn resonance(noise: f64) -> Dataset {
    let u = |t: f64| f64::from(((t / 0.33 + 1e-9) as i32 * 7 % 5) - 2);
    let rate = move |t: f64, x: &[f64]| vec![x[1], 30.0 * u(t) - 40.0 * x[0] - 0.4 * x[1]];
    let whole = log(&["y", "w", "u"], &[0.5, 0.0], &rate, (0.11, 400), noise, &|t| vec![u(t + 1e-9)], 3);
    let run = &whole.runs()[0];
    let values = Mat::from_fn(run.n_samples(), 2, |i, j| run.values[(i, 2 * j)]);
    Dataset::new(vec![Channel::new("y"), Channel::new("u")], vec![Run { values, ..run.clone() }]).unwrap()
}

#[test]
fn a_resonance_of_nine_samples_a_period_is_found_with_and_without_smoother() {
    let constraints = Constraints { fixed: vec![Fixed::parse("y' = w").unwrap()], ..Constraints::default() };
    let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
    let smooth = Identify { library, constraints, hold: Some(Hold::Zero), ..settings(&["y", "w"], &["u"]) };
    let raw = Identify { smoother: None, ..smooth.clone() };
    for identify in [smooth, raw] {
        let found = identify.fit(&resonance(0.01), &Silent).unwrap();
        let record = found.model.identification.as_ref().unwrap();
        for (term, truth) in [("y", -40.0), ("w", -0.4), ("u", 30.0)] {
            let k = record.terms.iter().position(|t| t == term).unwrap();
            let (value, error) = (record.coefficients[1][k], record.standard_errors[1][k]);
            // The log's own integration switches the control up to a fiftieth of a period early: beyond the standard errors.
            assert!((value - truth).abs() < 0.01 * truth.abs().max(1.0) && error < 0.02, "{term}: {value} +- {error}");
        }
        assert!(!found.is_poor(), "{:?}", found.fidelity);
    }
}

#[test]
fn a_model_of_noise_is_poor_and_a_model_of_chaos_is_not() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let values = Mat::from_fn(200, 1, |_, _| normal(&mut rng));
    let run = Run { name: "a".into(), time: (0..200).map(|i| 0.1 * f64::from(i)).collect(), values };
    let noise = Dataset::new(vec![Channel::new("x")], vec![run]).unwrap();
    let found = settings(&["x"], &[]).fit(&noise, &Silent).unwrap();
    assert!(found.is_poor(), "{:?}", found.fidelity);

    let lorenz =
        |_: f64, x: &[f64]| vec![10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]];
    let data = log(&["x", "y", "z"], &[-8.0, 7.0, 27.0], &lorenz, (0.02, 1000), 0.1, &|_| vec![], 12);
    let library = LibrarySettings { degree: 2, ..LibrarySettings::default() };
    let found = Identify { library, ..settings(&["x", "y", "z"], &[]) }.fit(&data, &Silent).unwrap();
    assert!(!found.is_poor(), "{:?}", found.fidelity);
}

#[test]
fn a_clock_among_the_states_is_told_about() {
    let clock = |t: f64| vec![1900.0 + t];
    let rate = |_: f64, x: &[f64]| vec![-0.5 * x[0]];
    let data = log(&["x", "year"], &[3.0], &rate, (0.1, 60), 0.01, &clock, 4);
    let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
    let found = Identify { library, ..settings(&["x", "year"], &[]) }.fit(&data, &Silent).unwrap();
    assert!(found.notes.contains(&Note::LineOfTime { state: "year".into() }), "{:?}", found.notes);
}

#[test]
fn the_model_carries_what_its_controls_do_between_samples() {
    let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
    let identify = Identify { library, refine: false, ..settings(&["x", "v"], &["u"]) };
    assert_eq!(identify.fit(&interpolated(), &Silent).unwrap().model.hold(), Hold::Linear);
    let alone = settings(&["x1", "x2"], &[]).fit(&lotka_volterra(1), &Silent).unwrap();
    assert_eq!(alone.model.identification.unwrap().hold, None);
}
