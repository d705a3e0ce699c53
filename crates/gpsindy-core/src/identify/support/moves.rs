//! The moves of the search: terms are dropped, added and exchanged by evidence.
//!
//! At a fit the trajectories are linear in all candidate coefficients to first order, so the search for a better support is
//! again a sparse regression, with the sensitivities of the trajectories as its columns; what it proposes is then fitted in full.

use crate::error::Result;
use crate::identify::limits::{BARELY_IN, LEAST_LEAD, NO_WEIGHT, ROUNDS};
use crate::identify::support::fit::{Fitter, Trial};
use crate::identify::support::linear::Linear;

impl Fitter<'_> {
    /// Drops, adds and exchanges terms while that lowers the evidence.
    pub(crate) fn improve(&self, start: Trial, window: f64, keep_going: &dyn Fn() -> Result<()>) -> Result<Trial> {
        let mut best = start;
        for _ in 0..ROUNDS {
            keep_going()?;
            let linear = self.linearise(&best, window)?;
            let mut found = None;
            for support in linear.proposals() {
                let Some(trial) = self.attempt(&best, &linear, &support, window) else { continue };
                if self.lead(&trial, &best) > LEAST_LEAD {
                    found = Some(trial);
                    break;
                }
            }
            match found {
                Some(trial) => best = trial,
                None => break,
            }
        }
        Ok(best)
    }

    /// The full fit of `support`, from where the linear problem has its optimum; where no term leaves also from where
    /// `best` remains, since the linear optimum may lie too far away to be one.
    pub(crate) fn attempt(&self, best: &Trial, linear: &Linear, support: &[usize], window: f64) -> Option<Trial> {
        let (solution, initial) = linear.solution(support, &best.initial);
        let mut equations = best.equations.clone();
        equations.set_support(support, &solution);
        let near = Trial { initial, ..best.clone() };
        let far = self.fit_unless_beaten(&equations, window, Some(&near), Some(best)).ok();
        if linear.active.iter().any(|k| !support.contains(k)) {
            return far;
        }
        let mut coefficients = best.equations.coefficients.clone();
        for &k in support {
            let (s, j) = linear.candidates[k];
            if !best.equations.support.contains(s, j) {
                coefficients[s][j] = BARELY_IN * self.scales[s][j].copysign(solution[s][j]);
            }
        }
        let mut equations = best.equations.clone();
        equations.set_support(support, &coefficients);
        let close = self.fit_unless_beaten(&equations, window, Some(best), Some(best)).ok();
        match (far, close) {
            (Some(far), Some(close)) => Some(if self.lead(&far, &close) >= 0.0 { far } else { close }),
            (far, close) => far.or(close),
        }
    }

    /// Lets the standard errors allow for the choice of the terms: over the equations one move away that hold the term,
    /// weighted by their evidence, `sqrt(sum_m w_m (error_m^2 + (value_m - value)^2))`. And the probability of every term by
    /// the same weights: `1 / (1 + sum of w over the moves that take it out)`, `1 - 1 / (1 + sum of w over those that bring it)`.
    ///
    /// Source: Buckland, Burnham and Augustin 1997, Model selection: an integral part of inference.
    pub(crate) fn weigh_choice(&self, trial: &mut Trial, linear: &Linear) {
        let mut moved = vec![0.0; linear.candidates.len()];
        let stated = |support: &[usize]| {
            let terms = linear.with_always(support);
            let errors = linear.problem.standard_errors(&terms, 1.0);
            (linear.problem.refit(&terms).coefficients, terms.into_iter().zip(errors).collect::<Vec<_>>())
        };
        let (best, _) = stated(&linear.active);
        let mut sums: Vec<(f64, f64)> = linear
            .candidates
            .iter()
            .map(|&(s, j)| if trial.errors[s][j] > 0.0 { (1.0, trial.errors[s][j].powi(2)) } else { (0.0, 0.0) })
            .collect();
        let rivals = linear.moves(&linear.active).into_iter().map(|(change, support)| (trial.share * change, support));
        for (change, support) in rivals.take_while(|(change, _)| *change < NO_WEIGHT) {
            let weight = (-0.5 * change).exp().min(1.0);
            for (k, sum) in moved.iter_mut().enumerate() {
                *sum += if linear.active.contains(&k) == support.contains(&k) { 0.0 } else { weight };
            }
            let (values, errors) = stated(&support);
            let known = |k: usize, error: f64| error.is_finite() && sums.get(k).is_some_and(|sum| sum.0 > 0.0);
            let known: Vec<(usize, f64)> = errors.into_iter().filter(|&(k, error)| known(k, error)).collect();
            for (k, error) in known {
                sums[k].0 += weight;
                sums[k].1 += weight * (error.powi(2) + (values[k] - best[k]).powi(2));
            }
        }
        for (&(s, j), (weight, square)) in linear.candidates.iter().zip(sums).filter(|(_, sum)| sum.0 > 0.0) {
            trial.errors[s][j] = (square / weight).sqrt();
        }
        trial.inclusion = vec![vec![0.0; trial.equations.n_terms()]; trial.equations.n_states()];
        for (k, (&(s, j), sum)) in linear.candidates.iter().zip(moved).enumerate() {
            let stays = 1.0 / (1.0 + sum);
            trial.inclusion[s][j] = if linear.active.contains(&k) { stays } else { 1.0 - stays };
        }
    }
}
