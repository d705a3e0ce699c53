//! Stability: does a cause keep its size in every run, in the inner and the outer part of its range, early and late?
//!
//! The size of a true cause is invariant; that of an imitation is not (Peters, Buehlmann, Meinshausen 2016, JRSS B 78(5)).
//! At the joint fit, each part of the logs gets a size of its own in a linearised model, with everything else free. The
//! test of agreement uses the size and colour of the residual, so its null distribution is known.

mod gated;

use crate::diagnose::catalogue::hypothesis::Role;
use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::linear::elimination::{eliminate, gain};
use crate::diagnose::limits::stability::{DISAGREES, MOST_PARTS, NOTHING, SAME_SIZE};
use crate::diagnose::report::BetweenRuns;
use crate::diagnose::steps::verdict::between::{Sizes, named};
use crate::model::Model;
use crate::refine::{Jacobian, Point};
use gated::Gated;
use nalgebra::{DMatrix, DVector};

/// Whether the sizes of a cause agree between parts of the logs.
pub(crate) struct Stability {
    /// Parts that determine a size.
    pub(crate) parts: usize,
    pub(crate) agree: usize,
    /// Chance of so much disagreement.
    pub(crate) p_value: f64,
    /// Parts that disagree, in words.
    pub(crate) disagree: Vec<String>,
    /// Its sizes by run.
    pub(crate) sizes: Vec<Sizes>,
}

impl Stability {
    /// Its sizes by run and pooled, where several runs show them.
    pub(crate) fn between(&self, confidence: f64) -> Vec<BetweenRuns> {
        self.sizes.iter().filter_map(|sizes| sizes.stated(confidence)).collect()
    }
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

/// Stability of the effect at `place` of the winner; `None` where no part determines a size of its own.
///
/// `nominal` gives the sizes of wrong parameters: what their values changed by.
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
    let mut found =
        Stability { parts: 0, agree: 0, p_value: 1.0, disagree: Vec::new(), sizes: products.sizes(best, place, &own) };
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
        let name = |run: usize| named(&members(best, run));
        let columns = |run: usize| (column + run * own.len()..column + (run + 1) * own.len()).collect();
        all.push(Question { parts: (0..runs).map(|run| Part { name: name(run), columns: columns(run) }).collect() });
    }
    all
}

/// Names of the runs of a part.
fn members(best: &Contestant, part: usize) -> Vec<String> {
    let logs = &best.experiment.logs;
    let own = (0..logs.len()).filter(|&l| part_of(l, logs.len()) == part);
    own.map(|l| logs[l].name.clone()).collect()
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
            // The places of this window's columns: once for all runs, once more for its own.
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

    /// Sizes of the effect at `place` by run, by a straight line from the joint fit, with everything that is common to the runs free.
    fn sizes(&self, best: &Contestant, place: usize, own: &[usize]) -> Vec<Sizes> {
        if self.runs < 2 {
            return Vec::new();
        }
        let first = self.gram.nrows() - self.runs * own.len();
        let columns = |k: usize| (0..self.runs).map(move |run| first + run * own.len() + k);
        let one = |(k, &free): (usize, &usize)| {
            let index = best.free[free].parameter;
            let (_, added) = best.added[place]
                .iter()
                .find(|(i, added)| *i == index && matches!(added.role, Role::Plain | Role::Scale))?;
            if !is_inside(best, free) {
                return None;
            }
            let (mut gram, mut slope) = (self.gram.clone(), self.slope.clone());
            let common = (0..self.free).filter(|i| !own.contains(i) && is_inside(best, *i));
            let others = (0..own.len()).filter(|&other| other != k && is_inside(best, own[other])).flat_map(columns);
            for i in common.chain(others) {
                eliminate(&mut gram, &mut slope, i, NOTHING * self.before[i]);
            }
            let telling: Vec<usize> = (0..self.runs)
                .filter(|&run| {
                    let i = first + run * own.len() + k;
                    gram[(i, i)] > NOTHING * self.before[i]
                })
                .collect();
            let at = |i: usize| first + telling[i] * own.len() + k;
            let information = DMatrix::from_fn(telling.len(), telling.len(), |i, j| gram[(at(i), at(j))]);
            let moved = information.clone().cholesky()?.solve(&DVector::from_fn(telling.len(), |i, _| slope[at(i)]));
            Some(Sizes {
                parameter: added.symbol.clone(),
                unit: added.unit.clone(),
                runs: telling.iter().map(|&run| members(best, run)).collect(),
                values: moved.add_scalar(best.refined.parameters[index]),
                information,
            })
        };
        own.iter().enumerate().filter_map(one).collect()
    }

    /// Chance that sizes of their own in `extra` gain as much by noise and the rest; `None` where the logs say nothing of them.
    ///
    /// `own`: the effect's parameters among the free ones, and how far the first of them, its size, is from doing nothing.
    fn disagreement(&self, best: &Contestant, (own, size): (&[usize], f64), extra: &[usize]) -> Option<f64> {
        let is_inside = |i: &usize| is_inside(best, *i);
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

/// Whether free parameter number `place` can move: what stands at its bound can't give way, and would look as if it wanted to.
fn is_inside(best: &Contestant, place: usize) -> bool {
    let free = &best.free[place];
    let value = best.refined.parameters[free.parameter];
    value > free.lower && value < free.upper
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
    use crate::model::System;
    use crate::refine::Experiment;

    /// Stability of a linear loss in a drive that loses `loses(x)` beyond its model.
    fn linear(loses: impl Fn(f64) -> f64) -> Stability {
        let (model, data) = drive(None, loses, 0.01, (4, 400));
        fitted_loss(&model, &data)
    }

    /// Stability of a linear loss beside that of the model.
    fn fitted_loss(model: &Model, data: &crate::data::Dataset) -> Stability {
        let system = System::new(model).unwrap();
        let experiment = Experiment::new(&system, data, Some(&[0.01])).unwrap();
        let fitter = Fitter::default();
        let nominal = fitter.nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        let scene = scene_of(&nominal);
        let hypotheses = enumerate(model, &scene, &[0], &[]).unwrap();
        let friction = hypotheses.iter().find(|h| h.id() == "viscous_friction").unwrap();
        let applied = friction.apply(model, &scene).unwrap();
        let best = fitter.with(&nominal, &[unsearched(friction)], &applied, &[vec![0.5]], Budget::Thorough).unwrap();
        of(model, &best, 0).unwrap()
    }

    #[test]
    fn the_size_of_a_true_cause_agrees_in_all_parts() {
        let found = linear(|x| 1.8 * x);
        // Four runs, two halves of the range, two of the time.
        assert_eq!((found.parts, found.agree), (8, 8), "{:?}", found.disagree);
        assert!(found.p_value > 0.05, "{}", found.p_value);
    }

    /// Sizes by run of a linear loss in four runs whose losses differ by `change` from each other.
    fn by_run(change: f64) -> BetweenRuns {
        let all: Vec<_> =
            (0..4).map(|run| drive(None, |x| (1.5 + f64::from(run) * change) * x, 0.01, (4, 400))).collect();
        let run =
            |(i, (_, data)): (usize, &(Model, crate::data::Dataset))| data.with_runs(&[i]).unwrap().runs()[0].clone();
        let runs = all.iter().enumerate().map(run).collect();
        let data = crate::data::Dataset::new(all[0].1.channels().to_vec(), runs).unwrap();
        let found = fitted_loss(&all[0].0, &data);
        found.between(0.95).remove(0)
    }

    #[test]
    fn a_size_that_differs_between_runs_has_a_spread_and_one_that_does_not_has_none() {
        let apart = by_run(0.2);
        let values: Vec<f64> = apart.runs.iter().map(|run| run.value).collect();
        for (value, truth) in values.iter().zip([0.5, 0.7, 0.9, 1.1]) {
            assert!((value - truth).abs() < 0.08, "{values:?}");
        }
        assert!(
            apart.share > 0.9 && (apart.spread - 0.258).abs() < 0.06 && (apart.pooled - 0.8).abs() < 0.05,
            "{apart:?}"
        );
        let alike = by_run(0.0);
        assert!(alike.p_value > 0.01 && alike.low < 0.5 && 0.5 < alike.high && alike.spread < 0.03, "{alike:?}");
    }

    #[test]
    fn an_imitation_has_another_size_in_the_outer_part() {
        let found = linear(|x| x + 1.5 * x * x * x);
        assert!(found.p_value < 1e-3, "{}", found.p_value);
        assert!(found.disagree.contains(&"the outer part of x".to_string()), "{:?}", found.disagree);
    }
}
