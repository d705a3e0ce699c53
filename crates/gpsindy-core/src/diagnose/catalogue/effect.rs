//! The catalogue: physical effects that a nominal model may lack.

use crate::expression::Expression;

macro_rules! catalogue {
    ($($variant:ident $id:literal $family:ident $form:literal $parameters:literal $signature:literal),+ $(,)?) => {
        /// An effect of the catalogue.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Effect { $(#[doc = $signature] $variant),+ }

        impl Effect {
            /// Every effect of the catalogue, in its order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The id in reports and options.
            pub fn id(self) -> &'static str {
                match self { $(Self::$variant => $id),+ }
            }

            /// What it adds to the right side of the state's equation, or does to the input or the sensor.
            pub fn form(self) -> &'static str {
                match self { $(Self::$variant => $form),+ }
            }

            /// Its parameters in words.
            pub fn parameters(self) -> &'static str {
                match self { $(Self::$variant => $parameters),+ }
            }

            /// What it looks like in a log.
            pub fn signature(self) -> &'static str {
                match self { $(Self::$variant => $signature),+ }
            }

            /// Effects of one family share their prior odds, so that large families do not win by number.
            pub fn family(self) -> Family {
                match self { $(Self::$variant => Family::$family),+ }
            }
        }
    };
}

/// A group of effects of the same physical kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    /// A nominal parameter is wrong.
    Parameter,
    /// Functions of the state's own rate.
    Friction,
    /// Functions of a position.
    Stiffness,
    /// Products and other axes.
    Coupling,
    /// A static map of the control.
    InputStatic,
    /// A control that acts late.
    InputDynamic,
    /// A control that passes a play.
    Memory,
    /// Functions of time.
    Time,
    /// The sensor and not the plant.
    Sensor,
    /// An effect of the user's own.
    Custom,
}

catalogue! {
    ParameterError "parameter_error" Parameter "value of a nominal parameter" "value: what the logs say"
        "the whole term that the parameter scales is too large or too small",
    Bias "bias" Parameter "c" "c: constant rate"
        "a steady push that does not depend on anything",
    ViscousFriction "viscous_friction" Friction "-c*z" "c: damping rate"
        "oscillations die faster, steady speed falls in proportion",
    CoulombFriction "coulomb_friction" Friction "-c*sign(z)" "c: friction level, w: speed within which the sign is smoothed"
        "decay by equal steps, standing still, a jump of the rate at every reversal",
    StribeckFriction "stribeck_friction" Friction "-(c + (s - c)*exp(-(z/w)^2))*sign(z)" "c: level at speed, s: level near zero, w: speed that parts them"
        "sticks more than it slides: jerky motion at low speed",
    QuadraticDrag "quadratic_drag" Friction "-c*z*abs(z)" "c: drag coefficient"
        "top speed saturates, slow motion is untouched",
    LinearStiffness "linear_stiffness" Stiffness "-c*z" "c: stiffness"
        "a shifted resonance, a spring that pulls back",
    CubicStiffness "cubic_stiffness" Stiffness "-c*z^3" "c: hardening"
        "resonance shifts with amplitude",
    GravityLoad "gravity_load" Stiffness "c*sin(z + phase)" "c: largest load, phase: where it vanishes"
        "a load that depends on the angle",
    Coupling "coupling" Coupling "c*z" "c: gain from z"
        "this axis moves when only the other is driven",
    ProductCoupling "product_coupling" Coupling "c*z*w" "c: gain of the product"
        "grows when two motions happen together",
    InputGain "input_gain" InputStatic "u becomes (1 + c)*u" "c: relative gain error"
        "every response to the control is scaled",
    InputBias "input_bias" InputStatic "u becomes u + c" "c: offset of the control"
        "acts as if the command were shifted",
    InputSaturation "input_saturation" InputStatic "u becomes clamp(u, -c, c)" "c: limit"
        "large commands do no more than middle ones",
    InputDeadZone "input_dead_zone" InputStatic "u becomes dead_zone(u, c)" "c: half width"
        "small commands do nothing",
    InputDelay "input_delay" InputDynamic "u becomes delay(u, tau)" "tau: delay, s"
        "everything happens later by the same time",
    InputLag "input_lag" InputDynamic "u becomes a state that follows u with time constant tau" "tau: time constant, s"
        "fast commands are rounded, slow ones pass",
    Backlash "backlash" Memory "u becomes play(u, c)" "c: total width"
        "nothing happens for a while after every reversal of the command",
    Cogging "cogging" Stiffness "c*sin(n*z + phase)" "c: size, n: spatial frequency, phase"
        "a ripple that repeats with position",
    PeriodicDisturbance "periodic_disturbance" Time "c*sin(omega*t + phase)" "c: size, omega: rad/s, phase"
        "a line in the spectrum that no command has",
    StepDisturbance "step_disturbance" Time "c*step(t - t0)" "c: size, t0: time, s"
        "everything is as it should be until an instant",
    Drift "drift" Time "a parameter or bias changes slowly with time: c*t" "c: change per second"
        "the beginning fits, the end does not",
    SensorBias "sensor_bias" Sensor "the column reads state + c" "c: offset"
        "a constant difference that no motion explains",
    SensorScale "sensor_scale" Sensor "the column reads (1 + c)*state" "c: relative error of scale"
        "differences in proportion to the reading",
    SensorDelay "sensor_delay" Sensor "the column reads the state tau earlier" "tau: delay, s"
        "one column runs behind the others",
}

impl Effect {
    /// The effect with this id.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|e| e.id() == id)
    }

    /// Whether the effect acts on a control.
    pub fn acts_on_input(self) -> bool {
        matches!(self.family(), Family::InputStatic | Family::InputDynamic | Family::Memory)
    }

    /// Whether the effect acts on what a column reads.
    pub fn acts_on_sensor(self) -> bool {
        self.family() == Family::Sensor
    }
}

/// An effect of the user's own, added to the right side of an equation.
#[derive(Debug, Clone, PartialEq)]
pub struct CustomEffect {
    /// Its id in the report.
    pub id: String,
    /// The state in whose equation it acts.
    pub state: String,
    /// What is added, in the names of the model and of its own parameters.
    pub form: Expression,
    /// Names and ranges of its parameters; the first one that is free of sign scales the effect.
    pub parameters: Vec<CustomParameter>,
}

/// A parameter of a [`CustomEffect`].
#[derive(Debug, Clone, PartialEq)]
pub struct CustomParameter {
    /// Its name inside the form.
    pub name: String,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Unit as text, may be empty.
    pub unit: String,
}

/// The experiment that tells two effects apart that the given logs can't part.
pub(crate) fn separating_experiment(one: &str, other: &str) -> &'static str {
    const MENU: &[(&[&str], &[&str], &str)] = &[
        (&["input_delay"], &["input_lag"], "a step, or a chirp beyond 1/(2 pi tau), sampled faster"),
        (
            &["input_delay"],
            &["sensor_delay"],
            "log an echo of the command or a second sensor, or close the loop over it",
        ),
        (
            &["coulomb_friction", "stribeck_friction"],
            &["coulomb_friction", "viscous_friction", "stribeck_friction", "quadratic_drag"],
            "slow reversals at three or more speeds, or a coast-down",
        ),
        (&["viscous_friction"], &["quadratic_drag"], "steady motion at three or more speeds, or a coast-down"),
        (
            &["input_gain"],
            &["parameter_error", "sensor_scale"],
            "add a known mass or load, or check one static reading against a ruler",
        ),
        (
            &["bias", "input_bias"],
            &["sensor_bias", "bias", "input_bias", "coulomb_friction"],
            "turn the rig round, or stand still at two positions",
        ),
        (
            &["backlash"],
            &["input_dead_zone", "input_lag", "input_delay"],
            "triangles of rising amplitude about two offsets",
        ),
        (&["input_saturation"], &["input_lag", "input_gain"], "one frequency at several amplitudes"),
        (&["cogging"], &["periodic_disturbance"], "the same motion at two speeds"),
        (&["cubic_stiffness"], &["gravity_load", "linear_stiffness"], "a larger amplitude, or a second mean position"),
        (
            &["drift", "step_disturbance", "periodic_disturbance"],
            &["bias", "drift", "step_disturbance"],
            "the identical run repeated three times",
        ),
    ];
    for (left, right, experiment) in MENU {
        let one_way = left.contains(&one) && right.contains(&other);
        if one_way || (left.contains(&other) && right.contains(&one)) {
            return experiment;
        }
    }
    "a run with another amplitude, offset and speed than the given logs have"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_read_back_and_are_those_of_the_contract() {
        assert_eq!(Effect::ALL.len(), 25);
        for &effect in Effect::ALL {
            assert_eq!(Effect::from_id(effect.id()), Some(effect));
        }
        assert_eq!(Effect::from_id("nothing"), None);
    }

    #[test]
    fn twins_have_an_experiment_that_parts_them() {
        assert!(separating_experiment("input_lag", "input_delay").contains("chirp"));
        assert_eq!(
            separating_experiment("backlash", "input_dead_zone"),
            separating_experiment("input_dead_zone", "backlash")
        );
    }
}
