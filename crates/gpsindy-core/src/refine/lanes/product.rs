//! Products of a small matrix with vectors that lie side by side in lanes.

use super::lockstep::L;

/// Rows that are summed at once: one sum waits for its last addition, four of them do not wait for each other.
const ROWS: usize = 4;

/// Adds to `sums` (rows) a matrix (rows x columns, row after row) times the vectors (columns) of all lanes.
pub(super) struct Product<'a> {
    pub(super) matrix: &'a [f64],
    pub(super) vectors: &'a [[f64; L]],
    pub(super) sums: &'a mut [[f64; L]],
}

impl Product<'_> {
    /// By the widest registers that the processor has.
    pub(super) fn add(self) {
        pulp::Arch::new().dispatch(self);
    }
}

impl pulp::WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { matrix, vectors, sums } = self;
        let width = vectors.len();
        if width == 0 {
            return;
        }
        let mut blocks = sums.chunks_exact_mut(ROWS);
        let mut matrices = matrix.chunks_exact(ROWS * width);
        for (sums, matrix) in blocks.by_ref().zip(matrices.by_ref()) {
            let mut own = [[0.0; L]; ROWS];
            for (column, lanes) in vectors.iter().enumerate() {
                for (row, own) in own.iter_mut().enumerate() {
                    let by = matrix[row * width + column];
                    own.iter_mut().zip(lanes).for_each(|(own, lane)| *own += by * lane);
                }
            }
            for (sums, own) in sums.iter_mut().zip(own) {
                sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            }
        }
        for (sums, row) in blocks.into_remainder().iter_mut().zip(matrices.remainder().chunks_exact(width)) {
            for (by, lanes) in row.iter().zip(vectors) {
                sums.iter_mut().zip(lanes).for_each(|(sum, lane)| *sum += by * lane);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_is_that_of_every_lane() {
        for (rows, columns) in [(1, 3), (4, 4), (7, 5), (12, 12), (3, 0)] {
            let matrix: Vec<f64> = (0..rows * columns).map(|i| (1.7 * i as f64).sin()).collect();
            let vectors: Vec<[f64; L]> =
                (0..columns).map(|c| std::array::from_fn(|lane| (0.3 + c as f64 + 5.0 * lane as f64).cos())).collect();
            let mut sums = vec![[0.25; L]; rows];
            Product { matrix: &matrix, vectors: &vectors, sums: &mut sums }.add();
            for (row, sums) in sums.iter().enumerate() {
                for (lane, sum) in sums.iter().enumerate() {
                    let own = (0..columns).map(|c| matrix[row * columns + c] * vectors[c][lane]);
                    assert!((sum - 0.25 - own.sum::<f64>()).abs() < 1e-12, "{rows} x {columns}");
                }
            }
        }
    }
}
