//! Dry friction that holds at rest: `stick(z, 0)` and `breakaway(z, r)` as modes of a rollout.
//!
//! In motion such a function is the sign of its state. At rest it has the value that keeps the state there, as long as
//! there is one within its reach: the right side is a set (Filippov 1988, Differential Equations with Discontinuous
//! Righthand Sides). An integrator walks from one change of mode to the next.

mod slots;

pub(crate) use slots::{Kept, Mode, Slots};

use crate::error::Result;
use crate::expression::{Expression, Function, Tape};
use crate::model::Model;

/// The functions of a model that may hold a state at rest, each one slot of its rates.
#[derive(Debug, Clone)]
pub(crate) struct Sticks {
    /// The state that each slot holds.
    states: Vec<usize>,
    /// Corner width and reach of every slot, side by side, of the parameters.
    bounds: Tape,
    /// The rates as a tape of the variables of [`crate::model::System::rates`] and then the slots' values.
    rates: Tape,
}

fn slot_name(index: usize) -> String {
    format!("slot {index}")
}

/// Of a function that may hold: the state that it holds, its corner width and its reach.
fn parts(expression: &Expression) -> Option<(&str, Expression, Expression)> {
    let Expression::Call(function, arguments) = expression else { return None };
    let [Expression::Variable(state), amount] = &arguments[..] else { return None };
    match function {
        Function::Stick => Some((state, amount.clone(), Expression::Number(1.0))),
        Function::Breakaway => Some((state, Expression::Number(0.0), amount.clone())),
        _ => None,
    }
}

/// Whether an amount is made of numbers and parameters, so that it stays as it is throughout a rollout.
pub(crate) fn is_fixed(model: &Model, amount: &Expression) -> bool {
    let mut fixed = true;
    amount.visit(&mut |part| {
        fixed &= match part {
            Expression::Variable(name) => model.parameter_index(name).is_some(),
            other => *other != Expression::Time,
        };
    });
    fixed
}

impl Sticks {
    /// Of `rates`, which are expressions of `variables`; none where no function may hold.
    pub(crate) fn new(
        model: &Model,
        rates: &[Expression],
        variables: &[String],
        n_simulator_outputs: usize,
    ) -> Result<Option<Self>> {
        let mut found: Vec<(usize, Expression, Expression)> = Vec::new();
        let mut known: Vec<Expression> = Vec::new();
        for rate in rates {
            rate.visit(&mut |part| {
                let Some((state, width, reach)) = parts(part) else { return };
                // What changes on the way has a corner of some width everywhere.
                if !(is_fixed(model, &width) && is_fixed(model, &reach)) {
                    return;
                }
                let Some(state) = model.state_index(state).filter(|_| !known.contains(part)) else { return };
                known.push(part.clone());
                found.push((state, width, reach));
            });
        }
        if found.is_empty() {
            return Ok(None);
        }
        let with_slots: Vec<Expression> = rates
            .iter()
            .map(|rate| {
                rate.map(&|part| match known.iter().position(|k| *k == part) {
                    Some(slot) => Expression::Variable(slot_name(slot)),
                    None => part,
                })
            })
            .collect();
        let variables: Vec<String> = variables.iter().cloned().chain((0..known.len()).map(slot_name)).collect();
        let parameters: Vec<String> = model.parameters.iter().map(|p| p.name.clone()).collect();
        let bounds: Vec<Expression> =
            found.iter().flat_map(|(_, width, reach)| [width.clone(), reach.clone()]).collect();
        Ok(Some(Self {
            states: found.iter().map(|(state, ..)| *state).collect(),
            bounds: Tape::new(&bounds, &parameters)?,
            rates: Tape::with_simulator(&with_slots, &variables, n_simulator_outputs)?,
        }))
    }

    /// The states that are held at rest by more than what acts on them in motion, at these parameters, all of the system's.
    pub(crate) fn firmly_held(&self, parameters: &[f64]) -> Vec<usize> {
        let bounds = self.bounds.evaluate_once(parameters, 0.0);
        let is_firm = |slot: &usize| bounds[2 * slot] == 0.0 && bounds[2 * slot + 1] > 1.0;
        (0..self.states.len()).filter(is_firm).map(|slot| self.states[slot]).collect()
    }
}
