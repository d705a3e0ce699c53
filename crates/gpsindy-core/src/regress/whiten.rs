//! Rows with correlated errors, made equal and independent (generalised least squares).

use super::dense::Cholesky;
use crate::error::{Error, Result};
use faer::Mat;

/// Turns rows with error covariance C into rows with covariance 1: `L^-1` with `C = L L'`.
///
/// Applied to theta and target alike it makes ordinary least squares, and every method here, the generalised one.
///
/// Source: Golub and Van Loan 2013, Matrix Computations, section 6.1.2.
#[derive(Debug, Clone)]
pub struct Whitening {
    factor: Cholesky,
    jitter: f64,
}

impl Whitening {
    /// From a covariance of the rows (r x r), of which the lower triangle is read.
    ///
    /// # Errors
    /// A covariance that is not square, not finite, or that stays indefinite with 1e-6 of its mean diagonal added.
    pub fn from_covariance(covariance: &Mat<f64>) -> Result<Self> {
        let r = covariance.nrows();
        if covariance.ncols() != r {
            return Err(Error::shape(
                "covariance of the rows",
                "a square matrix",
                format!("{r} x {}", covariance.ncols()),
            ));
        }
        if (0..r).any(|j| covariance.col_as_slice(j).iter().any(|v| !v.is_finite())) {
            return Err(Error::NotFinite { what: "covariance of the rows".into() });
        }
        let (factor, jitter) = Cholesky::with_jitter(covariance, "covariance")?;
        Ok(Self { factor, jitter })
    }

    /// Share of the mean diagonal that had to be added, 0 where none.
    pub fn jitter(&self) -> f64 {
        self.jitter
    }

    /// Whitens every column of `rows` (r x any) in place.
    pub fn apply(&self, rows: &mut Mat<f64>) {
        for j in 0..rows.ncols() {
            self.apply_column(rows.col_as_slice_mut(j));
        }
    }

    /// Whitens one column of r values in place.
    pub fn apply_column(&self, column: &mut [f64]) {
        self.factor.solve_lower(column);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LeastSquares, Regressor};
    use super::*;

    #[test]
    fn the_mean_of_two_correlated_readings_is_the_textbook_one() {
        // Readings 1 and 3 with variances 1 and 4, covariance 1: weights (1, 0), so the estimate is 1.
        let covariance = Mat::from_fn(2, 2, |i, j| [[1.0, 1.0], [1.0, 4.0]][i][j]);
        let whitening = Whitening::from_covariance(&covariance).unwrap();
        let mut theta = Mat::from_fn(2, 1, |_, _| 1.0);
        let mut target = [1.0, 3.0];
        whitening.apply(&mut theta);
        whitening.apply_column(&mut target);
        let fit = LeastSquares.fit(theta.as_ref(), &target).unwrap();
        assert!((fit.coefficients[0] - 1.0).abs() < 1e-14);
    }

    #[test]
    fn a_diagonal_covariance_divides_each_row_by_its_deviation() {
        let covariance = Mat::from_fn(3, 3, |i, j| if i == j { (i + 1) as f64 } else { 0.0 });
        let mut column = [1.0, -2.0, 0.5];
        Whitening::from_covariance(&covariance).unwrap().apply_column(&mut column);
        let wanted = [1.0, -2.0 / 2f64.sqrt(), 0.5 / 3f64.sqrt()];
        assert!(column.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn a_variance_of_zero_or_below_is_refused() {
        let covariance = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 - 2.0 * i as f64 } else { 0.0 });
        assert!(Whitening::from_covariance(&covariance).is_err());
    }
}
