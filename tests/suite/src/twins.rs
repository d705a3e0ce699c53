//! Twins: catalogue effects that describe the same logs as the truth.
//!
//! The test is made on the right sides along the visited states: two effects are twins when what they add there is the
//! same up to a factor. That finds the algebraic twins (a wrong damping is a viscous friction is a coupling with the
//! velocity) without a table by family; what only looks alike through the sensors is left to a short list of rules.

use crate::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
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
    /// Index of the effect that it stands for.
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
            Act::Resonance { .. } | Act::Hysteresis { .. } => return None,
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
    if aa <= 0.0 || bb <= 0.0 { 1.0 } else { (1.0 - ab * ab / (aa * bb)).max(0.0).sqrt() }
}

/// Do two effects leave the same footprint?
pub fn alike(plant: &Plant, survey: &Survey, one: &Effect, two: &Effect) -> bool {
    match (footprint(plant, survey, &one.act, one.state), footprint(plant, survey, &two.act, two.state)) {
        (Some(a), Some(b)) => uncovered(&a, &b) < 0.2,
        _ => one.id == two.id && one.state == two.state,
    }
}

/// Candidates of one free amplitude, to be compared with the truth.
fn candidates(plant: &Plant, survey: &Survey) -> Vec<(Effect, bool)> {
    let mut list = Vec::new();
    let mut add = |id, state, variables: Vec<Variable>, act| {
        list.push((Effect { id, state, variables, act }, true));
    };
    let n = plant.states.len();
    let variables: Vec<Variable> =
        (0..n).map(Variable::State).chain((0..plant.controls.len()).map(Variable::Control)).collect();
    for row in (0..n).filter(|&r| plant.rows[r] != Row::Kinematic) {
        add("bias", row, vec![], Act::Constant { c: 1.0 });
        for (k, &z) in variables.iter().enumerate() {
            let small = Act::Linear { z, c: 1.0 };
            if matches!(z, Variable::State(_)) {
                for id in ["viscous_friction", "linear_stiffness", "coupling"] {
                    add(id, row, vec![z], small);
                }
                add("quadratic_drag", row, vec![z], Act::Quadratic { z, c: 1.0 });
                add("cubic_stiffness", row, vec![z], Act::Cubic { z, c: 1.0 });
                add("gravity_load", row, vec![z], Act::Sine { z, c: 1.0, n: 1.0, phase: 0.0 });
                if let Variable::State(i) = z
                    && i == row
                {
                    add("coulomb_friction", row, vec![z], Act::Friction { law: Friction::Coulomb { c: 1.0 } });
                }
            } else {
                add("coupling", row, vec![z], small);
            }
            for &w in &variables[k..] {
                add("product_coupling", row, vec![z, w], Act::Product { z, w, c: 1.0 });
            }
        }
    }
    for j in 0..plant.controls.len() {
        let z = Variable::Control(j);
        let range = 0.01 * (survey.control_high[j] - survey.control_low[j]).max(1e-9);
        for row in rows_of(plant, z, &survey.points) {
            add("input_gain", row, vec![z], Act::Actuator { control: j, law: Actuator::Gain { c: 0.01 } });
            add("input_bias", row, vec![z], Act::Actuator { control: j, law: Actuator::Bias { c: range } });
        }
    }
    for (k, parameter) in plant.parameters.iter().enumerate() {
        for row in rows_of(plant, Variable::Parameter(k), &survey.points) {
            let act = Act::Parameter { index: k, value: parameter.value * 1.001 };
            add("parameter_error", row, vec![Variable::Parameter(k)], act);
        }
    }
    list
}

/// The acceptable names of one effect of the truth.
pub fn accept(plant: &Plant, survey: &Survey, truth: &Effect, of: usize) -> Vec<Accept> {
    let mut list = Vec::new();
    let mut push = |effect, state, variables: Vec<Variable>| {
        let name = Accept { effect, state, variables, of };
        if !list.contains(&name) {
            list.push(name);
        }
    };
    push(truth.id, truth.state, truth.variables.clone());
    // An input acts wherever its control does; a parameter likewise.
    if let Some(&(Variable::Control(_) | Variable::Parameter(_))) = truth.variables.first()
        && matches!(truth.act, Act::Actuator { .. } | Act::Parameter { .. })
    {
        for row in rows_of(plant, truth.variables[0], &survey.points) {
            push(truth.id, row, truth.variables.clone());
        }
    }
    if let Some(mark) = footprint(plant, survey, &truth.act, truth.state) {
        for (other, _) in candidates(plant, survey) {
            let Some(there) = footprint(plant, survey, &other.act, other.state) else { continue };
            if uncovered(&mark, &there) < 0.02 {
                push(other.id, other.state, other.variables.clone());
            }
        }
    }
    let z = Variable::State(truth.state);
    match truth.act {
        Act::Friction { law: Friction::Coulomb { .. } } => push("stribeck_friction", truth.state, vec![z]),
        Act::Sine { n: 1.0, .. } => push("cogging", truth.state, truth.variables.clone()),
        Act::Actuator { control, law: Actuator::Delay { .. } } => {
            // One logged column, or all of them late alike: the sensor may as well be late.
            if plant.logged.len() == 1 && plant.controls.len() == 1 {
                push("sensor_delay", plant.logged[0], vec![]);
            }
            let _ = control;
        }
        Act::Sensor { law } => {
            for name in sensor_twins(plant, survey, truth.state, law) {
                push(name.0, name.1, name.2);
            }
        }
        _ => {}
    }
    list
}

/// What a sensor effect on a lone column may also be called.
fn sensor_twins(
    plant: &Plant,
    survey: &Survey,
    column: usize,
    law: Sensor,
) -> Vec<(&'static str, usize, Vec<Variable>)> {
    let mut list = Vec::new();
    if plant.logged.len() != 1 {
        return list;
    }
    let controls: Vec<usize> = (0..plant.controls.len()).collect();
    let row = (0..plant.rows.len()).find(|&r| plant.rows[r] != Row::Kinematic);
    let (Some(row), [control]) = (row, &controls[..]) else { return list };
    let _ = survey;
    match law {
        Sensor::Delay { .. } => list.push(("input_delay", row, vec![Variable::Control(*control)])),
        // Exact on a linear plant, near on the others: the fit of twins decides where it is run.
        Sensor::Bias { .. } => {
            list.push(("bias", row, vec![]));
            list.push(("input_bias", row, vec![Variable::Control(*control)]));
        }
        Sensor::Scale { .. } => list.push(("input_gain", row, vec![Variable::Control(*control)])),
    }
    let _ = column;
    list
}
