//! Every effect at every place of a model where it can act.

use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, Kind};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::sense::servo::{differences, servo};
use crate::diagnose::catalogue::sense::slipping::slip;
use crate::diagnose::catalogue::sense::{self, is_supply};
use crate::diagnose::limits::catalogue::{CLEARLY, FROM, INSIDE};
use crate::error::{Error, Result};
use crate::expression::Tape;
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
    let places = model.rows_with(name);
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
            // What is logged and stands in no equation, as what a clamp presses with, was logged for a reason.
            let is_read = |n: &str| model.rows_with(n).next().is_some();
            let place = position.filter(|n| equation.contains(n));
            let controls = controls().filter(|n| equation.contains(n) || !is_read(n));
            place.into_iter().chain(controls).map(|load| vec![own, load]).collect()
        }
        // A simulator that steps has both ends in one step.
        Place::OtherEnd if model.calls_simulator() => Vec::new(),
        Place::OtherEnd => {
            controls().chain(position).filter(|z| model.states[j].equation.contains(z)).map(|z| vec![z]).collect()
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
            driven().flat_map(|(j, u)| supplies(model, j, u).into_iter().map(move |w| (j, vec![u, w]))).collect()
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
            let of = |j, p: &'a str| {
                let all = losing(model, p);
                let alone = if all.is_empty() { scaled(model, j, p).collect() } else { Vec::new() };
                let one = controls().filter(move |u| heats(j, u)).chain(alone).map(move |u| vec![p, u]);
                one.chain((!all.is_empty()).then(|| std::iter::once(p).chain(all).collect()))
            };
            set().flat_map(|(j, p)| of(j, p).map(move |variables| (j, variables))).collect()
        }
        Place::Gap => gaps(model),
        Place::Row | Place::Own | Place::Position | Place::Other | Place::Pair | Place::Time => Vec::new(),
        Place::Load | Place::OtherEnd | Place::Parameter | Place::Control | Place::Sensor | Place::Random => Vec::new(),
    }
}

/// States in the terms of an equation that a parameter scales.
fn scaled<'a>(model: &'a Model, j: usize, parameter: &'a str) -> impl Iterator<Item = &'a str> {
    let slope = model.states[j].equation.derivative(parameter);
    let slope = slope.ok().filter(|slope| !slope.contains(parameter));
    let is_held = move |z: &&State| slope.as_ref().is_some_and(|slope| slope.contains(&z.name));
    model.states.iter().filter(is_held).map(|z| z.name.as_str())
}

/// What may feed the control `u`, which moves the state `j` most: a logged control that no equation uses, and another voltage or pressure that
/// those of `u` do not; what a supply loses to the drive stands in an equation of its own.
fn supplies<'a>(model: &'a Model, j: usize, u: &str) -> Vec<&'a str> {
    let reading = |name: &str, but: &str| {
        let others = model.states.iter().filter(|s| s.name != but && s.equation.contains(name));
        others.map(|s| s.name.clone()).collect::<Vec<_>>()
    };
    let is_source = |w: &str, unit: &str| {
        let driven = reading(u, w);
        is_supply(unit) && !driven.is_empty() && !reading(w, w).iter().any(|row| driven.contains(row))
    };
    let is_logged = |w: &&Control| reading(&w.name, "").is_empty() || is_source(&w.name, &w.unit);
    let controls = model.controls.iter().filter(is_logged).map(|w| w.name.as_str());
    let others = model.states.iter().enumerate().filter(|(i, _)| *i != j).map(|(_, w)| w);
    let states = others.filter(|w| is_source(&w.name, &w.unit)).map(|w| w.name.as_str());
    controls.chain(states).collect()
}

/// The states of several equations of one unit that a parameter takes from each, as a resistance does in every phase: what it loses goes with
/// the sum of their squares. None where it stands otherwise in one of its equations.
fn losing<'a>(model: &'a Model, parameter: &'a str) -> Vec<&'a str> {
    let read: Vec<(usize, &State)> =
        model.states.iter().enumerate().filter(|(_, s)| s.equation.contains(parameter)).collect();
    let is_one =
        |(j, own): &(usize, &State)| own.unit == read[0].1.unit && scaled(model, *j, parameter).any(|z| z == own.name);
    if read.len() > 1 && read.iter().all(is_one) {
        read.into_iter().map(|(_, own)| own.name.as_str()).collect()
    } else {
        Vec::new()
    }
}

/// Differences of two places, one of which may be the command of a position servo: the first equation that has them, and the two.
fn gaps(model: &Model) -> Vec<(usize, Vec<&str>)> {
    let mut found: Vec<(usize, [&str; 2])> = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        for [a, b] in differences(&state.equation) {
            if let Some(pair) = places(model, &a, &b).or_else(|| servo(model, &a, &b))
                && !found.iter().any(|(_, known)| known.contains(&pair[0]) && known.contains(&pair[1]))
            {
                found.push((j, pair));
            }
        }
    }
    found.into_iter().map(|(j, pair)| (j, pair.into())).collect()
}

/// Two names as those of states that are places.
fn places<'m>(model: &'m Model, one: &str, other: &str) -> Option<[&'m str; 2]> {
    let place = |name| model.state_index(name).filter(|&i| model.is_kinematic(i));
    Some([place(one)?, place(other)?].map(|i| model.states[i].name.as_str()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::Parameter;

    fn model(rates: [(&str, &str, &str); 3], controls: &[(&str, &str)], parameters: &[&str]) -> Model {
        let state = |(name, unit, rate): (&str, &str, &str)| State {
            unit: unit.into(),
            ..State::new(name, Expression::parse(rate).unwrap())
        };
        let control = |(name, unit): &(&str, &str)| Control { unit: (*unit).into(), ..Control::new(*name) };
        Model {
            states: rates.map(state).into(),
            controls: controls.iter().map(control).collect(),
            parameters: parameters.iter().map(|name| Parameter::new(*name, 0.8)).collect(),
            ..Model::default()
        }
    }

    #[test]
    fn what_is_logged_and_stands_in_no_equation_may_be_the_load_of_a_friction() {
        let slider = model(
            [("x", "m", "v"), ("v", "m/s", "u - 0.3*v"), ("T", "K", "q - T")],
            &[("u", "N"), ("q", "W"), ("N", "N")],
            &[],
        );
        assert_eq!(variables(Place::Load, &slider, 1), [["v", "u"], ["v", "N"]]);
    }

    #[test]
    fn a_pressure_feeds_a_valve_whose_equation_lacks_it_though_it_loses_to_it_in_its_own() {
        let rail = |flow: &str| {
            let rates = [("v", "m/s", "p - v"), ("p", "bar", flow), ("ps", "bar", "150 - ps - 9*abs(u)")];
            model(rates, &[("u", ""), ("q", "l/s")], &[])
        };
        // A logged control that no equation uses may be a supply, too.
        assert_eq!(supplies(&rail("3*u - v"), 1, "u"), ["q", "ps"]);
        assert_eq!(supplies(&rail("3*u*(ps - p) - v"), 1, "u"), ["q"]);
    }

    #[test]
    fn a_resistance_of_two_phases_loses_in_both() {
        let drive = |first: &str| {
            let rates = [("id", "A", first), ("iq", "A", "(uq - R*iq - w*id)/L"), ("w", "rad/s", "iq - w")];
            model(rates, &[("ud", "V"), ("uq", "V")], &["R", "L"])
        };
        let both = drive("(ud - R*id + w*iq)/L");
        assert_eq!(losing(&both, "R"), ["id", "iq"]);
        assert!(losing(&both, "L").is_empty());
        assert!(losing(&drive("(ud + w*iq)/L"), "R").is_empty());
        assert!(losing(&drive("(ud - R + w*iq)/L"), "R").is_empty());
    }
}
