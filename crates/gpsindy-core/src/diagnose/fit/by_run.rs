//! Sizes by run: what the logs say of an effect's size in each run alone, by straight lines from a fit, and runs that have their own.
//!
//! Friction, a gain or a payload may differ from one recording to the next though its form is the same. Such a size is a random effect of
//! the run: a mean over the runs, and a variance about it.

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::linear::elimination::{eliminate, gain};
use crate::diagnose::limits::stability::{MOST_PARTS, NOTHING};
use crate::excerpt::recording;
use crate::model::System;
use crate::refine::{Experiment, Free, Jacobian, Log, Point};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;

/// Part of the logs that each log belongs to: itself, or neighbours together where there are too many for a part each.
pub(crate) fn parts_of_logs(logs: &[Log]) -> Vec<usize> {
    (0..logs.len()).map(|log| part_of(log, logs.len())).collect()
}

/// The same by recordings: windows of one are one.
pub(crate) fn parts_of_recordings(logs: &[Log]) -> Vec<usize> {
    let mut names: Vec<&str> = Vec::new();
    for log in logs {
        let name = recording(&log.name);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let place = |log: &Log| names.iter().position(|name| *name == recording(&log.name)).unwrap_or(0);
    logs.iter().map(|log| part_of(place(log), names.len())).collect()
}

fn part_of(number: usize, count: usize) -> usize {
    if count <= MOST_PARTS { number } else { number * MOST_PARTS / count }
}

/// How many sizes more than one for all runs there are.
pub(crate) fn sizes_of_their_own(experiment: &Experiment) -> usize {
    let parts = parts_of_recordings(&experiment.logs).into_iter().collect::<BTreeSet<usize>>().len();
    differing(experiment).len() * parts.saturating_sub(1)
}

/// Parameters that have a value of their own in every run.
pub(crate) fn differing(experiment: &Experiment) -> Vec<usize> {
    let all = experiment.logs.iter().flat_map(|log| log.own.iter().map(|(parameter, _)| *parameter));
    all.collect::<BTreeSet<usize>>().into_iter().collect()
}

/// What is common to values with errors of their own that scatter: their mean, its weight, and the variance about it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pooled {
    pub(crate) mean: f64,
    /// Sum of the weights of the values: one by the squared deviation of the mean.
    pub(crate) weight: f64,
    /// Mean squared distance of the values from the mean, by their weights, and at least one.
    pub(crate) factor: f64,
    pub(crate) variance: f64,
    /// Weighted sum of squares about the mean with one value for all.
    pub(crate) excess: f64,
}

impl Pooled {
    /// Of values with their inverse covariance; none where that is none.
    ///
    /// Random effects by moments: DerSimonian and Laird 1986, Controlled Clinical Trials 7(3), for values that share errors.
    pub(crate) fn of(values: &DVector<f64>, information: &DMatrix<f64>) -> Option<Self> {
        let count = values.len();
        let own = information.clone().cholesky()?.inverse();
        let freedom = count.checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
        let row = information.column_sum();
        let total = row.sum();
        let centre = row.dot(values) / total;
        let excess = values.dot(&(information * values)) - total * centre * centre;
        let scale = information.trace() - row.norm_squared() / total;
        let variance = if scale > 0.0 { ((excess - freedom) / scale).max(0.0) } else { 0.0 };
        let weights = (own + DMatrix::identity(count, count) * variance).cholesky()?.inverse();
        let row = weights.column_sum();
        let mean = row.dot(values) / row.sum();
        let apart = values.add_scalar(-mean);
        let factor = (apart.dot(&(&weights * &apart)) / freedom).max(1.0);
        Some(Self { mean, weight: row.sum(), factor, variance, excess })
    }
}

/// A size in each part of the logs that determines it.
pub(crate) struct Values {
    /// Numbers of the parts.
    pub(crate) parts: Vec<usize>,
    pub(crate) values: DVector<f64>,
    /// Inverse covariance of these values.
    pub(crate) information: DMatrix<f64>,
}

/// Products of all columns among themselves and with the residual, whitened, the initial states eliminated: the free parameters, then for
/// every part of the logs the own ones of an effect in that part alone.
///
/// The residual is that of one size for all runs: where runs have their own it is reckoned back along a straight line.
pub(crate) struct Products {
    pub(crate) gram: DMatrix<f64>,
    pub(crate) slope: DVector<f64>,
    /// Squared length of every column before anything was eliminated.
    pub(crate) before: Vec<f64>,
    /// How many parameters the fit has free.
    pub(crate) free: usize,
    pub(crate) runs: usize,
}

impl Products {
    /// At a fit, whose `system` and `free` parameters may have more at their ends; `own`: those of an effect among the free ones.
    pub(crate) fn new(
        best: &Contestant,
        (system, free): (&System, &[Free]),
        own: &[usize],
        part: &[usize],
    ) -> Option<Self> {
        let mut parameters = best.refined.parameters.clone();
        parameters.resize(system.n_parameters(), 0.0);
        let point = Point { parameters, initial: best.refined.initial.clone() };
        let jacobian = Jacobian::new(system, &best.experiment, &point, free).ok()?;
        let runs = part.iter().max().map_or(0, |last| last + 1);
        let (n, q) = (jacobian.n_states, free.len());
        let width = q + runs * own.len();
        let mut all = Self {
            gram: DMatrix::zeros(width, width),
            slope: DVector::zeros(width),
            before: vec![0.0; width],
            free: best.free.len(),
            runs,
        };
        for (block, window) in jacobian.blocks.iter().zip(&best.experiment.windows) {
            let mut residual = block.residual.clone();
            for &(parameter, more) in &best.experiment.logs[window.log].own {
                let column = own.iter().find(|&&i| free[i].parameter == parameter);
                column.into_iter().for_each(|i| residual.axpy(more, &block.derivative.column(n + i), 1.0));
            }
            let whitener = Whitener::new(&best.evidence.colours, &block.present, &best.experiment.repeats(window));
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
            let run = part[window.log];
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

    /// Columns of number `k` of so many `own` parameters, part by part.
    pub(crate) fn columns(&self, own: usize, k: usize) -> impl Iterator<Item = usize> + use<> {
        let first = self.gram.nrows() - self.runs * own;
        (0..self.runs).map(move |run| first + run * own + k)
    }

    /// Number `k` of the `own` parameters by part, with everything that is common to the runs free, and of the other own ones those in
    /// `beside` by part.
    pub(crate) fn values(&self, best: &Contestant, own: &[usize], k: usize, beside: &[usize]) -> Option<Values> {
        let (mut gram, mut slope) = (self.gram.clone(), self.slope.clone());
        let common = (0..self.free).filter(|&i| i != own[k] && !beside.iter().any(|&b| own[b] == i));
        let others = beside.iter().filter(|&&other| other != k && is_inside(best, own[other]));
        let others = others.flat_map(|&other| self.columns(own.len(), other));
        for i in common.filter(|i| is_inside(best, *i)).chain(others) {
            eliminate(&mut gram, &mut slope, i, NOTHING * self.before[i]);
        }
        let place: Vec<usize> = self.columns(own.len(), k).collect();
        let is_telling = |run: &usize| gram[(place[*run], place[*run])] > NOTHING * self.before[place[*run]];
        let parts: Vec<usize> = (0..self.runs).filter(is_telling).collect();
        let at = |i: usize| place[parts[i]];
        let information = DMatrix::from_fn(parts.len(), parts.len(), |i, j| gram[(at(i), at(j))]);
        let moved = information.clone().cholesky()?.solve(&DVector::from_fn(parts.len(), |i, _| slope[at(i)]));
        let joint = best.refined.parameters[best.free[own[k]].parameter];
        Some(Values { parts, values: moved.add_scalar(joint), information })
    }

    /// Twice the nats that number `k` of the `own` parameters gains by a value of its own in every part, and how many these are beyond one.
    pub(crate) fn gain_by_run(&self, best: &Contestant, own: &[usize], k: usize) -> (f64, usize) {
        let (mut gram, mut slope) = (self.gram.clone(), self.slope.clone());
        for i in (0..self.free).filter(|i| is_inside(best, *i)) {
            eliminate(&mut gram, &mut slope, i, NOTHING * self.before[i]);
        }
        gain(&mut gram, &mut slope, self.columns(own.len(), k), |i| NOTHING * self.before[i])
    }
}

/// Whether free parameter number `place` can move: what stands at its bound can't give way, and would look as if it wanted to.
pub(crate) fn is_inside(best: &Contestant, place: usize) -> bool {
    let free = &best.free[place];
    let value = best.refined.parameters[free.parameter];
    value > free.lower && value < free.upper
}

/// The size of the effect at `place` among the free parameters: the first of those that are plain numbers.
pub(crate) fn size_of(best: &Contestant, place: usize) -> Option<usize> {
    let is_size = |added: &Added| matches!(added.role, Role::Plain | Role::Scale);
    let (index, _) = best.added[place].iter().find(|(_, added)| is_size(added))?;
    best.free.iter().position(|free| free.parameter == *index)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn windows_of_one_recording_are_one_part() {
        let log = |name: &str| Log { name: name.into(), ..Log::default() };
        let logs = ["arm.csv from 2.000 s", "arm.csv from 7.500 s", "wrist.csv", "arm.csv from 9.000 s"].map(log);
        assert_eq!(parts_of_recordings(&logs), [0, 0, 1, 0]);
        assert_eq!(parts_of_logs(&logs), [0, 1, 2, 3]);
        let many: Vec<Log> = (0..2 * MOST_PARTS).map(|i| log(&format!("{i}.csv"))).collect();
        assert_eq!(parts_of_recordings(&many)[..4], [0, 0, 1, 1]);
    }
}
