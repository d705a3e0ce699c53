//! The winner with sizes that may differ in halves of the logs.

use crate::diagnose::fit::contestant::Contestant;
use crate::expression::{Expression, Function};
use crate::model::{Model, Parameter, System};
use crate::refine::Free;

/// The winner with further parameters that change a cause's sizes in a half of the logs.
pub(super) struct Gated {
    pub(super) system: System,
    pub(super) free: Vec<Free>,
    /// Name of each half, and how many of `free` at the end are its.
    pub(super) halves: Vec<(String, usize)>,
}

impl Gated {
    /// Halves that can't be written into the equations are left out.
    pub(super) fn new(best: &Contestant, place: usize) -> Self {
        let mut found = Self { system: best.system.clone(), free: best.free.clone(), halves: Vec::new() };
        for (name, gate) in gates(best, place) {
            let Some((system, free)) = found.with(best, place, &gate) else { continue };
            found.halves.push((name, free.len() - found.free.len()));
            (found.system, found.free) = (system, free);
        }
        found
    }

    /// One more half: every parameter of the effect gets a change of its own where `gate` is one.
    fn with(&self, best: &Contestant, place: usize, gate: &Expression) -> Option<(System, Vec<Free>)> {
        let mut model: Model = self.system.model().clone();
        let mut free = self.free.clone();
        for (index, added) in &best.added[place] {
            if !best.free.iter().any(|f| f.parameter == *index) {
                continue;
            }
            let symbol = model.parameters[*index].name.clone();
            let name = format!("{symbol}__{}", self.halves.len());
            let change = Expression::variable(name.clone()).times(gate.clone());
            let changed = Expression::variable(symbol.clone()).plus(change);
            for state in &mut model.states {
                state.equation = with_changed(&state.equation, &symbol, &changed);
                state.measured = state.measured.as_ref().map(|m| m.substitute(&symbol, &changed));
            }
            model.parameters.push(Parameter::new(name, 0.0));
            free.push(Free::new(model.parameters.len() - 1, added.scale));
        }
        let system = System::with_simulator(&model, best.system.simulator().cloned()).ok()?;
        Some((system.with_followers(best.nominal_states()).ok()?, free))
    }
}

/// The equation with the parameter `symbol` changed, but for how much more than in motion friction holds at rest, which stays on the way.
fn with_changed(equation: &Expression, symbol: &str, changed: &Expression) -> Expression {
    let kept = Expression::variable(format!("{symbol} at rest"));
    let keep = |part| match part {
        Expression::Call(Function::Breakaway, arguments) => {
            let kept = arguments.iter().map(|a| a.substitute(symbol, &kept)).collect();
            Expression::Call(Function::Breakaway, kept)
        }
        other => other,
    };
    let back = Expression::variable(symbol);
    equation.map(&keep).substitute(symbol, changed).substitute(&format!("{symbol} at rest"), &back)
}

/// Halves of the logs: the outer part of each variable that the cause depends on, and the later part of the time.
fn gates(best: &Contestant, place: usize) -> Vec<(String, Expression)> {
    let (model, experiment) = (best.system.model(), &best.experiment);
    let values = |name: &str| -> Option<Vec<f64>> {
        let state = model.state_index(name).and_then(|j| experiment.column_of(j));
        let logs = experiment.logs.iter();
        match (state, model.control_index(name)) {
            (Some(c), _) => Some(logs.flat_map(|l| l.measured[c].iter().copied()).filter(|v| v.is_finite()).collect()),
            (None, Some(c)) => Some(logs.flat_map(|l| l.controls[c].iter().copied()).collect()),
            (None, None) => None,
        }
    };
    let mut all = Vec::new();
    for name in depends_on(best, place) {
        let Some(mut values) = values(&name) else { continue };
        let Some(centre) = median(&mut values) else { continue };
        let mut sizes: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
        let Some(half) = median(&mut sizes).filter(|h| *h > 0.0) else { continue };
        if let Ok(gate) = Expression::parse(&format!("step(abs({name} - ({centre:e})) - {half:e})")) {
            all.push((format!("the outer part of {name}"), gate));
        }
    }
    let mut times: Vec<f64> = experiment.logs.iter().flat_map(|l| l.time.iter().copied()).collect();
    if let Some(middle) = median(&mut times)
        && let Ok(gate) = Expression::parse(&format!("step(t - ({middle:e}))"))
    {
        all.push(("the later part of the time".into(), gate));
    }
    all
}

/// States and controls that a cause depends on; of a wrong parameter those that it acts on.
fn depends_on(best: &Contestant, place: usize) -> Vec<String> {
    let (model, hypothesis) = (best.system.model(), &best.hypotheses[place]);
    let is_variable = |name: &String| model.state_index(name).is_some() || model.control_index(name).is_some();
    let mut names: Vec<String> = hypothesis.variables.iter().filter(|n| is_variable(n)).cloned().collect();
    if names.is_empty()
        && let Some((index, _)) = best.added[place].first()
    {
        let symbol = &model.parameters[*index].name;
        let slopes = model.states.iter().filter_map(|s| s.equation.derivative(symbol).ok());
        names = slopes.flat_map(|slope| slope.variables()).filter(is_variable).collect();
        names.sort();
        names.dedup();
    }
    names
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
