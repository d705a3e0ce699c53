//! A regression problem reduced by QR to at most p + 1 rows.
//!
//! `[theta target] = Q [R z]` gives `||theta x - target|| = ||R x - z||` for every x, so each method works on the small
//! problem, without the squared condition number of `theta' theta`. A problem with fewer rows than terms stays as it is.

use super::Fit;
use super::dense::{dot, refit, residual, transposed_times};
use crate::error::{Error, Result};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor as qr;
use faer::{Mat, MatRef, Par};

/// A checked regression problem in its smallest form.
#[derive(Debug, Clone)]
pub struct Reduced {
    pub(crate) a: Mat<f64>,
    pub(crate) b: Vec<f64>,
    n_rows: usize,
    norms: Vec<f64>,
}

impl Reduced {
    /// Checks and reduces.
    ///
    /// # Shapes
    /// `theta`: (r x p), rows are samples. `target`: r.
    ///
    /// # Errors
    /// Sizes that differ, no row or column, a value that is not finite.
    pub fn new(theta: MatRef<'_, f64>, target: &[f64]) -> Result<Self> {
        let (r, p) = (theta.nrows(), theta.ncols());
        if target.len() != r {
            return Err(Error::shape("regression target", format!("{r} values, one a row of theta"), target.len()));
        }
        if r == 0 {
            return Err(Error::TooFewSamples { what: "regression".into(), needed: 1, found: 0 });
        }
        if p == 0 {
            return Err(Error::settings("the library holds no term; allow at least one"));
        }
        if let Some(i) = target.iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite { what: format!("regression target, row {}", i + 1) });
        }
        for j in 0..p {
            if let Some(i) = (0..r).find(|&i| !theta[(i, j)].is_finite()) {
                return Err(Error::NotFinite { what: format!("theta, row {}, term {}", i + 1, j + 1) });
            }
        }
        let mut joined = Mat::from_fn(r, p + 1, |i, j| if j < p { theta[(i, j)] } else { target[i] });
        if r > p + 1 {
            joined = upper_factor(joined);
        }
        Ok(Self::from_joined(joined, r))
    }

    fn from_joined(joined: Mat<f64>, n_rows: usize) -> Self {
        let p = joined.ncols() - 1;
        let b = joined.col_as_slice(p).to_vec();
        let a = joined.subcols(0, p).to_owned();
        let norms = (0..p).map(|j| dot(a.col_as_slice(j), a.col_as_slice(j)).sqrt()).collect();
        Self { a, b, n_rows, norms }
    }

    /// Rows of the problem before the reduction.
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Number of terms p.
    pub fn n_terms(&self) -> usize {
        self.a.ncols()
    }

    /// Euclidean norm of each column of theta, p of them.
    pub fn norms(&self) -> &[f64] {
        &self.norms
    }

    /// Squared norm of the target.
    pub fn target_square(&self) -> f64 {
        dot(&self.b, &self.b)
    }

    /// Sum of squared residuals of `coefficients` (p).
    pub fn residual(&self, coefficients: &[f64]) -> f64 {
        let r = residual(&self.a, &self.b, coefficients);
        dot(&r, &r)
    }

    /// Least squares on `support`, without shrinkage; a column that depends on the others gets 0.
    pub fn refit(&self, support: &[usize]) -> Fit {
        let small = refit(&self.a, &self.b, support);
        let mut coefficients = vec![0.0; self.n_terms()];
        for (&j, &value) in support.iter().zip(&small.coefficients) {
            coefficients[j] = value;
        }
        Fit {
            coefficients,
            level: support.len() as f64,
            residual: small.residual,
            converged: true,
            iterations: 1,
            gap: f64::NAN,
        }
    }

    /// Standard errors of a refit on `support`, for rows whose errors have standard deviation `noise`.
    ///
    /// `noise * sqrt(diag((theta_S' theta_S)^-1))`, one a term of `support`.
    pub fn standard_errors(&self, support: &[usize], noise: f64) -> Vec<f64> {
        refit(&self.a, &self.b, support).variance.iter().map(|v| noise * v.sqrt()).collect()
    }

    /// The same problem with what a refit on `support` says for its target, and errors of the rows that `noise` draws; what no
    /// column can explain stays.
    pub(crate) fn redrawn(&self, support: &[usize], mut noise: impl FnMut() -> f64) -> Self {
        let fit = self.refit(support);
        let left = residual(&self.a, &self.b, &fit.coefficients);
        let p = self.n_terms();
        let is_reduced = self.n_rows > self.a.nrows();
        let value = |(i, (b, left)): (usize, (&f64, &f64))| if is_reduced && i == p { *b } else { b - left + noise() };
        let b = self.b.iter().zip(&left).enumerate().map(value).collect();
        Self { b, ..self.clone() }
    }

    /// The smallest lambda at which the LASSO keeps no term: `max_j |a_j' b| / s_j`, `s_j` the norm of the column where
    /// `scale_columns`, else 1.
    pub fn lambda_max(&self, scale_columns: bool) -> f64 {
        let correlations = transposed_times(&self.a, &self.b);
        let scaled = correlations.iter().zip(&self.norms).map(|(c, &norm)| {
            let scale = if scale_columns { norm } else { 1.0 };
            if norm > 0.0 { c.abs() / scale } else { 0.0 }
        });
        scaled.fold(0.0, f64::max)
    }

    /// The same rows with the columns `terms` alone, in that order.
    pub fn with_terms(&self, terms: &[usize]) -> Self {
        Self {
            a: Mat::from_fn(self.a.nrows(), terms.len(), |i, k| self.a[(i, terms[k])]),
            b: self.b.clone(),
            n_rows: self.n_rows,
            norms: terms.iter().map(|&j| self.norms[j]).collect(),
        }
    }

    /// Every row times `factor`: with its square as the weight of all of them.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        for j in 0..self.a.ncols() {
            self.a.col_as_slice_mut(j).iter_mut().for_each(|v| *v *= factor);
        }
        self.b.iter_mut().chain(&mut self.norms).for_each(|v| *v *= factor);
        self
    }

    /// The problem made of the rows of several reduced ones.
    ///
    /// # Errors
    /// No part, or parts with different numbers of terms.
    pub fn stack(parts: &[&Self]) -> Result<Self> {
        let Some(first) = parts.first() else {
            return Err(Error::TooFewSamples { what: "regression".into(), needed: 1, found: 0 });
        };
        let p = first.n_terms();
        if let Some(other) = parts.iter().find(|part| part.n_terms() != p) {
            return Err(Error::shape("parts of a regression", format!("{p} terms"), other.n_terms()));
        }
        let rows: usize = parts.iter().map(|part| part.b.len()).sum();
        let mut joined = Mat::zeros(rows, p + 1);
        let mut top = 0;
        for part in parts {
            let height = part.b.len();
            for j in 0..p {
                joined.col_as_slice_mut(j)[top..top + height].copy_from_slice(part.a.col_as_slice(j));
            }
            joined.col_as_slice_mut(p)[top..top + height].copy_from_slice(&part.b);
            top += height;
        }
        if rows > p + 1 {
            joined = upper_factor(joined);
        }
        Ok(Self::from_joined(joined, parts.iter().map(|part| part.n_rows).sum()))
    }
}

/// The upper triangle R of a tall matrix's QR factorisation.
fn upper_factor(mut matrix: Mat<f64>) -> Mat<f64> {
    let (r, p) = (matrix.nrows(), matrix.ncols());
    let block = qr::recommended_block_size::<f64>(r, p);
    let mut reflectors = Mat::<f64>::zeros(block, p.min(r));
    let mut memory = MemBuffer::new(qr::qr_in_place_scratch::<f64>(r, p, block, Par::Seq, Default::default()));
    qr::qr_in_place(matrix.as_mut(), reflectors.as_mut(), Par::Seq, MemStack::new(&mut memory), Default::default());
    Mat::from_fn(p.min(r), p, |i, j| if i <= j { matrix[(i, j)] } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::*;

    #[test]
    fn reduction_keeps_the_residual_of_every_coefficient_vector() {
        let (theta, target) = random_problem(50, 6, &[(1, 2.0)], 0.3, 1);
        let small = Reduced::new(theta.as_ref(), &target).unwrap();
        assert_eq!(small.a.nrows(), 7);
        for trial in 0..5 {
            let x: Vec<f64> = (0..6).map(|j| ((j * 7 + trial * 3) % 5) as f64 - 2.0).collect();
            let direct = residual(&theta, &target, &x);
            // Both sums have about 50 terms of size 10.
            assert!((dot(&direct, &direct) - small.residual(&x)).abs() < 1e-11 * dot(&direct, &direct));
        }
    }

    #[test]
    fn parts_stack_to_the_whole() {
        let (theta, target) = random_problem(60, 4, &[(0, 1.0), (3, -2.0)], 0.1, 2);
        let whole = Reduced::new(theta.as_ref(), &target).unwrap();
        let one = Reduced::new(theta.subrows(0, 25), &target[..25]).unwrap();
        let two = Reduced::new(theta.subrows(25, 35), &target[25..]).unwrap();
        let stacked = Reduced::stack(&[&one, &two]).unwrap();
        assert_eq!(stacked.n_rows(), 60);
        let x = [0.5, -1.0, 2.0, 0.1];
        assert!((whole.residual(&x) / stacked.residual(&x) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn sizes_and_values_are_checked_once_and_named() {
        let theta = Mat::from_fn(3, 2, |i, j| (i + j) as f64);
        let text = |theta: &Mat<f64>, target: &[f64]| Reduced::new(theta.as_ref(), target).unwrap_err().to_string();
        assert!(text(&theta, &[1.0]).contains("regression target"));
        assert!(text(&theta, &[1.0, f64::NAN, 2.0]).contains("row 2"));
        let broken = Mat::from_fn(3, 2, |i, j| if (i, j) == (2, 1) { f64::INFINITY } else { 1.0 });
        assert!(text(&broken, &[1.0, 2.0, 3.0]).contains("row 3, term 2"));
        assert!(text(&Mat::zeros(0, 2), &[]).contains("no value"));
        assert!(text(&Mat::zeros(3, 0), &[1.0, 2.0, 3.0]).contains("no term"));
    }
}
