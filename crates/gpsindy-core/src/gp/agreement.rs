//! The three engines are exact, so they must agree: likelihood, gradient, leave-one-out, posterior.

use super::contract::{kernels, some_hyper};
use super::quantity::Quantity;
use super::{Conditioned, Engine, Evaluation, Fit, Kernel, Points, Posterior, Workspace};

fn uniform(n: usize) -> Points {
    let time: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
    let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.2 * (5.0 * t).cos()).collect();
    Points::in_time(&time, &values)
}

fn irregular(n: usize) -> Points {
    let mut points = uniform(n);
    points.inputs[0]
        .iter_mut()
        .enumerate()
        .for_each(|(i, t)| *t += 0.04 * (2.3 * i as f64).sin() + if i > n / 2 { 3.0 } else { 0.0 });
    points.inputs[0][5] = points.inputs[0][4];
    points.noise_weights = (0..n).map(|i| 0.5 + (i % 4) as f64).collect();
    points
}

fn agree(kernel: &Kernel, points: &Points, engine: Engine, noise: f64, tolerance: f64) {
    let mut hyper = some_hyper(kernel, 1);
    hyper.push(noise.ln());
    let evaluation = Evaluation { kernel, hyper: &hyper, jitter: 0.0 };
    let mut workspace = Workspace::default();
    let (mut expected, mut found) = (vec![0.0; hyper.len()], vec![0.0; hyper.len()]);
    let dense = evaluation.likelihood_by(Engine::Dense, points, &mut expected, &mut workspace).unwrap();
    let fast = evaluation.likelihood_by(engine, points, &mut found, &mut workspace).unwrap();
    assert!((dense - fast).abs() < tolerance * (1.0 + dense.abs()), "{kernel}: {dense} {fast}");
    let value = evaluation.likelihood_by(engine, points, &mut [], &mut workspace).unwrap();
    assert!((value - fast).abs() < 1e-12 * (1.0 + fast.abs()), "{kernel}: {value} {fast}");
    let size = expected.iter().fold(1.0f64, |m, g| m.max(g.abs()));
    for (e, f) in expected.iter().zip(&found) {
        assert!((e - f).abs() < tolerance * size, "{kernel}: {expected:?} {found:?}");
    }
    let out = evaluation.leave_one_out_by(Engine::Dense, points, &mut workspace).unwrap();
    let other = evaluation.leave_one_out_by(engine, points, &mut workspace).unwrap();
    let largest = out.weights.iter().fold(0.0f64, |m, w| m.max(w.abs()));
    for i in 0..points.len() {
        assert!((out.weights[i] - other.weights[i]).abs() < tolerance * largest, "{kernel}");
        assert!((out.diagonal[i] / other.diagonal[i] - 1.0).abs() < tolerance, "{kernel}");
    }
}

#[test]
fn toeplitz_agrees_with_dense() {
    for kernel in kernels() {
        for n in [2, 3, 17, 100] {
            // Condition numbers reach n/noise^2 = 1e4; rounding of 1e-16 leaves 1e-12, the bound is the promise.
            agree(&kernel, &uniform(n), Engine::Toeplitz, 0.1, 1e-8);
        }
        agree(&kernel, &uniform(60), Engine::Toeplitz, 0.01, 1e-8);
    }
}

#[test]
fn state_space_agrees_with_dense_on_irregular_weighted_times() {
    for kernel in [Kernel::Matern12, Kernel::Matern32, Kernel::Matern52] {
        for n in [8, 120] {
            agree(&kernel, &irregular(n), Engine::StateSpace, 0.1, 1e-9);
            agree(&kernel, &irregular(n), Engine::StateSpace, 0.01, 1e-9);
        }
        agree(&kernel, &uniform(120), Engine::StateSpace, 0.1, 1e-9);
    }
}

#[test]
fn toeplitz_agrees_with_dense_where_there_is_next_to_no_noise() {
    // Ratios of the variances down to 1e-12 of the unit amplitude, around and below which a fit's floor of the noise lies.
    for (noise, tolerance) in [(1e-3, 1e-6), (1e-4, 1e-4), (1e-5, 1e-2)] {
        for kernel in kernels() {
            for n in [2, 3, 17, 200] {
                // Both engines lose the condition number, n/noise^2 and more of a periodic process, of their sixteen digits.
                agree(&kernel, &uniform(n), Engine::Toeplitz, noise, tolerance);
            }
        }
    }
}

/// A fit with given hyperparameters, scale one.
fn with_hyper(kernel: Kernel, hyper: Vec<f64>, noise: f64) -> Fit {
    Fit {
        kernel,
        hyper,
        dimension: 1,
        noise,
        noise_floor: 1e-4,
        scale: 1.0,
        mean: 0.0,
        nll: 0.0,
        jitter: 0.0,
        engine: Engine::Dense,
        converged: true,
        weak: vec![],
        candidates: vec![],
    }
}

/// Posteriors of the smoother and, by a sum that has no state-space form but is the same process, of the dense engine.
fn smoothed_and_dense(kernel: &Kernel, noise: f64, points: &Points, at: &[Vec<f64>], joint: bool) -> [Posterior; 2] {
    let both = [Quantity::Value, Quantity::Derivative];
    let sum = kernel.clone().plus(Kernel::SquaredExponential);
    [(kernel.clone(), vec![0.2, -0.1]), (sum, vec![0.2, -0.1, -60.0, 0.0])].map(|(kernel, hyper)| {
        Conditioned::new(&with_hyper(kernel, hyper, noise), points).unwrap().predict(at, &both, joint).unwrap()
    })
}

fn assert_same_law([a, b]: &[Posterior; 2], kernel: &Kernel) {
    assert_eq!(a.mean.len(), b.mean.len());
    for i in 0..a.mean.len() {
        let (mean, other) = (a.mean[i], b.mean[i]);
        assert!((mean - other).abs() < 1e-9 * (1.0 + other.abs()), "{kernel} {i}: {mean} {other}");
        let (variance, other) = (a.variance[i], b.variance[i]);
        assert!((variance - other).abs() < 1e-9 * (1.0 + other), "{kernel} {i}: {variance} {other}");
    }
}

#[test]
fn the_smoother_agrees_with_the_dense_posterior() {
    let at = vec![vec![-0.5, 0.0, 0.31, 0.4, 2.0, 2.0, 1.2, 5.9, 9.0, 12.0]];
    for kernel in [Kernel::Matern32, Kernel::Matern52] {
        let laws = smoothed_and_dense(&kernel, 0.05, &irregular(60), &at, true);
        assert_same_law(&laws, &kernel);
        let [a, b] = laws.map(|law| law.covariance.unwrap());
        for (i, j) in (0..20).flat_map(|i| (0..20).map(move |j| (i, j))) {
            assert!((a[(i, j)] - b[(i, j)]).abs() < 1e-9, "{kernel} {i} {j}: {} {}", a[(i, j)], b[(i, j)]);
        }
    }
}

#[test]
fn four_stretches_side_by_side_agree_with_the_dense_posterior() {
    let n = 900;
    for points in [uniform(n), irregular(n)] {
        let own = points.inputs.clone();
        // Between the points, beyond both ends, some times twice and in no order.
        let between = vec![(0..700).map(|i| 97.0 * (0.5 + 0.55 * (i as f64).sin()) - 3.0).collect()];
        for (at, kernel, noise) in [
            (&own, Kernel::Matern52, 0.05),
            (&own, Kernel::Matern32, 0.5),
            (&own, Kernel::Matern52, 1e-3),
            (&between, Kernel::Matern52, 0.2),
        ] {
            assert_same_law(&smoothed_and_dense(&kernel, noise, &points, at, false), &kernel);
        }
        for kernel in [Kernel::Matern12, Kernel::Matern32, Kernel::Matern52] {
            agree(&kernel, &points, Engine::StateSpace, 0.1, 1e-9);
        }
    }
}

#[test]
fn the_derivative_posterior_is_the_slope_of_the_mean() {
    for kernel in kernels().into_iter().filter(Kernel::differentiable) {
        let hyper = some_hyper(&kernel, 1);
        let process = Conditioned::new(&with_hyper(kernel.clone(), hyper, 0.1), &uniform(50)).unwrap();
        let mean = |t: f64| process.predict(&[vec![t]], &[Quantity::Value], false).unwrap().mean[0];
        let slope = process.predict(&[vec![2.34]], &[Quantity::Derivative], false).unwrap().mean[0];
        // Central difference: h^2 of truncation and 1e-14/h of rounding.
        assert!((slope - (mean(2.34 + 1e-5) - mean(2.34 - 1e-5)) / 2e-5).abs() < 1e-6, "{kernel}");
    }
}

#[test]
fn a_long_log_is_smoothed_block_by_block_to_the_same_answer() {
    // Three blocks of the smoother; a fit of the same process sees the middle alone, where the ends are forgotten.
    let n = 40_000;
    let whole = Points::in_time(&irregular(n).inputs[0], &uniform(n).targets);
    let part = |column: &[f64]| column[16_000..17_000].to_vec();
    let middle = Points { inputs: vec![part(&whole.inputs[0])], targets: part(&whole.targets), noise_weights: vec![] };
    let evaluation = Evaluation { kernel: &Kernel::Matern52, hyper: &[0.0, 0.0, -2.0], jitter: 0.0 };
    let long = evaluation.leave_one_out(&whole, &mut Workspace::default()).unwrap();
    let short = evaluation.leave_one_out(&middle, &mut Workspace::default()).unwrap();
    for i in 300..700 {
        // Thirty lengths to either end: their memory is e^-60.
        assert!((long.weights[16_000 + i] - short.weights[i]).abs() < 1e-9, "{i}");
        assert!((long.diagonal[16_000 + i] / short.diagonal[i] - 1.0).abs() < 1e-10, "{i}");
    }
}
