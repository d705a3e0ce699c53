//! Hypotheses: an effect of the catalogue at a place in a model, written into the model's equations.

use super::effect::{CustomEffect, Effect, Family};
use super::scene::Scene;
use crate::error::{Error, Result};
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
    /// One column, proportional to the first parameter.
    Amplitude,
    /// Two columns, at phase zero and at a quarter turn: size and phase (first and last parameter).
    Sinusoid,
    /// Two columns, proportional to the first and to the second parameter.
    Pair,
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
}

/// A model with a hypothesis written into it.
#[derive(Debug, Clone)]
pub(crate) struct Applied {
    pub(crate) model: Model,
    /// Parameters that are to be fitted: index in the model, and what is known of them.
    pub(crate) fitted: Vec<(usize, Added)>,
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
        super::apply::apply(self, model, scene)
    }
}

/// Every hypothesis that makes sense in `model`, logged in the states `logged`.
pub(crate) fn enumerate(model: &Model, logged: &[usize], custom: &[CustomEffect]) -> Result<Vec<Hypothesis>> {
    let mut all = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        if !model.is_kinematic(j) {
            state_hypotheses(model, j, state, &mut all);
        }
    }
    for parameter in &model.parameters {
        if let Some(j) = acts_in(model, &parameter.name) {
            all.push(Hypothesis::catalogue(Effect::ParameterError, j, &[&parameter.name]));
            all.push(Hypothesis::catalogue(Effect::Drift, j, &[&parameter.name]));
        }
    }
    for control in &model.controls {
        if let Some(j) = acts_in(model, &control.name) {
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
        all.push(Hypothesis {
            kind: Kind::Custom(effect.clone().into()),
            state: j,
            variables: effect.form.variables(),
        });
    }
    Ok(all)
}

/// The first equation that is more than a name and in which `name` stands.
fn acts_in(model: &Model, name: &str) -> Option<usize> {
    let dynamic = (0..model.states.len()).find(|&j| model.states[j].equation.contains(name));
    dynamic.or_else(|| model.states.iter().position(|s| s.measured.as_ref().is_some_and(|m| m.contains(name))))
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
