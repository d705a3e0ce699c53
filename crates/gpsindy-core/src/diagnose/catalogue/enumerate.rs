//! Every effect at every place of a model where it can act.

use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::sense::slipping::slip;
use crate::diagnose::catalogue::sense::{self, is_supply};
use crate::diagnose::limits::catalogue::{CLEARLY, FROM, INSIDE};
use crate::error::{Error, Result};
use crate::expression::{Expression, Operator, Tape};
use crate::model::{Control, Model, State};

/// Every hypothesis that makes sense in `model`, logged in the states `logged`.
#[cfg(test)]
pub(crate) fn enumerate(
    model: &Model,
    scene: &Scene,
    logged: &[usize],
    custom: &[CustomEffect],
) -> Result<Vec<Hypothesis>> {
    let mut all = everything(model, scene, logged, custom)?;
    all.retain(|h| h.broken_sense(model, scene).is_none());
    Ok(all)
}

/// Every hypothesis that can be written into `model`, whether it makes sense or not.
pub(crate) fn everything(
    model: &Model,
    scene: &Scene,
    logged: &[usize],
    custom: &[CustomEffect],
) -> Result<Vec<Hypothesis>> {
    let mut all: Vec<Hypothesis> = Vec::new();
    let push = |all: &mut Vec<Hypothesis>, effect: Effect, state: usize, variables: &[&str]| {
        let hypothesis = Hypothesis::catalogue(effect, state, variables);
        if !all.contains(&hypothesis) {
            all.push(hypothesis);
        }
    };
    let at = |place: Place| Effect::ALL.iter().copied().filter(move |e| e.acts_at(place));
    for j in (0..model.states.len()).filter(|&j| !model.is_kinematic(j)) {
        let mut own = Vec::new();
        for place in Place::IN_A_ROW {
            let choices = variables(place, model, j);
            at(place).for_each(|effect| choices.iter().for_each(|variables| push(&mut own, effect, j, variables)));
        }
        // What a port stands for is not listed as a term of its row once more.
        let mut ports = scene.reach.ports_of(model, j).peekable();
        let in_row = if ports.peek().is_none() { own.clone() } else { Vec::new() };
        let at_ports: Vec<Hypothesis> = ports.flat_map(|site| own.iter().filter_map(|h| h.at(site, model))).collect();
        let forces = || own.iter().filter(|h| h.family() != Family::Coupling);
        let controls = scene.reach.controls_of(model, j);
        let at_controls = controls.flat_map(|site| forces().filter_map(|h| h.at(site, model)));
        all.extend(in_row.into_iter().chain(at_ports).chain(at_controls));
    }
    for parameter in model.parameters.iter().filter(|p| !scene.reach.is_absent_effect(&p.name, model)) {
        if let Some(j) = acts_in(model, scene, &parameter.name) {
            at(Place::Parameter).for_each(|effect| push(&mut all, effect, j, &[&parameter.name]));
        }
    }
    for control in &model.controls {
        if let Some(j) = acts_in(model, scene, &control.name) {
            at(Place::Control).for_each(|effect| push(&mut all, effect, j, &[&control.name]));
        }
    }
    for &j in logged {
        at(Place::Sensor).for_each(|effect| push(&mut all, effect, j, &[]));
    }
    for place in Place::ELSEWHERE {
        let choices = choices(place, model, scene);
        at(place).for_each(|effect| choices.iter().for_each(|(j, variables)| push(&mut all, effect, *j, variables)));
    }
    for effect in custom {
        let Some(j) = model.state_index(&effect.state) else {
            return Err(Error::unknown("state", &effect.state, model.states.iter().map(|s| &s.name)));
        };
        // Its own parameters, and those of the model, are no variables that it depends on.
        let moves = |name: &String| model.state_index(name).is_some() || model.control_index(name).is_some();
        let own = |name: &String| effect.parameters.iter().any(|p| p.name == *name);
        let variables = effect.form.variables().into_iter().filter(|name| moves(name) && !own(name)).collect();
        all.push(Hypothesis { kind: Kind::Custom(effect.clone().into()), state: j, variables, site: None });
    }
    Ok(all)
}

/// The equation in which `name` appears; of several, the one whose rate it moves most compared with what is typical there.
///
/// An effect on a control or a parameter acts wherever it appears, but a report has one place for it.
fn acts_in(model: &Model, scene: &Scene, name: &str) -> Option<usize> {
    if let Some(row) = scene.reach.row(name) {
        return Some(row);
    }
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

/// Change of equation `j` as a control goes over its range, or a parameter by half of itself, compared with the typical rate.
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
                (Some(e), _) => e.low + if low { INSIDE.0 } else { INSIDE.1 } * (e.high - e.low),
                (None, Some(value)) if other == name => value * (FROM + 0.5 * part),
                (None, value) => value.unwrap_or(0.0),
            }
        });
        tape.evaluate_once(&values.collect::<Vec<f64>>(), scene.times.0)[0]
    };
    let changes = (0..8).map(|point| (at(1.0, point) - at(0.0, point)).abs()).filter(|c| c.is_finite());
    changes.sum::<f64>() / scene.rates[j]
}

/// What an effect at `place` in equation `j` may depend on: a list of variables for each choice.
fn variables(place: Place, model: &Model, j: usize) -> Vec<Vec<&str>> {
    let own = model.states[j].name.as_str();
    let position = model.integral_of(j).map(|i| model.states[i].name.as_str());
    let states = || model.states.iter().map(|s| s.name.as_str());
    let controls = || model.controls.iter().map(|c| c.name.as_str());
    match place {
        Place::Row | Place::Time => vec![Vec::new()],
        Place::Own => vec![vec![own]],
        Place::Position => match position {
            Some(x) => vec![vec![x]],
            None if sense::is_speed(&model.states[j].unit) => Vec::new(),
            None => vec![vec![own]],
        },
        Place::Other => {
            let others = states().filter(|&n| n != own && Some(n) != position);
            let unused = controls().filter(|n| !model.states[j].equation.contains(n));
            others.chain(unused).map(|z| vec![z]).collect()
        }
        Place::Pair => {
            let names: Vec<&str> = states().chain(controls()).collect();
            let pairs = names.iter().enumerate().flat_map(|(i, &z)| names[i..].iter().map(move |&w| vec![z, w]));
            pairs.collect()
        }
        Place::Load => {
            let equation = &model.states[j].equation;
            let loads = position.into_iter().chain(controls()).filter(|n| equation.contains(n));
            loads.map(|load| vec![own, load]).collect()
        }
        Place::Parameter | Place::Control | Place::Sensor | Place::Random => Vec::new(),
        Place::DriveAndSpeed | Place::Supply | Place::Rate => Vec::new(),
        Place::Contact | Place::Heated | Place::Gap => Vec::new(),
    }
}

/// Equations and variables of a place that is not of one equation.
fn choices<'a>(place: Place, model: &'a Model, scene: &Scene) -> Vec<(usize, Vec<&'a str>)> {
    let controls = || model.controls.iter().map(|c| c.name.as_str());
    let driven = || controls().filter_map(|u| Some((acts_in(model, scene, u)?, u)));
    let set = || model.parameters.iter().filter_map(|p| Some((acts_in(model, scene, &p.name)?, p.name.as_str())));
    match place {
        Place::DriveAndSpeed => driven().map(|(j, u)| (j, vec![u, model.states[j].name.as_str()])).collect(),
        Place::Supply => {
            let stands = |n: &str| model.states.iter().any(|s| s.equation.contains(n));
            let are_together =
                |u: &str, w: &str| model.states.iter().any(|s| s.equation.contains(u) && s.equation.contains(w));
            let feeds = |u: &str, w: &&Control| !stands(&w.name) || (is_supply(&w.unit) && !are_together(u, &w.name));
            let beside = |u| model.controls.iter().filter(move |w| feeds(u, w));
            driven().flat_map(|(j, u)| beside(u).map(move |w| (j, vec![u, w.name.as_str()]))).collect()
        }
        // Only a parameter that scales its terms has a rate that can saturate.
        Place::Rate => set().flat_map(|(j, p)| scaled(model, j, p).map(move |z| (j, vec![p, z]))).collect(),
        Place::Contact => {
            let of = |(j, p): (usize, &'a str)| Some((j, std::iter::once(p).chain(slip(model, p)?.1).collect()));
            set().filter_map(of).collect()
        }
        Place::Heated => {
            let heats = |j: usize, u: &str| model.states[j].equation.contains(u);
            // What a resistance or a friction loses goes with the square of what it scales.
            let of = |j, p| controls().filter(move |u| heats(j, u)).chain(scaled(model, j, p));
            set().flat_map(|(j, p)| of(j, p).map(move |u| (j, vec![p, u]))).collect()
        }
        Place::Gap => gaps(model),
        Place::Row | Place::Own | Place::Position | Place::Other | Place::Pair | Place::Time => Vec::new(),
        Place::Load | Place::Parameter | Place::Control | Place::Sensor | Place::Random => Vec::new(),
    }
}

/// States in the terms of an equation that a parameter scales.
fn scaled<'a>(model: &'a Model, j: usize, parameter: &'a str) -> impl Iterator<Item = &'a str> {
    let slope = model.states[j].equation.derivative(parameter);
    let slope = slope.ok().filter(|slope| !slope.contains(parameter));
    let is_held = move |z: &&State| slope.as_ref().is_some_and(|slope| slope.contains(&z.name));
    model.states.iter().filter(is_held).map(|z| z.name.as_str())
}

/// Differences of two places: the first equation that has them, and the two.
fn gaps(model: &Model) -> Vec<(usize, Vec<&str>)> {
    let place = |part: &Expression| match part {
        Expression::Variable(name) => model.state_index(name).filter(|&i| model.is_kinematic(i)),
        _ => None,
    };
    let mut found: Vec<(usize, [usize; 2])> = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        state.equation.visit(&mut |part| {
            if let Expression::Binary(Operator::Subtract, a, b) = part
                && let (Some(p), Some(q)) = (place(a), place(b))
                && !found.iter().any(|(_, known)| known.contains(&p) && known.contains(&q))
            {
                found.push((j, [p, q]));
            }
        });
    }
    found.into_iter().map(|(j, pair)| (j, pair.map(|i| model.states[i].name.as_str()).into())).collect()
}
