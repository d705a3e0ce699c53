//! The fit of a model of equations: Levenberg-Marquardt whose derivatives are made where a step needs them, and not where it ends.
//!
//! In a curved valley a step that goes far leaves its floor, and one that stays on it goes next to nowhere. So once a step was slow the next
//! ones are also tried bent, by the second derivative along them (geodesic acceleration): Transtrum and Sethna 2012, Improvements to the
//! Levenberg-Marquardt algorithm for nonlinear least-squares minimization, arXiv 1201.5885.

use super::blocks::squares;
use super::jacobian::{Block, Jacobian, Point, misses, prior_cost};
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

/// Share of a step at which the residuals show how it bends; the source's.
const BENT: f64 = 0.1;

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
    let (mut iterations, mut slow, mut bends) = (0, 0, false);
    let is_hopeless = |search: &Search<'_>, slow: usize| slow >= SLOW_STEPS && search.cost > settings.hopeless;
    while iterations < settings.max_iterations
        && !(search.is_at_rest || is_hopeless(&search, slow) || experiment.tally.is_over())
    {
        watch(iterations)?;
        iterations += 1;
        search.refresh()?;
        let before = search.cost;
        search.advance(settings.tolerance, bends);
        slow = if before - search.cost < SLOW * before { slow + 1 } else { 0 };
        bends |= slow > 0;
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

    /// One step, where one helps; `bends` where it would be too short, as one before was.
    fn advance(&mut self, tolerance: f64, bends: bool) {
        let normal = Normal::new(&self.jacobian, self.experiment, &self.point, self.free);
        for _ in 0..ROUNDS {
            let mut trials = self.steps(&normal);
            let gained = self.cost - trials.iter().map(|trial| trial.cost).fold(f64::INFINITY, f64::min);
            if gained > 0.0 {
                if bends && gained > tolerance * self.cost {
                    trials.extend(self.bent(&normal, &trials));
                }
                let Some(best) = trials.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) else { return };
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

    /// Four steps of different length.
    fn steps(&self, normal: &Normal) -> Vec<Trial> {
        let step = |factor: &f64| Some((*factor, normal.step(&self.point, self.free, self.damping * factor)?));
        self.tried(DAMPINGS.iter().filter_map(step).collect())
    }

    /// The steps of some `trials`, each with what its second derivative adds.
    fn bent(&self, normal: &Normal, trials: &[Trial]) -> Vec<Trial> {
        let begun = self.tried(trials.iter().map(|t| (t.factor, between(&self.point, &t.point, BENT))).collect());
        let step = |(trial, begun): (&Trial, Trial)| {
            let of_window = |(w, (block, residual)): (usize, (&Block, &DVector<f64>))| {
                let initial = trial.point.initial[w].iter().zip(&self.point.initial[w]).map(|(to, from)| to - from);
                let parameter = |f: &Free| trial.point.parameters[f.parameter] - self.point.parameters[f.parameter];
                let moved: Vec<f64> = initial.chain(self.free.iter().map(parameter)).collect();
                let line = &block.residual - BENT * (&block.derivative * DVector::from_vec(moved));
                (residual - line) / (BENT * BENT)
            };
            let blocks = self.jacobian.blocks.iter().zip(&begun.residuals).enumerate();
            let left: Vec<DVector<f64>> = blocks.map(of_window).collect();
            let normal = normal.of(&self.jacobian, self.experiment, &left);
            Some((trial.factor, normal.step(&trial.point, self.free, self.damping * trial.factor)?))
        };
        self.tried(trials.iter().zip(begun).filter_map(step).collect())
    }

    /// Where some steps lead, each with the factor on its damping.
    fn tried(&self, steps: Vec<(f64, Point)>) -> Vec<Trial> {
        let (factors, points): (Vec<f64>, Vec<Point>) = steps.into_iter().unzip();
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
        factors.into_iter().zip(points).zip(residuals).map(trial).collect()
    }
}

/// The point a `share` of the way from one to another.
fn between(from: &Point, to: &Point, share: f64) -> Point {
    let values = |from: &[f64], to: &[f64]| from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect();
    Point {
        parameters: values(&from.parameters, &to.parameters),
        initial: from.initial.iter().zip(&to.initial).map(|(a, b)| values(a, b)).collect(),
    }
}
