//! The fit of a model of equations: Levenberg-Marquardt whose derivatives are made where a step needs them, and not where it ends.

use super::blocks::squares;
use super::jacobian::{Jacobian, Point, misses, prior_cost};
use super::normal::Normal;
use super::{Experiment, Found, Free, Kept, Refine};
use crate::error::Result;
use crate::model::System;
use nalgebra::DVector;

/// Factors on the damping that a step tries side by side: nearly Newton's own step, about as far as before, and two that are
/// shorter, so that a round that fails raises the damping by little more than the longest of them.
const DAMPINGS: [f64; 4] = [0.01, 0.3, 10.0, 300.0];

/// Damping at first, by how much it grows where none of the four steps helps, and its limits.
const DAMPING: f64 = 1e-3;
const MORE: f64 = 1e4;
const LEAST: f64 = 1e-12;
const MOST: f64 = 1e6;

/// Rounds of steps, each shorter than all before, after which none helps.
const ROUNDS: usize = 3;

/// Share of the cost below which a step is slow, and so many of them in a row.
const SLOW: f64 = 0.1;
const SLOW_STEPS: usize = 2;

/// What a fit must end with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// A value to rank by: derivatives of the point before the last step will do.
    Rank,
    /// Derivatives of the point where it ends.
    Derivatives,
}

/// Fits the free parameters and all starts from `point`; a single step takes the derivatives that an earlier fit has `kept`.
pub(super) fn fit(
    settings: &Refine,
    (system, experiment, free): (&System, &Experiment, &[Free]),
    (point, kept): (Point, Option<&Kept>),
    wanted: Wanted,
    watch: &dyn Fn(usize) -> Result<()>,
) -> Result<Found> {
    let kept = kept.filter(|kept| settings.max_iterations == 1 && kept.serves(experiment));
    let jacobian = Jacobian::beside(system, experiment, &point, free, kept)?;
    let cost = jacobian.cost(experiment, &point, free);
    let mut search =
        Search { system, experiment, free, point, jacobian, cost, damping: DAMPING, is_fresh: true, is_at_rest: false };
    let (mut iterations, mut slow) = (0, 0);
    let is_hopeless = |search: &Search<'_>, slow: usize| slow >= SLOW_STEPS && search.cost > settings.hopeless;
    while iterations < settings.max_iterations
        && !(search.is_at_rest || is_hopeless(&search, slow) || experiment.tally.is_over())
    {
        watch(iterations)?;
        iterations += 1;
        search.refresh()?;
        let before = search.cost;
        search.advance(settings.tolerance);
        slow = if before - search.cost < SLOW * before { slow + 1 } else { 0 };
    }
    // A last step that gains next to nothing leaves the derivatives what they are.
    if wanted == Wanted::Derivatives && !search.is_at_rest {
        search.refresh()?;
    }
    let Search { point, jacobian, cost, is_at_rest, .. } = search;
    // Of what a step by another point's derivatives did not help nothing is known.
    Ok(Found { point, jacobian, cost, converged: is_at_rest && kept.is_none(), iterations })
}

/// Where a fit is.
struct Search<'a> {
    system: &'a System,
    experiment: &'a Experiment,
    free: &'a [Free],
    point: Point,
    /// Residuals at the point; derivatives there where they are fresh, else those of the point before.
    jacobian: Jacobian,
    cost: f64,
    damping: f64,
    is_fresh: bool,
    is_at_rest: bool,
}

/// A step that was tried: where it leads, and the residuals there.
struct Trial {
    factor: f64,
    point: Point,
    residuals: Vec<DVector<f64>>,
    cost: f64,
}

impl Search<'_> {
    /// Makes the derivatives of the point where they are not there.
    fn refresh(&mut self) -> Result<()> {
        if !self.is_fresh {
            self.jacobian = Jacobian::new(self.system, self.experiment, &self.point, self.free)?;
            self.is_fresh = true;
        }
        Ok(())
    }

    /// One step, where one helps.
    fn advance(&mut self, tolerance: f64) {
        let normal = Normal::new(&self.jacobian, self.experiment, &self.point, self.free);
        for _ in 0..ROUNDS {
            let Some(best) = self.best_step(&normal) else { break };
            if best.cost < self.cost {
                self.is_at_rest = self.cost - best.cost <= tolerance * self.cost;
                self.damping = (self.damping * best.factor).clamp(LEAST, MOST);
                for (block, residual) in self.jacobian.blocks.iter_mut().zip(best.residuals) {
                    block.residual = residual;
                }
                (self.point, self.cost, self.is_fresh) = (best.point, best.cost, false);
                return;
            }
            self.damping *= MORE;
        }
        // Where no step of any length helps: the floor of the arithmetic, or of the finite differences.
        self.is_at_rest = true;
    }

    /// The best of four steps of different length.
    fn best_step(&self, normal: &Normal) -> Option<Trial> {
        let step = |factor: &f64| Some((*factor, normal.step(&self.point, self.free, self.damping * factor)?));
        let (factors, points): (Vec<f64>, Vec<Point>) = DAMPINGS.iter().filter_map(step).unzip();
        let empty = || self.jacobian.blocks.iter().map(|block| DVector::zeros(block.residual.len())).collect();
        let mut residuals: Vec<Vec<DVector<f64>>> = points.iter().map(|_| empty()).collect();
        misses(self.system, self.experiment, &points, None, |point, window, row, missed| {
            residuals[point][window][row] = missed;
        });
        let trial = |((factor, point), residuals): ((f64, Point), Vec<DVector<f64>>)| {
            let sum: f64 = residuals.iter().map(|residual| squares(self.experiment, residual)).sum();
            let cost = sum + prior_cost(&point.parameters, self.free);
            Trial { factor, point, residuals, cost }
        };
        let trials = factors.into_iter().zip(points).zip(residuals).map(trial);
        trials.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }
}
