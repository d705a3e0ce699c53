//! Machines for the tests: a first-order drive under square waves whose losses may differ from its model, and benches to
//! which every effect of the catalogue can be added.

use crate::data::{Channel, Dataset, Run};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::fitter::Fitter;
use crate::diagnose::fit::lagging::start_of;
use crate::diagnose::fit::outputs::trajectories;
use crate::diagnose::limits::Budget;
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State, System};
use crate::random::normal;
use crate::refine::{Experiment, Hold, guess_initial};
use crate::simulate::{Excitation, Simulate};
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

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

/// Logs of `x' = v` and `v' = rate(x, v, u)` at 50 Hz under `input(time, run)`: four runs of so many samples with white noise of these deviations.
pub(crate) fn slider(
    seed: u64,
    rate: impl Fn(f64, f64, f64) -> f64,
    input: impl Fn(f64, f64) -> f64,
    noise: [f64; 2],
    n_samples: usize,
) -> Dataset {
    const STEP: f64 = 0.02;
    const FINE: usize = 40;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let runs = (0..4).map(|run| {
        let time: Vec<f64> = (0..n_samples).map(|i| STEP * i as f64).collect();
        let (mut x, mut v, mut values) = (0.0, 0.0, Mat::zeros(n_samples, 3));
        for (i, &t) in time.iter().enumerate() {
            let u = input(t, f64::from(run));
            values[(i, 0)] = x + noise[0] * normal(&mut random);
            values[(i, 1)] = v + noise[1] * normal(&mut random);
            values[(i, 2)] = u;
            let h = STEP / FINE as f64;
            for _ in 0..FINE {
                let middle = v + 0.5 * h * rate(x, v, u);
                v += h * rate(x + 0.5 * h * v, middle, u);
                x += h * middle;
            }
        }
        Run { name: format!("{run}"), time, values }
    });
    Dataset::new(["x", "v", "u"].map(Channel::new).into(), runs.collect()).unwrap()
}

/// A model of states, each with its name, unit and rate.
pub(crate) fn model_of(states: &[(&str, &str, &str)]) -> Model {
    let state = |(name, unit, rate): &(&str, &str, &str)| State {
        unit: (*unit).into(),
        ..State::new(*name, Expression::parse(rate).unwrap())
    };
    Model { states: states.iter().map(state).collect(), ..Model::default() }
}

/// The model of a [`slider`] whose rate is this expression.
pub(crate) fn slider_model(rate: &str) -> Model {
    let state = |name: &str, equation: &str| State::new(name, Expression::parse(equation).unwrap());
    Model { states: vec![state("x", "v"), state("v", rate)], controls: vec![Control::new("u")], ..Model::default() }
}

/// The fit of a model of one column to logs with noise of a known deviation, and what fitted it.
pub(crate) fn fitted(model: &Model, data: &Dataset, noise: f64) -> (Fitter, Contestant) {
    let system = System::new(model).unwrap();
    let columns = model.states.iter().filter(|state| data.index_of(&state.name).is_ok()).count();
    let experiment = Experiment::new(&system, data, Some(&vec![noise; columns])).unwrap();
    let fitter = Fitter::default();
    (fitter, fitter.nominal(system, experiment, Vec::new(), Budget::Usual).unwrap())
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
        let read: Vec<f64> = x.iter().map(|x| x + noise * normal(&mut random)).collect();
        Run {
            name: format!("run {run}"),
            time: (0..n_samples).map(|i| STEP * i as f64).collect(),
            values: Mat::from_fn(n_samples, 2, |i, c| if c == 0 { read[i] } else { input(i) }),
        }
    });
    let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], runs.collect()).unwrap();
    (model, data)
}

/// A nominal model, how it is driven and from where it starts.
pub(crate) struct Bench {
    pub(crate) model: Model,
    /// The controls of a run at a time.
    drive: fn(usize, f64) -> Vec<f64>,
    start: Vec<f64>,
    /// Noise of the logs as a share of a column's spread.
    pub(crate) noise: f64,
}

/// Samples of a run, and runs; the last one is held out.
const SAMPLES: usize = 240;
const RUNS: usize = 4;

/// Levels of either sign, small ones and rests among them, that no filter of the plant can hide.
fn levels(run: usize, t: f64, hold: f64) -> f64 {
    let levels = [0.0, 1.8, -2.4, 0.3, -0.9, 2.7, 0.0, -1.5, 0.5, 2.1, -0.2, -2.0];
    levels[((t / hold) as usize + if t < hold { 0 } else { 5 * run }) % levels.len()]
}

/// A cart on a spring with a logged supply, a tank, and two masses on a spring.
pub(crate) fn benches() -> Vec<Bench> {
    let state = |name: &str, unit: &str, equation: &str| State {
        unit: unit.into(),
        ..State::new(name, Expression::parse(equation).unwrap())
    };
    let control = |name: &str, unit: &str| Control { name: name.into(), unit: unit.into() };
    let cart = Model {
        name: "cart".into(),
        states: vec![state("x", "m", "v"), state("v", "m/s", "g*u - k*x - b*v")],
        controls: vec![control("u", "N"), control("volts", "V")],
        parameters: vec![Parameter::new("g", 1.2), Parameter::new("k", 4.0), Parameter::new("b", 0.7)],
        ..Model::default()
    };
    let tank = Model {
        name: "tank".into(),
        states: vec![state("h", "m", "q*u - r*h")],
        controls: vec![control("u", "l/s")],
        parameters: vec![Parameter::new("q", 0.8), Parameter::new("r", 0.6)],
        ..Model::default()
    };
    let masses = Model {
        name: "masses".into(),
        states: vec![
            state("x", "m", "v"),
            state("v", "m/s", "u - k*(x - y) - b*v"),
            state("y", "m", "w"),
            state("w", "m/s", "k*(x - y) - c*w"),
        ],
        controls: vec![control("u", "N")],
        parameters: vec![Parameter::new("k", 9.0), Parameter::new("b", 0.8), Parameter::new("c", 0.9)],
        ..Model::default()
    };
    // An angle, by which a weight acts.
    let arm = Model {
        name: "arm".into(),
        states: vec![state("q", "rad", "w"), state("w", "rad/s", "g*u - k*q - b*w")],
        controls: vec![control("u", "N m")],
        parameters: vec![Parameter::new("g", 1.2), Parameter::new("k", 4.0), Parameter::new("b", 0.7)],
        ..Model::default()
    };
    let drive: fn(usize, f64) -> Vec<f64> =
        |run, t| vec![levels(run, t, 0.7), 12.0 + 3.0 * (0.9 * t + 1.3 * run as f64).sin()];
    let pump: fn(usize, f64) -> Vec<f64> = |run, t| vec![levels(run, t, 1.1).abs()];
    let push: fn(usize, f64) -> Vec<f64> = |run, t| vec![levels(run, t, 0.9)];
    let torque: fn(usize, f64) -> Vec<f64> = |run, t| vec![levels(run, t, 0.7)];
    let still = |states: usize| vec![0.0; states];
    [(cart, drive, still(2)), (tank, pump, vec![0.4]), (masses, push, still(4)), (arm, torque, still(2))]
        .map(|(model, drive, start)| Bench { model, drive, start, noise: 0.003 })
        .into()
}

impl Bench {
    /// Noise-free readings of the nominal states by `machine`, run by run; `None` where it diverges.
    fn readings(&self, machine: &Model) -> Option<Vec<Mat<f64>>> {
        let system = System::new(machine).ok()?;
        let time: Vec<f64> = (0..SAMPLES).map(|i| STEP * i as f64).collect();
        let one = |run: usize| {
            let values: Vec<Vec<f64>> = time.iter().map(|&t| (self.drive)(run, t)).collect();
            let controls = Mat::from_fn(SAMPLES, values[0].len(), |i, c| values[i][c]);
            let excitation = Excitation::new(&system, &time, controls.as_ref(), Hold::Zero).ok()?;
            let known = self.start.len();
            let mut start = self.start.clone();
            let first = |c: usize| values[0][c];
            start.extend(machine.states[known..].iter().map(|s| start_of(machine, s, &self.start, first)));
            Some(Simulate::default().rollout(&system, &excitation, &start).ok()?.outputs)
        };
        (0..RUNS).map(one).collect()
    }

    /// Logs of `machine` with white noise of a share `noise` of each column's spread: to learn from, and held out.
    pub(crate) fn logs(&self, machine: &Model, noise: f64) -> (Dataset, Dataset) {
        let readings = self.readings(machine).unwrap();
        let n = self.model.states.len();
        let spread: Vec<f64> = (0..n).map(|j| spread(&readings, j)).collect();
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let mut runs: Vec<Run> = Vec::new();
        for (run, readings) in readings.iter().enumerate() {
            let time: Vec<f64> = (0..SAMPLES).map(|i| STEP * i as f64).collect();
            let noisy = Mat::from_fn(SAMPLES, n, |i, j| readings[(i, j)] + noise * spread[j] * normal(&mut random));
            let drive: Vec<Vec<f64>> = time.iter().map(|&t| (self.drive)(run, t)).collect();
            let values =
                Mat::from_fn(SAMPLES, n + drive[0].len(), |i, j| if j < n { noisy[(i, j)] } else { drive[i][j - n] });
            runs.push(Run { name: format!("run {run}"), time, values });
        }
        let channels = || self.model.states.iter().map(|s| Channel::new(&s.name));
        let controls = || self.model.controls.iter().map(|c| Channel::new(&c.name));
        let held = runs.split_off(RUNS - 1);
        let set = |runs| Dataset::new(channels().chain(controls()).collect(), runs).unwrap();
        (set(runs), set(held))
    }

    /// Root mean square difference of two machines' readings, as a share of each column's spread; not finite where one
    /// diverges.
    pub(crate) fn gap_between(&self, one: &Model, other: &Model) -> f64 {
        let (Some(one), Some(other)) = (self.readings(one), self.readings(other)) else { return f64::INFINITY };
        let n = self.model.states.len();
        let mut sum = 0.0;
        for j in 0..n {
            let spread = spread(&other, j);
            for (a, b) in one.iter().zip(&other) {
                sum += (0..SAMPLES).map(|i| ((a[(i, j)] - b[(i, j)]) / spread).powi(2)).sum::<f64>();
            }
        }
        (sum / (n * RUNS * SAMPLES) as f64).sqrt()
    }

    /// The same between a machine and the nominal model.
    pub(crate) fn gap(&self, machine: &Model) -> f64 {
        self.gap_between(machine, &self.model)
    }

    /// What the nominal model's logs excite.
    pub(crate) fn scene(&self) -> Scene {
        let system = System::new(&self.model).unwrap();
        let experiment = Experiment::new(&system, &self.logs(&self.model, 0.0).0, None).unwrap();
        let initial = guess_initial(&system, &experiment);
        Scene::new(&system, &experiment, &trajectories(&system, &experiment, &system.parameter_values(), &initial))
    }
}

/// Standard deviation of a column over all runs.
fn spread(readings: &[Mat<f64>], column: usize) -> f64 {
    let values = || readings.iter().flat_map(|r| (0..SAMPLES).map(move |i| r[(i, column)]));
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    (values().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}
