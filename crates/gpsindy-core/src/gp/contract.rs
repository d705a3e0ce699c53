//! The contract test of kernels: symmetry, positive definiteness, gradients and derivatives
//! that agree with differences. A new kernel joins by standing in [`kernels`].

use super::dense::{self, DenseWorkspace};
use super::kernel::covariance::{Lags, contract, derivatives, values};
use super::{Evaluation, Kernel, Points, Workspace};

pub(super) fn leaves() -> Vec<Kernel> {
    use Kernel::*;
    vec![SquaredExponential, Matern12, Matern32, Matern52, Periodic, RationalQuadratic]
}

pub(super) fn kernels() -> Vec<Kernel> {
    use Kernel::*;
    let mut all = leaves();
    all.push(SquaredExponential.plus(Periodic));
    all.push(SquaredExponential.times(Periodic));
    all.push(Matern32.times(RationalQuadratic).plus(Matern52));
    all.push(Matern52.times(SquaredExponential.plus(Periodic)));
    all
}

/// Hyperparameters of order one, all different.
pub(super) fn some_hyper(kernel: &Kernel, dimension: usize) -> Vec<f64> {
    (0..kernel.n_hyper(dimension)).map(|i| 0.3 * ((1.7 * i as f64 + 0.4).sin())).collect()
}

fn value(kernel: &Kernel, hyper: &[f64], lag: &[f64]) -> f64 {
    let columns: Vec<Vec<f64>> = lag.iter().map(|l| vec![*l]).collect();
    let mut out = [0.0];
    values(kernel, hyper, Lags { inputs: &columns, first: 0, origin: &vec![0.0; lag.len()] }, &mut out);
    out[0]
}

#[test]
fn every_kernel_is_symmetric_and_largest_at_lag_zero() {
    for kernel in kernels() {
        let hyper = some_hyper(&kernel, 1);
        let top = value(&kernel, &hyper, &[0.0]);
        for i in 1..60 {
            let lag = 0.11 * f64::from(i);
            let k = value(&kernel, &hyper, &[lag]);
            assert_eq!(k, value(&kernel, &hyper, &[-lag]), "{kernel}");
            assert!(k <= top * (1.0 + 1e-15), "{kernel}");
        }
    }
}

#[test]
fn every_kernel_is_positive_definite_in_one_and_several_dimensions() {
    for kernel in kernels() {
        for dimension in [1, 3] {
            let inputs =
                (0..dimension).map(|d| (0..40).map(|i| ((i * (d + 3)) as f64 * 0.77).sin() * 2.0).collect()).collect();
            let points = Points { inputs, targets: vec![0.0; 40], noise_weights: vec![] };
            let mut hyper = some_hyper(&kernel, dimension);
            // Rounding alone makes eigenvalues of -1e-15; a noise variance of 1e-10 is far above.
            hyper.push(1e-5f64.ln());
            let out = dense::likelihood(&kernel, &hyper, &points, 0.0, &mut [], &mut DenseWorkspace::default());
            assert!(out.is_some(), "{kernel} in {dimension} dimensions");
        }
    }
}

#[test]
fn hyperparameter_gradients_agree_with_differences() {
    for kernel in kernels() {
        for dimension in [1, 2] {
            let columns: Vec<Vec<f64>> =
                (0..dimension).map(|d| (0..200).map(|i| 0.013 * (i * (d + 1)) as f64).collect()).collect();
            let lags = Lags { inputs: &columns, first: 0, origin: &vec![0.0; dimension] };
            let weights: Vec<f64> = (0..200).map(|i| (0.9 * f64::from(i)).cos()).collect();
            let hyper = some_hyper(&kernel, dimension);
            let total = |hyper: &[f64]| {
                let mut out = vec![0.0; 200];
                values(&kernel, hyper, lags, &mut out);
                out.iter().zip(&weights).map(|(k, w)| k * w).sum::<f64>()
            };
            let mut gradient = vec![0.0; hyper.len()];
            contract(&kernel, &hyper, lags, &weights, &mut gradient);
            for p in 0..hyper.len() {
                let (mut up, mut down) = (hyper.clone(), hyper.clone());
                up[p] += 1e-5;
                down[p] -= 1e-5;
                let difference = (total(&up) - total(&down)) / 2e-5;
                // Central differences: 1e-10 of truncation, 1e-16 * 200 / 1e-5 of rounding.
                assert!(
                    (gradient[p] - difference).abs() < 1e-8 * (1.0 + 10.0 * difference.abs()),
                    "{kernel}, {p}: {} {difference}",
                    gradient[p]
                );
            }
        }
    }
}

#[test]
fn derivatives_along_time_agree_with_differences() {
    for kernel in kernels() {
        let hyper = some_hyper(&kernel, 1);
        for i in 1..40 {
            let lag = 0.07 * f64::from(i) * if i % 2 == 0 { 1.0 } else { -1.0 };
            let [k, slope, curvature] = derivatives(&kernel, &hyper, lag);
            assert!((k - value(&kernel, &hyper, &[lag])).abs() < 1e-14, "{kernel}");
            let h = 1e-5;
            let (up, down) = (derivatives(&kernel, &hyper, lag + h), derivatives(&kernel, &hyper, lag - h));
            // As above: truncation h^2, rounding 1e-16 / h.
            let (first, second) = ((up[0] - down[0]) / (2.0 * h), (up[1] - down[1]) / (2.0 * h));
            assert!((slope - first).abs() < 1e-8 * (1.0 + first.abs() + second.abs()), "{kernel} at {lag}");
            assert!((curvature - second).abs() < 1e-7 * (1.0 + second.abs()), "{kernel} at {lag}");
        }
        let [_, slope, curvature] = derivatives(&kernel, &hyper, 0.0);
        assert_eq!(kernel.differentiable(), curvature.is_finite(), "{kernel}");
        if kernel.differentiable() {
            assert!(slope.abs() < 1e-15 && curvature < 0.0, "{kernel}: {slope} {curvature}");
        }
    }
}

#[test]
fn likelihood_gradients_agree_with_differences() {
    for kernel in kernels() {
        let time: Vec<f64> = (0..30).map(|i| 0.2 * f64::from(i) + 0.03 * f64::from(i * i % 7)).collect();
        let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.1 * (17.0 * t).cos()).collect();
        let mut points = Points::in_time(&time, &values);
        points.noise_weights = (0..30).map(|i| 1.0 + f64::from(i % 3)).collect();
        let mut hyper = some_hyper(&kernel, 1);
        hyper.push(-1.5);
        let mut workspace = Workspace::default();
        let nll = |hyper: &[f64], gradient: &mut [f64], workspace: &mut Workspace| {
            Evaluation { kernel: &kernel, hyper, jitter: 0.0 }.likelihood(&points, gradient, workspace).unwrap()
        };
        let mut gradient = vec![0.0; hyper.len()];
        nll(&hyper, &mut gradient, &mut workspace);
        for p in 0..hyper.len() {
            let (mut up, mut down) = (hyper.clone(), hyper.clone());
            up[p] += 1e-5;
            down[p] -= 1e-5;
            let difference = (nll(&up, &mut [], &mut workspace) - nll(&down, &mut [], &mut workspace)) / 2e-5;
            assert!(
                (gradient[p] - difference).abs() < 1e-6 * (1.0 + difference.abs()),
                "{kernel}, {p}: {} {difference}",
                gradient[p]
            );
        }
    }
}

#[test]
fn names_are_read_back() {
    for kernel in kernels().into_iter().take(9) {
        assert_eq!(kernel.to_string().parse::<Kernel>().unwrap(), kernel);
    }
    let error = "matern72".parse::<Kernel>().unwrap_err().to_string();
    assert!(error.contains("matern52"), "{error}");
}
