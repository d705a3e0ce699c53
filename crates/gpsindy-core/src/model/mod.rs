//! Models: ordinary differential equations with named states, controls and parameters.
//!
//! The nominal simulator of a user, the model that `identify` learns and the corrected simulator
//! that `diagnose` writes are the same [`Model`]. [`System`] is a model compiled for evaluation.

pub(crate) mod batched;
pub(crate) mod change;
mod check;
mod engine;
mod export;
mod inputs;
mod port;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(crate) mod stepping;
pub(crate) mod sticking;
mod system;
pub(crate) mod unit;

pub use check::shows;
pub(crate) use engine::Drive;
pub use engine::{Rows, Steps};
pub use export::{Export, Language};
pub use inputs::{Input, InputKind};
pub(crate) use inputs::{LateState, ROUNDING, SHORTEST_HOLD, caught_after, sampled_at, slewed};
pub use port::Port;
pub(crate) use system::Follower;
pub use system::{Dynamics, System};

use crate::data::Hold;
use crate::error::Result;
use crate::expression::{Expression, Function};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The schema that [`Model`] follows.
pub const SCHEMA: &str = "gpsindy.model/1";

fn schema() -> String {
    SCHEMA.into()
}

/// A named set of ordinary differential equations; the content of a model file.
///
/// ```
/// use gpsindy_core::{Expression, Model, Parameter, State};
/// let model = Model {
///     name: "decay".into(),
///     states: vec![State::new("x", Expression::parse("-k*x")?)],
///     parameters: vec![Parameter::new("k", 0.5)],
///     ..Model::default()
/// };
/// model.check()?;
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Model {
    /// The schema, [`SCHEMA`].
    #[cfg_attr(feature = "serde", serde(default = "schema"))]
    pub schema: String,
    /// The model's name: one line of plain text.
    #[cfg_attr(feature = "serde", serde(default, deserialize_with = "check::plain_text"))]
    pub name: String,
    /// The states and their equations.
    #[cfg_attr(feature = "serde", serde(rename = "state"))]
    pub states: Vec<State>,
    /// The controls: inputs that the log carries.
    #[cfg_attr(feature = "serde", serde(rename = "control", default, skip_serializing_if = "Vec::is_empty"))]
    pub controls: Vec<Control>,
    /// The ports: places where a force that nobody modelled may act, zero in this model.
    #[cfg_attr(feature = "serde", serde(rename = "port", default, skip_serializing_if = "Vec::is_empty"))]
    pub ports: Vec<Port>,
    /// The parameters and their nominal values.
    #[cfg_attr(feature = "serde", serde(rename = "parameter", default, skip_serializing_if = "Vec::is_empty"))]
    pub parameters: Vec<Parameter>,
    /// Default initial state for a simulation, by name.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub initial: BTreeMap<String, f64>,
    /// How the model was learnt, where it was.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub identification: Option<IdentificationRecord>,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            schema: schema(),
            name: String::new(),
            states: Vec::new(),
            controls: Vec::new(),
            ports: Vec::new(),
            parameters: Vec::new(),
            initial: BTreeMap::new(),
            identification: None,
        }
    }
}

/// A state: what it is called, how it changes, and what the log's column of it reads.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct State {
    /// Name: a letter, then letters, digits and `_`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "check::plain_text"))]
    pub name: String,
    /// Unit as one line of plain text, empty where none is known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "String::is_empty", deserialize_with = "check::plain_text")
    )]
    pub unit: String,
    /// The right side of its differential equation, in its unit per second.
    pub equation: Expression,
    /// What the log's column reads; absent: the state itself.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub measured: Option<Expression>,
}

impl State {
    /// Whether its column shows what was sampled and held.
    pub(crate) fn is_held(&self) -> bool {
        let mut held = false;
        if let Some(measured) = &self.measured {
            measured.visit(&mut |part| held |= matches!(part, Expression::Call(Function::SampleHold, _)));
        }
        held
    }

    /// A state without a unit, measured as it is.
    pub fn new(name: impl Into<String>, equation: Expression) -> Self {
        Self { name: name.into(), unit: String::new(), equation, measured: None }
    }

    /// The unit of its rate: `m` gives `m/s`, `m/s` gives `m/s^2`; empty where it has none.
    pub(crate) fn rate_unit(&self) -> String {
        rate_unit(&self.unit)
    }
}

/// The unit of a time derivative of what is in `unit`: `m` gives `m/s`, `m/s` gives `m/s^2`; empty where there is none.
///
/// ```
/// assert_eq!(gpsindy_core::rate_unit("rad/s^2"), "rad/s^3");
/// ```
pub fn rate_unit(unit: &str) -> String {
    let power = |(head, power): (&str, &str)| Some(format!("{head}/s^{}", power.parse::<u32>().ok()?.checked_add(1)?));
    match unit.rsplit_once("/s^").and_then(power) {
        Some(higher) => higher,
        None if unit.is_empty() => String::new(),
        None if unit.ends_with("/s") => format!("{unit}^2"),
        None => format!("{unit}/s"),
    }
}

/// The same of a log that counts time in `time_unit`: `kpelts` gives `kpelts/year`.
///
/// ```
/// assert_eq!(gpsindy_core::rate_unit_in("kpelts", "year"), "kpelts/year");
/// ```
pub fn rate_unit_in(unit: &str, time_unit: &str) -> String {
    match (time_unit, unit::has_seconds(unit)) {
        ("s", _) => rate_unit(unit),
        (_, false) => unit::in_time_unit(&rate_unit(unit), time_unit),
        // Speeds in a log of minutes: both units are there.
        (_, true) => unit::product(&[(unit, 1), (time_unit, -1)]),
    }
}

/// A control: an input that the log carries.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Control {
    /// Name: a letter, then letters, digits and `_`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "check::plain_text"))]
    pub name: String,
    /// Unit as one line of plain text, empty where none is known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "String::is_empty", deserialize_with = "check::plain_text")
    )]
    pub unit: String,
}

impl Control {
    /// A control without a unit.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: String::new() }
    }
}

/// A parameter and what is believed of it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Parameter {
    /// Name: a letter, then letters, digits and `_`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "check::plain_text"))]
    pub name: String,
    /// Nominal value.
    pub value: f64,
    /// Unit as one line of plain text, empty where none is known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "String::is_empty", deserialize_with = "check::plain_text")
    )]
    pub unit: String,
    /// Relative 1-sigma belief; absent: taken as exact, yet still a suspect in a diagnosis.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub tolerance: Option<f64>,
    /// Lowest and highest value that the user's own simulator takes; absent where it says nothing.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub range: Option<(f64, f64)>,
    /// A change that matters to the user's own simulator, if the value itself does not give one.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub scale: Option<f64>,
}

impl Parameter {
    /// A parameter that is taken as exact.
    pub fn new(name: impl Into<String>, value: f64) -> Self {
        Self { name: name.into(), value, unit: String::new(), tolerance: None, range: None, scale: None }
    }
}

impl Parameter {
    /// A change that matters: a given scale, else the value's size, else one.
    pub(crate) fn typical(&self) -> f64 {
        match self.scale {
            Some(scale) => scale,
            None if self.value == 0.0 => 1.0,
            None => self.value.abs(),
        }
    }
}

/// How a model was learnt.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct IdentificationRecord {
    /// The library's terms, in order.
    pub terms: Vec<String>,
    /// One row a state, one column a term.
    pub coefficients: Vec<Vec<f64>>,
    /// Standard errors, laid out like the coefficients.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub standard_errors: Vec<Vec<f64>>,
    /// How sure it is that a term is in, laid out like the coefficients: by the evidence, or by bootstraps of a regression.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub inclusion_probabilities: Vec<Vec<f64>>,
    /// The weight of the 1-norm, one a state.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub lambda: Vec<f64>,
    /// What the controls were taken to do between samples, where there are controls: simulations do the same unless asked
    /// otherwise.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub hold: Option<Hold>,
}

impl Model {
    /// What controls do between samples by default: what the model was learnt with, else held.
    pub fn hold(&self) -> Hold {
        self.identification.as_ref().and_then(|record| record.hold).unwrap_or_default()
    }

    /// Checks names, expressions and references.
    ///
    /// # Errors
    /// The first contradiction, with the equation and the place.
    pub fn check(&self) -> Result<()> {
        check::check(self)
    }

    /// Checks the model and compiles it.
    ///
    /// # Errors
    /// As [`Model::check`].
    pub fn compile(&self) -> Result<System> {
        System::new(self)
    }

    /// Position of the state `name`.
    pub fn state_index(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|s| s.name == name)
    }

    /// Puts `by` in the place of `name` wherever it acts, but in the equation of the state number `kept`.
    pub(crate) fn replace(&mut self, name: &str, by: &Expression, kept: Option<usize>) {
        for (number, state) in self.states.iter_mut().enumerate() {
            if kept != Some(number) {
                state.equation = state.equation.substitute(name, by);
            }
            state.measured = state.measured.as_ref().map(|m| m.substitute(name, by));
        }
    }

    /// Position of the control `name`.
    pub fn control_index(&self, name: &str) -> Option<usize> {
        self.controls.iter().position(|c| c.name == name)
    }

    /// Position of the port `name`.
    pub fn port_index(&self, name: &str) -> Option<usize> {
        self.ports.iter().position(|p| p.name == name)
    }

    /// Position of the parameter `name`.
    pub fn parameter_index(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }

    /// The state of which state `index` is the time derivative: its equation is just that name, or turns its unit into that of the place
    /// (`6*n` for a speed in rpm of an angle in degrees).
    pub fn integral_of(&self, index: usize) -> Option<usize> {
        (0..self.states.len()).find(|&place| self.rate_of(place).is_some_and(|(rate, _)| rate == index))
    }

    /// The state that is the time derivative of state `place`, and what one of it is in the unit of the place per second.
    pub(crate) fn rate_of(&self, place: usize) -> Option<(usize, f64)> {
        /// How far the number in an equation may be from what the units say: it is typed by hand.
        const TYPED: f64 = 0.01;
        let State { equation, unit, .. } = &self.states[place];
        let (factor, name) = equation.multiple()?;
        let rate = self.state_index(name)?;
        let is_unit = || {
            unit::per_second(unit, &self.states[rate].unit).is_some_and(|known| (factor / known - 1.0).abs() < TYPED)
        };
        (*equation == Expression::Variable(name.into()) || is_unit()).then_some((rate, factor))
    }

    /// What one of the rate of state `place` is in the unit of the place per second; one where no state is its rate.
    pub(crate) fn per_rate(&self, place: usize) -> f64 {
        self.rate_of(place).map_or(1.0, |(_, factor)| factor)
    }

    /// The states in whose equations `name` stands.
    pub(crate) fn rows_with(&self, name: &str) -> impl Iterator<Item = usize> {
        (0..self.states.len()).filter(move |&j| self.states[j].equation.contains(name))
    }

    /// Whether the equation of state `index` is just the name of another state (`x = "v"`), or that in another unit.
    pub fn is_kinematic(&self, index: usize) -> bool {
        self.rate_of(index).is_some()
    }

    /// Every unit that is given, empty ones included.
    pub(crate) fn units(&self) -> impl Iterator<Item = &str> {
        let states = self.states.iter().map(|s| &s.unit).chain(self.controls.iter().map(|c| &c.unit));
        let others = self.ports.iter().map(|p| &p.unit).chain(self.parameters.iter().map(|p| &p.unit));
        states.chain(others).map(String::as_str)
    }

    /// Every name in use.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let states = self.states.iter().map(|s| s.name.as_str());
        let controls = self.controls.iter().map(|c| c.name.as_str());
        let ports = self.ports.iter().map(|p| p.name.as_str());
        states.chain(controls).chain(ports).chain(self.parameters.iter().map(|p| p.name.as_str()))
    }

    /// A name that nothing carries yet: `wanted`, or `wanted_2`, `wanted_3`, ...
    pub fn free_name(&self, wanted: &str) -> String {
        let taken = |name: &str| self.names().any(|n| n == name);
        if !taken(wanted) {
            return wanted.into();
        }
        let mut number = 2;
        loop {
            let name = format!("{wanted}_{number}");
            if !taken(&name) {
                return name;
            }
            number += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{rate_unit, rate_unit_in};

    #[test]
    fn the_unit_of_a_derivative_is_per_second() {
        for (unit, rate) in [("", ""), ("m", "m/s"), ("m/s", "m/s^2"), ("rad/s^2", "rad/s^3"), ("kpelts", "kpelts/s")] {
            assert_eq!(rate_unit(unit), rate);
            assert_eq!(rate_unit_in(unit, "s"), rate);
        }
        assert_eq!(rate_unit_in("rad", "min"), "rad/min");
        assert_eq!(rate_unit_in("m/s", "min"), "m/(s*min)");
    }
}
