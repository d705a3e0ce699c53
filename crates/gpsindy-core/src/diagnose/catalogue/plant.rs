//! Plants an effect in the nominal model, as the machine might have it and not as the search writes it.
//!
//! The forms are those of the published catalogue, with sharper corners than the search's: a friction whose sign turns
//! within a thousandth of the typical speed, an edge in time without a ramp. Nothing of the search's own writing of effects
//! is used.

use crate::diagnose::catalogue::effect::Effect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{Model, Parameter, State};
use std::f64::consts::{PI, TAU};

/// Share of the typical speed within which a friction turns. An exact sign at rest would stop any integrator.
const CORNER: f64 = 1e-3;

/// The nominal model with an effect whose size is one parameter.
#[derive(Debug, Clone)]
pub(crate) struct Planted {
    model: Model,
    /// The parameter that carries the size.
    parameter: usize,
    /// Name of the size in the catalogue's form.
    pub(crate) symbol: &'static str,
    pub(crate) unit: String,
    /// Value of the parameter without the effect, and what a strength of one adds to it.
    nominal: f64,
    sense: f64,
    is_limit: bool,
    /// A small strength to begin with, and the largest that makes sense in these logs.
    pub(crate) first: f64,
    pub(crate) most: f64,
    /// Why there is nothing beyond `most`; empty where only the search ends there.
    pub(crate) end: &'static str,
}

impl Planted {
    /// The model with the effect at `strength`, from 0 (none) to `most`.
    pub(crate) fn model(&self, strength: f64) -> Model {
        let mut model = self.model.clone();
        model.parameters[self.parameter].value = self.nominal + self.sense * strength;
        model
    }

    /// The size that a reader sees for a strength: the limit of a saturation, else the strength.
    pub(crate) fn size(&self, strength: f64) -> f64 {
        if self.is_limit { self.nominal - strength } else { strength }
    }

    /// Which parameter carries the size.
    pub(crate) fn parameter(&self) -> usize {
        self.parameter
    }
}

/// A strength with its first guess, its end, and the reason for the end.
struct Range {
    first: f64,
    most: f64,
    end: &'static str,
}

impl Range {
    fn open(first: f64, most: f64) -> Self {
        Self { first, most, end: "" }
    }
}

/// `model` with the effect of `hypothesis`; `None` for an effect of the user's own, which has no typical size.
pub(crate) fn plant(hypothesis: &Hypothesis, model: &Model, scene: &Scene) -> Result<Option<Planted>> {
    let Kind::Catalogue(effect) = &hypothesis.kind else { return Ok(None) };
    let effect = *effect;
    let mut model = model.clone();
    let name = |i: usize| hypothesis.variables.get(i).cloned().unwrap_or_default();
    if effect == Effect::ParameterError {
        return Ok(parameter_error(model, &name(0)));
    }
    let range = range(effect, hypothesis, &model, scene);
    let own = model.free_name(&format!("planted_{}", effect.id()));
    let mut parameter = Parameter::new(own.clone(), 0.0);
    let (symbol, sense, nominal) = match effect {
        Effect::InputSaturation => ("c", -1.0, control_size(&model, scene, &name(0))),
        Effect::InputDelay | Effect::InputLag | Effect::SensorDelay => ("tau", 1.0, 0.0),
        _ => ("c", 1.0, 0.0),
    };
    let unit = unit(effect, hypothesis, &model);
    parameter.unit.clone_from(&unit);
    let size = Expression::variable(own);
    let state = hypothesis.state;
    match effect {
        Effect::SensorBias | Effect::SensorScale | Effect::SensorDelay => sensor(effect, &mut model, state, &size)?,
        Effect::InputLag => lag(&mut model, &name(0), size),
        _ if effect.acts_on_input() => {
            let form = effect.form().split_once("becomes").map_or(effect.form(), |(_, form)| form);
            let becomes = written(form, symbol, &size, &[("u", Expression::variable(name(0)))])?;
            replace(&mut model, &name(0), &becomes);
        }
        Effect::Drift if !hypothesis.variables.is_empty() => {
            let changed = Expression::parse("1 + c*t")?.substitute("c", &size);
            replace(&mut model, &name(0), &changed.times(Expression::variable(name(0))));
        }
        _ => {
            let form = if effect == Effect::Drift { "c*t" } else { effect.form() };
            let mut symbols = shapes(effect, hypothesis, &model, scene, &size);
            symbols.push(("z", Expression::variable(name(0))));
            if effect == Effect::ProductCoupling {
                symbols.push(("w", Expression::variable(name(1))));
            }
            let mut term = written(form, symbol, &size, &symbols)?;
            if matches!(effect, Effect::CoulombFriction | Effect::StribeckFriction) {
                let speed = state_size(scene, model.state_index(&name(0)));
                term = term.map(&|part| with_corner(part, CORNER * speed));
            }
            let equation = &mut model.states[state].equation;
            *equation = equation.clone().plus(term);
        }
    }
    model.parameters.push(parameter);
    let parameter = model.parameters.len() - 1;
    Ok(Some(Planted {
        model,
        parameter,
        symbol,
        unit,
        nominal,
        sense,
        is_limit: effect == Effect::InputSaturation,
        first: range.first,
        most: range.most,
        end: range.end,
    }))
}

/// The catalogue's form with every symbol replaced, all at once, so that a variable may be called like a symbol.
fn written(form: &str, symbol: &str, size: &Expression, others: &[(&str, Expression)]) -> Result<Expression> {
    let parsed = Expression::parse(form)?;
    Ok(parsed.map(&|part| match &part {
        Expression::Variable(name) if name == symbol => size.clone(),
        Expression::Variable(name) => {
            others.iter().find(|(other, _)| other == name).map_or(part.clone(), |(_, e)| e.clone())
        }
        _ => part,
    }))
}

/// `sign(z)` turned within `width`.
fn with_corner(part: Expression, width: f64) -> Expression {
    match part {
        Expression::Call(Function::Sign, arguments) if arguments.len() == 1 => {
            arguments[0].clone().over(Expression::Number(width)).apply(Function::Tanh)
        }
        part => part,
    }
}

/// Values of the parameters that give an effect its shape: middle ones, that no start of the search has exactly.
fn shapes(
    effect: Effect,
    hypothesis: &Hypothesis,
    model: &Model,
    scene: &Scene,
    size: &Expression,
) -> Vec<(&'static str, Expression)> {
    let number = Expression::Number;
    let z = hypothesis.variables.first().and_then(|z| model.state_index(z));
    match effect {
        Effect::StribeckFriction => {
            vec![("s", number(2.0).times(size.clone())), ("w", number(0.13 * state_size(scene, z)))]
        }
        Effect::GravityLoad => vec![("phase", number(0.4))],
        Effect::Cogging => {
            let range = z.map_or(0.0, |j| scene.states[j].range());
            vec![("n", number(6.3 * TAU / range.max(f64::MIN_POSITIVE))), ("phase", number(0.7))]
        }
        Effect::PeriodicDisturbance => {
            let omega = (7.3 * TAU / scene.duration).min(0.4 * PI / scene.period);
            vec![("omega", number(omega)), ("phase", number(0.5))]
        }
        Effect::StepDisturbance => {
            // Runs have clocks of their own: the middle of the longest.
            vec![("t0", number(scene.times.0 + 0.43 * scene.duration))]
        }
        _ => Vec::new(),
    }
}

fn state_size(scene: &Scene, state: Option<usize>) -> f64 {
    state.and_then(|j| scene.states.get(j)).map_or(1.0, crate::diagnose::catalogue::excited::Excursion::size)
}

fn control_size(model: &Model, scene: &Scene, name: &str) -> f64 {
    model.control_index(name).map_or(0.0, |c| scene.controls[c].size_quantile(1.0))
}

fn range(effect: Effect, hypothesis: &Hypothesis, model: &Model, scene: &Scene) -> Range {
    let rate = scene.rates[hypothesis.state.min(scene.rates.len() - 1)];
    let size_of = |i: usize| {
        let name = hypothesis.variables.get(i);
        let control = name.and_then(|n| model.control_index(n));
        match control {
            Some(c) => scene.controls[c].size(),
            None => state_size(scene, name.and_then(|n| model.state_index(n))),
        }
    };
    let span = (scene.times.1 - scene.times.0).max(scene.period);
    let added = |scale: f64| Range::open(0.02 * scale, 300.0 * scale);
    let control = hypothesis.variables.first().cloned().unwrap_or_default();
    let largest = control_size(model, scene, &control);
    let stroke = model.control_index(&control).map_or(0.0, |c| scene.controls[c].range());
    let late = Range { first: 0.5 * scene.period, most: 0.1 * scene.duration, end: "a tenth of the longest run" };
    match effect {
        Effect::InputGain | Effect::SensorScale => Range::open(0.02, 3.0),
        Effect::InputBias => added(size_of(0)),
        Effect::InputSaturation => {
            Range { first: 0.1 * largest, most: 0.98 * largest, end: "the limit would leave nothing of the control" }
        }
        Effect::InputDeadZone => {
            Range { first: 0.02 * largest, most: 0.95 * largest, end: "it would leave nothing of the control" }
        }
        Effect::Backlash => {
            Range { first: 0.02 * stroke, most: 0.9 * stroke, end: "the control never reverses further" }
        }
        Effect::InputDelay | Effect::InputLag | Effect::SensorDelay => late,
        Effect::SensorBias => added(state_size(scene, Some(hypothesis.state))),
        Effect::ViscousFriction | Effect::LinearStiffness | Effect::Coupling => added(rate / size_of(0)),
        Effect::QuadraticDrag => added(rate / size_of(0).powi(2)),
        Effect::CubicStiffness => added(rate / size_of(0).powi(3)),
        Effect::ProductCoupling => added(rate / (size_of(0) * size_of(1))),
        Effect::Drift if hypothesis.variables.is_empty() => added(rate / span),
        Effect::Drift => Range::open(0.02 / span, 3.0 / span),
        _ => added(rate),
    }
}

fn unit(effect: Effect, hypothesis: &Hypothesis, model: &Model) -> String {
    let state = &model.states[hypothesis.state].unit;
    let control = || {
        let index = hypothesis.variables.first().and_then(|u| model.control_index(u));
        index.map_or(String::new(), |c| model.controls[c].unit.clone())
    };
    let rate = || model.states[hypothesis.state].rate_unit();
    match effect {
        Effect::InputDelay | Effect::InputLag | Effect::SensorDelay => "s".into(),
        Effect::InputBias | Effect::InputSaturation | Effect::InputDeadZone | Effect::Backlash => control(),
        Effect::SensorBias => state.clone(),
        Effect::Drift if !hypothesis.variables.is_empty() => "1/s".into(),
        Effect::Bias
        | Effect::CoulombFriction
        | Effect::StribeckFriction
        | Effect::GravityLoad
        | Effect::Cogging
        | Effect::PeriodicDisturbance
        | Effect::StepDisturbance => rate(),
        _ => String::new(),
    }
}

fn parameter_error(model: Model, name: &str) -> Option<Planted> {
    let parameter = model.parameter_index(name)?;
    let (nominal, unit) = (model.parameters[parameter].value, model.parameters[parameter].unit.clone());
    let scale = if nominal == 0.0 { 1.0 } else { nominal.abs() };
    // Away from zero, so that no sign changes.
    let sense = if nominal < 0.0 { -1.0 } else { 1.0 };
    let (first, most) = (0.02 * scale, 4.0 * scale);
    Some(Planted { model, parameter, symbol: "value", unit, nominal, sense, is_limit: false, first, most, end: "" })
}

fn sensor(effect: Effect, model: &mut Model, state: usize, size: &Expression) -> Result<()> {
    let own = Expression::variable(model.states[state].name.clone());
    let reads = model.states[state].measured.clone().unwrap_or_else(|| own.clone());
    let form = match effect {
        Effect::SensorBias => "reads + c",
        Effect::SensorScale => "(1 + c)*reads",
        _ => {
            let late = written("delay(x, tau)", "tau", size, &[("x", own)])?;
            let name = model.states[state].name.clone();
            model.states[state].measured = Some(reads.substitute(&name, &late));
            return Ok(());
        }
    };
    model.states[state].measured = Some(written(form, "c", size, &[("reads", reads)])?);
    Ok(())
}

fn lag(model: &mut Model, control: &str, time: Expression) {
    let follower = model.free_name(&format!("{control}_follows"));
    let own = Expression::variable(follower.clone());
    replace(model, control, &own);
    let rate = Expression::variable(control).minus(own).over(time);
    model.states.push(State::new(follower, rate));
}

fn replace(model: &mut Model, name: &str, by: &Expression) {
    for state in &mut model.states {
        state.equation = state.equation.substitute(name, by);
        state.measured = state.measured.as_ref().map(|m| m.substitute(name, by));
    }
}
