//! Writes a hypothesis into the equations of a model, with start values for its parameters.
//!
//! Each effect has its terms in its own file of `effects/`; this file has the building blocks.

use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::form::written;
use crate::diagnose::catalogue::hypothesis::{Added, Applied, Combine, Hypothesis, Kind, Role, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::Family;
use crate::diagnose::limits::catalogue::{CORNER, CORNERS};
use crate::diagnose::limits::sampling::REACH;
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::model::{Model, Parameter, State};
use std::f64::consts::PI;

/// Fewest repetitions within the logs before something may be called periodic: less is any smooth curve.
pub(crate) const RIPPLES: f64 = 1.25;

/// Bounds of a parameter of either sign.
pub(crate) const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
/// Bounds of a size that only takes energy out.
pub(crate) const POSITIVE: (f64, f64) = (0.0, f64::INFINITY);

/// A model into which a hypothesis is written.
pub(crate) struct Writer<'a> {
    pub(crate) model: Model,
    pub(crate) scene: &'a Scene,
    pub(crate) hypothesis: &'a Hypothesis,
    pub(crate) fitted: Vec<(usize, Added)>,
}

/// A control on which an effect acts.
pub(crate) struct Drive<'a> {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// The control as an expression.
    pub(crate) u: Expression,
    pub(crate) excursion: &'a Excursion,
}

pub(crate) fn number(value: f64) -> Expression {
    Expression::Number(value)
}

/// A start whose first value is a size: a small one, drawn to its length by the screening.
pub(crate) fn amplitude(values: &[f64]) -> Start {
    Start { columns: vec![values.to_vec()], combine: Combine::Amplitude, amplitudes: vec![(0, 0.0)], is_pointed: false }
}

/// A start from where nothing is a straight line.
pub(crate) fn keep(values: &[f64]) -> Start {
    Start { columns: vec![values.to_vec()], combine: Combine::Keep, amplitudes: Vec::new(), is_pointed: false }
}

/// A start whose first value is a size and whose last a phase.
pub(crate) fn sinusoid(values: &[f64]) -> Start {
    let mut turned = values.to_vec();
    if let Some(phase) = turned.last_mut() {
        *phase += 0.5 * PI;
    }
    Start {
        columns: vec![values.to_vec(), turned],
        combine: Combine::Sinusoid,
        amplitudes: Vec::new(),
        is_pointed: false,
    }
}

impl Hypothesis {
    /// Writes the hypothesis into `model`.
    pub(crate) fn apply(&self, model: &Model, scene: &Scene) -> Result<Applied> {
        let mut writer = Writer { model: model.clone(), scene, hypothesis: self, fitted: Vec::new() };
        let starts = match &self.kind {
            Kind::Catalogue(effect) => match self.carrier(model) {
                Some(parameter) => writer.carried(&parameter),
                None => (effect.definition().write)(&mut writer)?,
            },
            Kind::Custom(custom) => writer.custom(custom)?,
            Kind::Nameless(rival) => return Ok(rival.apply(model, scene)),
        };
        let parts = vec![writer.fitted.len()];
        Ok(Applied { model: writer.model, fitted: writer.fitted, parts, starts })
    }
}

impl<'a> Writer<'a> {
    /// Adds a parameter that the fit may change, and returns it as an expression.
    pub(crate) fn add(&mut self, symbol: &str, value: f64, scale: f64, bounds: (f64, f64), unit: &str) -> Expression {
        let name = self.model.free_name(&format!("{}_{symbol}", self.hypothesis.id()));
        let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        self.model.parameters.push(Parameter { unit: unit.into(), ..Parameter::new(name.clone(), value) });
        let added = Added {
            symbol: symbol.into(),
            name: name.clone(),
            unit: unit.into(),
            scale,
            lower: bounds.0,
            upper: bounds.1,
            role: Role::Plain,
        };
        self.fitted.push((self.model.parameters.len() - 1, added));
        Expression::variable(name)
    }

    /// Adds a duration, speed or frequency that the effect is named for, within what the logs can show.
    pub(crate) fn add_scale(
        &mut self,
        symbol: &str,
        value: f64,
        scale: f64,
        bounds: (f64, f64),
        unit: &str,
    ) -> Expression {
        let added = self.add(symbol, value, scale, bounds, unit);
        self.assign(Role::Scale);
        added
    }

    /// Adds the instant of an event, s.
    pub(crate) fn add_instant(&mut self, symbol: &str, scale: f64, bounds: (f64, f64)) -> Expression {
        let instant = self.add(symbol, bounds.0, scale, bounds, "s");
        self.assign(Role::Instant);
        instant
    }

    /// Gives the parameter that was added last a role.
    fn assign(&mut self, role: Role) {
        if let Some((_, added)) = self.fitted.last_mut() {
            added.role = role;
        }
    }

    /// Adds the speed within which dry friction turns around, around which it starts: a corner as other simulators have it,
    /// and beyond the sharpest of them none, where it holds at rest.
    pub(crate) fn add_corner(&mut self, symbol: &str) -> Expression {
        let (size, speed) = (self.size(0), self.unit_of(0));
        let corner = self.add(
            symbol,
            CORNER * size,
            CORNER * size,
            (CORNERS.0 * CORNER * size, CORNERS.1 * CORNER * size),
            &speed,
        );
        // A simulator that steps has no modes.
        if !self.model.calls_simulator() {
            self.assign(Role::Corner);
        }
        corner
    }

    /// Adds the delay of a command, s.
    pub(crate) fn add_delay(&mut self, symbol: &str, longest: f64) -> Expression {
        let delay = self.add(symbol, 0.0, self.scene.period, (0.0, longest), "s");
        if self.model.calls_simulator() {
            self.assign(Role::Late);
        }
        delay
    }

    /// Adds the level of dry friction at rest, the parameter before it being that in motion: found by trial.
    pub(crate) fn add_level_at_rest(&mut self, symbol: &str, scale: f64, unit: &str) -> Expression {
        let rest = self.add(symbol, 0.0, scale, POSITIVE, unit);
        self.assign(Role::AtRest);
        rest
    }

    /// Adds an end of the travel, above or below, that the logs may never reach.
    pub(crate) fn add_end(&mut self, symbol: &str, role: Role, scale: f64, bounds: (f64, f64)) -> Expression {
        let (value, unit) = (if role == Role::Above { bounds.1 } else { bounds.0 }, self.unit_of(0));
        let end = self.add(symbol, value, scale, bounds, &unit);
        self.assign(role);
        end
    }

    /// Adds the phase of a sine, which a reader has within a turn.
    pub(crate) fn add_phase(&mut self) -> Expression {
        let phase = self.add("phase", 0.0, 1.0, FREE, "rad");
        self.assign(Role::Angle);
        phase
    }

    /// An effect that the simulator has as a parameter of its own: that much more of it.
    fn carried(&mut self, parameter: &str) -> Vec<Start> {
        // Dry friction is a force; damping, stiffness and inertia are forces by their variable.
        let is_force = self.hypothesis.is(Effect::CoulombFriction);
        let size = if is_force { 1.0 } else { self.size(0) };
        let own = self.model.parameters.iter().find(|p| p.name == parameter).map_or("", |p| &p.unit);
        let unit = if own.is_empty() && is_force { self.unit_of_rate() } else { own.into() };
        let scale = self.rate() / size;
        let c = self.add("c", 0.0, scale, POSITIVE, &unit);
        self.replace(parameter, &Expression::variable(parameter).plus(c));
        vec![amplitude(&[1e-3 * scale])]
    }

    /// Adds a term to the right side of the equation, or to the port or control, at which the effect acts.
    pub(crate) fn add_term(&mut self, term: Expression) {
        if let Some(site) = &self.hypothesis.site {
            let name = site.name.clone();
            self.replace(&name, &Expression::variable(name.clone()).plus(term));
            return;
        }
        let state = &mut self.model.states[self.hypothesis.state];
        state.equation = state.equation.clone().plus(term);
    }

    /// A form of the effect's own symbols, and of the hypothesis' variables under the symbols that its definition has for
    /// them.
    pub(crate) fn form(&self, text: &str, own: &[(&str, Expression)]) -> Result<Expression> {
        let symbols = self.hypothesis.effect().map_or(&[][..], |effect| effect.definition().symbols);
        let variables =
            symbols.iter().copied().zip(self.hypothesis.variables.iter().cloned().map(Expression::variable));
        written(text, &own.iter().cloned().chain(variables).collect::<Vec<_>>())
    }

    /// Adds a state that starts at `initial` whatever the log, or where what it follows is.
    pub(crate) fn add_state(&mut self, wanted: &str, initial: Option<f64>) -> Expression {
        let name = self.model.free_name(wanted);
        if let Some(value) = initial {
            self.model.initial.insert(name.clone(), value);
        }
        self.model.states.push(State::new(name.clone(), Expression::Number(0.0)));
        Expression::variable(name)
    }

    /// Sets the equation of an added state.
    pub(crate) fn set_rate(&mut self, state: &Expression, rate: Expression) {
        if let Expression::Variable(name) = state
            && let Some(index) = self.model.state_index(name)
        {
            self.model.states[index].equation = rate;
        }
    }

    /// Puts `replacement` in the place of `name`, wherever it acts.
    pub(crate) fn replace(&mut self, name: &str, replacement: &Expression) {
        self.model.replace(name, replacement, None);
    }

    /// The same but in the equation of a variable of the hypothesis that is a state.
    pub(crate) fn replace_beside(&mut self, index: usize, name: &str, replacement: &Expression) {
        let kept = self.hypothesis.variables.get(index).and_then(|own| self.model.state_index(own));
        self.model.replace(name, replacement, kept);
    }

    /// Puts `replacement` in the place of a whole part, wherever it stands.
    pub(crate) fn replace_part(&mut self, whole: &Expression, replacement: &Expression) {
        let other = |part| if part == *whole { replacement.clone() } else { part };
        for state in &mut self.model.states {
            state.equation = state.equation.map(&other);
            state.measured = state.measured.as_ref().map(|m| m.map(&other));
        }
    }

    /// A variable of the hypothesis.
    pub(crate) fn variable(&self, index: usize) -> Result<Expression> {
        let name = self.hypothesis.variables.get(index).ok_or_else(|| {
            Error::model(format!("effect `{}` needs a variable that it depends on", self.hypothesis.id()))
        })?;
        Ok(Expression::variable(name.clone()))
    }

    /// How a variable of the hypothesis moves; `None` for what is neither state nor control.
    pub(crate) fn excursion(&self, index: usize) -> Option<&'a Excursion> {
        let name = self.hypothesis.variables.get(index)?;
        match self.model.state_index(name) {
            Some(j) => self.scene.states.get(j),
            None => self.model.control_index(name).map(|c| &self.scene.controls[c]),
        }
    }

    /// How far the difference of two states goes along the nominal trajectories; `None` for other variables.
    pub(crate) fn range_between(&self, one: usize, other: usize) -> Option<f64> {
        let state = |index: usize| self.model.state_index(self.hypothesis.variables.get(index)?);
        let (one, other) = (state(one)?, state(other)?);
        let ends = |(low, high): (f64, f64), difference: f64| (low.min(difference), high.max(difference));
        let differences = self.scene.moments.iter().map(|moment| moment[one] - moment[other]);
        let (low, high) = differences.filter(|d| d.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        (high > low).then_some(high - low)
    }

    /// Typical size of a variable: of a state or of a control.
    pub(crate) fn size(&self, index: usize) -> f64 {
        self.excursion(index).map_or(1.0, Excursion::size)
    }

    /// Typical rate of the equation in which the effect acts, or the force at its site that moves as much.
    pub(crate) fn rate(&self) -> f64 {
        self.hypothesis.typical_rate(self.scene)
    }

    /// A rate so small that a straight line holds.
    pub(crate) fn small(&self) -> f64 {
        1e-3 * self.rate()
    }

    pub(crate) fn unit_of_rate(&self) -> String {
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

    /// First and last time of the logs, and what lies between.
    pub(crate) fn span(&self) -> (f64, f64, f64) {
        let (first, last) = self.scene.times;
        (first, last, (last - first).max(self.scene.period))
    }

    /// The control on which the effect acts.
    pub(crate) fn drive(&self) -> Result<Drive<'a>> {
        let name = self.hypothesis.variables.first().cloned().unwrap_or_default();
        let Some(control) = self.model.control_index(&name) else {
            return Err(Error::unknown("control", &name, self.model.controls.iter().map(|c| &c.name)));
        };
        let unit = self.model.controls[control].unit.clone();
        Ok(Drive { u: Expression::variable(name.clone()), name, unit, excursion: &self.scene.controls[control] })
    }

    /// Times at which a delay or a lag is tried: from half a sample up by `ratio`, to a tenth of the longest log.
    pub(crate) fn times(&self, ratio: f64, most: usize) -> Vec<Start> {
        let longest = 0.1 * self.scene.duration;
        let times = std::iter::successors(Some(0.5 * self.scene.period), |t| Some(t * ratio));
        times.take(most).take_while(|&t| t <= longest).map(|t| keep(&[t])).collect()
    }

    /// Adds period and phase of a sample-and-hold, both found by trial.
    pub(crate) fn add_sampling(&mut self) -> (Expression, Expression) {
        let step = self.scene.period;
        let seen = self.seen().map_or(0.0, |(period, _)| REACH * period);
        let longest = (0.1 * self.scene.duration).max(seen);
        let period = self.add("T", 2.0 * step, step, (1.5 * step, longest.max(2.0 * step)), "s");
        let phase = self.add("phase", self.scene.times.0, step, FREE, "s");
        let last = self.fitted.len();
        for ((_, added), role) in self.fitted[last - 2..].iter_mut().zip([Role::Period, Role::Phase]) {
            added.role = role;
        }
        (period, phase)
    }

    /// Period and phase of the sensor of the hypothesis, where its column shows them.
    fn seen(&self) -> Option<(f64, f64)> {
        let is_of_sensor = self.hypothesis.family() == Family::Sensor;
        self.scene.samplings.get(self.hypothesis.state).copied().flatten().filter(|_| is_of_sensor)
    }

    /// Periods at which a sample-and-hold is tried, in samples of the log: about a quarter apart. That of a sensor that repeats its readings
    /// is known; of a control those come first that what a fit leaves points to.
    pub(crate) fn samplings(&self) -> Vec<Start> {
        if let Some((period, phase)) = self.seen() {
            return vec![keep(&[period, phase])];
        }
        const SAMPLES: [f64; 12] = [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0, 32.0];
        let longest = 0.1 * self.scene.duration;
        let periods = SAMPLES.iter().map(|samples| samples * self.scene.period);
        let tried = periods.take_while(|&period| period <= longest).map(|period| keep(&[period, self.scene.times.0]));
        let control = self.hypothesis.variables.first().and_then(|name| self.model.control_index(name));
        let pointed = control.and_then(|control| self.scene.holds.get(control)).into_iter().flatten();
        let best = |(place, &(period, phase))| Start { is_pointed: place == 0, ..keep(&[period, phase]) };
        let pointed = pointed.enumerate().map(best);
        pointed.chain(tried).collect()
    }

    /// What the column of the hypothesis reads now.
    pub(crate) fn reads(&self) -> Expression {
        let state = &self.model.states[self.hypothesis.state];
        state.measured.clone().unwrap_or_else(|| Expression::variable(state.name.clone()))
    }

    /// The column of the hypothesis reads something else.
    pub(crate) fn read_as(&mut self, measured: Expression) {
        self.model.states[self.hypothesis.state].measured = Some(measured);
    }

    fn custom(&mut self, custom: &CustomEffect) -> Result<Vec<Start>> {
        let starts =
            crate::diagnose::catalogue::custom::starts::starts(custom, &self.model, self.scene, self.hypothesis.state);
        let mut form = custom.form.clone();
        for parameter in &custom.parameters {
            let value = 0.5 * (parameter.low + parameter.high);
            let scale = parameter.high - parameter.low;
            let bounds = (parameter.low, parameter.high);
            let own = self.add(&parameter.name, value, scale, bounds, &parameter.unit);
            form = form.substitute(&parameter.name, &own);
        }
        self.add_term(form);
        Ok(starts)
    }
}
