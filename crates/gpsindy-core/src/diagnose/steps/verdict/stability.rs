//! Stability: does a cause keep its size in every run, in the inner and the outer part of its range, early and late?
//!
//! The size of a true cause is invariant; that of an imitation is not (Peters, Buehlmann, Meinshausen 2016, JRSS B 78(5)).
//! At the joint fit, each part of the logs gets a size of its own in a linearised model, with everything else free. The
//! test of agreement uses the size and colour of the residual, so its null distribution is known.

use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::linear::elimination::{eliminate, gain};
use crate::diagnose::limits::stability::{DISAGREES, MOST_PARTS, NOTHING, SAME_SIZE};
use crate::expression::{Expression, Function};
use crate::model::{Model, Parameter, System};
use crate::refine::{Free, Jacobian, Point};
use nalgebra::{DMatrix, DVector};

/// Whether the sizes of a cause agree between parts of the logs.
pub(crate) struct Stability {
    /// Parts that tell a size.
    pub(crate) parts: usize,
    pub(crate) agree: usize,
    /// Chance of so much disagreement.
    pub(crate) p_value: f64,
    /// Parts that disagree, in words.
    pub(crate) disagree: Vec<String>,
}

/// A question: sizes of their own in parts of the logs.
struct Question {
    /// One list of columns a part; the first part of a halving has none, it keeps the joint size.
    parts: Vec<Part>,
}

struct Part {
    name: String,
    columns: Vec<usize>,
}

/// Stability of the effect at `place` of the winner; `None` where no part tells a size of its own.
///
/// `nominal` tells the sizes of wrong parameters: they are what the values changed by.
pub(crate) fn of(nominal: &Model, best: &Contestant, place: usize) -> Option<Stability> {
    let own: Vec<usize> = best.added[place]
        .iter()
        .filter_map(|(index, _)| best.free.iter().position(|f| f.parameter == *index))
        .collect();
    if own.is_empty() {
        return None;
    }
    let gated = Gated::new(best, place);
    let products = Products::new(best, &gated, &own)?;
    let first = best.free[own[0]].parameter;
    let size = best.refined.parameters[first] - nominal.parameters.get(first).map_or(0.0, |p| p.value);
    let questions = questions(best, &gated, &own, products.runs);
    let mut found = Stability { parts: 0, agree: 0, p_value: 1.0, disagree: Vec::new() };
    let mut asked = 0;
    for question in questions {
        let all: Vec<usize> = question.parts.iter().flat_map(|p| p.columns.iter().copied()).collect();
        let Some(p_value) = products.disagreement(best, (&own, size), &all) else { continue };
        asked += 1;
        found.p_value = found.p_value.min(p_value);
        let halves = question.parts.len() == 1;
        for part in &question.parts {
            let alone = if halves { Some(p_value) } else { products.disagreement(best, (&own, size), &part.columns) };
            let Some(alone) = alone else { continue };
            found.parts += 1;
            if p_value < DISAGREES && alone * question.parts.len() as f64 <= DISAGREES {
                found.disagree.push(part.name.clone());
            } else {
                found.agree += 1;
            }
        }
        if halves {
            // The other half keeps the joint size.
            found.parts += 1;
            found.agree += 1;
        }
    }
    found.p_value = (found.p_value * f64::from(asked)).min(1.0);
    (asked > 0).then_some(found)
}

/// The winner with further parameters that change a cause's sizes in a half of the logs.
struct Gated {
    system: System,
    free: Vec<Free>,
    /// Name of each half, and how many of `free` at the end are its.
    halves: Vec<(String, usize)>,
}

impl Gated {
    /// Halves that can't be written into the equations are left out.
    fn new(best: &Contestant, place: usize) -> Self {
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
            if model.states.iter().any(|s| bounds_a_hold(&s.equation, &symbol)) {
                continue;
            }
            let name = format!("{symbol}__{}", self.halves.len());
            let change = Expression::variable(name.clone()).times(gate.clone());
            let changed = Expression::variable(symbol.clone()).plus(change);
            for state in &mut model.states {
                state.equation = state.equation.substitute(&symbol, &changed);
                state.measured = state.measured.as_ref().map(|m| m.substitute(&symbol, &changed));
            }
            model.parameters.push(Parameter::new(name, 0.0));
            free.push(Free::new(model.parameters.len() - 1, added.scale));
        }
        let system = System::with_simulator(&model, best.system.simulator().cloned()).ok()?;
        Some((system.with_followers(best.nominal_states()).ok()?, free))
    }
}

/// Whether the parameter `symbol` says how much more than in motion friction holds at rest: that can't change on the way.
fn bounds_a_hold(equation: &Expression, symbol: &str) -> bool {
    let mut found = false;
    equation.visit(&mut |part| {
        if let Expression::Call(Function::Breakaway, arguments) = part {
            found |= arguments.get(1).is_some_and(|reach| reach.contains(symbol));
        }
    });
    found
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

/// Columns: the free parameters, the changes in each half, then for every run the effect's parameters in that run alone.
fn questions(best: &Contestant, gated: &Gated, own: &[usize], runs: usize) -> Vec<Question> {
    let mut all = Vec::new();
    let mut column = best.free.len();
    for (name, count) in &gated.halves {
        let columns = (column..column + count).collect();
        all.push(Question { parts: vec![Part { name: name.clone(), columns }] });
        column += count;
    }
    if runs > 1 {
        let logs = &best.experiment.logs;
        let name = |run: usize| {
            let members: Vec<&str> =
                (0..logs.len()).filter(|&l| part_of(l, logs.len()) == run).map(|l| logs[l].name.as_str()).collect();
            format!("run {}", members.join(", "))
        };
        let columns = |run: usize| (column + run * own.len()..column + (run + 1) * own.len()).collect();
        all.push(Question { parts: (0..runs).map(|run| Part { name: name(run), columns: columns(run) }).collect() });
    }
    all
}

/// Which part log number `log` belongs to.
fn part_of(log: usize, logs: usize) -> usize {
    if logs <= MOST_PARTS { log } else { log * MOST_PARTS / logs }
}

/// Products of all columns among themselves and with the residual, whitened, the initial states eliminated.
struct Products {
    gram: DMatrix<f64>,
    slope: DVector<f64>,
    /// Squared length of every column before anything was eliminated.
    before: Vec<f64>,
    free: usize,
    runs: usize,
}

impl Products {
    fn new(best: &Contestant, gated: &Gated, own: &[usize]) -> Option<Self> {
        let mut parameters = best.refined.parameters.clone();
        parameters.resize(gated.system.n_parameters(), 0.0);
        let point = Point { parameters, initial: best.refined.initial.clone() };
        let jacobian = Jacobian::new(&gated.system, &best.experiment, &point, &gated.free).ok()?;
        let logs = best.experiment.logs.len();
        let runs = logs.min(MOST_PARTS);
        let (n, q) = (jacobian.n_states, gated.free.len());
        let width = q + runs * own.len();
        let mut all = Self {
            gram: DMatrix::zeros(width, width),
            slope: DVector::zeros(width),
            before: vec![0.0; width],
            free: best.free.len(),
            runs,
        };
        for (block, window) in jacobian.blocks.iter().zip(&best.experiment.windows) {
            let whitener = Whitener::new(&best.evidence.colours, &block.present);
            let mut residual = block.residual.clone();
            whitener.whiten(&mut residual);
            let mut derivative = block.derivative.clone();
            for mut column in derivative.column_iter_mut() {
                let mut values = column.clone_owned();
                whitener.whiten(&mut values);
                column.copy_from(&values);
            }
            let directions = derivative.columns(0, n).into_owned().qr().q();
            let mut free = derivative.columns(n, q).into_owned();
            let lengths: Vec<f64> = free.column_iter().map(|c| c.norm_squared()).collect();
            free -= &directions * directions.tr_mul(&free);
            residual -= &directions * directions.tr_mul(&residual);
            let (gram, slope) = (free.tr_mul(&free), free.tr_mul(&residual));
            // Where each of this window's columns stands: once for all runs, once more for its own.
            let run = part_of(window.log, logs);
            let places: Vec<(usize, usize)> = (0..q)
                .map(|i| (i, i))
                .chain(own.iter().enumerate().map(|(k, &i)| (q + run * own.len() + k, i)))
                .collect();
            for &(row, i) in &places {
                all.slope[row] += slope[i];
                all.before[row] += lengths[i];
                for &(column, j) in &places {
                    all.gram[(row, column)] += gram[(i, j)];
                }
            }
        }
        for (i, free) in best.free.iter().enumerate() {
            if let Some((mean, sd)) = free.prior {
                all.gram[(i, i)] += sd.powi(-2);
                all.slope[i] += (mean - best.refined.parameters[free.parameter]) / (sd * sd);
            }
        }
        all.gram.iter().chain(all.slope.iter()).all(|v| v.is_finite()).then_some(all)
    }

    /// Chance that sizes of their own in `extra` gain as much by noise and the rest; `None` where nothing is told of them.
    ///
    /// `own`: the effect's parameters among the free ones, and how far the first of them, its size, is from doing nothing.
    fn disagreement(&self, best: &Contestant, (own, size): (&[usize], f64), extra: &[usize]) -> Option<f64> {
        // What stands at its bound can't give way, and would look as if it wanted to.
        let is_inside = |i: &usize| {
            let free = &best.free[*i];
            let value = best.refined.parameters[free.parameter];
            value > free.lower && value < free.upper
        };
        let mut gram = self.gram.clone();
        let mut slope = self.slope.clone();
        let is_own = |i: &usize| own.contains(i);
        for i in (0..self.free).filter(is_inside).filter(|i| !is_own(i)) {
            eliminate(&mut gram, &mut slope, i, NOTHING * self.before[i]);
        }
        // By how much the effect as a whole moves the outputs beyond what the others can, with a size that differs by a little.
        let moved = gram[(own[0], own[0])].max(0.0) * (SAME_SIZE * size).powi(2);
        for &i in own.iter().filter(|i| is_inside(i)) {
            eliminate(&mut gram, &mut slope, i, NOTHING * self.before[i]);
        }
        let (gain, degrees) = gain(&mut gram, &mut slope, extra.iter().copied(), |i| NOTHING * self.before[i]);
        if degrees == 0 {
            return None;
        }
        let count = best.evidence.count();
        let allowed = moved.max(best.evidence.negligible() * count as f64);
        // The expected shift and the chance one add as lengths do.
        let beyond = (gain.sqrt() - allowed.sqrt()).max(0.0).powi(2);
        Some(gain_tail(with_fitted_level(beyond, count), degrees, count, best.evidence.spent()))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::enumerate::enumerate;
    use crate::diagnose::fit::fitter::{Fitter, unsearched};
    use crate::diagnose::fit::outputs::scene_of;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::limits::Budget;
    use crate::refine::Experiment;

    /// Stability of a linear loss in a drive that loses `loses(x)` beyond its model.
    fn linear(loses: impl Fn(f64) -> f64) -> Stability {
        let (model, data) = drive(None, loses, 0.01, (4, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
        let fitter = Fitter::default();
        let nominal = fitter.nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let scene = scene_of(&nominal);
        let hypotheses = enumerate(&model, &scene, &[0], &[]).unwrap();
        let friction = hypotheses.iter().find(|h| h.id() == "viscous_friction").unwrap();
        let applied = friction.apply(&model, &scene).unwrap();
        let best = fitter.with(&nominal, &[unsearched(friction)], &applied, &[vec![0.5]], Budget::Thorough).unwrap();
        of(&model, &best, 0).unwrap()
    }

    #[test]
    fn the_size_of_a_true_cause_agrees_in_all_parts() {
        let found = linear(|x| 1.8 * x);
        // Four runs, two halves of the range, two of the time.
        assert_eq!((found.parts, found.agree), (8, 8), "{:?}", found.disagree);
        assert!(found.p_value > 0.05, "{}", found.p_value);
    }

    #[test]
    fn an_imitation_has_another_size_in_the_outer_part() {
        let found = linear(|x| x + 1.5 * x * x * x);
        assert!(found.p_value < 1e-3, "{}", found.p_value);
        assert!(found.disagree.contains(&"the outer part of x".to_string()), "{:?}", found.disagree);
    }
}
