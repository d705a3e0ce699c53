//! The factorisation behind a step of ADMM; Boyd et al. 2011, section 4.2.4.

use super::super::dense::{Cholesky, times, transposed_times};
use faer::Mat;

/// The cached factorisation of the x-update, `(A'A + rho 1)^-1`, section 4.2.4.
pub(super) enum Factor {
    /// At least as many rows as terms.
    Tall(Cholesky),
    /// Fewer rows than terms: through `rho 1 + AA'` by the matrix inversion lemma.
    Fat(Cholesky, f64),
}

impl Factor {
    pub(super) fn new(gram: &Mat<f64>, outer: Option<&Mat<f64>>, rho: f64) -> Self {
        let mut shifted = outer.unwrap_or(gram).clone();
        for i in 0..shifted.nrows() {
            shifted[(i, i)] += rho;
        }
        // Either is positive semidefinite, so rho = 1e-6 or more fails only by rounding; a larger shift is then used.
        let mut extra = rho;
        let factor = loop {
            if let Some(factor) = Cholesky::new(shifted.clone()) {
                break factor;
            }
            for i in 0..shifted.nrows() {
                shifted[(i, i)] += extra;
            }
            extra *= 10.0;
            if !extra.is_finite() {
                break Cholesky::identity(shifted.nrows());
            }
        };
        if outer.is_some() { Self::Fat(factor, rho) } else { Self::Tall(factor) }
    }

    pub(super) fn solve(&self, a: &Mat<f64>, s: &[f64]) -> Vec<f64> {
        match self {
            Self::Tall(factor) => {
                let mut x = s.to_vec();
                factor.solve(&mut x);
                x
            }
            Self::Fat(factor, rho) => {
                let mut y = times(a, s);
                factor.solve(&mut y);
                let mut x = s.to_vec();
                for (x, c) in x.iter_mut().zip(transposed_times(a, &y)) {
                    *x = (*x - c) / rho;
                }
                x
            }
        }
    }
}
