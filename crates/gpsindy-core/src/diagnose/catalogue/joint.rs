//! Effects that are screened and fitted together because each alone would have the wrong sign.
//!
//! The damping of an oscillation mixes dry, linear and quadratic friction. If the nominal model has too much of one and
//! lacks two others, every single friction is rejected for its sign, and a search that adds one effect at a time misses
//! the true combination. So the frictions of an equation are also tested together, and with the damping parameter of the
//! nominal model in the place of viscous friction. An exchange between two states also needs two terms. And the commands of a machine
//! are late together where they go over one bus: one by one they take as many rounds as there are commands.

use crate::diagnose::catalogue::applied::Combine;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Applied, Hypothesis, Kind, Start};
use crate::diagnose::catalogue::list::Effect;
use crate::error::Result;
use crate::expression::Tape;
use crate::model::Model;

/// Bounds of a parameter that only takes energy out of its equation, whatever the state: it keeps its sign.
///
/// Such a parameter `p` of the equation of `v` has `v * d(dv/dt)/dp * p <= 0` everywhere; tried at a handful of points.
pub(crate) fn dissipative_bounds(model: &Model, name: &str) -> Option<(f64, f64)> {
    const POINTS: [[f64; 3]; 6] =
        [[1.3, 0.7, -0.4], [-1.1, 0.2, 0.9], [0.1, -1.7, 0.3], [-0.2, -0.6, -1.2], [2.9, 1.1, 0.8], [-2.3, 0.5, 1.6]];
    let value = model.parameters[model.parameter_index(name)?].value;
    let names: Vec<String> = model.names().map(str::to_string).collect();
    let mut found = false;
    for state in &model.states {
        if state.measured.as_ref().is_some_and(|m| m.contains(name)) {
            return None;
        }
        if !state.equation.contains(name) {
            continue;
        }
        let slope = state.equation.derivative(name).ok()?;
        if !slope.contains(&state.name) {
            return None;
        }
        let tape = Tape::new(&[slope], &names).ok()?;
        for (k, point) in POINTS.iter().enumerate() {
            let at = |i: usize, other: &str| match model.parameter_index(other) {
                Some(p) => model.parameters[p].value,
                None if *other == state.name => point[0],
                None => point[1 + (i + k) % 2],
            };
            let values: Vec<f64> = names.iter().enumerate().map(|(i, other)| at(i, other)).collect();
            if !(tape.evaluate_once(&values, 0.0)[0] * point[0] * value < 0.0) {
                return None;
            }
        }
        found = true;
    }
    let bounds = if value > 0.0 { (0.0, f64::INFINITY) } else { (f64::NEG_INFINITY, 0.0) };
    found.then_some(bounds)
}

/// Sets of hypotheses (indices) that apply together: the frictions of every equation, by two and three.
pub(crate) fn frictions(model: &Model, hypotheses: &[Hypothesis]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        let place = |effect: Effect| {
            hypotheses
                .iter()
                .position(|h| h.kind == Kind::Catalogue(effect) && h.state == j && h.variables == [state.name.as_str()])
        };
        let (dry, quadratic) = (place(Effect::CoulombFriction), place(Effect::QuadraticDrag));
        let own = hypotheses
            .iter()
            .enumerate()
            .filter(|(_, h)| h.state == j && h.frees().is_some_and(|name| dissipative_bounds(model, name).is_some()));
        let mut linear: Vec<usize> = own.map(|(i, _)| i).collect();
        if linear.is_empty() {
            linear.extend(place(Effect::ViscousFriction));
        }
        let both: Vec<usize> = dry.into_iter().chain(quadratic).collect();
        if both.len() == 2 {
            all.push(both.clone());
        }
        for &l in &linear {
            all.extend(both.iter().map(|&b| vec![b, l]));
            if both.len() == 2 {
                all.push(vec![both[0], both[1], l]);
            }
        }
    }
    all
}

/// Sets of two that make an exchange, `c (z - own)`: heat between two bodies, a spring or a damper between two masses.
///
/// Alone each of the two terms moves the equation's mean far off, and products of the two states, which do not,
/// look better.
pub(crate) fn exchanges(model: &Model, hypotheses: &[Hypothesis]) -> Vec<Vec<usize>> {
    let mut all = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        let place = |effect: Effect, z: &str| {
            hypotheses.iter().position(|h| h.kind == Kind::Catalogue(effect) && h.state == j && h.variables == [z])
        };
        for other in (0..model.states.len()).filter(|&i| i != j) {
            // Alike with alike: places with places, rates with rates.
            let own = match (model.integral_of(j), model.integral_of(other)) {
                (None, None) => &state.name,
                (Some(_), Some(_)) => &state.name,
                (Some(place), None) if place != other => &model.states[place].name,
                _ => continue,
            };
            // A difference makes sense only within one unit.
            if model.states.iter().any(|s| s.name == *own && s.unit != model.states[other].unit) {
                continue;
            }
            let pull = place(Effect::LinearStiffness, own).or_else(|| place(Effect::ViscousFriction, own));
            let push = place(Effect::Coupling, &model.states[other].name);
            all.extend(push.zip(pull).map(|(a, b)| vec![a, b]));
        }
    }
    all
}

/// The set of the delays of all controls; none of a single control.
pub(crate) fn late(hypotheses: &[Hypothesis]) -> Vec<Vec<usize>> {
    let all: Vec<usize> = (0..hypotheses.len()).filter(|&i| hypotheses[i].is(Effect::InputDelay)).collect();
    if all.len() > 1 { vec![all] } else { Vec::new() }
}

/// Several hypotheses written into one model. Sizes start together, the first start of each becoming one with all columns; times are alike,
/// each start of one beside that of the other of the same rank.
pub(crate) fn apply(hypotheses: &[&Hypothesis], model: &Model, scene: &Scene) -> Result<Applied> {
    let Some((first, others)) = hypotheses.split_first() else {
        return Ok(Applied { model: model.clone(), fitted: Vec::new(), parts: Vec::new(), starts: Vec::new() });
    };
    let mut whole = first.apply(model, scene)?;
    for other in others {
        let next = other.apply(&whole.model, scene)?;
        let are_kept = |starts: &[Start]| starts.iter().all(|start| start.combine == Combine::Keep);
        let most = if are_kept(&whole.starts) && are_kept(&next.starts) { usize::MAX } else { 1 };
        let starts = whole.starts.iter().zip(&next.starts).take(most).filter_map(|(a, b)| a.beside(b)).collect();
        whole.fitted.extend(next.fitted);
        whole.parts.extend(next.parts);
        whole.model = next.model;
        whole.starts = starts;
    }
    Ok(whole)
}

impl Start {
    /// Columns of both, the other's parameters at nothing in each; one of both where both are kept as they are. `None` where a size is no
    /// straight line.
    fn beside(&self, other: &Self) -> Option<Self> {
        if self.combine == Combine::Keep && other.combine == Combine::Keep {
            let columns = self.columns.iter().zip(&other.columns).map(|(a, b)| [a.as_slice(), b].concat()).collect();
            return Some(Self { columns, ..self.clone() });
        }
        let own = self.columns.first()?.len();
        if self.amplitudes.len() != self.columns.len() || other.amplitudes.len() != other.columns.len() {
            return None;
        }
        let (mine, theirs) = (self.at_nothing(), other.at_nothing());
        let columns = self.columns.iter().map(|c| [c.as_slice(), &theirs].concat());
        let columns = columns.chain(other.columns.iter().map(|c| [&mine, c.as_slice()].concat())).collect();
        let shifted = other.amplitudes.iter().map(|&(i, origin)| (i + own, origin));
        let amplitudes: Vec<(usize, f64)> = self.amplitudes.iter().copied().chain(shifted).collect();
        Some(Self { columns, combine: self.combine, amplitudes, is_pointed: false })
    }

    /// Values that a screening found, and the same with smaller sizes: what is free with them may have to move first,
    /// where a straight line no longer holds.
    pub(crate) fn shortened(&self, values: &[f64]) -> Vec<Vec<f64>> {
        let shorter = |part: f64| {
            let mut values = values.to_vec();
            for &(i, origin) in &self.amplitudes {
                values[i] = origin + part * (values[i] - origin);
            }
            values
        };
        if self.amplitudes.is_empty() { vec![values.to_vec()] } else { [1.0, 0.3, 0.03].map(shorter).into() }
    }

    /// The first column with every size at nothing.
    fn at_nothing(&self) -> Vec<f64> {
        let mut values = self.columns[0].clone();
        for &(i, origin) in &self.amplitudes {
            values[i] = origin;
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Parameter, State};

    fn model(equation: &str) -> Model {
        Model {
            states: vec![
                State::new("x", Expression::variable("v")),
                State::new("v", Expression::parse(equation).unwrap()),
            ],
            parameters: [("m", 2.0), ("k", 4.0), ("b", 0.3), ("f", 0.1)].map(|(n, v)| Parameter::new(n, v)).into(),
            ..Model::default()
        }
    }

    #[test]
    fn a_damping_coefficient_keeps_its_sign_and_others_are_free() {
        let model = model("(-k*x - b*v - f*v*abs(v))/m");
        let zero_up = Some((0.0, f64::INFINITY));
        assert_eq!(dissipative_bounds(&model, "b"), zero_up);
        assert_eq!(dissipative_bounds(&model, "f"), zero_up);
        assert_eq!(dissipative_bounds(&model, "k"), None);
        assert_eq!(dissipative_bounds(&model, "m"), None);
    }

    #[test]
    fn an_exchange_pairs_a_neighbour_with_the_own_state() {
        let state = |name: &str, unit: &str, text: &str| State {
            unit: unit.into(),
            ..State::new(name, Expression::parse(text).unwrap())
        };
        let sets = |states: Vec<State>| {
            let model = Model { states, ..Model::default() };
            let hypotheses: Vec<Hypothesis> = model
                .states
                .iter()
                .enumerate()
                .flat_map(|(j, _)| {
                    let of = move |(z, effect)| Hypothesis::catalogue(effect, j, &[z]);
                    let effects = [Effect::Coupling, Effect::LinearStiffness, Effect::ViscousFriction];
                    let names: Vec<&str> = model.states.iter().map(|s| s.name.as_str()).collect();
                    names.into_iter().flat_map(move |z| effects.map(|e| (z, e))).map(of).collect::<Vec<_>>()
                })
                .collect();
            let name = |h: usize| {
                let h: &Hypothesis = &hypotheses[h];
                format!("{} {} {}", h.id(), model.states[h.state].name, h.variables[0])
            };
            exchanges(&model, &hypotheses).into_iter().map(|set| set.into_iter().map(name).collect()).collect()
        };
        let rooms: Vec<Vec<String>> = sets(vec![state("a", "degC", "-a"), state("b", "degC", "-b")]);
        assert_eq!(rooms[0], ["coupling a b", "linear_stiffness a a"]);
        assert_eq!(rooms.len(), 2);
        assert!(sets(vec![state("a", "degC", "-a"), state("b", "W", "-b")]).is_empty());
        // A mass on a spring to another mass: places pull by places, rates by rates.
        let masses = vec![state("x", "m", "v"), state("v", "m/s", "-x"), state("y", "m", "w"), state("w", "m/s", "-y")];
        let masses: Vec<Vec<String>> = sets(masses);
        assert!(masses.contains(&vec!["coupling v y".to_string(), "linear_stiffness v x".into()]), "{masses:?}");
        assert!(!masses.iter().any(|set| set[0] == "coupling v x"), "{masses:?}");
    }

    #[test]
    fn a_parameter_that_drives_keeps_no_sign() {
        assert_eq!(dissipative_bounds(&model("b*v - k*x/m - f*v"), "b"), None);
        assert_eq!(dissipative_bounds(&model("-b*(v - x) - k/m + f"), "b"), None);
    }
}
