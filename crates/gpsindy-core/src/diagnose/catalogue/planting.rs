//! Adds an effect to the nominal model for a power study, as the machine might have it and not as the search models it.
//!
//! The forms are those of the published catalogue, with sharper corners than those of the search: a friction whose sign
//! changes within a thousandth of the typical speed, a step in time without a ramp. No code of the search is shared. Each
//! effect has its form in its own file of `effects/`; this file has the building blocks.

use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::form::written;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{Model, Parameter};

/// Share of the typical speed within which a friction turns. An exact sign at rest would stop any integrator.
const CORNER: f64 = 1e-3;

/// The nominal model with an effect whose size is one parameter.
#[derive(Debug, Clone)]
pub(crate) struct Planted {
    model: Model,
    /// The parameter that carries the size.
    parameter: usize,
    size: Size,
}

impl Planted {
    /// The model with the effect at `strength`, from 0 (none) to `most`.
    pub(crate) fn model(&self, strength: f64) -> Model {
        let mut model = self.model.clone();
        model.parameters[self.parameter].value = self.size.nominal + self.size.sense * strength;
        model
    }

    /// The size that a reader sees for a strength: the limit of a saturation, else the strength.
    pub(crate) fn size(&self, strength: f64) -> f64 {
        if self.size.is_limit { self.size.nominal - strength } else { strength }
    }

    /// Which parameter carries the size.
    pub(crate) fn parameter(&self) -> usize {
        self.parameter
    }

    /// Name of the size in the catalogue's form.
    pub(crate) fn symbol(&self) -> &'static str {
        self.size.symbol
    }

    pub(crate) fn unit(&self) -> &str {
        &self.size.unit
    }

    /// A small strength to begin with, and the largest that makes sense in these logs.
    pub(crate) fn range(&self) -> (f64, f64) {
        (self.size.first, self.size.most)
    }

    /// Why there is nothing beyond the largest; empty where only the search ends there.
    pub(crate) fn end(&self) -> &'static str {
        self.size.end
    }
}

/// What the size of a planted effect is, and how far it may go.
#[derive(Debug, Clone)]
pub(crate) struct Size {
    symbol: &'static str,
    unit: String,
    /// The parameter that carries it, where it is one of the model's own.
    carrier: Option<usize>,
    /// Value of the parameter without the effect, and what a strength of one adds to it.
    nominal: f64,
    sense: f64,
    is_limit: bool,
    first: f64,
    most: f64,
    end: &'static str,
}

impl Size {
    /// A strength from `first` to `most`, beyond which there is nothing for the reason `end`.
    pub(crate) fn within(symbol: &'static str, unit: String, (first, most): (f64, f64), end: &'static str) -> Self {
        Self { symbol, unit, carrier: None, nominal: 0.0, sense: 1.0, is_limit: false, first, most, end }
    }

    /// A strength of an added term whose typical value is `scale`.
    pub(crate) fn added(unit: String, scale: f64) -> Self {
        Self::within("c", unit, (0.02 * scale, 300.0 * scale), "")
    }

    /// The same below zero.
    pub(crate) fn downward(self) -> Self {
        Self { sense: -1.0, ..self }
    }

    /// The same under another symbol of the form.
    pub(crate) fn called(self, symbol: &'static str) -> Self {
        Self { symbol, ..self }
    }

    /// A limit that begins at `nominal`, where it does nothing, and comes down.
    pub(crate) fn limit(symbol: &'static str, unit: String, nominal: f64, (first, most): (f64, f64)) -> Self {
        let end = "the limit would leave nothing of the control";
        Self { nominal, sense: -1.0, is_limit: true, ..Self::within(symbol, unit, (first, most), end) }
    }

    /// A parameter of the model that is off, away from zero so that no sign changes.
    pub(crate) fn of_parameter(carrier: usize, model: &Model) -> Self {
        let Parameter { value, unit, .. } = &model.parameters[carrier];
        let scale = model.parameters[carrier].typical();
        let sense = if *value < 0.0 { -1.0 } else { 1.0 };
        let plain = Self::within("value", unit.clone(), (0.02 * scale, 4.0 * scale), "");
        Self { carrier: Some(carrier), nominal: *value, sense, ..plain }
    }
}

/// A model into which an effect is planted.
pub(crate) struct Planting<'a> {
    pub(crate) model: Model,
    pub(crate) scene: &'a Scene,
    pub(crate) hypothesis: &'a Hypothesis,
    /// The size, a parameter of the model to be.
    pub(crate) size: Expression,
}

/// `model` with the effect of `hypothesis`; `None` for an effect of the user's own, which has no typical size.
pub(crate) fn plant(hypothesis: &Hypothesis, model: &Model, scene: &Scene) -> Result<Option<Planted>> {
    let Kind::Catalogue(effect) = &hypothesis.kind else { return Ok(None) };
    let own = model.free_name(&format!("planted_{}", effect.id()));
    let size = Expression::variable(own.clone());
    let mut planting = Planting { model: model.clone(), scene, hypothesis, size };
    let Some(size) = (effect.definition().plant)(&mut planting)? else { return Ok(None) };
    let mut model = planting.model;
    let parameter = size.carrier.unwrap_or_else(|| {
        model.parameters.push(Parameter { unit: size.unit.clone(), ..Parameter::new(own, 0.0) });
        model.parameters.len() - 1
    });
    Ok(Some(Planted { model, parameter, size }))
}

impl Planting<'_> {
    /// A form with `symbol` as its size and other symbols replaced, all at once, so that a variable may be called like a
    /// symbol.
    pub(crate) fn written(&self, form: &str, symbol: &str, others: &[(&str, Expression)]) -> Result<Expression> {
        let size = [(symbol, self.size.clone())];
        written(form, &[&size, others].concat())
    }

    /// Adds a form of the size `c` and the hypothesis' variables `z` and `w` to the equation.
    pub(crate) fn add(&mut self, form: &str, shapes: &[(&str, Expression)]) -> Result<()> {
        let mut others = shapes.to_vec();
        let variables = ["z", "w"].into_iter().zip(&self.hypothesis.variables);
        others.extend(variables.map(|(symbol, name)| (symbol, Expression::variable(name.clone()))));
        let term = self.written(form, "c", &others)?;
        self.add_term(term);
        Ok(())
    }

    pub(crate) fn add_term(&mut self, term: Expression) {
        if let Some(site) = &self.hypothesis.site {
            let name = site.name.clone();
            self.replace(&name, &Expression::variable(name.clone()).plus(term));
            return;
        }
        let equation = &mut self.model.states[self.hypothesis.state].equation;
        *equation = equation.clone().plus(term);
    }

    /// Puts a form of the size and the control `u` in the control's place.
    pub(crate) fn drive(&mut self, form: &str, symbol: &str) -> Result<()> {
        let name = self.name(0);
        let becomes = self.written(form, symbol, &[("u", Expression::variable(name.clone()))])?;
        self.replace(&name, &becomes);
        Ok(())
    }

    pub(crate) fn replace(&mut self, name: &str, by: &Expression) {
        self.model.replace(name, by, None);
    }

    /// The same but in the equation of a variable of the hypothesis that is a state.
    pub(crate) fn replace_beside(&mut self, index: usize, name: &str, by: &Expression) {
        let kept = self.hypothesis.variables.get(index).and_then(|own| self.model.state_index(own));
        self.model.replace(name, by, kept);
    }

    /// The column reads a form of the size `c` and what it `reads` now.
    pub(crate) fn read_as(&mut self, form: &str) -> Result<()> {
        let state = &self.model.states[self.hypothesis.state];
        let reads = state.measured.clone().unwrap_or_else(|| Expression::variable(state.name.clone()));
        let measured = self.written(form, "c", &[("reads", reads)])?;
        self.model.states[self.hypothesis.state].measured = Some(measured);
        Ok(())
    }

    /// The column reads as it does now, of a form of the size and the state `x` in the state's place.
    pub(crate) fn see_as(&mut self, form: &str, symbol: &str) -> Result<()> {
        let state = &self.model.states[self.hypothesis.state];
        let own = Expression::variable(state.name.clone());
        let reads = state.measured.clone().unwrap_or_else(|| own.clone());
        let measured = reads.substitute(&state.name, &self.written(form, symbol, &[("x", own)])?);
        self.model.states[self.hypothesis.state].measured = Some(measured);
        Ok(())
    }

    /// Name of a variable of the hypothesis.
    pub(crate) fn name(&self, index: usize) -> String {
        self.hypothesis.variables.get(index).cloned().unwrap_or_default()
    }

    /// How the variable moves; `None` where it is neither state nor control.
    pub(crate) fn excursion(&self, index: usize) -> Option<&Excursion> {
        let name = self.hypothesis.variables.get(index)?;
        match self.model.control_index(name) {
            Some(c) => self.scene.controls.get(c),
            None => self.model.state_index(name).and_then(|j| self.scene.states.get(j)),
        }
    }

    /// Typical size of a variable of the hypothesis.
    pub(crate) fn size_of(&self, index: usize) -> f64 {
        self.excursion(index).map_or(1.0, Excursion::size)
    }

    /// Largest size of the control.
    pub(crate) fn largest(&self) -> f64 {
        self.excursion(0).map_or(0.0, |e| e.size_quantile(1.0))
    }

    /// Typical rate of the equation.
    pub(crate) fn rate(&self) -> f64 {
        self.hypothesis.typical_rate(self.scene)
    }

    /// From the first sample of any log to the last one.
    pub(crate) fn span(&self) -> f64 {
        (self.scene.times.1 - self.scene.times.0).max(self.scene.period)
    }

    pub(crate) fn rate_unit(&self) -> String {
        self.hypothesis.unit_of_rate(&self.model)
    }

    /// Unit of a factor before the hypothesis' variables to these powers, `(variable, power)`.
    pub(crate) fn unit_per(&self, powers: &[(usize, i32)]) -> String {
        self.hypothesis.unit_per(&self.model, powers)
    }

    /// Unit of a variable of the hypothesis.
    pub(crate) fn unit_of(&self, index: usize) -> String {
        self.hypothesis.unit_of(&self.model, index)
    }

    /// Unit of the first variable where it is a control.
    pub(crate) fn control_unit(&self) -> String {
        let index = self.model.control_index(&self.name(0));
        index.map_or(String::new(), |c| self.model.controls[c].unit.clone())
    }

    /// A time by which something is late.
    pub(crate) fn late(&self) -> Size {
        let range = (0.5 * self.scene.period, 0.1 * self.scene.duration);
        Size::within("tau", "s".into(), range, "a tenth of the longest run")
    }

    /// `sign` turned within a small part of the typical size of the first variable.
    pub(crate) fn with_corners(&self, term: Expression) -> Expression {
        let width = CORNER * self.size_of(0);
        term.map(&|part| match part {
            Expression::Call(Function::Sign, arguments) if arguments.len() == 1 => {
                arguments[0].clone().over(Expression::Number(width)).apply(Function::Tanh)
            }
            part => part,
        })
    }
}
