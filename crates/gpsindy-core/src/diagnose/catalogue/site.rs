//! Sites: the ports and controls at which effects act as they do in an equation.
//!
//! Friction in one joint of an arm enters every equation through the inverse mass matrix. An effect at the port of the joint
//! does so; an effect written into a single equation does not.

use crate::diagnose::catalogue::excursion::Excursion;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::limits::catalogue::{ALONG, INSIDE};
use crate::model::{Model, Parameter, System};
use std::sync::Arc;

/// A port or control at which an effect acts: `name` becomes `name + effect`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Site {
    pub(crate) name: String,
    pub(crate) unit: String,
    /// The state that is its position.
    pub(crate) position: Option<String>,
    /// How far a unit at the site moves the rate of its own motion, in that rate's unit.
    pub(crate) gain: f64,
    /// The state whose rate it moves most, compared with what is typical there.
    pub(crate) moves: usize,
    /// Effects that the simulator has as parameters of its own: id, and the parameter's name.
    pub(crate) carried: Vec<(String, String)>,
}

impl Site {
    /// The simulator's own parameter that stands for `effect` here, where it has one.
    pub(crate) fn carrier<'m>(&self, effect: Effect, model: &'m Model) -> Option<&'m Parameter> {
        let (_, name) = self.carried.iter().find(|(id, _)| *id == effect.id())?;
        model.parameters.iter().find(|p| p.name == *name)
    }
}

/// What the inputs of a system reach, by differences at points within what the logs excite.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Reach {
    /// The row of the motion, and the site.
    pub(crate) sites: Vec<(usize, Arc<Site>)>,
    /// For a simulator without equations: the row that a control or parameter moves most.
    rows: Vec<(String, usize)>,
}

impl Reach {
    /// Of every port; of every control that moves several rows and has a motion, where no port does the same.
    pub(crate) fn new(system: &System, states: &[Excursion], controls: &[Excursion], rates: &[f64]) -> Self {
        let model = system.model();
        let calls = system.engine().is_some();
        if model.ports.is_empty() && model.controls.is_empty() && !calls {
            return Self::default();
        }
        let points = points(states, controls);
        let values = system.parameter_values();
        let response = |name: &str, change: f64| {
            let found = system.response(name, change, &points, &values)?;
            found.iter().flatten().all(|v| v.is_finite()).then_some(found)
        };
        let beside = |found: &[Vec<f64>], j: usize| rms(found, j) / rates[j];
        let most = |found: &[Vec<f64>]| {
            (0..rates.len())
                .filter(|&j| !model.is_kinematic(j))
                .max_by(|&a, &b| beside(found, a).total_cmp(&beside(found, b)).then(b.cmp(&a)))
                .filter(|&j| beside(found, j) > 0.0)
        };
        let mut sites = Vec::new();
        let mut known: Vec<Vec<f64>> = Vec::new();
        let flat = |found: &[Vec<f64>]| -> Vec<f64> {
            found.iter().flat_map(|row| row.iter().zip(rates).map(|(v, rate)| v / rate)).collect()
        };
        for port in &model.ports {
            let Some(row) = model.state_index(&port.variable) else { continue };
            let Some(found) = response(&port.name, 1.0) else { continue };
            let gain = rms(&found, row);
            let Some(moves) = most(&found).filter(|_| gain > 0.0) else { continue };
            known.push(flat(&found));
            let position =
                port.position.clone().or_else(|| model.integral_of(row).map(|i| model.states[i].name.clone()));
            let (name, unit, carried) = (port.name.clone(), port.unit.clone(), port.carried.clone());
            sites.push((row, Site { name, unit, position, gain, moves, carried }.into()));
        }
        let mut rows = Vec::new();
        for control in &model.controls {
            let Some(found) = response(&control.name, 1.0) else { continue };
            let Some(row) = most(&found) else { continue };
            rows.push((control.name.clone(), row));
            let moved = (0..rates.len()).filter(|&j| !model.is_kinematic(j) && rms(&found, j) > 0.0).count();
            let Some(position) = model.integral_of(row) else { continue };
            let own = flat(&found);
            if calls || moved < 2 || known.iter().any(|other| is_along(other, &own)) {
                continue;
            }
            let site = Site {
                name: control.name.clone(),
                unit: control.unit.clone(),
                position: Some(model.states[position].name.clone()),
                gain: rms(&found, row),
                moves: row,
                carried: Vec::new(),
            };
            sites.push((row, site.into()));
        }
        if calls {
            for parameter in &model.parameters {
                let change = 0.5 * parameter.typical();
                let row = response(&parameter.name, change).as_deref().and_then(most);
                rows.extend(row.map(|row| (parameter.name.clone(), row)));
            }
        } else {
            rows.clear();
        }
        Self { sites, rows }
    }

    /// The row that the control or parameter `name` of a simulator without equations moves most.
    pub(crate) fn row(&self, name: &str) -> Option<usize> {
        self.rows.iter().find(|(other, _)| other == name).map(|(_, row)| *row)
    }

    /// Whether a port stands for the forces of row `row`.
    pub(crate) fn ports_of<'a>(&'a self, model: &'a Model, row: usize) -> impl Iterator<Item = &'a Arc<Site>> {
        self.sites.iter().filter(move |(r, s)| *r == row && model.port_index(&s.name).is_some()).map(|(_, site)| site)
    }

    /// The controls at which effects of row `row` may act.
    pub(crate) fn controls_of<'a>(&'a self, model: &'a Model, row: usize) -> impl Iterator<Item = &'a Arc<Site>> {
        self.sites.iter().filter(move |(r, s)| *r == row && model.port_index(&s.name).is_none()).map(|(_, site)| site)
    }

    /// Whether the simulator's own parameter `name` stands for an effect that the nominal model lacks altogether.
    pub(crate) fn is_absent_effect(&self, name: &str, model: &Model) -> bool {
        let carries = |(_, site): &(usize, Arc<Site>)| {
            site.carried.iter().any(|(id, p)| p == name && Effect::from_id(id).is_some())
        };
        self.sites.iter().any(carries) && model.parameters.iter().any(|p| p.name == name && p.value == 0.0)
    }
}

/// Points inside the excited box: every state and control low or high, in eight patterns.
fn points(states: &[Excursion], controls: &[Excursion]) -> Vec<Vec<f64>> {
    let all: Vec<&Excursion> = states.iter().chain(controls).collect();
    let at = |pattern: usize| {
        let value = |(i, e): (usize, &&Excursion)| {
            let part = if (pattern >> (i % 3)) & 1 == 0 { INSIDE.0 } else { INSIDE.1 };
            if e.low.is_finite() && e.high.is_finite() { e.low + part * (e.high - e.low) } else { 0.0 }
        };
        all.iter().enumerate().map(value).collect()
    };
    (0..8).map(at).collect()
}

fn rms(found: &[Vec<f64>], row: usize) -> f64 {
    (found.iter().map(|v| v[row] * v[row]).sum::<f64>() / found.len().max(1) as f64).sqrt()
}

/// Whether two inputs do the same at every point, but for one factor.
fn is_along(one: &[f64], other: &[f64]) -> bool {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cosine = dot(one, other) / (dot(one, one) * dot(other, other)).sqrt();
    1.0 - cosine * cosine < ALONG * ALONG
}
