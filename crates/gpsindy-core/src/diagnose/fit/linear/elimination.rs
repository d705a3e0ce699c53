//! Columns of a linear regression taken out of its products one after the other: what they gain, and what is left of the others.

use nalgebra::{DMatrix, DVector};

/// Eliminates column `i` from the products, where more than `least` of it is left.
///
/// `gram` (k x k): products of the columns with each other; `slope` (k): with the residual.
pub(crate) fn eliminate(gram: &mut DMatrix<f64>, slope: &mut DVector<f64>, i: usize, least: f64) {
    let left = gram[(i, i)];
    if !(left > least && left > 0.0) {
        return;
    }
    let column = gram.column(i).clone_owned();
    let along = slope[i] / left;
    slope.axpy(-along, &column, 1.0);
    gram.ger(-1.0 / left, &column, &column, 1.0);
}

/// By how much `columns` together lower the squared residual, and how many of them can: those of which more than `least(i)` is
/// left besides the others. They are eliminated.
pub(crate) fn gain(
    gram: &mut DMatrix<f64>,
    slope: &mut DVector<f64>,
    columns: impl IntoIterator<Item = usize>,
    least: impl Fn(usize) -> f64,
) -> (f64, usize) {
    let (mut gain, mut degrees) = (0.0, 0);
    for i in columns {
        let left = gram[(i, i)];
        if left > least(i) && left > 0.0 {
            gain += slope[i] * slope[i] / left;
            degrees += 1;
            eliminate(gram, slope, i, 0.0);
        }
    }
    (gain, degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gain_is_that_of_the_least_squares_fit_and_a_copy_of_a_column_adds_none() {
        let columns = DMatrix::from_row_slice(4, 3, &[1.0, 0.5, 1.0, 0.0, 2.0, 0.0, -1.0, 0.3, -1.0, 2.0, 1.0, 2.0]);
        let residual = DVector::from_row_slice(&[0.7, -1.2, 0.4, 2.0]);
        let (mut gram, mut slope) = (columns.tr_mul(&columns), columns.tr_mul(&residual));
        let (found, degrees) = gain(&mut gram, &mut slope, 0..3, |_| 1e-9);
        let q = columns.columns(0, 2).into_owned().qr().q();
        assert_eq!(degrees, 2);
        assert!((found - q.tr_mul(&residual).norm_squared()).abs() < 1e-12);
    }
}
