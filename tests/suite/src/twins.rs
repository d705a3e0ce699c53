//! Twins: catalogue effects that describe the same logs as the truth.
//!
//! Two tests. On the right sides along the visited states: rivals whose footprint is a multiple of the truth's are exact
//! twins (a wrong damping is a viscous friction is a coupling with the velocity). On the readings: every rival of one
//! number is fitted to the clean runs, and counts as a twin where its BIC comes within 6 of the truth's.

use crate::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
use crate::fit::{Contest, Rival, scaled};
use crate::gap::{Log, Ruler};
use crate::plant::{Plant, Row};
use crate::simulate::rows_of;
use crate::survey::Survey;

/// An acceptable name.
#[derive(Debug, Clone, PartialEq)]
pub struct Accept {
    /// Catalogue id.
    pub effect: &'static str,
    /// Equation or column.
    pub state: usize,
    /// Variables.
    pub variables: Vec<Variable>,
    /// Index of the effect that it represents.
    pub of: usize,
}

/// What an effect adds to all right sides at the visited points, in units of their sizes; `None` where memory decides.
fn footprint(plant: &Plant, survey: &Survey, act: &Act, row: usize) -> Option<Vec<f64>> {
    let n = plant.states.len();
    let mut all = Vec::with_capacity(n * survey.points.len());
    for (x, u) in &survey.points {
        let (mut before, mut after) = (vec![0.0; n], vec![0.0; n]);
        let (mut p, mut u1) = (plant.values(), u.clone());
        (plant.flow)(&p, x, u, 0.0, &mut before);
        match *act {
            Act::Parameter { index, value } => p[index] = value,
            Act::Actuator { control, law } => {
                u1[control] = match law {
                    Actuator::Gain { c } => (1.0 + c) * u[control],
                    Actuator::Bias { c } => u[control] + c,
                    Actuator::Saturation { c } => u[control].clamp(-c, c),
                    Actuator::DeadZone { c } => u[control].signum() * (u[control].abs() - c).max(0.0),
                    _ => return None,
                }
            }
            Act::Periodic { .. } | Act::Step { .. } | Act::Drift { .. } | Act::Sensor { .. } => return None,
            Act::Resonance { .. } | Act::Hysteresis { .. } | Act::Memory { .. } | Act::Inertia { .. } => return None,
            Act::Saturating { .. } | Act::Slipping { .. } | Act::Warming { .. } | Act::Loose { .. } => return None,
            _ => {}
        }
        (plant.flow)(&p, x, &u1, 0.0, &mut after);
        after[row] += act.added(0.5, x, u);
        if let Act::Friction { law } = act {
            after[row] -= x[row].signum() * law.level(x[row], x[row], x, u);
        }
        for i in 0..n {
            all.push((after[i] - before[i]) / survey.slope[i].max(1e-12));
        }
    }
    Some(all)
}

/// Share of `a` that no multiple of `b` covers.
fn uncovered(a: &[f64], b: &[f64]) -> f64 {
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(p, q)| p * q).sum::<f64>();
    let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
    if aa <= 0.0 || bb <= 0.0 {
        return 1.0;
    }
    let rest: f64 = a.iter().zip(b).map(|(p, q)| (p - ab / bb * q).powi(2)).sum();
    (rest / aa).sqrt()
}

/// Do two effects leave nearly the same footprint?
pub fn alike(plant: &Plant, survey: &Survey, one: &Effect, two: &Effect) -> bool {
    match (footprint(plant, survey, &one.act, one.state), footprint(plant, survey, &two.act, two.state)) {
        (Some(a), Some(b)) => uncovered(&a, &b) < 0.2,
        _ => one.id == two.id && one.state == two.state,
    }
}

/// Rivals of one free number.
fn rivals(plant: &Plant, survey: &Survey, interval: f64) -> Vec<Rival> {
    let mut list: Vec<Rival> = Vec::new();
    let n = plant.states.len();
    let mut add = |id, state, variables: Vec<Variable>, usual, remembers, at: Box<dyn Fn(f64) -> Act + Send + Sync>| {
        let at = Box::new(move |s| Effect { id, state, variables: variables.clone(), act: at(s) });
        list.push(Rival { id, at, usual, numbers: 1, remembers });
    };
    let variables: Vec<Variable> =
        (0..n).map(Variable::State).chain((0..plant.controls.len()).map(Variable::Control)).collect();
    for row in (0..n).filter(|&r| plant.rows[r] != Row::Kinematic) {
        let mut term = |id, variables: Vec<Variable>, unit: Act| {
            let squares: f64 = survey.points.iter().map(|(x, u)| unit.added(0.5, x, u).powi(2)).sum();
            let size = (squares / survey.points.len() as f64).sqrt();
            if size > 0.0 {
                let usual = 0.1 * survey.slope[row] / size;
                add(id, row, variables, usual, false, Box::new(move |s| scaled(unit, s)));
            }
        };
        term("bias", vec![], Act::Constant { c: 1.0 });
        term("drift", vec![], Act::Drift { c: 1.0 });
        for (k, &z) in variables.iter().enumerate() {
            let linear = Act::Linear { z, c: 1.0 };
            if let Variable::State(i) = z {
                for id in ["viscous_friction", "linear_stiffness", "coupling"] {
                    term(id, vec![z], linear);
                }
                term("quadratic_drag", vec![z], Act::Quadratic { z, c: 1.0 });
                term("cubic_stiffness", vec![z], Act::Cubic { z, c: 1.0 });
                // A phase of its own would be a second number; upright and sideways represent it.
                if matches!(plant.rows[row], Row::Force { position: Some(q), angle: true } if q == i) {
                    term("gravity_load", vec![z], Act::Sine { z, c: 1.0, n: 1.0, phase: 0.0 });
                }
            } else {
                term("coupling", vec![z], linear);
            }
            for &w in &variables[k..] {
                term("product_coupling", vec![z, w], Act::Product { z, w, c: 1.0 });
            }
        }
        let level = 0.1 * survey.slope[row];
        let friction = move |s: f64| Act::Friction { law: Friction::Coulomb { c: s } };
        add("coulomb_friction", row, vec![Variable::State(row)], level, false, Box::new(friction));
    }
    for control in 0..plant.controls.len() {
        let z = Variable::Control(control);
        let (low, high) = (survey.control_low[control], survey.control_high[control]);
        let (range, reach) = ((high - low).max(1e-9), low.abs().max(high.abs()));
        let Some(&row) = rows_of(plant, z, &survey.points).iter().find(|&&r| plant.rows[r] != Row::Kinematic) else {
            continue;
        };
        let act = move |law| Act::Actuator { control, law };
        add("input_gain", row, vec![z], 0.1, false, Box::new(move |s| act(Actuator::Gain { c: s })));
        add("input_bias", row, vec![z], 0.05 * range, false, Box::new(move |s| act(Actuator::Bias { c: s })));
        let cut = move |s: f64| act(Actuator::Saturation { c: (reach * (1.0 - s)).max(0.0) });
        add("input_saturation", row, vec![z], 0.3, false, Box::new(cut));
        let dead = move |s: f64| act(Actuator::DeadZone { c: s.max(0.0) });
        add("input_dead_zone", row, vec![z], 0.1 * range, false, Box::new(dead));
        let delay = move |s: f64| act(Actuator::Delay { tau: s.max(0.0) });
        add("input_delay", row, vec![z], interval, true, Box::new(delay));
        let lag = move |s: f64| act(Actuator::Lag { tau: s.max(1e-2 * interval) });
        add("input_lag", row, vec![z], interval, true, Box::new(lag));
        let play = move |s: f64| act(Actuator::Play { c: s.max(0.0) });
        add("backlash", row, vec![z], 0.1 * range, true, Box::new(play));
    }
    for (index, parameter) in plant.parameters.iter().enumerate() {
        let value = parameter.value;
        let v = Variable::Parameter(index);
        if let Some(&row) = rows_of(plant, v, &survey.points).first() {
            let act = move |s: f64| Act::Parameter { index, value: value * (1.0 + s) };
            add("parameter_error", row, vec![v], 0.05, false, Box::new(act));
        }
    }
    for &column in &plant.logged {
        let spread = survey.spread[column];
        let act = |law| Act::Sensor { law };
        add("sensor_bias", column, vec![], 0.1 * spread, false, Box::new(move |s| act(Sensor::Bias { c: s })));
        add("sensor_scale", column, vec![], 0.05, false, Box::new(move |s| act(Sensor::Scale { c: s })));
        let late = move |s: f64| act(Sensor::Delay { tau: s.max(0.0) });
        add("sensor_delay", column, vec![], interval, true, Box::new(late));
    }
    list
}

/// A rival that was fitted: its name and the squares that it leaves.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Its name.
    pub name: Accept,
    /// Squares left, in units of the noise.
    pub left: f64,
    /// Is its footprint a multiple of the truth's?
    pub exact: bool,
}

/// What the rivals leave of an effect's gap.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The rivals that are near.
    pub near: Vec<Fitted>,
    /// Squares that the nominal model leaves.
    pub gap: f64,
    /// Values compared.
    pub count: usize,
}

/// Lets all rivals try the clean logs of one effect.
pub fn compete(
    ruler: &Ruler,
    survey: &Survey,
    logs: &[Log],
    linear: bool,
    truth: &Effect,
    of: usize,
) -> Option<Outcome> {
    let plant = ruler.plant;
    let interval = logs.first().map_or(1.0, |l| l.times[1] - l.times[0]);
    let contest = Contest::new(ruler, logs, linear)?;
    let mark = footprint(plant, survey, &truth.act, truth.state);
    let mut near = Vec::new();
    for rival in rivals(plant, survey, interval) {
        let there = (rival.at)(rival.usual);
        let name = Accept { effect: rival.id, state: there.state, variables: there.variables.clone(), of };
        let steps = footprint(plant, survey, &there.act, there.state);
        let exact = matches!((&mark, &steps), (Some(a), Some(b)) if uncovered(a, b) < 1e-6);
        if exact {
            near.push(Fitted { name, left: 0.0, exact });
            continue;
        }
        if rival.remembers && ruler.reset > 0.0 {
            continue;
        }
        let Some((share, guess)) = contest.screen(&rival) else { continue };
        if share > 0.3 {
            continue;
        }
        if let Some(left) = contest.fit(&rival, guess) {
            near.push(Fitted { name, left, exact });
        }
    }
    Some(Outcome { near, gap: contest.gap, count: contest.count })
}

/// Does the effect act wherever its control or its parameter occurs?
fn wherever(id: &str) -> bool {
    let others = ["backlash", "parameter_error", "motor_limit", "saturating_rate", "thermal", "slip"];
    id.starts_with("input") || others.contains(&id)
}

/// The acceptable names of one effect of the truth, given what its rivals leave.
pub fn accept(plant: &Plant, survey: &Survey, truth: &Effect, of: usize, outcome: Option<&Outcome>) -> Vec<Accept> {
    let mut list: Vec<Accept> = Vec::new();
    let mut push = |effect, state, variables: Vec<Variable>| {
        let name = Accept { effect, state, variables, of };
        if !list.contains(&name) {
            list.push(name);
        }
    };
    push(truth.id, truth.state, truth.variables.clone());
    if let Act::Product { z, w, .. } = truth.act {
        push("product_coupling", truth.state, vec![w, z]);
    }
    let mut names = vec![(truth.id, truth.variables.clone())];
    if let Some(outcome) = outcome {
        let numbers = truth.act.numbers().len() as f64;
        let penalty = (1.0 - numbers) * (outcome.count as f64).ln();
        for rival in &outcome.near {
            if rival.exact || rival.left + penalty < 6.0 {
                push(rival.name.effect, rival.name.state, rival.name.variables.clone());
                names.push((rival.name.effect, rival.name.variables.clone()));
            }
        }
    }
    // An input acts wherever its control does; a parameter likewise.
    for (id, variables) in names {
        if let Some(&v @ (Variable::Control(_) | Variable::Parameter(_))) = variables.first()
            && wherever(id)
        {
            for row in rows_of(plant, v, &survey.points) {
                push(id, row, variables.clone());
            }
        }
    }
    // Forms that contain the truth.
    match truth.act {
        Act::Friction { law: Friction::Coulomb { .. } } => {
            push("stribeck_friction", truth.state, vec![Variable::State(truth.state)]);
        }
        // What is held by a peak of the friction that fades at once is a Stribeck friction of a narrow peak.
        Act::Friction { law: Friction::Stribeck { .. } } => {
            push("stribeck_friction", truth.state, vec![Variable::State(truth.state)]);
            push("stiction", truth.state, vec![Variable::State(truth.state)]);
        }
        Act::Loose { p, q, .. } => push("gear_play", truth.state, vec![Variable::State(q), Variable::State(p)]),
        Act::Sine { n: 1.0, .. } => push("cogging", truth.state, truth.variables.clone()),
        _ => {}
    }
    list
}
