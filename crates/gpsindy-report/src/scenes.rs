//! One small scene an effect: a simulator, the same machine with the effect in it, and the motion that shows it.

use gpsindy_core::diagnose::Effect;

/// What the control `u` of a scene does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drive {
    /// Nothing: the machine is let go.
    None,
    /// Steps to +1, -1, +0.5, -0.5 and 0, each held for a fifth of the time.
    Steps,
    /// A sine of this many periods and this amplitude.
    Sine(f64, f64),
    /// A ramp from 0 to 1.
    Ramp,
}

/// A simulator and a machine, both moved in the same way.
pub(crate) struct Scene {
    pub(crate) drive: Drive,
    /// Length, s.
    pub(crate) until: f64,
    /// States of the simulator: name, value at the start, equation.
    pub(crate) simulator: &'static [(&'static str, f64, &'static str)],
    /// What differs in the machine: a state with another equation, or one of its own.
    pub(crate) machine: &'static [(&'static str, &'static str)],
    /// The column that is drawn.
    pub(crate) column: &'static str,
    /// What the column reads in the machine; empty: the state itself.
    pub(crate) reads: &'static str,
    /// Where the machine's own states start.
    pub(crate) own_start: f64,
}

type States = &'static [(&'static str, f64, &'static str)];

const CART: States = &[("x", 0.0, "v"), ("v", 0.0, "2*u - 0.8*v")];
const COASTING: States = &[("v", 2.0, "-0.4*v")];
const TURNING: States = &[("q", 0.0, "v"), ("v", 0.0, "2*u - 0.8*v")];
const SPRING: States = &[("x", 1.0, "v"), ("v", 0.0, "-4*x - 0.2*v + 3*u")];
const ARM: States = &[("q", 0.0, "v"), ("v", 0.0, "-9*q - 1.5*v + 6*u")];
const RIG: States = &[("v", 0.0, "2*u - 0.8*v"), ("z", 0.0, "1.5*u - 0.5*z")];
const GEARS: States =
    &[("p", 0.0, "a"), ("a", 0.0, "4*u - a - 20*(p - q)"), ("q", 0.0, "b"), ("b", 0.0, "20*(p - q) - 0.6*b")];

/// The scene of an effect; nothing for one that has none yet.
#[rustfmt::skip]
pub(crate) fn scene(effect: Effect) -> Option<Scene> {
    use Drive::{None as Released, Ramp, Sine, Steps};
    let of = |simulator, drive, until, column, machine| {
        Some(Scene { drive, until, simulator, machine, column, reads: "", own_start: 0.0 })
    };
    let sensor = |simulator, drive, until, column, reads| {
        Some(Scene { drive, until, simulator, machine: &[], column, reads, own_start: 0.0 })
    };
    match effect.id() {
        "parameter_error" => of(SPRING, Released, 8.0, "x", &[("v", "-5*x - 0.2*v + 3*u")]),
        "bias" => of(SPRING, Released, 8.0, "x", &[("v", "-4*x - 0.2*v + 3*u + 1.2")]),
        "viscous_friction" => of(COASTING, Released, 6.0, "v", &[("v", "-0.4*v - 0.5*v")]),
        "coulomb_friction" => of(COASTING, Released, 6.0, "v", &[("v", "-0.4*v - 0.5*tanh(v/0.02)")]),
        "stribeck_friction" => of(COASTING, Released, 6.0, "v", &[("v", "-0.4*v - (0.15 + 0.85*exp(-(v/0.4)^2))*tanh(v/0.02)")]),
        "quadratic_drag" => of(COASTING, Released, 6.0, "v", &[("v", "-0.4*v - 0.6*v*abs(v)")]),
        "linear_stiffness" => of(CART, Steps, 10.0, "v", &[("v", "2*u - 0.8*v - 1.5*x")]),
        "cubic_stiffness" => of(SPRING, Released, 8.0, "x", &[("v", "-4*x - 0.2*v + 3*u - 5*x^3")]),
        "gravity_load" => of(TURNING, Ramp, 9.0, "v", &[("v", "2*u - 0.8*v + 1.2*sin(q)")]),
        "coupling" => of(RIG, Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.5*z")]),
        "product_coupling" => of(RIG, Steps, 10.0, "v", &[("v", "2*u - 0.8*v - 0.5*v*z")]),
        "input_gain" => of(CART, Steps, 10.0, "v", &[("v", "2*(1.3*u) - 0.8*v")]),
        "input_bias" => of(CART, Steps, 10.0, "v", &[("v", "2*(u + 0.3) - 0.8*v")]),
        "input_saturation" => of(CART, Sine(3.0, 1.0), 10.0, "v", &[("v", "2*clamp(u, -0.5, 0.5) - 0.8*v")]),
        "input_dead_zone" => of(CART, Sine(3.0, 1.0), 10.0, "v", &[("v", "2*dead_zone(u, 0.3) - 0.8*v")]),
        "input_delay" => of(CART, Steps, 10.0, "v", &[("v", "2*delay(u, 0.35) - 0.8*v")]),
        "input_hold" => of(CART, Sine(3.0, 1.0), 10.0, "v", &[("v", "2*sample_hold(u, 0.8, 0) - 0.8*v")]),
        "input_lag" => of(CART, Steps, 10.0, "v", &[("v", "2*w - 0.8*v"), ("w", "(u - w)/0.5")]),
        "backlash" => of(CART, Sine(3.0, 1.0), 10.0, "v", &[("v", "2*play(u, 0.7) - 0.8*v")]),
        "cogging" => of(TURNING, Ramp, 9.0, "v", &[("v", "2*u - 0.8*v + 1.2*sin(6*q)")]),
        "periodic_disturbance" => of(CART, Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 1.5*sin(4*t)")]),
        "step_disturbance" => of(CART, Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.8*step(t - 5.3)")]),
        "process_noise" => of(CART, Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.5*sin(1.7*t + 2) + 0.5*sin(4.1*t) + 0.5*sin(9.7*t + 1)")]),
        "drift" => of(CART, Sine(4.0, 1.0), 12.0, "v", &[("v", "2*u - 0.8*v + 0.08*t")]),
        "sensor_bias" => sensor(SPRING, Released, 8.0, "x", "x + 0.3"),
        "sensor_scale" => sensor(SPRING, Released, 8.0, "x", "1.3*x"),
        "sensor_delay" => sensor(SPRING, Released, 8.0, "x", "delay(x, 0.3)"),
        "inertia" => of(SPRING, Released, 8.0, "x", &[("v", "(-4*x - 0.2*v + 3*u)/1.4")]),
        "motor_limit" => of(CART, Steps, 10.0, "v", &[("v", "2*clamp(u, -0.9*(1 + v/2.2), 0.9*(1 - v/2.2)) - 0.8*v")]),
        "supply" => Some(Scene {
            drive: Steps, until: 10.0, simulator: CART, column: "v", reads: "", own_start: 12.0,
            machine: &[("v", "2*u*(w/12) - 0.8*v"), ("w", "0.8*(12 - 5*abs(u) - w)")],
        }),
        "input_rate_limit" => of(CART, Steps, 10.0, "v", &[("v", "2*w - 0.8*v"), ("w", "clamp(20*(u - w), -0.9, 0.9)")]),
        "asymmetric_friction" => of(CART, Sine(3.0, 1.0), 10.0, "v", &[("v", "2*u - 0.8*v - 0.9*max(tanh(v/0.02), 0) - 0.1*min(tanh(v/0.02), 0)")]),
        "load_friction" => of(ARM, Sine(2.0, 1.0), 10.0, "q", &[("v", "-9*q - 1.5*v + 6*u - (0.2 + 0.5*abs(6*u))*tanh(v/0.02)")]),
        "stiction" => of(CART, Sine(2.0, 0.7), 10.0, "v", &[("v", "2*u - 0.8*v - (0.4 + 0.6*exp(-(v/0.1)^2))*d/0.01"), ("d", "v - abs(v)*d/0.01")]),
        "hysteresis" => of(ARM, Sine(2.0, 1.0), 10.0, "q", &[("v", "-9*q - 1.5*v + 6*u - 3*h"), ("h", "6*v - 3*abs(v)*h - 3*v*abs(h)")]),
        "gear_play" => of(GEARS, Steps, 8.0, "b", &[("a", "4*u - a - 20*dead_zone(p - q, 0.3)"), ("b", "20*dead_zone(p - q, 0.3) - 0.6*b")]),
        "elastic_joint" => of(CART, Steps, 10.0, "v", &[("v", "2*u - 0.8*v + 0.6*(36*s + 1.2*r)"), ("s", "r"), ("r", "-36*s - 1.2*r - (2*u - 0.8*v)")]),
        "end_stop" => of(SPRING, Sine(2.0, 1.0), 8.0, "x", &[("v", "-4*x - 0.2*v + 3*u - (200 + 20*v)*max(0, x - 0.6)")]),
        "saturating_rate" => of(&[("s", 8.0, "-0.5*s")], Released, 8.0, "s", &[("s", "-0.5*s/(1 + 0.25*s)")]),
        "thermal" => of(CART, Sine(6.0, 1.0), 18.0, "v", &[("v", "2*u - 0.8*(1 + 2*T)*v"), ("T", "(2*u^2 - T)/6")]),
        "slip" => of(&[("r", 0.0, "4*u - 2*r")], Ramp, 6.0, "r", &[("r", "4*u/sqrt(1 + 0.6*r^2) - 2*r")]),
        "sensor_hold" => sensor(SPRING, Released, 8.0, "x", "sample_hold(x, 0.4, 0)"),
        "sensor_filter" => Some(Scene {
            drive: Released, until: 8.0, simulator: SPRING, column: "x", reads: "y", own_start: 1.0,
            machine: &[("y", "(x - y)/0.4")],
        }),
        "clock" => sensor(SPRING, Released, 8.0, "x", "delay(x, 0.5)"),
        _ => None,
    }
}

impl Drive {
    /// The control at a time of a scene that lasts `until` seconds.
    pub(crate) fn at(self, t: f64, until: f64) -> f64 {
        match self {
            Drive::None => 0.0,
            Drive::Steps => [1.0, -1.0, 0.5, -0.5, 0.0][((5.0 * t / until) as usize).min(4)],
            Drive::Sine(periods, amplitude) => amplitude * (std::f64::consts::TAU * periods * t / until).sin(),
            Drive::Ramp => t / until,
        }
    }

    pub(crate) fn words(self) -> &'static str {
        match self {
            Drive::None => "let go, without a control",
            Drive::Steps => "driven by steps of the control `u`: 1, -1, 0.5, -0.5 and 0",
            Drive::Sine(..) => "driven by a sine of the control `u`",
            Drive::Ramp => "driven by a control `u` that rises steadily from 0 to 1",
        }
    }
}
