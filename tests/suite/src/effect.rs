//! The true effects: the ways in which a real plant departs from its nominal model.

use crate::integrate::Values;
use crate::plant::Plant;

/// A variable that an effect depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variable {
    /// A state by index.
    State(usize),
    /// A control by index.
    Control(usize),
    /// A parameter by index.
    Parameter(usize),
}

/// Dry friction: the force that opposes motion, and the one that holds at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Friction {
    /// The same level everywhere.
    Coulomb { c: f64 },
    /// Falls from `s` at rest to `c` in motion, over the speed `w`.
    Stribeck { c: f64, s: f64, w: f64 },
    /// One level a direction.
    Asymmetric { up: f64, down: f64 },
    /// Grows with the size of another variable.
    Loaded { c: f64, load: Variable },
    /// Only near one place.
    Placed { c: f64, position: usize, at: f64, width: f64 },
}

/// How an actuator departs from its command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Actuator {
    Gain {
        c: f64,
    },
    Bias {
        c: f64,
    },
    Saturation {
        c: f64,
    },
    DeadZone {
        c: f64,
    },
    Delay {
        tau: f64,
    },
    Lag {
        tau: f64,
    },
    Play {
        c: f64,
    },
    RateLimit {
        c: f64,
    },
    /// The limit `s` at standstill falls to nothing at the speed `z0` of a state.
    SpeedLimit {
        s: f64,
        z0: f64,
        speed: usize,
    },
}

/// How a column departs from its state.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Sensor {
    Bias {
        c: f64,
    },
    Scale {
        c: f64,
    },
    Delay {
        tau: f64,
    },
    /// A low pass.
    Filter {
        tau: f64,
    },
    /// Reads the state at the time `(1 - slow) t`.
    Clock {
        slow: f64,
    },
}

/// What an effect does.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Act {
    Parameter {
        index: usize,
        value: f64,
    },
    Constant {
        c: f64,
    },
    Linear {
        z: Variable,
        c: f64,
    },
    Quadratic {
        z: Variable,
        c: f64,
    },
    Cubic {
        z: Variable,
        c: f64,
    },
    Sine {
        z: Variable,
        c: f64,
        n: f64,
        phase: f64,
    },
    Product {
        z: Variable,
        w: Variable,
        c: f64,
    },
    Periodic {
        c: f64,
        omega: f64,
        phase: f64,
    },
    Step {
        c: f64,
        t0: f64,
    },
    Drift {
        c: f64,
    },
    Friction {
        law: Friction,
    },
    Actuator {
        control: usize,
        law: Actuator,
    },
    Sensor {
        law: Sensor,
    },
    /// A spring that touches beyond an edge: `-c max(0, side (z - edge)) side`.
    Contact {
        z: Variable,
        c: f64,
        edge: f64,
        side: f64,
    },
    /// `c exp(side (z - edge)/w)`, a rise that no polynomial of the catalogue has.
    Exponential {
        z: Variable,
        c: f64,
        edge: f64,
        w: f64,
    },
    /// `c / (|z| + w)`, as of adhesion or of a supply at constant power.
    Inverse {
        z: Variable,
        c: f64,
        w: f64,
    },
    /// `c a b d`.
    Triple {
        a: Variable,
        b: Variable,
        d: Variable,
        c: f64,
    },
    /// A small mass on a spring that the model lacks: `c` its share of mass.
    Resonance {
        position: usize,
        velocity: usize,
        c: f64,
        omega: f64,
        damping: f64,
    },
    /// Bouc-Wen: a spring with memory, `-c h`, `h' = v - |v| h |h| / w^2`.
    Hysteresis {
        velocity: usize,
        c: f64,
        w: f64,
    },
    /// Bouc-Wen with an exponent of one: `-c h`, `h' = v - b |v| h - g v |h|`.
    Memory {
        velocity: usize,
        c: f64,
        b: f64,
        g: f64,
    },
    /// The whole equation is divided by `1 + c`.
    Inertia {
        c: f64,
    },
    /// A parameter divided by `1 + h z`.
    Saturating {
        index: usize,
        z: usize,
        h: f64,
    },
    /// A parameter divided by `sqrt(1 + q z^2)`.
    Slipping {
        index: usize,
        z: usize,
        q: f64,
    },
    /// A parameter times `1 + c T`, `T' = ((u/usual)^2 - T)/tau` from nothing.
    Warming {
        index: usize,
        control: usize,
        c: f64,
        tau: f64,
        usual: f64,
    },
    /// Between two places nothing is passed on within `c` of their middle.
    Loose {
        p: usize,
        q: usize,
        c: f64,
    },
}

/// One effect at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Name in the catalogue, or a name of our own outside it.
    pub id: &'static str,
    /// Equation, or column, in which it acts.
    pub state: usize,
    /// What it depends on, as the answers name it.
    pub variables: Vec<Variable>,
    /// What it does.
    pub act: Act,
}

fn read(variable: Variable, x: &[f64], u: &[f64]) -> f64 {
    match variable {
        Variable::State(i) => x[i],
        Variable::Control(j) => u[j],
        Variable::Parameter(_) => 0.0,
    }
}

impl Friction {
    /// Level of the friction force at a velocity; `direction` decides where the law knows one.
    pub fn level(&self, velocity: f64, direction: f64, x: &[f64], u: &[f64]) -> f64 {
        match *self {
            Friction::Coulomb { c } => c,
            Friction::Stribeck { c, s, w } => c + (s - c) * (-(velocity / w).powi(2)).exp(),
            Friction::Asymmetric { up, down } => {
                if direction > 0.0 {
                    up
                } else {
                    down
                }
            }
            Friction::Loaded { c, load } => c * read(load, x, u).abs(),
            Friction::Placed { c, position, at, width } => c * (-((x[position] - at) / width).powi(2)).exp(),
        }
    }
}

impl Act {
    /// What a term adds to the right side of its equation; zero for what is not such a term.
    pub fn added(&self, t: f64, x: &[f64], u: &[f64]) -> f64 {
        match *self {
            Act::Constant { c } => c,
            Act::Linear { z, c } => c * read(z, x, u),
            Act::Quadratic { z, c } => {
                let z = read(z, x, u);
                -c * z * z.abs()
            }
            Act::Cubic { z, c } => -c * read(z, x, u).powi(3),
            Act::Sine { z, c, n, phase } => c * (n * read(z, x, u) + phase).sin(),
            Act::Product { z, w, c } => c * read(z, x, u) * read(w, x, u),
            Act::Periodic { c, omega, phase } => c * (omega * t + phase).sin(),
            // The integrator stops at the event, so the middle of a step decides.
            Act::Step { c, t0 } => c * f64::from(u8::from(t > t0)),
            Act::Drift { c } => c * t,
            Act::Contact { z, c, edge, side } => -c * (side * (read(z, x, u) - edge)).max(0.0) * side,
            Act::Exponential { z, c, edge, w } => c * ((read(z, x, u) - edge) / w).min(20.0).exp(),
            Act::Inverse { z, c, w } => c / (read(z, x, u).abs() + w),
            Act::Triple { a, b, d, c } => c * read(a, x, u) * read(b, x, u) * read(d, x, u),
            _ => 0.0,
        }
    }

    /// How many hidden values the effect needs.
    pub fn hidden(&self) -> usize {
        match self {
            Act::Resonance { .. } => 2,
            Act::Hysteresis { .. } | Act::Actuator { law: Actuator::Lag { .. }, .. } => 1,
            Act::Memory { .. } | Act::Warming { .. } | Act::Sensor { law: Sensor::Filter { .. } } => 1,
            _ => 0,
        }
    }

    /// Derivatives of the hidden values at `slot`, and what they add to the equation.
    pub fn hidden_flow(&self, slot: usize, x: &Values, d: &mut Values) -> f64 {
        match *self {
            Act::Resonance { position, velocity, c, omega, damping } => {
                let (stretch, slip) = (x[slot] - x[position], x[slot + 1] - x[velocity]);
                let pull = omega * omega * stretch + 2.0 * damping * omega * slip;
                d[slot] = x[slot + 1];
                d[slot + 1] = -pull;
                c * pull
            }
            Act::Hysteresis { velocity, c, w } => {
                let (v, h) = (x[velocity], x[slot]);
                d[slot] = v - v.abs() * h * h.abs() / (w * w);
                -c * h
            }
            Act::Memory { velocity, c, b, g } => {
                let (v, h) = (x[velocity], x[slot]);
                d[slot] = v - b * v.abs() * h - g * v * h.abs();
                -c * h
            }
            _ => 0.0,
        }
    }

    /// The numbers of the effect as the answers state them.
    pub fn numbers(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Act::Parameter { value, .. } => vec![("value", value)],
            Act::Constant { c } | Act::Product { c, .. } | Act::Drift { c } | Act::Triple { c, .. } => vec![("c", c)],
            Act::Linear { c, .. } | Act::Quadratic { c, .. } | Act::Cubic { c, .. } => vec![("c", c.abs())],
            Act::Sine { c, n, phase, .. } => vec![("c", c), ("n", n), ("phase", phase)],
            Act::Periodic { c, omega, phase } => vec![("c", c), ("omega", omega), ("phase", phase)],
            Act::Step { c, t0 } => vec![("c", c), ("t0", t0)],
            Act::Friction { law } => match law {
                Friction::Coulomb { c } | Friction::Loaded { c, .. } => vec![("c", c)],
                Friction::Stribeck { c, s, w } => vec![("c", c), ("s", s), ("w", w)],
                Friction::Asymmetric { up, down } => vec![("up", up), ("down", down)],
                Friction::Placed { c, at, width, .. } => vec![("c", c), ("at", at), ("width", width)],
            },
            Act::Actuator { law, .. } => match law {
                Actuator::Gain { c }
                | Actuator::Bias { c }
                | Actuator::Saturation { c }
                | Actuator::DeadZone { c }
                | Actuator::Play { c }
                | Actuator::RateLimit { c } => vec![("c", c)],
                Actuator::SpeedLimit { s, z0, .. } => vec![("s", s), ("z0", z0)],
                Actuator::Delay { tau } | Actuator::Lag { tau } => vec![("tau", tau)],
            },
            Act::Sensor { law } => match law {
                Sensor::Bias { c } | Sensor::Scale { c } => vec![("c", c)],
                Sensor::Delay { tau } | Sensor::Filter { tau } => vec![("tau", tau)],
                Sensor::Clock { slow } => vec![("e", -slow)],
            },
            Act::Contact { c, edge, .. } => vec![("c", c), ("edge", edge)],
            Act::Exponential { c, edge, w, .. } => vec![("c", c), ("edge", edge), ("w", w)],
            Act::Inverse { c, w, .. } | Act::Hysteresis { c, w, .. } => vec![("c", c), ("w", w)],
            Act::Resonance { c, omega, damping, .. } => vec![("c", c), ("omega", omega), ("damping", damping)],
            Act::Memory { c, b, g, .. } => vec![("c", c), ("b", b), ("g", g)],
            Act::Inertia { c } | Act::Loose { c, .. } => vec![("c", c)],
            Act::Saturating { h, .. } => vec![("h", h)],
            Act::Slipping { q, .. } => vec![("q", q)],
            Act::Warming { c, tau, .. } => vec![("c", c), ("time", tau)],
        }
    }
}

impl Effect {
    /// The names of the variables in the model of `plant`, as an answer lists them: what a term saturates with, not its parameter, and the
    /// parameter that warms up, not what heats it.
    pub fn names(&self, plant: &Plant) -> Vec<String> {
        let listed = match self.id {
            "saturating_rate" | "slip" => self.variables.get(1..).unwrap_or_default(),
            "thermal" => self.variables.get(..1).unwrap_or_default(),
            _ => &self.variables,
        };
        listed
            .iter()
            .map(|v| match *v {
                Variable::State(i) => plant.states[i].name.clone(),
                Variable::Control(j) => plant.controls[j].name.clone(),
                Variable::Parameter(k) => plant.parameters[k].name.clone(),
            })
            .collect()
    }
}
