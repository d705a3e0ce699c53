//! Likelihood with gradient by each engine, and the smoother: `cargo bench -p gpsindy-benches`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gpsindy_core::gp::{Conditioned, Engine, Evaluation, FitSettings, Kernel, Points, Quantity, Workspace, fit};
use std::hint::black_box;

fn points(n: usize) -> Points {
    shifted(n, 0.0)
}

/// Every time moved off the clock by up to `shift` seconds.
fn shifted(n: usize, shift: f64) -> Points {
    let time: Vec<f64> = (0..n).map(|i| 0.1 * i as f64 + shift * (i as f64).sin()).collect();
    let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.1 * (37.0 * t * t).sin()).collect();
    Points::in_time(&time, &values)
}

/// Squared exponential, amplitude, length and noise of order one, 1 and 0.14.
fn quadratic_and_cubic(c: &mut Criterion) {
    let mut group = c.benchmark_group("likelihood and gradient, se");
    group.sample_size(10);
    for n in [300, 1000, 3000] {
        let points = points(n);
        for engine in [Engine::Dense, Engine::Toeplitz] {
            let (mut workspace, mut gradient) = (Workspace::default(), [0.0; 3]);
            group.bench_function(BenchmarkId::new(format!("{engine:?}"), n), |b| {
                b.iter(|| {
                    let hyper = black_box([0.0, 0.0, -2.0]);
                    let evaluation = Evaluation { kernel: &Kernel::SquaredExponential, hyper: &hyper, jitter: 0.0 };
                    evaluation.likelihood_by(engine, &points, &mut gradient, &mut workspace)
                });
            });
        }
    }
    group.finish();
}

/// The throughput is points a second: 1e9 over it are nanoseconds a point.
fn linear(c: &mut Criterion) {
    let mut group = c.benchmark_group("likelihood and gradient, state space");
    group.sample_size(10);
    for n in [1000usize, 10_000, 1_000_000] {
        group.throughput(Throughput::Elements(n as u64));
        let points = points(n);
        for kernel in [Kernel::Matern12, Kernel::Matern32, Kernel::Matern52] {
            let (mut workspace, mut gradient) = (Workspace::default(), [0.0; 3]);
            group.bench_function(BenchmarkId::new(kernel.to_string(), n), |b| {
                b.iter(|| {
                    let hyper = black_box([0.0, 0.0, -2.0]);
                    let evaluation = Evaluation { kernel: &kernel, hyper: &hyper, jitter: 0.0 };
                    evaluation.likelihood_by(Engine::StateSpace, &points, &mut gradient, &mut workspace)
                });
            });
        }
    }
    group.finish();
}

/// Means and variances of value and derivative at every point, everything around the recursions included.
fn smoothing(c: &mut Criterion) {
    let mut group = c.benchmark_group("value and derivative with variances, matern52");
    group.sample_size(10);
    for (clock, shift) in [("uniform", 0.0), ("irregular", 0.03)] {
        let Ok(fitted) = fit(&[Kernel::Matern52], &[shifted(200, shift)], &FitSettings::default()) else { continue };
        for n in [10_000usize, 100_000, 1_000_000] {
            group.throughput(Throughput::Elements(n as u64));
            let points = shifted(n, shift);
            group.bench_function(BenchmarkId::new(clock, n), |b| {
                let both = [Quantity::Value, Quantity::Derivative];
                b.iter(|| Conditioned::new(&fitted, &points)?.predict(black_box(&points.inputs), &both, false));
            });
        }
    }
    group.finish();
}

/// Noise near the floor of a fit, where the covariance is nearly singular.
fn little_noise(c: &mut Criterion) {
    let mut group = c.benchmark_group("likelihood and gradient, se, noise 1e-4");
    group.sample_size(10);
    for n in [300, 1000] {
        let points = points(n);
        for engine in [Engine::Dense, Engine::Toeplitz] {
            let (mut workspace, mut gradient) = (Workspace::default(), [0.0; 3]);
            group.bench_function(BenchmarkId::new(format!("{engine:?}"), n), |b| {
                b.iter(|| {
                    let hyper = black_box([0.0, 0.0, -9.2]);
                    let evaluation = Evaluation { kernel: &Kernel::SquaredExponential, hyper: &hyper, jitter: 0.0 };
                    evaluation.likelihood_by(engine, &points, &mut gradient, &mut workspace)
                });
            });
        }
    }
    group.finish();
}

fn whole_fit(c: &mut Criterion) {
    let runs = [points(240)];
    let mut group = c.benchmark_group("fit, 240 samples");
    group.sample_size(10);
    for kernel in [Kernel::SquaredExponential, Kernel::Matern52, Kernel::RationalQuadratic] {
        let kernels = [kernel];
        group.bench_function(kernels[0].to_string(), |b| b.iter(|| fit(&kernels, &runs, &FitSettings::default())));
    }
    group.finish();
}

criterion_group!(benches, quadratic_and_cubic, linear, smoothing, little_noise, whole_fit);
criterion_main!(benches);
