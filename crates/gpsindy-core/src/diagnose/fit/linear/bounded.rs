//! Maximises the gain `2 s'l - l'G l` over step lengths `l` within bounds.

use crate::diagnose::limits::FLAT;
use nalgebra::{DMatrix, DVector};

/// Largest `2 s'l - l'G l` with every length within its bounds, and the lengths.
///
/// Few columns: every choice of those that stay at a bound is tried.
pub(crate) fn bounded_gain(gram: &DMatrix<f64>, slope: &DVector<f64>, bounds: &[(f64, f64)]) -> (f64, Vec<f64>) {
    let count = bounds.len();
    let mut best = (0.0, vec![0.0; count]);
    for choice in 0..3usize.pow(count as u32) {
        let at = |i: usize| choice / 3usize.pow(i as u32) % 3;
        let mut lengths = DVector::zeros(count);
        let mut loose = Vec::new();
        for i in 0..count {
            match at(i) {
                0 if bounds[i].0 < bounds[i].1 => loose.push(i),
                1 if bounds[i].0.is_finite() => lengths[i] = bounds[i].0,
                2 if bounds[i].1.is_finite() => lengths[i] = bounds[i].1,
                _ => lengths[i] = f64::NAN,
            }
        }
        if lengths.iter().any(|l: &f64| l.is_nan()) {
            continue;
        }
        let right = slope - gram * &lengths;
        let own = DMatrix::from_fn(loose.len(), loose.len(), |a, b| {
            gram[(loose[a], loose[b])] * if a == b { 1.0 + 1e-9 } else { 1.0 }
        });
        let Some(factor) = own.cholesky() else { continue };
        let solved = factor.solve(&DVector::from_fn(loose.len(), |a, _| right[loose[a]]));
        for (&i, &length) in loose.iter().zip(solved.iter()) {
            lengths[i] = length;
        }
        let inside = (0..count).all(|i| lengths[i] >= bounds[i].0 && lengths[i] <= bounds[i].1);
        let gain = 2.0 * slope.dot(&lengths) - lengths.dot(&(gram * &lengths));
        if inside && gain > best.0 {
            best = (gain, lengths.iter().copied().collect());
        }
    }
    best
}

/// Gain of all directions that columns span, by the eigenvectors that are not rounding error, and how many these are.
///
/// `before`: squared sizes of the columns before anything was projected out of them.
pub(crate) fn span_gain(gram: &DMatrix<f64>, slope: &DVector<f64>, before: &[f64]) -> Option<(f64, usize)> {
    // Columns of very different size would hide each other: scale to what they were before the projection.
    let scale =
        DVector::from_iterator(before.len(), before.iter().map(|b| if *b > 0.0 { b.sqrt().recip() } else { 0.0 }));
    let scaled = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| gram[(i, j)] * scale[i] * scale[j]);
    if !scaled.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = scaled.symmetric_eigen();
    let slope = eigen.eigenvectors.tr_mul(&slope.component_mul(&scale));
    let mut gain = 0.0;
    let mut degrees = 0;
    for (value, part) in eigen.eigenvalues.iter().zip(slope.iter()) {
        if *value > FLAT {
            gain += part * part / value;
            degrees += 1;
        }
    }
    Some((gain, degrees.max(1)))
}
