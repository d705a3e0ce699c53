//! Writes an effect into the equations of a model, with start values for its parameters.

use crate::diagnose::catalogue::effect::{CustomEffect, Effect};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Added, Applied, Combine, Hypothesis, Kind, Start};
use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Operator};
use crate::model::{Model, Parameter, State};
use std::f64::consts::{PI, TAU};

/// Fewest repetitions within the logs before something may be called periodic: less is any smooth curve.
const RIPPLES: f64 = 1.25;

/// Share of the logs that must lie on either side of a step: nearer to an end it is how a run starts or stops.
const EDGE: f64 = 0.1;
/// Fewest samples before and after a step.
const LASTING: f64 = 8.0;

fn number(value: f64) -> Expression {
    Expression::Number(value)
}

struct Writer<'a> {
    model: Model,
    scene: &'a Scene,
    hypothesis: &'a Hypothesis,
    fitted: Vec<(usize, Added)>,
}

fn amplitude(values: &[f64]) -> Start {
    Start { columns: vec![values.to_vec()], combine: Combine::Amplitude, amplitudes: vec![(0, 0.0)] }
}

fn keep(values: &[f64]) -> Start {
    Start { columns: vec![values.to_vec()], combine: Combine::Keep, amplitudes: Vec::new() }
}

fn sinusoid(values: &[f64]) -> Start {
    let mut turned = values.to_vec();
    if let Some(phase) = turned.last_mut() {
        *phase += 0.5 * PI;
    }
    Start { columns: vec![values.to_vec(), turned], combine: Combine::Sinusoid, amplitudes: Vec::new() }
}

pub(crate) fn apply(hypothesis: &Hypothesis, model: &Model, scene: &Scene) -> Result<Applied> {
    let mut writer = Writer { model: model.clone(), scene, hypothesis, fitted: Vec::new() };
    let starts = match &hypothesis.kind {
        Kind::Catalogue(effect) => writer.write(*effect)?,
        Kind::Custom(custom) => writer.custom(custom)?,
    };
    let parts = vec![writer.fitted.len()];
    Ok(Applied { model: writer.model, fitted: writer.fitted, parts, starts })
}

impl Writer<'_> {
    /// Adds a parameter that the fit may change, and returns it as an expression.
    fn add(&mut self, symbol: &str, value: f64, scale: f64, bounds: (f64, f64), unit: &str) -> Expression {
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
        };
        self.fitted.push((self.model.parameters.len() - 1, added));
        Expression::variable(name)
    }

    fn add_term(&mut self, term: Expression) {
        let state = &mut self.model.states[self.hypothesis.state];
        state.equation = state.equation.clone().plus(term);
    }

    fn variable(&self, index: usize) -> Result<Expression> {
        let name = self.hypothesis.variables.get(index).ok_or_else(|| {
            Error::invalid(format!("effect `{}` needs a variable that it depends on", self.hypothesis.id()))
        })?;
        Ok(Expression::variable(name.clone()))
    }

    /// Typical size of a variable: of a state or of a control.
    fn size(&self, index: usize) -> f64 {
        let Some(name) = self.hypothesis.variables.get(index) else { return 1.0 };
        if let Some(j) = self.model.state_index(name) {
            return self.scene.states.get(j).map_or(1.0, |s| s.size());
        }
        self.model.control_index(name).map_or(1.0, |c| self.scene.controls[c].size())
    }

    fn unit_of_rate(&self) -> String {
        self.model.states[self.hypothesis.state].rate_unit()
    }

    fn write(&mut self, effect: Effect) -> Result<Vec<Start>> {
        let rate = self.scene.rates[self.hypothesis.state.min(self.scene.rates.len() - 1)];
        match effect {
            Effect::ParameterError => self.parameter_error(),
            Effect::SensorBias | Effect::SensorScale | Effect::SensorDelay => self.sensor(effect),
            Effect::InputGain
            | Effect::InputBias
            | Effect::InputSaturation
            | Effect::InputDeadZone
            | Effect::InputDelay
            | Effect::InputLag
            | Effect::Backlash => self.input(effect),
            Effect::PeriodicDisturbance | Effect::StepDisturbance | Effect::Drift => self.time(effect, rate),
            _ => self.state_term(effect, rate),
        }
    }

    fn parameter_error(&mut self) -> Result<Vec<Start>> {
        let name = self.hypothesis.variables[0].clone();
        let Some(index) = self.model.parameter_index(&name) else {
            return Err(Error::unknown("parameter", &name, self.model.parameters.iter().map(|p| &p.name)));
        };
        let (lower, upper) = crate::diagnose::catalogue::joint::dissipative_bounds(&self.model, &name)
            .unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        let parameter = &mut self.model.parameters[index];
        parameter.tolerance = None;
        let size = if parameter.value == 0.0 { 1.0 } else { parameter.value.abs() };
        let added = Added { symbol: "value".into(), name, unit: parameter.unit.clone(), scale: size, lower, upper };
        // A straight line near the nominal value, then finite steps for what is none.
        let value = parameter.value;
        self.fitted.push((index, added));
        let near = Start { amplitudes: vec![(0, value)], ..amplitude(&[value + 1e-3 * size]) };
        let steps = [1.3, 0.75].map(|f| keep(&[if value == 0.0 { f - 1.0 } else { value * f }]));
        Ok(std::iter::once(near).chain(steps).collect())
    }

    fn state_term(&mut self, effect: Effect, rate: f64) -> Result<Vec<Start>> {
        const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        const POSITIVE: (f64, f64) = (0.0, f64::INFINITY);
        let unit = self.unit_of_rate();
        let small = 1e-3 * rate;
        if effect == Effect::Bias {
            let c = self.add("c", 0.0, rate, FREE, &unit);
            self.add_term(c);
            return Ok(vec![amplitude(&[small])]);
        }
        let z = self.variable(0)?;
        let size = self.size(0);
        Ok(match effect {
            Effect::ViscousFriction | Effect::LinearStiffness | Effect::Coupling => {
                let bounds = if effect == Effect::ViscousFriction { POSITIVE } else { FREE };
                let c = self.add("c", 0.0, rate / size, bounds, "");
                let term = c.times(z);
                self.add_term(if effect == Effect::Coupling { term } else { term.negated() });
                vec![amplitude(&[small / size])]
            }
            Effect::CoulombFriction => {
                let c = self.add("c", 0.0, rate, POSITIVE, &unit);
                let w = self.add("w", 0.02 * size, 0.02 * size, (0.002 * size, 0.1 * size), "");
                self.add_term(c.times(z.over(w).apply(Function::Tanh)).negated());
                vec![amplitude(&[small, 0.02 * size])]
            }
            Effect::StribeckFriction => {
                let c = self.add("c", 0.0, rate, POSITIVE, &unit);
                let extra = self.add("s_minus_c", 0.0, rate, POSITIVE, &unit);
                let w = self.add("w", size, size, (0.02 * size, 2.0 * size), "");
                // How sharp the corner is decides how long a part that should stick creeps: fitted, as for dry friction.
                let corner = self.add("corner", 0.02 * size, 0.02 * size, (0.002 * size, 0.1 * size), "");
                let bump = z.clone().over(w).power(number(2.0)).negated().apply(Function::Exp);
                self.add_term(c.plus(extra.times(bump)).times(z.over(corner).apply(Function::Tanh)).negated());
                let start = |w: f64| Start {
                    columns: vec![vec![small, 0.0, w * size, 0.02 * size], vec![0.0, small, w * size, 0.02 * size]],
                    combine: Combine::Amplitude,
                    amplitudes: vec![(0, 0.0), (1, 0.0)],
                };
                [0.1, 0.3, 1.0].map(start).into()
            }
            Effect::QuadraticDrag => {
                let c = self.add("c", 0.0, rate / (size * size), POSITIVE, "");
                self.add_term(c.times(z.clone()).times(z.apply(Function::Abs)).negated());
                vec![amplitude(&[small / (size * size)])]
            }
            Effect::CubicStiffness => {
                let c = self.add("c", 0.0, rate / size.powi(3), FREE, "");
                self.add_term(c.times(z.power(number(3.0))).negated());
                vec![amplitude(&[small / size.powi(3)])]
            }
            Effect::ProductCoupling => {
                let w = self.variable(1)?;
                let both = size * self.size(1);
                let c = self.add("c", 0.0, rate / both, FREE, "");
                let product = if z == w { z.power(number(2.0)) } else { z.times(w) };
                self.add_term(c.times(product));
                vec![amplitude(&[small / both])]
            }
            Effect::GravityLoad => {
                let c = self.add("c", 0.0, rate, FREE, &unit);
                let phase = self.add("phase", 0.0, 1.0, FREE, "rad");
                self.add_term(c.times(z.plus(phase).apply(Function::Sin)));
                vec![sinusoid(&[small, 0.0])]
            }
            Effect::Cogging => {
                let range =
                    self.model.state_index(&self.hypothesis.variables[0]).map_or(0.0, |j| self.scene.states[j].range());
                if range <= 0.0 {
                    return Ok(Vec::new());
                }
                let c = self.add("c", 0.0, rate, FREE, &unit);
                let n = self.add("n", 1.0, TAU / range, (RIPPLES * TAU / range, f64::INFINITY), "");
                let phase = self.add("phase", 0.0, 1.0, FREE, "rad");
                let angle = Expression::Binary(Operator::Multiply, n.into(), z.into());
                self.add_term(c.times(angle.plus(phase).apply(Function::Sin)));
                // Up to sixty ripples over the range; steps of half a ripple, so that no line is missed.
                (3..120).map(|k| sinusoid(&[small, PI * f64::from(k) / range, 0.0])).collect()
            }
            _ => Vec::new(),
        })
    }

    fn input(&mut self, effect: Effect) -> Result<Vec<Start>> {
        const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let name = self.hypothesis.variables[0].clone();
        let Some(control) = self.model.control_index(&name) else {
            return Err(Error::unknown("control", &name, self.model.controls.iter().map(|c| &c.name)));
        };
        let unit = self.model.controls[control].unit.clone();
        let scene = self.scene;
        let excursion = &scene.controls[control];
        let (size, period) = (excursion.size(), scene.period);
        let u = Expression::variable(name.clone());
        // Delays and lags up to a tenth of the longest log: a half to some hundred samples, in even ratios.
        let times = || {
            let longest = 0.1 * scene.duration;
            std::iter::successors(Some(0.5 * period), |t| Some(t * 1.5)).take_while(move |&t| t <= longest).take(14)
        };
        let (replacement, starts) = match effect {
            Effect::InputGain => {
                let c = self.add("c", 0.0, 1.0, FREE, "");
                (number(1.0).plus(c).times(u), vec![amplitude(&[1e-3])])
            }
            Effect::InputBias => {
                let c = self.add("c", 0.0, size, FREE, &unit);
                (u.plus(c), vec![amplitude(&[1e-3 * size])])
            }
            Effect::InputSaturation => {
                let largest = excursion.size_quantile(1.0);
                let c = self.add("c", largest, size, (0.02 * largest, largest), &unit);
                let starts = [0.97, 0.92, 0.85, 0.75, 0.6, 0.45, 0.3];
                let at = |part: &f64| keep(&[0.5 * (part * largest + excursion.size_quantile(*part))]);
                (Expression::Call(Function::Clamp, vec![u, c.clone().negated(), c]), starts.iter().map(at).collect())
            }
            Effect::InputDeadZone => {
                let largest = excursion.size_quantile(1.0);
                let c = self.add("c", 0.0, size, (0.0, 0.95 * largest), &unit);
                let starts = [0.02, 0.05, 0.1, 0.2, 0.35, 0.5].iter().map(|part| keep(&[part * size])).collect();
                (Expression::Call(Function::DeadZone, vec![u, c]), starts)
            }
            Effect::Backlash => {
                let range = excursion.range();
                let c = self.add("c", 0.0, size, (0.0, 0.9 * range), &unit);
                let starts = [0.01, 0.03, 0.06, 0.12, 0.25, 0.4].iter().map(|part| keep(&[part * range])).collect();
                (Expression::Call(Function::Play, vec![u, c]), starts)
            }
            Effect::InputDelay => {
                let tau = self.add("tau", 0.0, period, (0.0, 0.3 * scene.duration), "s");
                (Expression::Call(Function::Delay, vec![u, tau]), times().map(|t| keep(&[t])).collect())
            }
            _ => {
                let tau = self.add("tau", period, period, (0.05 * period, 0.5 * scene.duration), "s");
                let lagged = self.model.free_name(&format!("{name}_lag"));
                self.replace(&name, &Expression::variable(lagged.clone()));
                let follows = u.minus(Expression::variable(lagged.clone())).over(tau);
                self.model.states.push(State { unit, ..State::new(lagged, follows) });
                return Ok(times().map(|t| keep(&[t])).collect());
            }
        };
        self.replace(&name, &replacement);
        Ok(starts)
    }

    /// Puts `replacement` in the place of the control `name`, wherever it acts.
    fn replace(&mut self, name: &str, replacement: &Expression) {
        for state in &mut self.model.states {
            state.equation = state.equation.substitute(name, replacement);
            state.measured = state.measured.as_ref().map(|m| m.substitute(name, replacement));
        }
    }

    fn sensor(&mut self, effect: Effect) -> Result<Vec<Start>> {
        const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let j = self.hypothesis.state;
        let name = self.model.states[j].name.clone();
        let unit = self.model.states[j].unit.clone();
        let size = self.scene.states[j].size();
        let reads = self.model.states[j].measured.clone().unwrap_or_else(|| Expression::variable(name.clone()));
        let period = self.scene.period;
        let (measured, starts) = match effect {
            Effect::SensorBias => {
                let c = self.add("c", 0.0, size, FREE, &unit);
                (reads.plus(c), vec![amplitude(&[1e-3 * size])])
            }
            Effect::SensorScale => {
                let c = self.add("c", 0.0, 1.0, FREE, "");
                (number(1.0).plus(c).times(reads), vec![amplitude(&[1e-3])])
            }
            _ => {
                let tau = self.add("tau", 0.0, period, (0.0, 0.3 * self.scene.duration), "s");
                let late = Expression::Call(Function::Delay, vec![Expression::variable(name.clone()), tau]);
                let times = std::iter::successors(Some(0.5 * period), |t| Some(t * 1.7)).take(10);
                let longest = 0.1 * self.scene.duration;
                (reads.substitute(&name, &late), times.take_while(|&t| t <= longest).map(|t| keep(&[t])).collect())
            }
        };
        self.model.states[j].measured = Some(measured);
        Ok(starts)
    }

    fn time(&mut self, effect: Effect, rate: f64) -> Result<Vec<Start>> {
        const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let unit = self.unit_of_rate();
        let (first, last) = self.scene.times;
        let span = (last - first).max(self.scene.period);
        let small = 1e-3 * rate;
        match effect {
            Effect::PeriodicDisturbance => {
                let slowest = RIPPLES * TAU / span;
                let c = self.add("c", 0.0, rate, FREE, &unit);
                let omega =
                    self.add("omega", 1.0, TAU / self.scene.duration, (slowest, PI / self.scene.period), "rad/s");
                let phase = self.add("phase", 0.0, 1.0, FREE, "rad");
                let angle = Expression::Binary(Operator::Multiply, omega.into(), Expression::Time.into());
                self.add_term(c.times(angle.plus(phase).apply(Function::Sin)));
                Ok(self
                    .scene
                    .peaks
                    .iter()
                    .filter(|&&omega| omega >= slowest)
                    .map(|&omega| sinusoid(&[small, omega, 0.0]))
                    .collect())
            }
            Effect::StepDisturbance => {
                let c = self.add("c", 0.0, rate, FREE, &unit);
                // Less than a handful of samples beside the edge is a spike, not an event that lasts.
                let margin = (EDGE * span).max(LASTING * self.scene.period).min(0.5 * span);
                let t0 = self.add("t0", first, 0.01 * span, (first + margin, last - margin), "s");
                // A ramp of two samples in place of the edge, so that its time can be fitted.
                let ramp = Expression::Time.minus(t0).over(number(2.0 * self.scene.period));
                let edge = Expression::Call(Function::Clamp, vec![ramp, number(0.0), number(1.0)]);
                self.add_term(c.times(edge));
                let times = (2..31).map(|k| first + span * f64::from(k) / 32.0);
                let inside = times.filter(|t| (first + margin..=last - margin).contains(t));
                Ok(inside.map(|t| amplitude(&[small, t])).collect())
            }
            _ => {
                let Some(name) = self.hypothesis.variables.first().cloned() else {
                    let c = self.add("c", 0.0, rate / span, FREE, "");
                    self.add_term(c.times(Expression::Time));
                    return Ok(vec![amplitude(&[small / span])]);
                };
                let c = self.add("c", 0.0, 1.0 / span, FREE, "1/s");
                let changed = number(1.0).plus(c.times(Expression::Time)).times(Expression::variable(name.clone()));
                self.replace(&name, &changed);
                Ok(vec![amplitude(&[1e-3 / span])])
            }
        }
    }

    fn custom(&mut self, custom: &CustomEffect) -> Result<Vec<Start>> {
        let starts = crate::diagnose::catalogue::custom::starts(custom, &self.model, self.scene, self.hypothesis.state);
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
