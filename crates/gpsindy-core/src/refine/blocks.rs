//! Residuals and derivatives of every window, as a fit and its normal equations take them.

use super::{Experiment, Free, Starts};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Share of the typical size by which a value is moved for a finite difference: the root of the
/// rounding error, a compromise between truncation and cancellation.
const DIFFERENCE: f64 = 1e-6;

/// Where a search is: all parameters, and every window's initial state.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) parameters: Vec<f64>,
    pub(crate) initial: Vec<Vec<f64>>,
}

/// One window's residuals and derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// (measured - model)/noise, sample by sample; zero where a value is missing.
    pub(crate) residual: DVector<f64>,
    /// Derivatives of model/noise: initial states first, then the free parameters.
    pub(crate) derivative: DMatrix<f64>,
    /// Whether a value is there.
    pub(crate) present: Vec<bool>,
}

/// Residuals and derivatives of every window.
#[derive(Debug, Clone)]
pub(crate) struct Jacobian {
    pub(crate) blocks: Vec<Block>,
    pub(crate) n_states: usize,
}

/// Sum of a window's squared residuals, the first samples counting as they do; infinite where it is no number.
pub(super) fn squares(experiment: &Experiment, residual: &DVector<f64>) -> f64 {
    let columns = experiment.columns.len();
    let sum = residual.iter().enumerate().map(|(row, e)| experiment.starts.weight(row / columns) * (e * e)).sum();
    if f64::is_finite(sum) { sum } else { f64::INFINITY }
}

/// Sum of the beliefs' squared, scaled distances.
pub(crate) fn prior_cost(parameters: &[f64], free: &[Free]) -> f64 {
    free.iter().filter_map(|f| f.prior.map(|(mean, sd)| ((parameters[f.parameter] - mean) / sd).powi(2))).sum()
}

impl Block {
    /// What so many first values say of some states at the window's start, the others as they are: the Cholesky factor of their information, in
    /// squares of the noise; `far`: how far a state may be from its start where they say nothing of it, in its unit.
    pub(crate) fn known_start(&self, values: usize, states: &[usize], far: &[f64]) -> Option<Cholesky<f64, Dyn>> {
        let seen = self.derivative.rows(0, values.min(self.derivative.nrows())).select_columns(states);
        let mut information = seen.tr_mul(&seen);
        let ridge = 1e-9 * information.diagonal().max() + f64::MIN_POSITIVE;
        states.iter().enumerate().for_each(|(i, &j)| information[(i, i)] += ridge.max(far[j].powi(-2)));
        information.cholesky()
    }
}

impl Jacobian {
    /// Sum of squares with the beliefs' terms.
    pub(crate) fn cost(&self, experiment: &Experiment, point: &Point, free: &[Free]) -> f64 {
        let Starts { samples, more } = experiment.starts;
        let first = |b: &Block| b.residual.iter().take(samples * experiment.columns.len()).map(|e| e * e).sum::<f64>();
        let squares = self.blocks.iter().map(|b| b.residual.norm_squared() + more * first(b)).sum::<f64>();
        squares + prior_cost(&point.parameters, free)
    }

    /// Residuals with NaN for what is missing.
    pub(crate) fn residuals(&self) -> Vec<Vec<f64>> {
        self.blocks
            .iter()
            .map(|b| b.residual.iter().zip(&b.present).map(|(&e, &there)| if there { e } else { f64::NAN }).collect())
            .collect()
    }
}

/// Step of the finite difference of column `column`.
pub(super) fn difference(experiment: &Experiment, n_states: usize, free: &[Free], column: usize) -> f64 {
    DIFFERENCE * if column < n_states { experiment.scale[column] } else { free[column - n_states].scale }
}
