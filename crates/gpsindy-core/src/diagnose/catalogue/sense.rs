//! Where an effect makes physical sense: by units, by the ranges in the logs, by the terms of the equation.

pub(crate) mod scaled;
pub(crate) mod servo;
pub(crate) mod slipping;

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::limits::catalogue::{MOVES, REVERSES};
use crate::model::Model;
use crate::model::unit::{is_length, is_place};
use scaled::is_scaled;
use servo::is_servo;

/// A condition on a place. Where no units are given, a rule by units lets everything pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sense {
    /// The equation is one of a speed: friction, inertia and contact need one.
    Speed,
    /// The equation is none of a speed: a balance of amounts.
    Balance,
    /// The variable with this number never falls below zero in the logs.
    NotNegative(usize),
    /// The variable with this number takes either sign in the logs.
    EitherSign(usize),
    /// The variable with this number moves by more than a hundredth of its size.
    Moves(usize),
    /// The equation is none of a temperature, which nothing stops or rubs.
    NotThermal,
    /// The equation is that of the rate of a place, or none of a voltage, a pressure or another amount, which nothing rubs, and none of a servo, which
    /// has no speed whose sign it is.
    Moving,
    /// The variable with this number has a rate of its own, or is no voltage, pressure or other amount, which has no weight and no teeth.
    Placed(usize),
    /// The variable with this number is no length: a weight on an arm goes by the angle.
    Angle(usize),
    /// The variable with this number is a control that is no flow of matter, or a current, a voltage or a speed, whose losses heat.
    Lossy(usize),
    /// No parameter scales the whole equation: it would be the same suspect.
    NoScale,
    /// The variable with this number is no command in the unit of a place: such a one is where to go, and loads nothing.
    NoTarget(usize),
    /// The rates are equations: within a step of a simulator that steps nothing can hold.
    Modes,
}

impl Sense {
    /// The rule in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Speed => "the equation is that of a speed",
            Self::Balance => "the equation is that of an amount, not of a speed",
            Self::NotNegative(_) => "the variable is never negative in the logs",
            Self::EitherSign(_) => "the variable takes both signs in the logs",
            Self::Moves(_) => "the variable moves in the logs",
            Self::NotThermal => "the equation is not that of a temperature",
            Self::Moving => {
                "the equation is not that of an amount, such as a voltage or a pressure, or of a servo without a speed"
            }
            Self::Placed(_) => "the variable is not an amount, such as a voltage or a pressure",
            Self::Angle(_) => "the variable is not a length",
            Self::Lossy(_) => "the variable is a control that is no flow of matter, or a current, a voltage or a speed",
            Self::NoScale => "no parameter of this equation alone scales it as a whole",
            Self::NoTarget(_) => "the variable is not the target of a position servo",
            Self::Modes => "the model has equations, not a simulator that steps",
        }
    }

    /// Whether it holds for an effect in the equation of `state` that depends on `variables`.
    pub(crate) fn holds(self, state: usize, variables: &[String], model: &Model, scene: &Scene) -> bool {
        // The range of a difference is not that of its variables.
        let one = |index: usize| variables.get(index).filter(|_| !slipping::is_of_a_difference(variables));
        let excursion = |index: usize| one(index).and_then(|name| excursion(name, model, scene));
        match self {
            Self::Speed => may_be_speed(model, state),
            Self::Balance => !has_place(model, state),
            Self::NotNegative(index) => excursion(index).is_none_or(Excursion::is_never_negative),
            Self::EitherSign(index) => {
                // What the logs say of its place: the start of a rollout may go the other way.
                let state = one(index).and_then(|name| model.state_index(name));
                let turns = state.and_then(|j| scene.turns.get(j).copied().flatten());
                turns.unwrap_or_else(|| excursion(index).is_none_or(reverses))
            }
            Self::Moves(index) => excursion(index).is_none_or(|e| e.range() > MOVES * e.size()),
            Self::NotThermal => !is_temperature(&model.states[state].unit),
            Self::Moving => {
                has_place(model, state) || !(is_amount(&model.states[state].unit) || is_servo(model, state))
            }
            Self::Placed(index) => {
                let state = variables.get(index).and_then(|name| model.state_index(name));
                let has_speed = |j| (0..model.states.len()).any(|i| model.integral_of(i) == Some(j));
                state.is_none_or(|j| has_speed(j) || !is_amount(&model.states[j].unit))
            }
            Self::Angle(index) => {
                let state = variables.get(index).and_then(|name| model.state_index(name));
                state.is_none_or(|j| !is_length(&model.states[j].unit))
            }
            Self::Lossy(index) => variables.get(index).is_none_or(|name| match model.state_index(name) {
                Some(j) => is_lossy(&model.states[j].unit),
                None => model.control_index(name).is_none_or(|c| !is_flow(&model.controls[c].unit)),
            }),
            Self::NoScale => !is_scaled(state, model),
            Self::NoTarget(index) => {
                let control = variables.get(index).and_then(|name| model.control_index(name));
                control.is_none_or(|c| !is_place(&model.controls[c].unit))
            }
            Self::Modes => !model.calls_simulator(),
        }
    }
}

/// Whether the variable goes either way by more than the error of a start.
fn reverses(excursion: &Excursion) -> bool {
    excursion.high.min(-excursion.low) > REVERSES * excursion.size()
}

fn excursion<'a>(name: &str, model: &Model, scene: &'a Scene) -> Option<&'a Excursion> {
    match model.state_index(name) {
        Some(j) => scene.states.get(j),
        None => model.control_index(name).and_then(|c| scene.controls.get(c)),
    }
}

/// Whether a unit is one of a speed: it has no spring, no weight and no teeth. Only what may be a place or an angle does.
pub(crate) fn is_speed(unit: &str) -> bool {
    unit.ends_with("/s") || is_rate_of_place(unit)
}

/// Whether a unit is one of the speed of a place.
fn is_rate_of_place(unit: &str) -> bool {
    let is_rate = |(of, per): (&str, &str)| is_place(of) && matches!(per, "s" | "min" | "h");
    unit == "rpm" || unit.split_once('/').is_some_and(is_rate)
}

/// Whether a unit is a base, or one of these prefixes and a base.
fn is_or_prefixed(unit: &str, prefixes: &[char], is_base: impl Fn(&str) -> bool) -> bool {
    is_base(unit) || unit.strip_prefix(prefixes).is_some_and(is_base)
}

/// Whether a unit is one of a voltage or a pressure, of which a drive is fed.
pub(crate) fn is_supply(unit: &str) -> bool {
    is_or_prefixed(unit, &['k', 'M', 'm', 'h'], |unit| matches!(unit, "V" | "Pa" | "bar" | "psi" | "atm"))
}

/// Whether a unit is one of a current, of a voltage, or of the speed of a place; or none is given.
fn is_lossy(unit: &str) -> bool {
    let is_electrical = is_or_prefixed(unit, &['k', 'M', 'm', 'u', 'µ'], |unit| matches!(unit, "A" | "V"));
    unit.is_empty() || is_electrical || is_rate_of_place(unit)
}

/// Whether a unit is one of a flow of matter, or of a share that flows: its square heats nothing.
fn is_flow(unit: &str) -> bool {
    let Some((of, per)) = unit.split_once('/') else { return false };
    let is_base = |name: &str| matches!(name, "1" | "g" | "t" | "mol" | "l" | "L" | "m^3" | "m3" | "m³");
    matches!(per, "s" | "min" | "h" | "d" | "day")
        && is_or_prefixed(of, &['k', 'M', 'm', 'u', 'µ', 'n', 'c', 'd', 'h'], is_base)
}

/// Whether a unit is one of a temperature.
fn is_temperature(unit: &str) -> bool {
    matches!(unit, "K" | "°C" | "degC" | "deg C" | "C" | "°F" | "degF")
}

/// Whether a unit begins with one of an electrical or thermal quantity, of a pressure or of an amount of matter. Percent may be those of a
/// valve's travel, and are none.
fn is_amount(unit: &str) -> bool {
    let first = unit.split(['/', '*', '^', ' ', '·']).next().unwrap_or_default();
    let is_base = |name: &str| {
        let known = ["V", "A", "W", "J", "Pa", "bar", "psi", "atm", "mol", "M", "g", "l", "L", "Ohm", "ppm"];
        known.contains(&name) || is_temperature(name)
    };
    is_or_prefixed(first, &['k', 'M', 'm', 'u', 'µ', 'n', 'c', 'd', 'h'], is_base)
}

/// Whether the state is the rate of a place of the model, or by its unit a speed; or says nothing of either.
pub(crate) fn may_be_speed(model: &Model, state: usize) -> bool {
    has_place(model, state) || model.states[state].unit.is_empty()
}

/// Whether the state is the rate of a place of the model, or by its unit a speed.
fn has_place(model: &Model, state: usize) -> bool {
    model.integral_of(state).is_some() || is_speed(&model.states[state].unit)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Control, Parameter, State};

    /// What the logs excite where the states take these values.
    fn scene(states: Vec<Excursion>) -> Scene {
        Scene {
            states,
            controls: Vec::new(),
            turns: Vec::new(),
            clocks: Vec::new(),
            samplings: Vec::new(),
            holds: Vec::new(),
            rates: Vec::new(),
            period: 0.01,
            times: (0.0, 1.0),
            duration: 1.0,
            window: 1.0,
            peaks: Vec::new(),
            moments: Vec::new(),
            reach: Default::default(),
        }
    }

    #[test]
    fn an_amount_that_noise_takes_below_zero_is_never_negative() {
        let states = vec![State::new("s", Expression::parse("-0.5*s").unwrap())];
        let model = Model { states, ..Model::default() };
        let holds = |values: &[f64]| {
            Sense::NotNegative(0).holds(0, &["s".to_string()], &model, &scene(vec![Excursion::of(values)]))
        };
        assert!(holds(&[1.6, 0.8, 0.3, -0.01]));
        assert!(!holds(&[1.6, 0.8, -0.3, -0.9]));
        let used_up = Excursion::of(&[1.6, 0.8, 0.1, -0.15]);
        assert!(!used_up.is_never_negative() && used_up.with_noise(0.05).is_never_negative());
    }

    #[test]
    fn the_target_of_a_servo_is_no_load() {
        let of = |unit: &str| {
            let control = Control { unit: unit.into(), ..Control::new("u") };
            let states = vec![State::new("v", Expression::variable("u"))];
            let model = Model { states, controls: vec![control], ..Model::default() };
            let variables = ["v", "u"].map(String::from);
            let scene = scene(Vec::new());
            Sense::NoTarget(1).holds(0, &variables, &model, &scene)
        };
        assert!(!of("rad") && !of("mm"));
        assert!(of("N m") && of("A") && of("") && of("rad/s"));
    }

    #[test]
    fn currents_and_speeds_heat_and_amounts_and_places_do_not() {
        for unit in ["A", "mA", "V", "m/s", "rad/s", "rpm", ""] {
            assert!(is_lossy(unit), "{unit}");
        }
        for unit in ["mol/L", "g/L", "1/s", "m", "K", "rad"] {
            assert!(!is_lossy(unit), "{unit}");
        }
        for unit in ["mg/s", "kg/h", "mol/s", "L/min", "m^3/s", "1/h"] {
            assert!(is_flow(unit), "{unit}");
        }
        for unit in ["m/s", "rad/s", "N", "W", "J/s", "V", "A", "N m", "", "mm/s"] {
            assert!(!is_flow(unit), "{unit}");
        }
    }

    #[test]
    fn an_amount_has_neither_weight_nor_friction_and_a_place_of_any_unit_may() {
        for unit in ["V", "mA", "bar", "kPa", "mg", "mol/l", "K", "kW", "g/l", "degC"] {
            assert!(is_amount(unit), "{unit}");
        }
        for unit in [
            "", "rad", "deg", "m", "mm", "cm/s", "rpm", "%", "counts", "rad/s", "m/s", "N*m*s", "km/h", "mrad", "rev",
            "Nm",
        ] {
            assert!(!is_amount(unit), "{unit}");
        }
    }

    #[test]
    fn a_voltage_that_oscillates_has_friction_and_weight_where_one_that_relaxes_has_none() {
        let of = |rates: [&str; 2], unit: &str| {
            let state = |name: &str, rate: &str| State::new(name, Expression::parse(rate).unwrap());
            let mut states = vec![state("q", rates[0]), state("r", rates[1])];
            states.iter_mut().for_each(|state| state.unit = unit.into());
            let model = Model { states, ..Model::default() };
            let holds = |sense: Sense, state: usize| sense.holds(state, &["q".to_string()], &model, &scene(Vec::new()));
            (holds(Sense::Moving, 1), holds(Sense::Placed(0), 1))
        };
        assert_eq!(of(["r", "-q - r"], "V"), (true, true));
        assert_eq!(of(["-q", "q - r"], "V"), (false, false));
        assert_eq!(of(["-q", "q - r"], "m"), (true, true));
    }

    fn model(equation: &str) -> Model {
        Model {
            states: vec![
                State::new("x", Expression::variable("v")),
                State::new("v", Expression::parse(equation).unwrap()),
            ],
            controls: vec![Control::new("u")],
            parameters: ["m", "k"].map(|n| Parameter::new(n, 1.7)).into(),
            ..Model::default()
        }
    }

    #[test]
    fn a_mass_scales_its_equation_and_a_stiffness_does_not() {
        let scaled = |equation: &str| is_scaled(1, &model(equation));
        assert!(scaled("(u - k*x - 0.2*v)/m"));
        assert!(!scaled("u/m - k*x - 0.2*v"));
        assert!(!scaled("u - k*x"));
    }

    #[test]
    fn one_mass_of_two_axes_is_not_the_inertia_of_one() {
        let mut table = model("(u - 0.2*v)/m");
        assert!(is_scaled(1, &table));
        table.states.push(State::new("w", Expression::parse("-0.3*w/m").unwrap()));
        assert!(!is_scaled(1, &table));
    }
}
