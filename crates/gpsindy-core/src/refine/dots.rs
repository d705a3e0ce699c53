//! Products of columns with each other, four at a time and in vectors: screening spends most of its time here.
//!
//! Each product has eight running sums in a fixed order, and nothing is fused, so that every processor gives the same bits.

use nalgebra::{DMatrix, DVector};

/// Running sums of one product.
const SUMS: usize = 8;

/// Products that are summed side by side: one alone waits for its last addition.
const SIDE_BY_SIDE: usize = 4;

/// Adds to `out` the product of `x` with each of `others`, which have its length.
pub(crate) fn dots(x: &[f64], others: &[&[f64]], out: &mut [f64]) {
    pulp::Arch::new().dispatch(Dots { x, others, out });
}

/// Products of the columns of a matrix with each other and with `right`.
pub(crate) fn products(matrix: &DMatrix<f64>, right: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let width = matrix.ncols();
    let columns: Vec<&[f64]> = matrix.as_slice().chunks_exact(matrix.nrows().max(1)).collect();
    let (mut gram, mut slope) = (DMatrix::zeros(width, width), DVector::zeros(width));
    for (j, column) in columns.iter().enumerate() {
        dots(column, &columns[j..], &mut gram.as_mut_slice()[j * width + j..][..width - j]);
    }
    gram.fill_upper_triangle_with_lower_triangle();
    dots(right.as_slice(), &columns, slope.as_mut_slice());
    (gram, slope)
}

/// Squares of all values of a column, one window after the other.
pub(crate) fn squares(column: &[DVector<f64>]) -> f64 {
    let of_window = |values: &DVector<f64>| {
        let mut sum = [0.0];
        dots(values.as_slice(), &[values.as_slice()], &mut sum);
        sum[0]
    };
    column.iter().map(of_window).sum()
}

/// Takes out of `x` what lies along orthonormal `directions`.
pub(crate) fn reject(directions: &DMatrix<f64>, x: &mut DVector<f64>) {
    let rows = directions.nrows();
    if rows == 0 || directions.is_empty() {
        return;
    }
    let columns: Vec<&[f64]> = directions.as_slice().chunks_exact(rows).collect();
    let mut along = vec![0.0; columns.len()];
    dots(x.as_slice(), &columns, &mut along);
    pulp::Arch::new().dispatch(Less { x: x.as_mut_slice(), columns: &columns, along: &along });
}

struct Dots<'a> {
    x: &'a [f64],
    others: &'a [&'a [f64]],
    out: &'a mut [f64],
}

impl pulp::WithSimd for Dots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { x, others, out } = self;
        // The running sums of a product fill so many vectors.
        match SUMS / S::F64_LANES {
            1 => add::<S, 1>(simd, x, others, out),
            2 => add::<S, 2>(simd, x, others, out),
            4 => add::<S, 4>(simd, x, others, out),
            _ => add::<S, SUMS>(simd, x, others, out),
        }
    }
}

#[inline(always)]
fn add<S: pulp::Simd, const VECTORS: usize>(simd: S, x: &[f64], others: &[&[f64]], out: &mut [f64]) {
    let mut several = others.chunks_exact(SIDE_BY_SIDE);
    let mut sums = out.chunks_exact_mut(SIDE_BY_SIDE);
    for (others, out) in several.by_ref().zip(sums.by_ref()) {
        let found = side_by_side::<S, SIDE_BY_SIDE, VECTORS>(simd, x, std::array::from_fn(|k| others[k]));
        out.iter_mut().zip(found).for_each(|(out, found)| *out += found);
    }
    for (other, out) in several.remainder().iter().zip(sums.into_remainder()) {
        *out += side_by_side::<S, 1, VECTORS>(simd, x, [other])[0];
    }
}

#[inline(always)]
fn side_by_side<S: pulp::Simd, const N: usize, const VECTORS: usize>(
    simd: S,
    x: &[f64],
    others: [&[f64]; N],
) -> [f64; N] {
    let whole = x.len() / SUMS * SUMS;
    let mut sums = [[simd.splat_f64s(0.0); VECTORS]; N];
    let own = S::as_simd_f64s(&x[..whole]).0.as_chunks::<VECTORS>().0;
    let beside = others.map(|other| &S::as_simd_f64s(&other[..whole]).0.as_chunks::<VECTORS>().0[..own.len()]);
    for (i, own) in own.iter().enumerate() {
        for (sums, other) in sums.iter_mut().zip(&beside) {
            for k in 0..VECTORS {
                sums[k] = simd.add_f64s(sums[k], simd.mul_f64s(own[k], other[i][k]));
            }
        }
    }
    std::array::from_fn(|n| {
        let mut lanes = [0.0; SUMS];
        S::as_mut_simd_f64s(&mut lanes).0.copy_from_slice(&sums[n]);
        let [a, b, c, d, e, f, g, h] = lanes;
        let sum = ((a + e) + (b + f)) + (c + g) + (d + h);
        x[whole..].iter().zip(&others[n][whole..]).fold(sum, |sum, (x, other)| sum + x * other)
    })
}

/// `x` less each of `columns` times what is `along` it.
struct Less<'a> {
    x: &'a mut [f64],
    columns: &'a [&'a [f64]],
    along: &'a [f64],
}

impl pulp::WithSimd for Less<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { x, columns, along } = self;
        let whole = x.len() / S::F64_LANES * S::F64_LANES;
        let (own, rest) = S::as_mut_simd_f64s(x);
        for (i, own) in own.iter_mut().enumerate() {
            let mut sum = simd.splat_f64s(0.0);
            for (column, &along) in columns.iter().zip(along) {
                let column = S::as_simd_f64s(column).0;
                sum = simd.add_f64s(sum, simd.mul_f64s(simd.splat_f64s(along), column[i]));
            }
            *own = simd.sub_f64s(*own, sum);
        }
        for (i, own) in rest.iter_mut().enumerate() {
            *own -= columns.iter().zip(along).map(|(column, along)| along * column[whole + i]).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(count: usize, seed: f64) -> DVector<f64> {
        DVector::from_fn(count, |i, _| (seed * (i as f64 + 0.3)).sin())
    }

    #[test]
    fn products_are_those_of_the_matrix_whatever_their_number_and_length() {
        for count in [0, 1, 7, 8, 21] {
            for columns in [0, 1, 4, 6] {
                let x = values(count, 1.7);
                let matrix: Vec<DVector<f64>> = (0..columns).map(|k| values(count, 0.4 + k as f64)).collect();
                let slices: Vec<&[f64]> = matrix.iter().map(DVector::as_slice).collect();
                let mut found = vec![2.0; columns];
                dots(x.as_slice(), &slices, &mut found);
                for (found, column) in found.iter().zip(&matrix) {
                    assert!((found - 2.0 - column.dot(&x)).abs() < 1e-13, "{count} {columns}");
                }
            }
        }
        let column = [values(21, 0.9), values(5, 0.2)];
        let expected: f64 = column.iter().map(DVector::norm_squared).sum();
        assert!((squares(&column) - expected).abs() < 1e-13);
    }

    #[test]
    fn products_of_a_matrix_are_those_of_all_of_its_columns() {
        for width in [0, 1, 5] {
            let matrix = DMatrix::from_fn(21, width, |i, j| ((1.3 + j as f64) * (i as f64 + 0.5)).sin());
            let right = values(21, 0.7);
            let (gram, slope) = products(&matrix, &right);
            assert!((gram - matrix.tr_mul(&matrix)).norm() < 1e-12, "{width}");
            assert!((slope - matrix.tr_mul(&right)).norm() < 1e-12, "{width}");
        }
    }

    #[test]
    fn nothing_of_a_rejected_direction_is_left() {
        for columns in [0, 1, 3, 5] {
            let matrix = DMatrix::from_fn(21, columns, |i, j| ((1.3 + j as f64) * (i as f64 + 0.5)).sin());
            let directions = matrix.qr().q();
            let before = values(21, 2.3);
            let mut x = before.clone();
            reject(&directions, &mut x);
            let expected = &before - &directions * directions.tr_mul(&before);
            assert!((&x - expected).norm() < 1e-13, "{columns}");
            assert!(directions.tr_mul(&x).norm() < 1e-13, "{columns}");
        }
    }
}
