//! Tune: the free parameters of a fit, where the innovations of the filter have them.
//!
//! A rollout charges a random force to whatever parameter may take it up: those within their tolerances go to the ends of these, and a law is
//! left beside the force that is not the machine's. Beside the right processes the innovations are white, so that least squares on them finds
//! the parameters without bias.
//!
//! Source: the prediction error method, Ljung 1999, System Identification, chapter 7.

use super::account::Account;
use crate::diagnose::fit::filter::{Filtered, Pace};
use crate::diagnose::limits::forcing::{SETTLED, SHORTENED, SLOPED, TUNED};
use crate::diagnose::limits::{Budget, FLAT};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::{Result, unless_refused};
use crate::parallel;
use crate::refine::{Free, bounded_solution, prior_cost};
use nalgebra::{DMatrix, DVector};

impl Account {
    /// The same with the rollouts that its parameters lead to; as it is where these can't be followed.
    pub(super) fn rolled(mut self, contest: &Contest<'_>) -> Result<Self> {
        let free = self.fit.free.clone();
        for f in &mut self.fit.free {
            let value = self.fit.refined.parameters[f.parameter];
            (f.lower, f.upper) = (value, value);
        }
        let moved = contest.fitter.on(&self.fit, &self.fit.experiment, Budget::Usual);
        self.fit = unless_refused(moved)?.unwrap_or(self.fit);
        self.fit.free = free;
        Ok(self)
    }

    /// Moves the free parameters to where they cost least beside the processes; by how many nats less, and nothing where the filter diverges.
    pub(super) fn tune(&mut self) -> Option<f64> {
        if self.fit.free.is_empty() {
            return Some(0.0);
        }
        let mut found = self.passed(&self.fit.refined.parameters)?;
        let first = self.cost(&found, &self.fit.refined.parameters);
        // Innovations are nearly linear in the parameters: the slopes of the first step serve all.
        let slopes = self.slopes(&found.whitened())?;
        let mut last = first;
        for _ in 0..TUNED {
            let Some((next, parameters)) = self.stepped((&found, last), &slopes) else { break };
            let cost = self.cost(&next, &parameters);
            let gained = last - cost;
            self.fit.refined.parameters = parameters;
            (found, last) = (next, cost);
            if gained < SETTLED {
                break;
            }
        }
        Some(first - last)
    }

    /// By how much every free parameter moves each of the `innovations`.
    pub(super) fn slopes(&self, innovations: &[f64]) -> Option<Vec<Vec<f64>>> {
        let slope = |f: &Free| {
            let mut aside = self.fit.refined.parameters.clone();
            let step = SLOPED * f.scale;
            aside[f.parameter] += step;
            let moved = self.passed(&aside)?.whitened();
            let is_whole = moved.len() == innovations.len();
            is_whole.then(|| moved.into_iter().zip(innovations).map(|(moved, own)| (moved - own) / step).collect())
        };
        parallel::map(&self.fit.free, slope).into_iter().collect()
    }

    /// A step of Gauss and Newton from where the pass `found` was made, shortened until it lowers the cost below `known`.
    fn stepped(&self, (found, known): (&Filtered, f64), slopes: &[Vec<f64>]) -> Option<(Filtered, Vec<f64>)> {
        let at = &self.fit.refined.parameters;
        let change = change(&self.fit.free, at, (&found.whitened(), slopes), found.level)?;
        SHORTENED.into_iter().find_map(|share| {
            let mut parameters = at.clone();
            for (f, change) in self.fit.free.iter().zip(&change) {
                parameters[f.parameter] += share * change;
            }
            let next = self.passed(&parameters)?;
            (self.cost(&next, &parameters) < known).then_some((next, parameters))
        })
    }

    pub(super) fn passed(&self, parameters: &[f64]) -> Option<Filtered> {
        self.filtered_with(parameters, &self.processes, Pace::Path)
    }

    fn cost(&self, found: &Filtered, parameters: &[f64]) -> f64 {
        0.5 * prior_cost(parameters, &self.fit.free) - found.likelihood
    }
}

/// By how much each free parameter moves, within its bounds, where the `innovations` with these `slopes` have the variance `level`; nothing where the
/// equations can't be solved.
fn change(free: &[Free], at: &[f64], (innovations, slopes): (&[f64], &[Vec<f64>]), level: f64) -> Option<Vec<f64>> {
    let slopes: Vec<&[f64]> = slopes.iter().map(Vec::as_slice).collect();
    let (mut gram, right) = products(free, at, (innovations, &slopes), level);
    for i in 0..free.len() {
        // What moves no innovation stays where it is.
        gram[(i, i)] = if gram[(i, i)] > 0.0 { gram[(i, i)] * (1.0 + FLAT) } else { 1.0 };
    }
    let change = bounded_solution(&gram, &right, at, free)?;
    change.iter().all(|c| c.is_finite()).then(|| change.iter().copied().collect())
}

/// Products of the `slopes` of the free parameters with each other, and with the `innovations` they are to lower, of variance `level`; with what is
/// believed of the parameters.
pub(super) fn products(
    free: &[Free],
    at: &[f64],
    (innovations, slopes): (&[f64], &[&[f64]]),
    level: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / level;
    let count = free.len();
    let mut gram = DMatrix::from_fn(count, count, |i, j| dot(slopes[i], slopes[j]));
    let mut right = DVector::from_fn(count, |i, _| -dot(slopes[i], innovations));
    for (i, f) in free.iter().enumerate() {
        if let Some((mean, deviation)) = f.prior {
            gram[(i, i)] += deviation.powi(-2);
            right[i] -= (at[f.parameter] - mean) / deviation.powi(2);
        }
    }
    (gram, right)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_change_ends_at_a_bound_and_the_others_make_up_for_it() {
        let slopes = [vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 1.0]];
        let innovations = [-2.0, -1.0, -3.0];
        let free = |upper: f64| [Free { upper, ..Free::new(0, 1.0) }, Free::new(1, 1.0)];
        let loose = change(&free(9.0), &[0.0, 0.0], (&innovations, &slopes), 1.0).unwrap();
        assert!((loose[0] - 2.0).abs() < 1e-4 && (loose[1] - 1.0).abs() < 1e-4, "{loose:?}");
        let bound = change(&free(1.0), &[0.0, 0.0], (&innovations, &slopes), 1.0).unwrap();
        assert!((bound[0] - 1.0).abs() < 1e-12 && (bound[1] - 1.5).abs() < 1e-4, "{bound:?}");
    }
}
