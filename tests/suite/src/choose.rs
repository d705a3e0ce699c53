//! Which effects make physical sense on a plant, each as a family over its size from 0 (nothing) to 1 (large).

use crate::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
use crate::plant::{Plant, Row};
use crate::random::{Draw, digits};
use crate::simulate::rows_of;
use crate::survey::Survey;
use std::f64::consts::TAU;

/// An effect of open size.
pub struct Offer {
    /// Its name.
    pub id: &'static str,
    /// The effect of a size within (0, 1].
    pub at: Box<dyn Fn(f64) -> Effect + Send + Sync>,
}

/// Where and when the runs happen, as far as an effect must know.
pub struct Frame {
    /// Sampling interval.
    pub interval: f64,
    /// Time of the first and the last sample of the given logs.
    pub span: (f64, f64),
}

struct Menu<'a> {
    plant: &'a Plant,
    survey: &'a Survey,
    list: Vec<Offer>,
}

impl Menu<'_> {
    /// Adds an additive term: its amplitude at size 1 moves the row as much as all that the nominal model has there.
    fn term(&mut self, id: &'static str, row: usize, variables: Vec<Variable>, unit: Act, signed: f64) {
        let squares: f64 = self.survey.points.iter().map(|(x, u)| unit.added(0.5, x, u).powi(2)).sum();
        let size = (squares / self.survey.points.len() as f64).sqrt();
        if size <= 0.0 || !size.is_finite() || self.survey.slope[row] <= 0.0 {
            return;
        }
        let full = signed * self.survey.slope[row] / size;
        self.push(id, row, variables, move |s| scaled(unit, full * s));
    }

    fn push(
        &mut self,
        id: &'static str,
        state: usize,
        variables: Vec<Variable>,
        act: impl Fn(f64) -> Act + Send + Sync + 'static,
    ) {
        let at = Box::new(move |s: f64| Effect { id, state, variables: variables.clone(), act: act(s) });
        self.list.push(Offer { id, at });
    }

    /// Does a state pass through zero, so that an odd function of it makes sense?
    fn central(&self, i: usize) -> bool {
        let (low, high) = (self.survey.low[i], self.survey.high[i]);
        low < -0.2 * high.abs() && high > 0.2 * low.abs()
    }

    fn dynamic(&self) -> Vec<usize> {
        (0..self.plant.rows.len()).filter(|&i| self.plant.rows[i] != Row::Kinematic).collect()
    }
}

/// The unit act with another amplitude, rounded.
fn scaled(unit: Act, factor: f64) -> Act {
    crate::fit::scaled(unit, digits(factor, 4))
}

/// All effects of the catalogue that fit the plant.
pub fn catalogue(plant: &Plant, survey: &Survey, frame: &Frame, draw: &mut Draw) -> Vec<Offer> {
    let mut menu = Menu { plant, survey, list: Vec::new() };
    for row in menu.dynamic() {
        let z = Variable::State(row);
        menu.term("bias", row, vec![], Act::Constant { c: 1.0 }, 0.7 * draw.sign());
        match plant.rows[row] {
            Row::Kinematic | Row::Rate => {}
            Row::Force { position, angle } => {
                menu.term("viscous_friction", row, vec![z], Act::Linear { z, c: 1.0 }, -1.0);
                menu.term("quadratic_drag", row, vec![z], Act::Quadratic { z, c: 1.0 }, 1.0);
                let level = 0.6 * survey.slope[row];
                if survey.low[row] < 0.3 * survey.high[row] {
                    let coulomb = move |s| Act::Friction { law: Friction::Coulomb { c: digits(level * s, 4) } };
                    menu.push("coulomb_friction", row, vec![z], coulomb);
                    let (ratio, w) = (draw.uniform(1.5, 2.5), digits(survey.spread[row] * draw.uniform(0.1, 0.4), 3));
                    menu.push("stribeck_friction", row, vec![z], move |s| {
                        let c = digits(0.6 * level * s, 4);
                        Act::Friction { law: Friction::Stribeck { c, s: digits(c * ratio, 4), w } }
                    });
                }
                if let Some(q) = position {
                    let q_ = Variable::State(q);
                    if menu.central(q) {
                        menu.term("linear_stiffness", row, vec![q_], Act::Linear { z: q_, c: 1.0 }, -1.0);
                        menu.term("cubic_stiffness", row, vec![q_], Act::Cubic { z: q_, c: 1.0 }, 1.0);
                    }
                    let turn = survey.high[q] - survey.low[q];
                    if angle {
                        let phase = if draw.chance(0.5) { 0.0 } else { digits(draw.uniform(-0.5, 0.5), 3) };
                        let sine = Act::Sine { z: q_, c: 1.0, n: 1.0, phase };
                        menu.term("gravity_load", row, vec![q_], sine, -1.0);
                        let n = (draw.uniform(1.5, 5.0) * TAU / turn).round().max(3.0);
                        let sine = Act::Sine { z: q_, c: 1.0, n, phase: digits(draw.uniform(-3.0, 3.0), 3) };
                        menu.term("cogging", row, vec![q_], sine, 1.0);
                    } else if turn < 60.0 * survey.spread[q] {
                        let n = digits(draw.uniform(1.5, 4.0) * TAU / turn, 3);
                        let sine = Act::Sine { z: q_, c: 1.0, n, phase: digits(draw.uniform(-3.0, 3.0), 3) };
                        menu.term("cogging", row, vec![q_], sine, 1.0);
                    }
                }
            }
            Row::Balance => {
                let id = if draw.chance(0.5) { "viscous_friction" } else { "linear_stiffness" };
                menu.term(id, row, vec![z], Act::Linear { z, c: 1.0 }, -1.0);
                menu.term("quadratic_drag", row, vec![z], Act::Quadratic { z, c: 1.0 }, 1.0);
                menu.term("cubic_stiffness", row, vec![z], Act::Cubic { z, c: 1.0 }, 1.0);
            }
        }
        let band = (plant.band.0 * plant.band.1).sqrt();
        let omega = digits(TAU * band * draw.log(0.5, 4.0), 3);
        let periodic = Act::Periodic { c: 1.0, omega, phase: digits(draw.uniform(-3.0, 3.0), 3) };
        let full = 0.8 * survey.slope[row];
        menu.push("periodic_disturbance", row, vec![], move |s| scaled(periodic, full * s));
        let t0 = digits(frame.span.0 + draw.uniform(0.25, 0.7) * (frame.span.1 - frame.span.0), 4);
        let sign = draw.sign();
        menu.push("step_disturbance", row, vec![], move |s| Act::Step { c: digits(sign * full * s, 4), t0 });
        let length = frame.span.1;
        menu.push("drift", row, vec![], move |s| Act::Drift { c: digits(sign * full * s / length, 4) });
        // A product of two variables that both do something.
        let others: Vec<Variable> = menu
            .dynamic()
            .into_iter()
            .map(Variable::State)
            .chain((0..plant.controls.len()).map(Variable::Control))
            .collect();
        let (i, j) = (draw.index(others.len()), draw.index(others.len()));
        if let (Some(&a), Some(&b)) = (others.get(i), others.get(j))
            && a != b
        {
            menu.term("product_coupling", row, vec![a, b], Act::Product { z: a, w: b, c: 1.0 }, draw.sign());
        }
    }
    for &(row, other) in &plant.couplings {
        let z = Variable::State(other);
        menu.term("coupling", row, vec![z], Act::Linear { z, c: 1.0 }, 0.7 * draw.sign());
    }
    parameters(&mut menu, draw);
    inputs(&mut menu, frame, draw);
    sensors(&mut menu, frame, draw);
    menu.list
}

fn parameters(menu: &mut Menu, draw: &mut Draw) {
    for (k, parameter) in menu.plant.parameters.iter().enumerate() {
        let (value, sign) = (parameter.value, draw.sign());
        let variable = Variable::Parameter(k);
        let rows = rows_of(menu.plant, variable, &menu.survey.points);
        if let Some(&row) = rows.first()
            && !parameter.certain
        {
            let act = move |s: f64| Act::Parameter { index: k, value: digits(value * (1.0 + sign * 0.5 * s), 5) };
            menu.push("parameter_error", row, vec![variable], act);
        }
    }
}

/// Longest delay that still belongs to the plant: a quarter of the fastest period, at least three samples.
fn longest(plant: &Plant, frame: &Frame) -> f64 {
    (0.25 / plant.band.1).max(3.0 * frame.interval)
}

fn inputs(menu: &mut Menu, frame: &Frame, draw: &mut Draw) {
    let late = longest(menu.plant, frame);
    for control in 0..menu.plant.controls.len() {
        let variable = Variable::Control(control);
        let rows = rows_of(menu.plant, variable, &menu.survey.points);
        let Some(&row) = rows.iter().find(|&&r| menu.plant.rows[r] != Row::Kinematic) else { continue };
        let (low, high) = (menu.survey.control_low[control], menu.survey.control_high[control]);
        let (reach, range) = (low.abs().max(high.abs()), high - low);
        let (s1, s2) = (draw.sign(), draw.sign());
        let v = vec![variable];
        let act = move |law| Act::Actuator { control, law };
        menu.push("input_gain", row, v.clone(), move |s| act(Actuator::Gain { c: digits(0.5 * s1 * s, 4) }));
        menu.push("input_bias", row, v.clone(), move |s| act(Actuator::Bias { c: digits(0.4 * s2 * range * s, 4) }));
        menu.push("input_saturation", row, v.clone(), move |s| {
            act(Actuator::Saturation { c: digits(reach * (1.0 - 0.7 * s), 4) })
        });
        if low < 0.15 * high {
            menu.push("input_dead_zone", row, v.clone(), move |s| {
                act(Actuator::DeadZone { c: digits(0.5 * reach * s, 4) })
            });
        }
        menu.push("input_delay", row, v.clone(), move |s| act(Actuator::Delay { tau: digits(late * s, 3) }));
        menu.push("input_lag", row, v.clone(), move |s| act(Actuator::Lag { tau: digits(late * s, 3) }));
        menu.push("backlash", row, v, move |s| act(Actuator::Play { c: digits(0.8 * range * s, 4) }));
    }
}

fn sensors(menu: &mut Menu, frame: &Frame, draw: &mut Draw) {
    let late = longest(menu.plant, frame);
    for &state in &menu.plant.logged {
        let (spread, s1, s2) = (menu.survey.spread[state], draw.sign(), draw.sign());
        let act = |law| Act::Sensor { law };
        menu.push("sensor_bias", state, vec![], move |s| act(Sensor::Bias { c: digits(s1 * spread * s, 4) }));
        menu.push("sensor_scale", state, vec![], move |s| act(Sensor::Scale { c: digits(0.4 * s2 * s, 4) }));
        menu.push("sensor_delay", state, vec![], move |s| act(Sensor::Delay { tau: digits(late * s, 3) }));
    }
}

/// Effects that were outside the catalogue when the first suites were drawn, and are in its second part.
const NAMED: [&str; 6] =
    ["load_dependent_friction", "one_sided_contact", "overflow", "missing_resonance", "hysteresis", "rate_limit"];

/// Effects that the catalogue lacks.
pub fn outside(plant: &Plant, survey: &Survey, draw: &mut Draw) -> Vec<Offer> {
    let mut menu = Menu { plant, survey, list: Vec::new() };
    for row in menu.dynamic() {
        let z = Variable::State(row);
        let level = survey.slope[row];
        if let Row::Force { position, .. } = plant.rows[row] {
            if menu.central(row) {
                let load = match plant.controls.is_empty() || draw.chance(0.3) {
                    true => position.map(Variable::State),
                    false => Some(Variable::Control(draw.index(plant.controls.len()))),
                };
                if let Some(load) = load {
                    let size = typical(survey, load);
                    menu.push("load_dependent_friction", row, vec![z, load], move |s| Act::Friction {
                        law: Friction::Loaded { c: digits(level * s / size, 4), load },
                    });
                }
            }
            if let Some(q) = position {
                let (at, width) = (place(survey, q, draw), digits(survey.spread[q] * draw.uniform(0.2, 0.4), 3));
                menu.push("friction_at_a_place", row, vec![Variable::State(q), z], move |s| Act::Friction {
                    law: Friction::Placed { c: digits(1.5 * level * s, 4), position: q, at, width },
                });
                let (edge, side) = edge(survey, q, draw);
                let q_ = Variable::State(q);
                let contact = Act::Contact { z: q_, c: 1.0, edge, side };
                menu.term("one_sided_contact", row, vec![q_], contact, 2.0);
                let omega = digits(TAU * plant.band.1 * draw.uniform(0.6, 1.5), 3);
                let damping = digits(draw.uniform(0.02, 0.08), 2);
                menu.push("missing_resonance", row, vec![q_, z], move |s| Act::Resonance {
                    position: q,
                    velocity: row,
                    c: digits(0.6 * s, 4),
                    omega,
                    damping,
                });
                let w = digits(survey.spread[q] * draw.uniform(0.2, 0.6), 3);
                menu.push("hysteresis", row, vec![q_, z], move |s| Act::Hysteresis {
                    velocity: row,
                    c: digits(level / w * s, 4),
                    w,
                });
            }
        } else if plant.rows[row] == Row::Balance {
            let (edge, side) = edge(survey, row, draw);
            let id = if plant.positive { "overflow" } else { "one_sided_contact" };
            let side = if plant.positive { 1.0 } else { side };
            let edge = if plant.positive { digits(survey.mean[row] + 0.6 * survey.spread[row], 3) } else { edge };
            menu.term(id, row, vec![z], Act::Contact { z, c: 1.0, edge, side }, 2.5);
        }
        let var = |draw: &mut Draw| {
            let states: Vec<usize> = menu.dynamic().into_iter().filter(|&i| plant.rows[i] != Row::Rate).collect();
            let i = draw.index(states.len() + plant.controls.len());
            if i < states.len() { Variable::State(states[i]) } else { Variable::Control(i - states.len()) }
        };
        let (a, b, d) = (var(draw), var(draw), var(draw));
        let mut variables = vec![a, b, d];
        variables.dedup();
        if variables.len() > 1 && a != d {
            menu.term("triple_product", row, variables, Act::Triple { a, b, d, c: 1.0 }, draw.sign());
        }
        if plant.rows[row] == Row::Rate {
            continue;
        }
        let w = digits(0.5 * survey.spread[row], 3);
        let rise = Act::Exponential { z, c: 1.0, edge: digits(survey.high[row], 3), w };
        menu.term("exponential_loss", row, vec![z], rise, -1.5);
        if menu.central(row) {
            menu.term("inverse_force", row, vec![z], Act::Inverse { z, c: 1.0, w: digits(0.4 * w, 3) }, draw.sign());
        }
    }
    for control in 0..plant.controls.len() {
        let variable = Variable::Control(control);
        let rows = rows_of(plant, variable, &survey.points);
        let Some(&row) = rows.iter().find(|&&r| plant.rows[r] != Row::Kinematic) else { continue };
        let speed = (survey.control_high[control] - survey.control_low[control]) * plant.band.1;
        menu.push("rate_limit", row, vec![variable], move |s| Act::Actuator {
            control,
            law: Actuator::RateLimit { c: digits(0.3 * speed / s, 4) },
        });
    }
    menu.list.retain(|offer| !NAMED.contains(&offer.id));
    menu.list
}

fn typical(survey: &Survey, variable: Variable) -> f64 {
    match variable {
        Variable::State(i) => (survey.mean[i].powi(2) + survey.spread[i].powi(2)).sqrt(),
        Variable::Control(j) => survey.control_low[j].abs().max(survey.control_high[j].abs()) * 0.5,
        Variable::Parameter(_) => 1.0,
    }
}

fn place(survey: &Survey, q: usize, draw: &mut Draw) -> f64 {
    digits(survey.mean[q] + draw.uniform(-0.8, 0.8) * survey.spread[q], 3)
}

fn edge(survey: &Survey, q: usize, draw: &mut Draw) -> (f64, f64) {
    let side = draw.sign();
    (digits(survey.mean[q] + side * draw.uniform(0.4, 1.0) * survey.spread[q], 3), side)
}
