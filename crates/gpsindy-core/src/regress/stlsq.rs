//! Sequentially thresholded least squares.
//!
//! Source: Brunton, Proctor, Kutz 2016, Discovering governing equations from data, algorithm 1; ridge term and stopping as in PySINDy's STLSQ.

use super::dense::{Cholesky, dot, gram, refit, transposed_times};
use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};
use faer::Mat;

/// Ridge regression, terms below the threshold out, again until the support stays.
#[derive(Debug, Clone, PartialEq)]
pub struct Stlsq {
    /// Smallest coefficient that stays, in the coefficient's unit, at least 0. Default 0.1.
    pub threshold: f64,
    /// Weight of the squared coefficients, at least 0. Default 0.05.
    pub ridge: f64,
    /// Rounds at most. Default 20.
    pub max_iterations: usize,
    /// Whether the support is fitted again without the ridge. Default true.
    pub refit: bool,
}

impl Default for Stlsq {
    fn default() -> Self {
        Self { threshold: 0.1, ridge: 0.05, max_iterations: 20, refit: true }
    }
}

impl Regressor for Stlsq {
    fn name(&self) -> &'static str {
        "stlsq"
    }

    fn level(&self) -> f64 {
        self.threshold
    }

    /// Geometric, from above the largest coefficient of the ridge fit down to a millionth of it.
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64> {
        let all: Vec<usize> = (0..problem.n_terms()).collect();
        let largest = ridge(problem, &all, self.ridge.max(0.0)).iter().fold(0.0f64, |m, c| m.max(c.abs()));
        let step = 1e-6f64.powf(1.0 / (count.max(2) - 1) as f64);
        (0..count).map(|k| 1.01 * largest * step.powi(k as i32)).collect()
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        if let Some(found) = levels.iter().find(|l| !(l.is_finite() && **l >= 0.0)) {
            return Err(Error::range("threshold", "at least 0 and finite", found));
        }
        if !(self.ridge.is_finite() && self.ridge >= 0.0) {
            return Err(Error::range("ridge", "at least 0 and finite", self.ridge));
        }
        Ok(levels.iter().map(|&threshold| self.fit_reduced(problem, threshold)).collect())
    }
}

impl Stlsq {
    fn fit_reduced(&self, problem: &Reduced, threshold: f64) -> Fit {
        let mut support: Vec<usize> = (0..problem.n_terms()).collect();
        let mut coefficients = vec![0.0; problem.n_terms()];
        let (mut converged, mut iterations) = (false, 0);
        while !converged && iterations < self.max_iterations {
            iterations += 1;
            let values = ridge(problem, &support, self.ridge);
            coefficients.fill(0.0);
            for (&j, &value) in support.iter().zip(&values) {
                coefficients[j] = if value.abs() >= threshold { value } else { 0.0 };
            }
            let left: Vec<usize> = support.iter().copied().filter(|&j| coefficients[j] != 0.0).collect();
            converged = left.len() == support.len() || left.is_empty();
            support = left;
        }
        let mut fit = Fit {
            residual: problem.residual(&coefficients),
            coefficients,
            level: threshold,
            converged,
            iterations,
            gap: f64::NAN,
        };
        if self.refit {
            let again = problem.refit(&support);
            fit = Fit { coefficients: again.coefficients, residual: again.residual, ..fit };
        }
        fit
    }
}

/// `(A_S'A_S + ridge 1)^-1 A_S'b`, plain least squares where that matrix is singular.
fn ridge(problem: &Reduced, support: &[usize], weight: f64) -> Vec<f64> {
    let columns = Mat::from_fn(problem.a.nrows(), support.len(), |i, k| problem.a[(i, support[k])]);
    if weight > 0.0 {
        let mut matrix = gram(columns.as_ref());
        for i in 0..support.len() {
            matrix[(i, i)] += weight;
        }
        if let Some(factor) = Cholesky::new(matrix) {
            let mut x = transposed_times(&columns, &problem.b);
            factor.solve(&mut x);
            // One step of refinement for libraries of large condition number.
            let fitted = super::dense::times(&columns, &x);
            let left: Vec<f64> = problem.b.iter().zip(&fitted).map(|(b, f)| b - f).collect();
            let mut correction: Vec<f64> =
                (0..support.len()).map(|k| dot(columns.col_as_slice(k), &left) - weight * x[k]).collect();
            factor.solve(&mut correction);
            x.iter_mut().zip(&correction).for_each(|(x, c)| *x += c);
            return x;
        }
    }
    refit(&problem.a, &problem.b, support).coefficients
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::*;

    #[test]
    fn ridge_on_one_column_has_its_closed_form() {
        // x = a'b / (a'a + ridge) = 14 / (14 + 0.05).
        let theta = Mat::from_fn(3, 1, |i, _| (i + 1) as f64);
        let fit = Stlsq { refit: false, ..Stlsq::default() }.fit(theta.as_ref(), &[1.0, 2.0, 3.0]).unwrap();
        assert!((fit.coefficients[0] - 14.0 / 14.05).abs() < 1e-14);
    }

    #[test]
    fn small_terms_go_and_the_rest_is_refitted() {
        for seed in 0..10 {
            let truth = [(1, 2.0), (4, -0.5), (6, 3.0)];
            let (theta, target) = random_problem(80, 9, &truth, 1e-3, seed);
            let fit = Stlsq::default().fit(theta.as_ref(), &target).unwrap();
            assert_eq!(fit.support(), [1, 4, 6], "seed {seed}");
            // Noise 1e-3 on 80 rows and columns of size 0.1 to 10.
            assert!(truth.iter().all(|&(j, c)| (fit.coefficients[j] - c).abs() < 5e-3));
            assert!(fit.converged);
        }
    }

    #[test]
    fn a_threshold_above_all_coefficients_leaves_nothing() {
        let (theta, target) = random_problem(20, 3, &[(1, 1.0)], 0.0, 5);
        let fit = Stlsq { threshold: 50.0, ..Stlsq::default() }.fit(theta.as_ref(), &target).unwrap();
        assert_eq!(fit.n_terms(), 0);
        assert!((fit.residual - dot(&target, &target)).abs() < 1e-9 * fit.residual);
    }

    #[test]
    fn the_path_starts_empty_and_ends_with_all_that_matters() {
        let (theta, target) = random_problem(60, 6, &[(0, 1.0), (3, -2.0)], 0.01, 6);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let method = Stlsq::default();
        let fits = method.path(&problem, &method.levels(&problem, 30)).unwrap();
        assert_eq!(fits[0].n_terms(), 0);
        assert!(fits.iter().any(|f| f.support() == [0, 3]));
        assert!(Stlsq { threshold: f64::NAN, ..method }.fit(theta.as_ref(), &target).is_err());
    }
}
