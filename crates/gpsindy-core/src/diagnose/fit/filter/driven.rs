//! What white noise does to the states of a linear system over one step.

use super::Process;
use crate::diagnose::limits::forcing::CONVERGED;
use nalgebra::{DMatrix, DVector};

/// Logarithm of a matrix near one, by its series; of one that is not, the first term.
pub(super) fn logarithm(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    /// Terms: the last one is below a thousandth for states that change by half between two samples. Exact.
    const TERMS: i32 = 8;
    let beyond = matrix - DMatrix::identity(matrix.nrows(), matrix.ncols());
    let mut power = beyond.clone();
    let mut sum = beyond.clone();
    for k in 2..=TERMS {
        power = -(&power * &beyond);
        sum += &power / f64::from(k);
    }
    if power.amax() < CONVERGED * beyond.amax() { sum } else { beyond }
}

/// Terms of the exponential of a step: a process may decay by e^2 within it. Exact.
pub(super) const TERMS: usize = 10;

/// Points on -1 to 1 of Gauss and Legendre's third rule, and their weights on 0 to 1. Exact.
pub(super) const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];

/// Adds what the white noise of a random process does to the states over a step: the integral of `e^(A s) e_d e_d' e^(A' s)` over
/// the step, by three points of Gauss and Legendre.
pub(super) fn driven(
    covariance: &mut DMatrix<f64>,
    rates: &DMatrix<f64>,
    (place, process): (usize, Process),
    step: f64,
) {
    let density = 2.0 * process.deviation * process.deviation / process.time;
    for (point, weight) in GAUSS {
        let time = 0.5 * step * (1.0 + point);
        let mut term = DVector::zeros(rates.nrows());
        term[place] = 1.0;
        let mut moved = term.clone();
        for k in 1..=TERMS {
            term = rates * term * (time / k as f64);
            moved += &term;
        }
        covariance.ger(density * weight * step, &moved, &moved, 1.0);
    }
}
