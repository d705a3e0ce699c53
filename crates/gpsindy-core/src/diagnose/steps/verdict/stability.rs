//! Stability: does a cause keep its size in every run, in the inner and the outer part of its range, early and late?
//!
//! The size of a true cause is invariant; that of an imitation is not (Peters, Buehlmann, Meinshausen 2016, JRSS B 78(5)).
//! At the joint fit, each part of the logs gets a size of its own in a linearised model, with everything else free. The
//! test of agreement uses the size and colour of the residual, so its null distribution is known.

mod gated;

use crate::diagnose::catalogue::hypothesis::Role;
use crate::diagnose::fit::by_run::{Products, Values, differing, is_inside, parts_of_logs};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::linear::elimination::{eliminate, gain};
use crate::diagnose::limits::stability::{DISAGREES, NOTHING, SAME_SIZE};
use crate::diagnose::report::BetweenRuns;
use crate::diagnose::steps::verdict::between::{Sizes, named};
use crate::model::Model;
use gated::Gated;

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
    /// Where runs have a size of their own: the chance of so much disagreement within them.
    pub(crate) within: Option<f64>,
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
    let logs = parts_of_logs(&best.experiment.logs);
    let products = Products::new(best, (&gated.system, &gated.free), &own, &logs)?;
    let first = best.free[own[0]].parameter;
    let size = best.refined.parameters[first] - nominal.parameters.get(first).map_or(0.0, |p| p.value);
    let questions = questions(best, &gated, &own, products.runs);
    let mut found = Stability {
        parts: 0,
        agree: 0,
        p_value: 1.0,
        disagree: Vec::new(),
        sizes: sizes(&products, best, place, &own),
        within: None,
    };
    let differing = differing(&best.experiment);
    let has_own = own.iter().enumerate().filter(|(_, free)| differing.contains(&best.free[**free].parameter));
    let by_run: Vec<usize> = has_own.flat_map(|(k, _)| products.columns(own.len(), k)).collect();
    let (mut asked, mut within) = (0, 1.0_f64);
    for question in questions {
        let all: Vec<usize> = question.parts.iter().flat_map(|p| p.columns.iter().copied()).collect();
        let halves = question.parts.len() == 1;
        let beside = if halves { &by_run[..] } else { &[] };
        let ask = |columns: &[usize]| disagreement(&products, best, (&own, size), (columns, beside));
        let Some(p_value) = ask(&all) else { continue };
        asked += 1;
        found.p_value = found.p_value.min(p_value);
        if halves {
            within = within.min(p_value);
        }
        for part in &question.parts {
            let alone = if halves { Some(p_value) } else { ask(&part.columns) };
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
    found.within = (!by_run.is_empty()).then(|| (within * f64::from(asked)).min(1.0));
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
    let parts = parts_of_logs(logs);
    (0..logs.len()).filter(|&l| parts[l] == part).map(|l| logs[l].name.clone()).collect()
}

/// Sizes of the effect at `place` by run, by a straight line from the joint fit, with everything that is common to the runs free.
fn sizes(products: &Products, best: &Contestant, place: usize, own: &[usize]) -> Vec<Sizes> {
    if products.runs < 2 {
        return Vec::new();
    }
    let all: Vec<usize> = (0..own.len()).collect();
    let one = |(k, &free): (usize, &usize)| {
        let index = best.free[free].parameter;
        let (_, added) = best.added[place]
            .iter()
            .find(|(i, added)| *i == index && matches!(added.role, Role::Plain | Role::Scale))?;
        if !is_inside(best, free) {
            return None;
        }
        // Where one size alone has a value in every run, the others are common to all.
        let is_alone = differing(&best.experiment).contains(&index);
        let beside = if is_alone { &all[k..=k] } else { &all[..] };
        let Values { parts, values, information } = products.values(best, own, k, beside)?;
        Some(Sizes {
            parameter: added.symbol.clone(),
            unit: added.unit.clone(),
            runs: parts.iter().map(|&run| members(best, run)).collect(),
            values,
            information,
        })
    };
    own.iter().enumerate().filter_map(one).collect()
}

/// Chance that sizes of their own in `extra` gain as much by noise and the rest; `None` where the logs say nothing of them.
///
/// `own`: the effect's parameters among the free ones, and how far the first of them, its size, is from doing nothing. `by_run`: columns of
/// sizes that runs have of their own, which halves of the logs then share.
fn disagreement(
    products: &Products,
    best: &Contestant,
    (own, size): (&[usize], f64),
    (extra, by_run): (&[usize], &[usize]),
) -> Option<f64> {
    let is_inside = |i: &usize| is_inside(best, *i);
    let mut gram = products.gram.clone();
    let mut slope = products.slope.clone();
    let least = |i: usize| NOTHING * products.before[i];
    let is_own = |i: &usize| own.contains(i);
    for i in (0..products.free).filter(is_inside).filter(|i| !is_own(i)) {
        eliminate(&mut gram, &mut slope, i, least(i));
    }
    // By how much the effect as a whole moves the outputs beyond what the others can, with a size that differs by a little.
    let moved = gram[(own[0], own[0])].max(0.0) * (SAME_SIZE * size).powi(2);
    for i in own.iter().copied().filter(is_inside).chain(by_run.iter().copied()) {
        eliminate(&mut gram, &mut slope, i, least(i));
    }
    let (gain, degrees) = gain(&mut gram, &mut slope, extra.iter().copied(), least);
    if degrees == 0 {
        return None;
    }
    let count = best.evidence.count();
    let allowed = moved.max(best.evidence.negligible() * count as f64);
    // The expected shift and the chance one add as lengths do.
    let beyond = (gain.sqrt() - allowed.sqrt()).max(0.0).powi(2);
    Some(gain_tail(with_fitted_level(beyond, count), degrees, count, best.evidence.spent()))
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
