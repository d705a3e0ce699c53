//! Which effects of the second part of the catalogue make physical sense on a plant, as families over their size.
//!
//! As in `choose`: forms of our own, true sticking, no smoothing of any edge. An effect that needs a column which no plant
//! logs (a supply) is drawn by nobody.

use crate::choose::{Frame, Offer};
use crate::effect::{Act, Actuator, Effect, Friction, Sensor, Variable};
use crate::plant::{Plant, Row};
use crate::random::{Draw, digits};
use crate::simulate::rows_of;
use crate::survey::Survey;
use std::f64::consts::TAU;

struct Menu<'a> {
    plant: &'a Plant,
    survey: &'a Survey,
    list: Vec<Offer>,
}

impl Menu<'_> {
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

    /// Does a state take either sign by a good part of its range?
    fn central(&self, i: usize) -> bool {
        let (low, high) = (self.survey.low[i], self.survey.high[i]);
        low < -0.2 * high.abs() && high > 0.2 * low.abs()
    }

    fn first_row(&self, variable: Variable) -> Option<usize> {
        let rows = rows_of(self.plant, variable, &self.survey.points);
        rows.into_iter().find(|&r| self.plant.rows[r] != Row::Kinematic)
    }

    /// Does row `r` move when state `z` and parameter `index` move together, as it does in a product of the two?
    fn is_product(&self, r: usize, index: usize, z: usize) -> bool {
        let n = self.plant.states.len();
        let at = |p: f64, step: f64, (x, u): &(Vec<f64>, Vec<f64>)| {
            let (mut parameters, mut x, mut d) = (self.plant.values(), x.clone(), vec![0.0; n]);
            parameters[index] *= p;
            x[z] += step * self.survey.spread[z];
            (self.plant.flow)(&parameters, &x, u, 0.0, &mut d);
            d[r]
        };
        self.survey.points.iter().take(5).any(|point| {
            let mixed = at(1.1, 0.1, point) - at(1.1, 0.0, point) - at(1.0, 0.1, point) + at(1.0, 0.0, point);
            mixed.abs() > 1e-6 * self.survey.slope[r]
        })
    }

    /// Does the parameter multiply what it acts on? What grows when a mass or a capacity that divides becomes smaller saturates nowhere.
    fn is_factor(&self, r: usize, index: usize) -> bool {
        let at = |p: f64, (x, u): &(Vec<f64>, Vec<f64>)| {
            let (mut parameters, mut d) = (self.plant.values(), vec![0.0; self.plant.states.len()]);
            parameters[index] *= p;
            (self.plant.flow)(&parameters, x, u, 0.0, &mut d);
            d[r]
        };
        self.survey.points.iter().take(5).all(|point| {
            let bent = at(1.5, point) - 2.0 * at(1.0, point) + at(0.5, point);
            bent.abs() <= 1e-6 * self.survey.slope[r]
        })
    }
}

/// All effects of the second part that fit the plant.
pub fn second(plant: &Plant, survey: &Survey, frame: &Frame, draw: &mut Draw) -> Vec<Offer> {
    let mut menu = Menu { plant, survey, list: Vec::new() };
    for row in 0..plant.rows.len() {
        match plant.rows[row] {
            Row::Force { position, .. } => forces(&mut menu, row, position, frame, draw),
            Row::Balance => stop(&mut menu, row, row, draw),
            Row::Kinematic | Row::Rate => {}
        }
    }
    rates(&mut menu, frame, draw);
    inputs(&mut menu, draw);
    // The late quarter of the fastest period, at least three samples.
    let late = (0.25 / plant.band.1).max(3.0 * frame.interval);
    for &state in &plant.logged {
        let act = |law| Act::Sensor { law };
        menu.push("sensor_filter", state, vec![], move |s| act(Sensor::Filter { tau: digits(late * s, 3) }));
        menu.push("clock", state, vec![], move |s| act(Sensor::Clock { slow: digits(0.05 * s, 3) }));
    }
    menu.list
}

fn forces(menu: &mut Menu, row: usize, position: Option<usize>, frame: &Frame, draw: &mut Draw) {
    let (plant, survey) = (menu.plant, menu.survey);
    let (z, level) = (Variable::State(row), survey.slope[row]);
    menu.push("inertia", row, vec![], move |s| Act::Inertia { c: digits(s, 4) });
    if menu.central(row) {
        let ratio = draw.uniform(0.3, 0.7);
        let swapped = draw.chance(0.5);
        menu.push("asymmetric_friction", row, vec![z], move |s| {
            let (much, little) = (digits(0.7 * level * s, 4), digits(0.7 * level * s * ratio, 4));
            let (up, down) = if swapped { (much, little) } else { (little, much) };
            Act::Friction { law: Friction::Asymmetric { up, down } }
        });
        let hold = draw.uniform(1.6, 2.5);
        let w = digits(0.04 * survey.spread[row], 3);
        menu.push("stiction", row, vec![z], move |s| {
            let c = digits(0.4 * level * s, 4);
            Act::Friction { law: Friction::Stribeck { c, s: digits(c * hold, 4), w } }
        });
        let loads = (0..plant.controls.len()).map(Variable::Control).chain(position.map(Variable::State));
        let loads: Vec<Variable> = loads.filter(|&load| rows_of(plant, load, &survey.points).contains(&row)).collect();
        if let Some(&load) = loads.get(draw.index(loads.len().max(1))) {
            let size = match load {
                Variable::Control(j) => 0.5 * survey.control_low[j].abs().max(survey.control_high[j].abs()),
                Variable::State(i) => survey.spread[i],
                Variable::Parameter(_) => 1.0,
            };
            menu.push("load_friction", row, vec![z, load], move |s| Act::Friction {
                law: Friction::Loaded { c: digits(level * s / size, 4), load },
            });
        }
    }
    if let Some(q) = position {
        if menu.central(row) {
            let travel = survey.high[q] - survey.low[q];
            let b = digits(draw.log(3.0, 15.0) / travel, 3);
            let g = digits(b * draw.uniform(-0.4, 0.4), 3);
            menu.push("hysteresis", row, vec![z], move |s| Act::Memory {
                velocity: row,
                c: digits(level * b * s, 4),
                b,
                g,
            });
        }
        let fastest = (0.3 / frame.interval).min(8.0 * plant.band.1);
        let omega = digits(TAU * draw.log(1.0 * plant.band.1, fastest.max(1.1 * plant.band.1)), 3);
        let damping = digits(draw.uniform(0.02, 0.1), 2);
        menu.push("elastic_joint", row, vec![z], move |s| Act::Resonance {
            position: q,
            velocity: row,
            c: digits(1.5 * s, 4),
            omega,
            damping,
        });
        stop(menu, row, q, draw);
        for p in (0..plant.states.len()).filter(|&p| p != q && plant.rows[p] == Row::Kinematic) {
            if q < p && joined(plant, survey, p, q) {
                let apart = survey.points.iter().map(|(x, _)| (x[p] - x[q]).abs()).fold(0.0, f64::max);
                let act = move |s: f64| Act::Loose { p, q, c: digits(0.6 * apart * s, 4) };
                menu.push("gear_play", row, vec![Variable::State(q), Variable::State(p)], act);
            }
        }
    }
}

/// Do the forces know two places by their difference only?
fn joined(plant: &Plant, survey: &Survey, p: usize, q: usize) -> bool {
    let n = plant.states.len();
    let flow = |x: &[f64], u: &[f64]| {
        let mut d = vec![0.0; n];
        (plant.flow)(&plant.values(), x, u, 0.0, &mut d);
        d
    };
    let mut meets = false;
    for (x, u) in survey.points.iter().take(10) {
        let (mut both, mut one) = (x.clone(), x.clone());
        both[p] += 0.1 * survey.spread[p];
        both[q] += 0.1 * survey.spread[p];
        one[p] += 0.1 * survey.spread[p];
        let (here, shifted, moved) = (flow(x, u), flow(&both, u), flow(&one, u));
        for i in 0..n {
            if (shifted[i] - here[i]).abs() > 1e-9 * (survey.slope[i] + here[i].abs()) {
                return false;
            }
            meets |= (moved[i] - here[i]).abs() > 1e-6 * survey.slope[i];
        }
    }
    meets
}

fn stop(menu: &mut Menu, row: usize, place: usize, draw: &mut Draw) {
    let survey = menu.survey;
    if matches!(menu.plant.states[row].unit.as_str(), "degC" | "K" | "°C") {
        return;
    }
    let side = draw.sign();
    let edge = digits(survey.mean[place] + side * draw.uniform(0.4, 1.0) * survey.spread[place], 3);
    let stiff = 4.0 * survey.slope[row] / survey.spread[place].max(1e-9);
    let z = Variable::State(place);
    menu.push("end_stop", row, vec![z], move |s| Act::Contact { z, c: digits(stiff * s, 4), edge, side });
}

/// Whether a unit is one of a flow of matter, or of a share that flows, whose square heats nothing.
fn is_flow(unit: &str) -> bool {
    let Some((of, per)) = unit.split_once('/') else { return false };
    matches!(of, "1" | "g" | "kg" | "mol" | "l" | "L" | "m^3" | "cm^3") && matches!(per, "s" | "min" | "h" | "d")
}

fn rates(menu: &mut Menu, frame: &Frame, draw: &mut Draw) {
    let (plant, survey) = (menu.plant, menu.survey);
    for index in 0..plant.parameters.len() {
        let variable = Variable::Parameter(index);
        let Some(row) = menu.first_row(variable).filter(|_| !plant.parameters[index].certain) else { continue };
        let held: Vec<usize> = (0..plant.states.len()).filter(|&z| menu.is_product(row, index, z)).collect();
        let is_factor = menu.is_factor(row, index);
        for z in held.into_iter().filter(|_| is_factor) {
            let balance = plant.rows[row] == Row::Balance;
            let variables = vec![variable, Variable::State(z)];
            if balance && survey.low[z] >= 0.0 {
                let h = 3.0 / survey.mean[z].abs().max(survey.spread[z]);
                menu.push("saturating_rate", row, variables, move |s| Act::Saturating {
                    index,
                    z,
                    h: digits(h * s, 4),
                });
            } else if matches!(plant.rows[row], Row::Force { .. }) && menu.central(z) {
                let q = 6.0 / survey.spread[z].powi(2);
                menu.push("slip", row, variables, move |s| Act::Slipping { index, z, q: digits(q * s, 4) });
            }
        }
        let controls = 0..plant.controls.len();
        for control in controls.filter(|&j| rows_of(plant, Variable::Control(j), &survey.points).contains(&row)) {
            let usual = digits(0.5 * survey.control_low[control].abs().max(survey.control_high[control].abs()), 3);
            let tau = digits(draw.uniform(0.1, 0.5) * (frame.span.1 - frame.span.0), 3);
            if is_flow(&plant.controls[control].unit) {
                continue;
            }
            let variables = vec![variable, Variable::Control(control)];
            menu.push("thermal", row, variables, move |s| Act::Warming { index, control, c: digits(s, 4), tau, usual });
        }
    }
}

fn inputs(menu: &mut Menu, draw: &mut Draw) {
    let (plant, survey) = (menu.plant, menu.survey);
    for control in 0..plant.controls.len() {
        let variable = Variable::Control(control);
        let Some(row) = menu.first_row(variable) else { continue };
        let (low, high) = (survey.control_low[control], survey.control_high[control]);
        let speed = (high - low) * plant.band.1;
        menu.push("input_rate_limit", row, vec![variable], move |s| Act::Actuator {
            control,
            law: Actuator::RateLimit { c: digits(0.3 * speed / s, 4) },
        });
        if matches!(plant.rows[row], Row::Force { .. }) {
            let (reach, fastest) = (low.abs().max(high.abs()), survey.high[row].abs().max(survey.low[row].abs()));
            let z0 = digits(fastest * draw.uniform(1.1, 2.5), 3);
            menu.push("motor_limit", row, vec![variable, Variable::State(row)], move |s| Act::Actuator {
                control,
                law: Actuator::SpeedLimit { s: digits(reach * 0.5 / s, 4), z0, speed: row },
            });
        }
    }
}
