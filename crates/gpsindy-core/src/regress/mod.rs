//! Sparse regression: `target ~ theta * xi` with few coefficients, one state at a time.
//!
//! Knows matrices only. Every method is a plain struct of settings that implements [`Regressor`]; each can walk a
//! path from no term to many, so that a [`Selection`] can choose the place to stop. Rows that carry unequal or
//! correlated errors are whitened first ([`Whitening`]).

mod dense;
mod ensemble;
mod folds;
mod lasso;
mod least_squares;
mod parts;
mod reduce;
mod select;
mod sqrt_lasso;
mod ssr;
mod stlsq;
mod subset;
mod whiten;

pub use ensemble::{Ensemble, Stability};
pub use folds::Folds;
pub use lasso::Lasso;
pub use least_squares::LeastSquares;
pub use reduce::Reduced;
pub use select::{Candidates, Choice, Selection, choose_by};
pub use sqrt_lasso::SqrtLasso;
pub use ssr::{Ssr, SsrRule};
pub use stlsq::Stlsq;
pub(crate) use subset::Gains;
pub use subset::Subset;
pub use whiten::Whitening;

use crate::error::Result;
use faer::MatRef;

/// A fitted column of Xi.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// p coefficients; a term that is out has exactly 0.
    pub coefficients: Vec<f64>,
    /// The tuning value it was made with: lambda, threshold or number of terms.
    pub level: f64,
    /// Sum of squared residuals over the rows.
    pub residual: f64,
    /// Whether the method met its stopping rule within its iterations.
    pub converged: bool,
    /// Iterations spent.
    pub iterations: usize,
    /// Duality gap before any refit, relative to half the squared target; NaN for methods without one.
    pub gap: f64,
}

impl Fit {
    /// The terms that are in, in the order of the columns.
    pub fn support(&self) -> Vec<usize> {
        (0..self.coefficients.len()).filter(|&j| self.coefficients[j] != 0.0).collect()
    }

    /// Number of terms that are in.
    pub fn n_terms(&self) -> usize {
        self.coefficients.iter().filter(|c| **c != 0.0).count()
    }
}

/// A method of sparse regression.
///
/// ```
/// use gpsindy_core::regress::{Lasso, Regressor};
/// let theta = faer::Mat::from_fn(20, 2, |i, j| if j == 0 { 1.0 } else { i as f64 });
/// let target: Vec<f64> = (0..20).map(|i| 3.0 * i as f64).collect();
/// let fit = Lasso { lambda: 0.1, ..Lasso::default() }.fit(theta.as_ref(), &target)?;
/// assert_eq!(fit.support(), [1]);
/// assert!((fit.coefficients[1] - 3.0).abs() < 1e-9);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
pub trait Regressor: std::fmt::Debug + Send + Sync {
    /// Name as the user writes it.
    fn name(&self) -> &'static str;

    /// The tuning value that [`Regressor::fit`] uses.
    fn level(&self) -> f64;

    /// At most `count` tuning values for this problem, from no term toward all terms.
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64>;

    /// Factor by which a tuning value of `of` rows must be multiplied to mean the same on `rows` of them. Default 1.
    fn level_for(&self, rows: usize, of: usize) -> f64 {
        let _ = (rows, of);
        1.0
    }

    /// A fit at each of `levels`, each started where the one before ended.
    ///
    /// # Errors
    /// A tuning value or a setting out of its range.
    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>>;

    /// The fit at the method's own tuning value.
    ///
    /// # Shapes
    /// `theta`: (r x p), rows are samples. `target`: r. Returns p coefficients.
    ///
    /// # Errors
    /// Sizes that differ, no row or column, a value that is not finite, a setting out of its range.
    fn fit(&self, theta: MatRef<'_, f64>, target: &[f64]) -> Result<Fit> {
        let problem = Reduced::new(theta, target)?;
        let mut fits = self.path(&problem, &[self.level()])?;
        Ok(fits.remove(0))
    }
}

#[cfg(test)]
pub(crate) mod testing;
