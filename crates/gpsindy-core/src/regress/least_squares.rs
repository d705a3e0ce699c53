//! Ordinary least squares on all terms.

use super::{Fit, Reduced, Regressor};
use crate::error::Result;

/// Least squares on every term: the end of each path, and the baseline.
///
/// Minimises `||theta xi - target||` by QR with column pivoting. A term that depends on others gets 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LeastSquares;

impl Regressor for LeastSquares {
    fn name(&self) -> &'static str {
        "least-squares"
    }

    fn level(&self) -> f64 {
        0.0
    }

    fn levels(&self, _problem: &Reduced, _count: usize) -> Vec<f64> {
        vec![0.0]
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        let all: Vec<usize> = (0..problem.n_terms()).collect();
        let fit = problem.refit(&all);
        Ok(levels.iter().map(|&level| Fit { level, ..fit.clone() }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::*;

    #[test]
    fn noiseless_rows_give_the_coefficients_back() {
        let (theta, target) = random_problem(30, 5, &[(0, 1.5), (2, -2.0), (4, 0.1)], 0.0, 3);
        let fit = LeastSquares.fit(theta.as_ref(), &target).unwrap();
        for (found, truth) in fit.coefficients.iter().zip([1.5, 0.0, -2.0, 0.0, 0.1]) {
            // Columns of norm 0.5 to 50, so 1e-12 is a few hundred roundings.
            assert!((found - truth).abs() < 1e-12, "{found} {truth}");
        }
    }

    #[test]
    fn fewer_rows_than_terms_still_fit_the_rows() {
        let (theta, target) = random_problem(4, 9, &[(0, 1.0)], 0.0, 4);
        let fit = LeastSquares.fit(theta.as_ref(), &target).unwrap();
        assert!(fit.residual < 1e-20);
        assert!(fit.n_terms() <= 4);
    }
}
