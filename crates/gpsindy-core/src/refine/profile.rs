//! Costs of models that differ in some parameters, all others being fitted along straight lines.
//!
//! Source: Golub and Pereyra 1973, variable projection (SIAM J. Numer. Anal. 10(2)), with the derivatives of one point for all.

use super::jacobian::{Jacobian, Lines, Point, misses, prior_cost};
use super::normal::{Normal, Solved};
use super::{Experiment, Free, Kept};
use crate::error::Result;
use crate::model::System;
use nalgebra::DVector;

/// What the costs of trials near one point are reckoned by.
pub(crate) struct Profile<'a> {
    system: &'a System,
    experiment: &'a Experiment,
    free: &'a [Free],
    lines: Option<Lines<'a>>,
    jacobian: Jacobian,
    solved: Option<Solved>,
}

impl<'a> Profile<'a> {
    /// Trials of a simulator that steps go along `lines` where there are any; the derivatives are those of an earlier fit as far as it has them.
    ///
    /// # Errors
    /// A model that diverges at `point`.
    pub(crate) fn new(
        system: &'a System,
        experiment: &'a Experiment,
        (point, free): (&Point, &'a [Free]),
        lines: Option<Lines<'a>>,
        kept: Option<&Kept>,
    ) -> Result<Self> {
        let jacobian = Jacobian::beside(system, experiment, point, free, kept)?;
        let solved = Normal::new(&jacobian, experiment, point, free).solved();
        Ok(Self { system, experiment, free, lines, jacobian, solved })
    }

    /// Costs of `trials`, which have the initial states and free parameters of the point, once those have taken a step each;
    /// infinite where the model diverges.
    pub(crate) fn costs(&self, trials: &[Point]) -> Vec<f64> {
        let width = self.jacobian.n_states + self.free.len();
        let columns = self.experiment.columns.len();
        let mut sums = vec![0.0; trials.len()];
        let mut slopes = vec![vec![DVector::zeros(width); self.experiment.windows.len()]; trials.len()];
        misses(self.system, self.experiment, trials, self.lines, |trial, window, row, missed| {
            let weight = self.experiment.starts.weight(row / columns);
            sums[trial] += weight * missed * missed;
            let derivative = self.jacobian.blocks[window].derivative.row(row);
            for (slope, d) in slopes[trial][window].iter_mut().zip(derivative.iter()) {
                *slope += weight * missed * d;
            }
        });
        let cost = |(trial, sum): (usize, &f64)| {
            let believed =
                |f: &Free| f.prior.map_or(0.0, |(mean, sd)| (mean - trials[trial].parameters[f.parameter]) / (sd * sd));
            let belief = DVector::from_iterator(self.free.len(), self.free.iter().map(believed));
            let gain = self.solved.as_ref().map_or(0.0, |solved| solved.gain(&slopes[trial], &belief));
            let cost = sum + prior_cost(&trials[trial].parameters, self.free) - gain;
            if cost.is_finite() { cost } else { f64::INFINITY }
        };
        sums.iter().enumerate().map(cost).collect()
    }
}
