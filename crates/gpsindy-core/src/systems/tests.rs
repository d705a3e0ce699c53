use super::*;
use crate::model::Dynamics;

fn clean(system: &TestSystem) -> Run {
    system.sample_usual(SensorNoise::None, 0).unwrap().runs()[0].clone()
}

fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}

#[test]
fn every_system_runs_and_moves() {
    for system in all() {
        let run = clean(&system);
        for (j, state) in system.model.states.iter().enumerate() {
            let column = run.column(j);
            assert!(column.iter().all(|v| v.abs() < 1e3), "{} {}", system.model.name, state.name);
            assert!(spread(column.iter().copied()) > 1e-3, "{} {}", system.model.name, state.name);
        }
        assert_eq!((system.controls)(0.0).len(), system.model.controls.len());
    }
}

#[test]
fn what_must_stay_constant_does() {
    let run = clean(&lotka_volterra());
    let integral = |i: usize| {
        let (x, y) = (run.values[(i, 0)], run.values[(i, 1)]);
        0.4 * x - x.ln() + 0.4 * y - 1.1 * y.ln()
    };
    // Steps with an error of 1e-10 over some hundred steps.
    assert!(spread((0..run.n_samples()).map(integral)) < 1e-6);
    let run = clean(&epidemic());
    assert!(spread((0..run.n_samples()).map(|i| (0..3).map(|j| run.values[(i, j)]).sum())) < 1e-12);
}

#[test]
fn the_terms_of_the_convection_are_its_equations() {
    let settings = crate::library::LibrarySettings { degree: 2, ..Default::default() };
    let library = crate::library::Library::new(&["x", "y", "z"], &[], &settings).unwrap();
    let state = [1.5, -2.0, 20.0];
    let theta = library.evaluate(Mat::from_fn(1, 3, |_, j| state[j]).as_ref(), &[0.0]).unwrap();
    let (mut rates, mut sums) = ([0.0; 3], [0.0; 3]);
    lorenz().model.compile().unwrap().derivative(0.0, &state, &[], &mut rates).unwrap();
    for (equation, term, value) in LORENZ_TERMS {
        sums[equation] += value * theta[(0, library.index_of(term).unwrap())];
    }
    // Sums of four numbers of size 50.
    assert!((0..3).all(|s| (rates[s] - sums[s]).abs() < 1e-13 * 50.0), "{rates:?} {sums:?}");
}

#[test]
fn the_cart_pole_keeps_its_energy_without_a_force() {
    let mut system = cart_pole();
    system.controls = |_| vec![0.0];
    let run = clean(&system);
    let (cart, pole, half, g) = (1.0, 0.1, 0.5, 9.81);
    let energy = |i: usize| {
        let [th, v, om] = [1, 2, 3].map(|j| run.values[(i, j)]);
        let sideways = v + half * om * th.cos();
        let upward = -half * om * th.sin();
        // A rod about its centre: m l^2/3 with l its half length.
        let rotation = 0.5 * pole * half * half / 3.0 * om * om;
        0.5 * cart * v * v + 0.5 * pole * (sideways.powi(2) + upward.powi(2)) + rotation + pole * g * half * th.cos()
    };
    assert!(spread((0..run.n_samples()).map(energy)) < 1e-7);
}

#[test]
fn points_of_rest_have_no_rates() {
    let rates = |system: TestSystem, x: &[f64], u: &[f64]| {
        let mut dx = vec![0.0; x.len()];
        system.model.compile().unwrap().derivative(0.0, x, u, &mut dx).unwrap();
        dx.iter().fold(0.0_f64, |largest, f| largest.max(f.abs()))
    };
    let wing = (8.0 / 3.0 * 27.0_f64).sqrt();
    assert!(rates(lorenz(), &[wing, wing, 27.0], &[]) < 1e-12);
    let hover = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    assert!(rates(planar_quadrotor(), &hover, &[0.5 * 9.81, 0.0]) < 1e-12);
    // The level at which a hole of a lets q out: (q/a)^2/(2 g).
    let level = 4.0 / (2.0 * 9.81);
    assert!(rates(double_tank(), &[level, level], &[1e-4]) < 1e-12);
    assert!(rates(duffing(), &[1.0, 0.0], &[0.0]) < 1e-12);
}

#[test]
fn the_van_der_pol_oscillator_reaches_its_cycle() {
    let run = clean(&van_der_pol());
    let late = run.column(0)[200..].iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
    // The amplitude is 2.02 at mu = 2; samples every 0.05 s miss the peak by less than 0.01.
    assert!((late - 2.02).abs() < 0.02, "{late}");
}

#[test]
fn noise_has_its_size_and_follows_the_seed() {
    let system = lotka_volterra();
    let truth = clean(&system);
    let noisy = |seed| system.sample_usual(SensorNoise::Absolute(0.2), seed).unwrap().runs()[0].clone();
    let (one, again, other) = (noisy(1), noisy(1), noisy(2));
    assert_eq!(one.values, again.values);
    assert_ne!(one.values, other.values);
    let n = truth.n_samples();
    let square = |i: usize| (one.values[(i, 0)] - truth.values[(i, 0)]).powi(2);
    let found = ((0..n).map(square).sum::<f64>() / n as f64).sqrt();
    // 301 samples: a relative deviation of 4 %.
    assert!((found - 0.2).abs() < 0.03, "{found}");
    assert!(system.sample_usual(SensorNoise::Relative(-0.1), 1).is_err());
    assert!(system.sample_usual(SensorNoise::PerState(vec![0.1]), 1).is_err());
}
