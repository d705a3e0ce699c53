//! Test systems with known equations: models, usual starts and controls, and noisy logs of them.

use crate::data::{Channel, Dataset, Hold, Run};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::model::{Control, Model, Parameter, State};
use crate::simulate::{Excitation, Simulate};
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// A system whose equations are known, with the way in which it is usually run.
///
/// ```
/// use gpsindy_core::systems::{SensorNoise, lotka_volterra};
/// let system = lotka_volterra();
/// let data = system.sample_usual(SensorNoise::Relative(0.05), 1)?;
/// assert_eq!(data.runs()[0].n_samples(), 301);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct TestSystem {
    /// The equations, with the usual initial state.
    pub model: Model,
    /// The usual controls (m) as functions of time, s.
    pub controls: fn(f64) -> Vec<f64>,
    /// Usual sampling period, s.
    pub period: f64,
    /// Usual length of a run, s.
    pub duration: f64,
}

/// White noise that is added to every logged column.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SensorNoise {
    /// None.
    None,
    /// A standard deviation for each state, in its unit.
    PerState(Vec<f64>),
    /// The same standard deviation for every state.
    Absolute(f64),
    /// This share of each column's own standard deviation.
    Relative(f64),
}

impl TestSystem {
    /// The usual initial state (n).
    pub fn initial(&self) -> Vec<f64> {
        self.model.states.iter().map(|s| self.model.initial.get(&s.name).copied().unwrap_or(0.0)).collect()
    }

    /// The usual sample times, s.
    pub fn times(&self) -> Vec<f64> {
        let n_steps = (self.duration / self.period).round() as usize;
        (0..=n_steps).map(|i| self.period * i as f64).collect()
    }

    /// One run at the usual times from the usual state under the usual controls.
    ///
    /// # Errors
    /// As [`TestSystem::sample`].
    pub fn sample_usual(&self, noise: SensorNoise, seed: u64) -> Result<Dataset> {
        self.sample(&self.times(), &self.initial(), noise, seed)
    }

    /// One run with samples at `times` (s) from `initial` (n), its controls held between the samples.
    ///
    /// Channels are the states, then the controls; only the states carry noise. The same seed gives the same
    /// noise on every machine.
    ///
    /// # Errors
    /// A noise level that is negative or not finite, wrong sizes, times that do not increase.
    pub fn sample(&self, times: &[f64], initial: &[f64], noise: SensorNoise, seed: u64) -> Result<Dataset> {
        let system = self.model.compile()?;
        let (n, m) = (system.n_states(), system.n_controls());
        let mut controls = Mat::zeros(times.len(), m);
        for (i, &t) in times.iter().enumerate() {
            for (j, value) in (self.controls)(t).into_iter().take(m).enumerate() {
                controls[(i, j)] = value;
            }
        }
        let excitation = Excitation::new(&system, times, controls.as_ref(), Hold::Zero)?;
        let settings = Simulate { tolerance: 1e-10, ..Simulate::default() };
        let clean = settings.rollout(&system, &excitation, initial)?.outputs;
        let levels = levels(&clean, noise)?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut values = Mat::zeros(times.len(), n + m);
        for i in 0..times.len() {
            for j in 0..n {
                values[(i, j)] = clean[(i, j)] + levels[j] * standard_normal(&mut random);
            }
            for j in 0..m {
                values[(i, n + j)] = controls[(i, j)];
            }
        }
        let states = self.model.states.iter().map(|s| Channel::new(&s.name).with_unit(&s.unit));
        let channels = states.chain(self.model.controls.iter().map(|c| Channel::new(&c.name).with_unit(&c.unit)));
        let run = Run { name: self.model.name.clone(), time: times.to_vec(), values };
        Dataset::new(channels.collect(), vec![run])
    }
}

fn levels(clean: &Mat<f64>, noise: SensorNoise) -> Result<Vec<f64>> {
    let n = clean.ncols();
    let deviation = |j: usize| {
        let column = clean.col_as_slice(j);
        let mean = column.iter().sum::<f64>() / column.len() as f64;
        (column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / column.len() as f64).sqrt()
    };
    let levels = match noise {
        SensorNoise::None => vec![0.0; n],
        SensorNoise::PerState(levels) if levels.len() != n => {
            return Err(Error::shape("noise", format!("{n} values"), levels.len()));
        }
        SensorNoise::PerState(levels) => levels,
        SensorNoise::Absolute(level) => vec![level; n],
        SensorNoise::Relative(share) => (0..n).map(|j| share * deviation(j)).collect(),
    };
    match levels.iter().find(|level| !(level.is_finite() && **level >= 0.0)) {
        Some(wrong) => Err(Error::range("noise", "0 or above", wrong)),
        None => Ok(levels),
    }
}

/// Box and Muller's transform of two uniform numbers, one of its two values.
fn standard_normal(random: &mut ChaCha8Rng) -> f64 {
    let scale = 1.0 / (1_u64 << 53) as f64;
    // Above 0, so that the logarithm is finite.
    let radius = ((random.next_u64() >> 11) as f64 + 1.0) * scale;
    let angle = (random.next_u64() >> 11) as f64 * scale;
    (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
}

/// A row: name, unit, equation, initial value.
type StateRow = (&'static str, &'static str, &'static str, f64);

fn build(
    name: &str,
    states: &[StateRow],
    controls: &[(&str, &str)],
    parameters: &[(&str, &str, f64)],
    (control, period, duration): (fn(f64) -> Vec<f64>, f64, f64),
) -> TestSystem {
    let state = |&(name, unit, equation, _): &StateRow| State {
        unit: unit.into(),
        // The tests compile every system, so that this never shows.
        ..State::new(name, Expression::parse(equation).unwrap_or(Expression::Number(f64::NAN)))
    };
    let model = Model {
        name: name.into(),
        states: states.iter().map(state).collect(),
        controls: controls.iter().map(|&(name, unit)| Control { name: name.into(), unit: unit.into() }).collect(),
        parameters: parameters
            .iter()
            .map(|&(name, unit, value)| Parameter { unit: unit.into(), ..Parameter::new(name, value) })
            .collect(),
        initial: states.iter().map(|&(name, _, _, initial)| (name.to_string(), initial)).collect(),
        ..Model::default()
    };
    TestSystem { model, controls: control, period, duration }
}

fn no_controls(_: f64) -> Vec<f64> {
    Vec::new()
}

/// Every system of this module.
pub fn all() -> Vec<TestSystem> {
    vec![
        lotka_volterra(),
        unicycle(),
        lorenz(),
        duffing(),
        van_der_pol(),
        pendulum(),
        cart_pole(),
        double_tank(),
        planar_quadrotor(),
        epidemic(),
    ]
}

/// Prey `x1` and predators `x2`; `d x1 - c log x1 + b x2 - a log x2` is constant.
///
/// Source: the paper, section V-A (its numbers of animals are without a unit).
pub fn lotka_volterra() -> TestSystem {
    build(
        "lotka_volterra",
        &[("x1", "", "a*x1 - b*x1*x2", 10.0), ("x2", "", "-c*x2 + d*x1*x2", 5.0)],
        &[],
        &[("a", "1/s", 1.1), ("b", "1/s", 0.4), ("c", "1/s", 1.0), ("d", "1/s", 0.4)],
        (no_controls, 0.1, 30.0),
    )
}

/// A unicycle: position `x1`, `x2`, speed `x3`, heading `x4`; acceleration `u1`, turning rate `u2`.
///
/// Source: the paper, section V-B.
pub fn unicycle() -> TestSystem {
    build(
        "unicycle",
        &[
            ("x1", "m", "x3*cos(x4)", 0.0),
            ("x2", "m", "x3*sin(x4)", 0.0),
            ("x3", "m/s", "u1", 0.5),
            ("x4", "rad", "u2", 0.5),
        ],
        &[("u1", "m/s^2"), ("u2", "rad/s")],
        &[],
        (|t| vec![t.sin(), 0.5 * t.cos()], 0.1, 20.0),
    )
}

/// Chaotic convection.
///
/// Source: Lorenz 1963, Deterministic nonperiodic flow.
pub fn lorenz() -> TestSystem {
    build(
        "lorenz",
        &[("x", "", "s*(y - x)", -8.0), ("y", "", "x*(r - z) - y", 8.0), ("z", "", "x*y - b*z", 27.0)],
        &[],
        &[("s", "1/s", 10.0), ("r", "", 28.0), ("b", "1/s", 8.0 / 3.0)],
        (no_controls, 0.01, 10.0),
    )
}

/// The terms of [`lorenz`] multiplied out: number of the equation, term of a library of degree 2, coefficient.
pub const LORENZ_TERMS: [(usize, &str, f64); 7] = [
    (0, "x", -10.0),
    (0, "y", 10.0),
    (1, "x", 28.0),
    (1, "x*z", -1.0),
    (1, "y", -1.0),
    (2, "x*y", 1.0),
    (2, "z", -8.0 / 3.0),
];

/// A driven beam between two magnets: linear stiffness `k` below 0, cubic stiffness `c`.
pub fn duffing() -> TestSystem {
    build(
        "duffing",
        &[("x", "m", "v", 0.5), ("v", "m/s", "u - d*v - k*x - c*x^3", 0.0)],
        &[("u", "m/s^2")],
        &[("d", "1/s", 0.3), ("k", "1/s^2", -1.0), ("c", "1/(m^2*s^2)", 1.0)],
        (|t| vec![0.5 * (1.2 * t).cos()], 0.02, 40.0),
    )
}

/// A relaxation oscillator with the limit cycle of amplitude 2.
pub fn van_der_pol() -> TestSystem {
    build(
        "van_der_pol",
        &[("x", "", "v", 0.5), ("v", "1/s", "mu*(1 - x^2)*v - x", 0.0)],
        &[],
        &[("mu", "1/s", 2.0)],
        (no_controls, 0.05, 20.0),
    )
}

/// A pendulum with viscous and dry friction, driven by a torque.
pub fn pendulum() -> TestSystem {
    build(
        "pendulum",
        &[("phi", "rad", "om", 1.2), ("om", "rad/s", "(u - m*g*l*sin(phi) - b*om - c*tanh(om/0.02))/(m*l^2)", 0.0)],
        &[("u", "N*m")],
        &[("m", "kg", 0.5), ("l", "m", 0.4), ("g", "m/s^2", 9.81), ("b", "N*m*s", 0.01), ("c", "N*m", 0.02)],
        (|t| vec![0.6 * (2.0 * t).sin() + 0.3 * (5.3 * t).sin()], 0.02, 20.0),
    )
}

/// A pole (mass `m`, half length `l`) on a cart (mass `mc`); `th` is 0 where the pole is upright.
///
/// Source: Florian 2007, Correct equations for the dynamics of the cart-pole system, without friction.
pub fn cart_pole() -> TestSystem {
    let angular = "(g*sin(th) - cos(th)*(f + m*l*om^2*sin(th))/(mc + m))/(l*(4/3 - m*cos(th)^2/(mc + m)))";
    let linear: &'static str = "(f + m*l*(om^2*sin(th) - cos(th)*(g*sin(th) - cos(th)*(f + m*l*om^2*sin(th))/(mc + m))/(l*(4/3 - m*cos(th)^2/(mc + m)))))/(mc + m)";
    build(
        "cart_pole",
        &[("x", "m", "v", 0.0), ("th", "rad", "om", 2.6), ("v", "m/s", linear, 0.0), ("om", "rad/s", angular, 0.0)],
        &[("f", "N")],
        &[("mc", "kg", 1.0), ("m", "kg", 0.1), ("l", "m", 0.5), ("g", "m/s^2", 9.81)],
        (|t| vec![(1.7 * t).sin() + 0.6 * (4.1 * t).cos()], 0.02, 10.0),
    )
}

/// Two tanks in a row, levels `h1`, `h2`; the pump's flow `q` enters the first.
pub fn double_tank() -> TestSystem {
    build(
        "double_tank",
        &[
            ("h1", "m", "(q - a1*sqrt(2*g*max(h1, 0)))/s1", 0.05),
            ("h2", "m", "(a1*sqrt(2*g*max(h1, 0)) - a2*sqrt(2*g*max(h2, 0)))/s2", 0.1),
        ],
        &[("q", "m^3/s")],
        &[("s1", "m^2", 0.0154), ("s2", "m^2", 0.0154), ("a1", "m^2", 5e-5), ("a2", "m^2", 5e-5), ("g", "m/s^2", 9.81)],
        (|t| vec![1e-4 + 4e-5 * (0.02 * t).sin().signum() + 2e-5 * (0.07 * t).sin()], 1.0, 600.0),
    )
}

/// A quadrotor in a vertical plane: thrust `u1` and torque `u2`, which keeps it near hovering.
pub fn planar_quadrotor() -> TestSystem {
    build(
        "planar_quadrotor",
        &[
            ("x", "m", "vx", 0.0),
            ("z", "m", "vz", 1.0),
            ("th", "rad", "om", 0.05),
            ("vx", "m/s", "-u1*sin(th)/m", 0.0),
            ("vz", "m/s", "u1*cos(th)/m - g", 0.0),
            ("om", "rad/s", "u2/j", 0.0),
        ],
        &[("u1", "N"), ("u2", "N*m")],
        &[("m", "kg", 0.5), ("j", "kg*m^2", 0.005), ("g", "m/s^2", 9.81)],
        (|t| vec![0.5 * 9.81 + 0.3 * (2.0 * t).sin(), 0.01 * (3.0 * t).cos()], 0.02, 6.0),
    )
}

/// An epidemic: shares of the susceptible, infected and recovered, which add up to 1. Time is in days.
///
/// Source: Kermack, McKendrick 1927, A contribution to the mathematical theory of epidemics.
pub fn epidemic() -> TestSystem {
    build(
        "epidemic",
        &[("s", "", "-b*s*i", 0.99), ("i", "", "b*s*i - g*i", 0.01), ("r", "", "g*i", 0.0)],
        &[],
        &[("b", "1/d", 0.4), ("g", "1/d", 0.1)],
        (no_controls, 1.0, 100.0),
    )
}

#[cfg(test)]
mod tests;
