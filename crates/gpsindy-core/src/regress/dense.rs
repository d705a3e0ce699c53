//! Small dense factorisations on one thread: Cholesky with its solves, least squares with column pivoting.

use crate::error::{Error, Result};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor as llt;
use faer::{Mat, MatRef, Par};

/// Sum of `x_i y_i`, in four interleaved sums so that the compiler can use vector registers.
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (x4, y4) = (x.chunks_exact(4), y.chunks_exact(4));
    let rest: f64 = x4.remainder().iter().zip(y4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in x4.zip(y4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// `y += a x`.
pub(crate) fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// `A' x`.
pub(crate) fn transposed_times(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    (0..a.ncols()).map(|j| dot(a.col_as_slice(j), x)).collect()
}

/// `A x`.
pub(crate) fn times(a: &Mat<f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; a.nrows()];
    for (j, &value) in x.iter().enumerate() {
        if value != 0.0 {
            axpy(value, a.col_as_slice(j), &mut y);
        }
    }
    y
}

/// `target - A x`.
pub(crate) fn residual(a: &Mat<f64>, target: &[f64], x: &[f64]) -> Vec<f64> {
    let mut r = target.to_vec();
    for (j, &value) in x.iter().enumerate() {
        if value != 0.0 {
            axpy(-value, a.col_as_slice(j), &mut r);
        }
    }
    r
}

/// `A'A` where `A` is tall, `AA'` where it is asked for.
pub(crate) fn gram(a: MatRef<'_, f64>) -> Mat<f64> {
    let mut g = Mat::zeros(a.ncols(), a.ncols());
    faer::linalg::matmul::matmul(&mut g, faer::Accum::Replace, a.transpose(), a, 1.0, Par::Seq);
    g
}

/// Lower Cholesky factor of a symmetric positive definite matrix.
#[derive(Debug, Clone)]
pub(crate) struct Cholesky {
    lower: Mat<f64>,
}

impl Cholesky {
    /// Factorises; reads the lower triangle only. `None` where a pivot is not positive.
    pub(crate) fn new(mut matrix: Mat<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let mut memory = MemBuffer::new(llt::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        llt::cholesky_in_place(matrix.as_mut(), Default::default(), Par::Seq, stack, Default::default()).ok()?;
        Some(Self { lower: matrix })
    }

    /// The factor of the identity, n x n.
    pub(crate) fn identity(n: usize) -> Self {
        Self { lower: Mat::identity(n, n) }
    }

    /// Factorises with a growing share of the mean diagonal added until it succeeds. Returns the share used too.
    pub(crate) fn with_jitter(matrix: &Mat<f64>, what: &str) -> Result<(Self, f64)> {
        let n = matrix.nrows();
        let scale = (0..n).map(|i| matrix[(i, i)].abs()).sum::<f64>() / n.max(1) as f64;
        for jitter in [0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6] {
            let mut shifted = matrix.clone();
            for i in 0..n {
                shifted[(i, i)] += jitter * scale;
            }
            if let Some(factor) = Self::new(shifted) {
                return Ok((factor, jitter));
            }
        }
        Err(Error::NotPositiveDefinite { what: what.into(), size: n, jitter: 1e-6 })
    }

    /// `x <- L^-1 x`.
    pub(crate) fn solve_lower(&self, x: &mut [f64]) {
        for j in 0..x.len() {
            let column = self.lower.col_as_slice(j);
            x[j] /= column[j];
            let value = x[j];
            let (_, below) = x.split_at_mut(j + 1);
            axpy(-value, &column[j + 1..], below);
        }
    }

    /// `x <- (L L')^-1 x`.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        self.solve_lower(x);
        for j in (0..x.len()).rev() {
            let column = self.lower.col_as_slice(j);
            x[j] = (x[j] - dot(&column[j + 1..], &x[j + 1..])) / column[j];
        }
    }
}

/// Least squares over some columns, by Householder QR with column pivoting.
#[derive(Debug)]
pub(crate) struct Refit {
    /// One coefficient a column of `support`; columns that depend on others get 0.
    pub(crate) coefficients: Vec<f64>,
    /// Sum of squared residuals.
    pub(crate) residual: f64,
    /// Diagonal of `(A'A)^-1`, 0 where a column depends on others.
    pub(crate) variance: Vec<f64>,
}

/// A column counts as dependent when less than this share of it is left after the others are projected out.
const DEPENDENT: f64 = 1e-10;

/// Minimises `||target - A_support x||`.
pub(crate) fn refit(a: &Mat<f64>, target: &[f64], support: &[usize]) -> Refit {
    let k = support.len();
    let norms: Vec<f64> = support.iter().map(|&j| dot(a.col_as_slice(j), a.col_as_slice(j)).sqrt()).collect();
    // Unit columns, so that the pivoting compares directions and not units.
    let mut q: Vec<Vec<f64>> = support
        .iter()
        .zip(&norms)
        .map(|(&j, &norm)| a.col_as_slice(j).iter().map(|v| if norm > 0.0 { v / norm } else { 0.0 }).collect())
        .collect();
    let mut rest = target.to_vec();
    let mut order: Vec<usize> = (0..k).collect();
    let mut upper = Mat::<f64>::zeros(k, k);
    let mut projections = vec![0.0; k];
    let mut rank = 0;
    // Modified Gram-Schmidt, twice, is as good as Householder here and needs no bookkeeping.
    while rank < k {
        let left = |i: &usize| dot(&q[*i], &q[*i]);
        let Some(best) = (rank..k).max_by(|&x, &y| left(&order[x]).total_cmp(&left(&order[y])).then(y.cmp(&x))) else {
            break;
        };
        let norm = dot(&q[order[best]], &q[order[best]]).sqrt();
        if norm.is_nan() || norm <= DEPENDENT {
            break;
        }
        order.swap(rank, best);
        for row in 0..rank {
            let swap = upper[(row, rank)];
            upper[(row, rank)] = upper[(row, best)];
            upper[(row, best)] = swap;
        }
        let mut pivot = std::mem::take(&mut q[order[rank]]);
        // A second pass against the finished columns keeps them orthogonal to rounding.
        for done in 0..rank {
            let overlap = dot(&q[order[done]], &pivot);
            axpy(-overlap, &q[order[done]], &mut pivot);
            upper[(done, rank)] += overlap;
        }
        let norm = dot(&pivot, &pivot).sqrt();
        pivot.iter_mut().for_each(|v| *v /= norm);
        upper[(rank, rank)] = norm;
        for later in rank + 1..k {
            let overlap = dot(&pivot, &q[order[later]]);
            axpy(-overlap, &pivot, &mut q[order[later]]);
            upper[(rank, later)] = overlap;
        }
        projections[rank] = dot(&pivot, &rest);
        axpy(-projections[rank], &pivot, &mut rest);
        q[order[rank]] = pivot;
        rank += 1;
    }
    let mut x = projections[..rank].to_vec();
    back_substitute(&upper, &mut x);
    let mut variance = vec![0.0; rank];
    for column in 0..rank {
        let mut unit = vec![0.0; column + 1];
        unit[column] = 1.0;
        back_substitute(&upper, &mut unit);
        for (row, value) in unit.iter().enumerate() {
            variance[row] += value * value;
        }
    }
    let mut result = Refit { coefficients: vec![0.0; k], residual: dot(&rest, &rest), variance: vec![0.0; k] };
    for (place, &column) in order[..rank].iter().enumerate() {
        result.coefficients[column] = x[place] / norms[column];
        result.variance[column] = variance[place] / (norms[column] * norms[column]);
    }
    result
}

/// `x <- U^-1 x` with the leading block of `upper`.
fn back_substitute(upper: &Mat<f64>, x: &mut [f64]) {
    for j in (0..x.len()).rev() {
        x[j] /= upper[(j, j)];
        let value = x[j];
        for i in 0..j {
            x[i] -= value * upper[(i, j)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cholesky_solves_a_system_with_known_answer() {
        // [[4, 2], [2, 3]] x = [8, 7] has x = [1.25, 1.5].
        let matrix = Mat::from_fn(2, 2, |i, j| [[4.0, 2.0], [2.0, 3.0]][i][j]);
        let mut x = [8.0, 7.0];
        Cholesky::new(matrix).unwrap().solve(&mut x);
        assert!((x[0] - 1.25).abs() < 1e-15 && (x[1] - 1.5).abs() < 1e-15);
    }

    #[test]
    fn a_matrix_of_negative_sign_is_refused_with_its_size() {
        let matrix = Mat::from_fn(2, 2, |i, j| if i == j { -1.0 } else { 0.0 });
        let error = Cholesky::with_jitter(&matrix, "covariance").unwrap_err();
        assert!(error.to_string().contains("covariance of 2 points"), "{error}");
    }

    #[test]
    fn refit_gives_a_line_its_slope_and_the_variance_of_the_textbook() {
        // y = 1 + 2 x at x = 0, 1, 2: (A'A)^-1 has diagonal (5/6, 1/2).
        let a = Mat::from_fn(3, 2, |i, j| if j == 0 { 1.0 } else { i as f64 });
        let fit = refit(&a, &[1.0, 3.0, 5.0], &[0, 1]);
        assert!((fit.coefficients[0] - 1.0).abs() < 1e-14 && (fit.coefficients[1] - 2.0).abs() < 1e-14);
        assert!((fit.variance[0] - 5.0 / 6.0).abs() < 1e-14 && (fit.variance[1] - 0.5).abs() < 1e-14);
        assert!(fit.residual < 1e-28);
    }

    #[test]
    fn refit_gives_a_dependent_column_nothing() {
        let a = Mat::from_fn(5, 3, |i, j| [1.0, i as f64, 2.0 * i as f64][j]);
        let fit = refit(&a, &[0.0, 1.0, 2.0, 3.0, 4.0], &[0, 1, 2]);
        assert_eq!(fit.coefficients.iter().filter(|c| c.abs() > 1e-12).count(), 1);
        assert!(fit.residual < 1e-24);
    }
}
