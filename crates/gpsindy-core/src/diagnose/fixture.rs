//! A machine for the tests: a first-order drive under square waves, which may lose more than its model says.

use crate::data::{Channel, Dataset, Run};
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State};
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Time between two samples, s.
const STEP: f64 = 0.05;

/// `x' = u - k*x` with k of one per second, known to `tolerance`, in whose place the machine loses `loses(x)`: `n_runs`
/// of `n_samples` under levels of either sign, with white noise of deviation `noise`.
pub(crate) fn drive(
    tolerance: Option<f64>,
    loses: impl Fn(f64) -> f64,
    noise: f64,
    size: (usize, usize),
) -> (Model, Dataset) {
    drive_of(5, tolerance, loses, noise, size)
}

/// As [`drive`], with the noise of a seed.
pub(crate) fn drive_of(
    seed: u64,
    tolerance: Option<f64>,
    loses: impl Fn(f64) -> f64,
    noise: f64,
    (n_runs, n_samples): (usize, usize),
) -> (Model, Dataset) {
    let model = Model {
        states: vec![State::new("x", Expression::parse("u - k*x").unwrap())],
        controls: vec![Control::new("u")],
        parameters: vec![Parameter { tolerance, ..Parameter::new("k", 1.0) }],
        ..Model::default()
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || (0..12).map(|_| (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64).sum::<f64>() - 6.0;
    let runs = (0..n_runs).map(|run| {
        let input = |i: usize| if ((i + 9 * run) / 40).is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut x = vec![0.0];
        for i in 1..n_samples {
            let slope = |x: f64| input(i - 1) - loses(x);
            x.push((0..10).fold(x[i - 1], |x, _| {
                let h = 0.1 * STEP;
                let (a, b) = (slope(x), slope(x + 0.5 * h * slope(x)));
                let c = slope(x + 0.5 * h * b);
                x + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(x + h * c))
            }));
        }
        let read: Vec<f64> = x.iter().map(|x| x + noise * normal()).collect();
        Run {
            name: format!("run {run}"),
            time: (0..n_samples).map(|i| STEP * i as f64).collect(),
            values: Mat::from_fn(n_samples, 2, |i, c| if c == 0 { read[i] } else { input(i) }),
        }
    });
    let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs.collect()).unwrap();
    (model, data)
}
