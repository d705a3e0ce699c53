//! A small example of an effect: a simulator, the same machine with the effect in it, and the motion that shows it.

/// What the control `u` of an example does.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Drive {
    /// Nothing: the machine is let go.
    Released,
    /// Steps to +1, -1, +0.5, -0.5 and 0, each held for a fifth of the time.
    Steps,
    /// A sine of this many periods and this amplitude.
    Sine(f64, f64),
    /// A ramp from 0 to 1.
    Ramp,
}

/// States of a simulator: name, value at the start, equation.
pub(crate) type States = &'static [(&'static str, f64, &'static str)];

/// A simulator and a machine, both moved in the same way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Example {
    /// The control.
    pub drive: Drive,
    /// Length, s.
    pub until: f64,
    /// States of the simulator: name, value at the start, equation.
    pub simulator: &'static [(&'static str, f64, &'static str)],
    /// What differs in the machine: a state with another equation, or one of its own.
    pub machine: &'static [(&'static str, &'static str)],
    /// The column that shows it.
    pub column: &'static str,
    /// What the column reads in the machine; empty: the state itself.
    pub reads: &'static str,
    /// Where the machine's own states start.
    pub own_start: f64,
}

impl Example {
    /// An effect in the equations.
    pub(crate) const fn of(
        simulator: States,
        drive: Drive,
        until: f64,
        column: &'static str,
        machine: &'static [(&'static str, &'static str)],
    ) -> Self {
        Self { drive, until, simulator, machine, column, reads: "", own_start: 0.0 }
    }

    /// An effect of a sensor.
    pub(crate) const fn sensor(
        simulator: States,
        drive: Drive,
        until: f64,
        column: &'static str,
        reads: &'static str,
    ) -> Self {
        Self { drive, until, simulator, machine: &[], column, reads, own_start: 0.0 }
    }
}

pub(crate) const CART: States = &[("x", 0.0, "v"), ("v", 0.0, "2*u - 0.8*v")];
pub(crate) const COASTING: States = &[("v", 2.0, "-0.4*v")];
pub(crate) const TURNING: States = &[("q", 0.0, "v"), ("v", 0.0, "2*u - 0.8*v")];
pub(crate) const SPRING: States = &[("x", 1.0, "v"), ("v", 0.0, "-4*x - 0.2*v + 3*u")];
pub(crate) const ARM: States = &[("q", 0.0, "v"), ("v", 0.0, "-9*q - 1.5*v + 6*u")];
pub(crate) const RIG: States = &[("v", 0.0, "2*u - 0.8*v"), ("z", 0.0, "1.5*u - 0.5*z")];
pub(crate) const GEARS: States =
    &[("p", 0.0, "a"), ("a", 0.0, "4*u - a - 20*(p - q)"), ("q", 0.0, "b"), ("b", 0.0, "20*(p - q) - 0.6*b")];

impl Drive {
    /// The control at a time of a scene that lasts `until` seconds.
    pub fn at(self, t: f64, until: f64) -> f64 {
        match self {
            Self::Released => 0.0,
            Self::Steps => [1.0, -1.0, 0.5, -0.5, 0.0][((5.0 * t / until) as usize).min(4)],
            Self::Sine(periods, amplitude) => amplitude * (std::f64::consts::TAU * periods * t / until).sin(),
            Self::Ramp => t / until,
        }
    }

    /// What it does, in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Released => "let go, without a control",
            Self::Steps => "driven by steps of the control `u`: 1, -1, 0.5, -0.5 and 0",
            Self::Sine(..) => "driven by a sine of the control `u`",
            Self::Ramp => "driven by a control `u` that rises steadily from 0 to 1",
        }
    }
}
