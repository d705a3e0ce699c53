//! Hypotheses: an effect of the catalogue at a place in a model, written into the model's equations.

use crate::diagnose::catalogue::effect::{CustomEffect, Effect, Family};
use crate::diagnose::catalogue::excited::Scene;
use crate::error::{Error, Result};
use crate::expression::Tape;
use crate::model::{Model, State};

/// What acts: an effect of the catalogue or one of the user's own.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Catalogue(Effect),
    Custom(Box<CustomEffect>),
}

/// An effect at a place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hypothesis {
    pub(crate) kind: Kind,
    /// The state in whose equation (or column) it acts.
    pub(crate) state: usize,
    /// The variables, controls or parameters that it depends on.
    pub(crate) variables: Vec<String>,
}

/// A parameter that a hypothesis adds to the model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Added {
    /// Its name in the catalogue's form.
    pub(crate) symbol: String,
    /// Its name in the model.
    pub(crate) name: String,
    pub(crate) unit: String,
    /// Size of a finite difference's typical value.
    pub(crate) scale: f64,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

/// How the coefficients of a screening become start values of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Combine {
    /// Columns that are each proportional to the size of one parameter.
    Amplitude,
    /// Two columns, at phase zero and at a quarter turn: size and phase (first and last parameter).
    Sinusoid,
    /// Any number of columns, each proportional to a parameter of its own.
    Span,
    /// The column is no straight line in any parameter: start where it was made.
    Keep,
}

/// Start values of the added parameters: one or two columns of a screening.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Start {
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) combine: Combine,
    /// For [`Combine::Amplitude`]: which parameter each column moves, and at which value it does nothing.
    pub(crate) amplitudes: Vec<(usize, f64)>,
}

/// A model with a hypothesis written into it.
#[derive(Debug, Clone)]
pub(crate) struct Applied {
    pub(crate) model: Model,
    /// Parameters that are to be fitted: index in the model, and what is known of them.
    pub(crate) fitted: Vec<(usize, Added)>,
    /// How many of them each hypothesis brought.
    pub(crate) parts: Vec<usize>,
    pub(crate) starts: Vec<Start>,
}

impl Hypothesis {
    pub(crate) fn catalogue(effect: Effect, state: usize, variables: &[&str]) -> Self {
        let variables = variables.iter().map(|v| (*v).to_string()).collect();
        Self { kind: Kind::Catalogue(effect), state, variables }
    }

    pub(crate) fn id(&self) -> &str {
        match &self.kind {
            Kind::Catalogue(effect) => effect.id(),
            Kind::Custom(custom) => &custom.id,
        }
    }

    pub(crate) fn family(&self) -> Family {
        match &self.kind {
            Kind::Catalogue(effect) => effect.family(),
            Kind::Custom(_) => Family::Custom,
        }
    }

    /// Writes the hypothesis into `model`.
    pub(crate) fn apply(&self, model: &Model, scene: &Scene) -> Result<Applied> {
        crate::diagnose::catalogue::write::apply(self, model, scene)
    }
}

/// Every hypothesis that makes sense in `model`, logged in the states `logged`.
pub(crate) fn enumerate(
    model: &Model,
    scene: &Scene,
    logged: &[usize],
    custom: &[CustomEffect],
) -> Result<Vec<Hypothesis>> {
    let mut all = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        if !model.is_kinematic(j) {
            state_hypotheses(model, j, state, &mut all);
        }
    }
    for parameter in &model.parameters {
        if let Some(j) = acts_in(model, scene, &parameter.name) {
            all.push(Hypothesis::catalogue(Effect::ParameterError, j, &[&parameter.name]));
            all.push(Hypothesis::catalogue(Effect::Drift, j, &[&parameter.name]));
        }
    }
    for control in &model.controls {
        if let Some(j) = acts_in(model, scene, &control.name) {
            for &effect in Effect::ALL.iter().filter(|e| e.acts_on_input()) {
                all.push(Hypothesis::catalogue(effect, j, &[&control.name]));
            }
        }
    }
    for &j in logged {
        for effect in [Effect::SensorBias, Effect::SensorScale, Effect::SensorDelay] {
            all.push(Hypothesis::catalogue(effect, j, &[]));
        }
    }
    for effect in custom {
        let Some(j) = model.state_index(&effect.state) else {
            return Err(Error::unknown("state", &effect.state, model.states.iter().map(|s| &s.name)));
        };
        // Its own parameters, and those of the model, are no variables that it depends on.
        let moves = |name: &String| model.state_index(name).is_some() || model.control_index(name).is_some();
        let own = |name: &String| effect.parameters.iter().any(|p| p.name == *name);
        let variables = effect.form.variables().into_iter().filter(|name| moves(name) && !own(name)).collect();
        all.push(Hypothesis { kind: Kind::Custom(effect.clone().into()), state: j, variables });
    }
    Ok(all)
}

/// The equation in which `name` stands; of several, the one whose rate it moves most beside what is typical there.
///
/// An effect on a control or a parameter acts wherever it stands, but a report has one place for it.
fn acts_in(model: &Model, scene: &Scene, name: &str) -> Option<usize> {
    /// What an equation must have beyond the first, so that equals keep their order.
    const CLEARLY: f64 = 1.05;
    let places = (0..model.states.len()).filter(|&j| model.states[j].equation.contains(name));
    let mut best: Option<(usize, f64)> = None;
    for j in places {
        let moved = influence(model, scene, j, name);
        if best.is_none_or(|(_, most)| moved > CLEARLY * most) {
            best = Some((j, moved));
        }
    }
    let reads = || model.states.iter().position(|s| s.measured.as_ref().is_some_and(|m| m.contains(name)));
    best.map(|(j, _)| j).or_else(reads)
}

/// Change of equation `j` as a control goes over its range, or a parameter by half of itself, beside the typical rate.
fn influence(model: &Model, scene: &Scene, j: usize, name: &str) -> f64 {
    let names: Vec<String> = model.names().map(str::to_string).collect();
    let Ok(tape) = Tape::new(std::slice::from_ref(&model.states[j].equation), &names) else { return 0.0 };
    let excursion = |other: &str| {
        let state = model.state_index(other).and_then(|i| scene.states.get(i));
        state.or_else(|| model.control_index(other).and_then(|i| scene.controls.get(i)))
    };
    let parameter = |other: &str| model.parameter_index(other).map(|i| model.parameters[i].value);
    let at = |part: f64, point: usize| {
        let values = names.iter().enumerate().map(|(i, other)| {
            let low = point >> (i % 3) & 1 == 0;
            match (excursion(other), parameter(other)) {
                (Some(e), _) if other == name => e.low + part * (e.high - e.low),
                (Some(e), _) => e.low + if low { 0.2 } else { 0.8 } * (e.high - e.low),
                (None, Some(value)) if other == name => value * (0.75 + 0.5 * part),
                (None, value) => value.unwrap_or(0.0),
            }
        });
        tape.evaluate_once(&values.collect::<Vec<f64>>(), scene.times.0)[0]
    };
    let changes = (0..8).map(|point| (at(1.0, point) - at(0.0, point)).abs()).filter(|c| c.is_finite());
    changes.sum::<f64>() / scene.rates[j]
}

fn state_hypotheses(model: &Model, j: usize, state: &State, all: &mut Vec<Hypothesis>) {
    let own = state.name.as_str();
    let position = model.integral_of(j).map(|i| model.states[i].name.as_str());
    let mut push = |effect: Effect, variables: &[&str]| all.push(Hypothesis::catalogue(effect, j, variables));
    push(Effect::Bias, &[]);
    for effect in [Effect::ViscousFriction, Effect::CoulombFriction, Effect::StribeckFriction, Effect::QuadraticDrag] {
        push(effect, &[own]);
    }
    push(Effect::CubicStiffness, &[own]);
    if let Some(x) = position {
        for effect in [Effect::LinearStiffness, Effect::CubicStiffness, Effect::GravityLoad, Effect::Cogging] {
            push(effect, &[x]);
        }
    } else if !state.unit.ends_with("/s") {
        // A speed has no spring, no weight and no teeth: only what may be a place or an angle does.
        push(Effect::LinearStiffness, &[own]);
        push(Effect::GravityLoad, &[own]);
        push(Effect::Cogging, &[own]);
    }
    let others = model.states.iter().map(|s| s.name.as_str()).filter(|&n| n != own && Some(n) != position);
    let unused = model.controls.iter().map(|c| c.name.as_str()).filter(|n| !state.equation.contains(n));
    for z in others.chain(unused) {
        push(Effect::Coupling, &[z]);
    }
    let names: Vec<&str> =
        model.states.iter().map(|s| s.name.as_str()).chain(model.controls.iter().map(|c| c.name.as_str())).collect();
    for (i, &z) in names.iter().enumerate() {
        for &w in &names[i..] {
            push(Effect::ProductCoupling, &[z, w]);
        }
    }
    for effect in [Effect::PeriodicDisturbance, Effect::StepDisturbance, Effect::Drift] {
        push(effect, &[]);
    }
}
