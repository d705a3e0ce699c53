//! A filter along the logs, as straight lines from its path need it.

use crate::refine::Tangent;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// The filter along the logs, and by what its innovations become white: by window and sample (c x c).
#[derive(Clone)]
pub(crate) struct Guide {
    pub(crate) tangent: Arc<Tangent>,
    pub(crate) whitening: Vec<Arc<Vec<DMatrix<f64>>>>,
}

/// Makes the values of all samples white, of `c` columns each.
pub(crate) fn whiten(by_sample: &[DMatrix<f64>], values: &mut DVector<f64>) {
    let mut before = Vec::new();
    for (sample, by) in by_sample.iter().enumerate() {
        let count = by.nrows();
        let own = &mut values.as_mut_slice()[sample * count..][..count];
        before.clear();
        before.extend_from_slice(own);
        own.fill(0.0);
        for (column, value) in by.as_slice().chunks_exact(count.max(1)).zip(&before) {
            own.iter_mut().zip(column).for_each(|(own, by)| *own += by * value);
        }
    }
}
