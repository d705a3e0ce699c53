//! The sums of a Runge-Kutta step, every state by the factor of its lane.

use crate::expression::vectors::vectors;
use pulp::Simd;

/// `out = x + by*rate`.
#[inline(always)]
pub(super) fn ahead<S: Simd, const L: usize>(
    simd: S,
    x: &[[f64; L]],
    (by, rate): (&[f64; L], &[[f64; L]]),
    out: &mut [[f64; L]],
) {
    let vector = |x, by, rate| simd.add_f64s(x, simd.mul_f64s(by, rate));
    for ((x, rate), out) in x.iter().zip(rate).zip(out) {
        vectors::<S, L>([x, by, rate], out, vector, |x, by, rate| x + by * rate);
    }
}

/// `sum += by*rate`.
#[inline(always)]
pub(super) fn add<S: Simd, const L: usize>(simd: S, sum: &mut [[f64; L]], by: &[f64; L], rate: &[[f64; L]]) {
    for (sum, rate) in sum.iter_mut().zip(rate) {
        let before = [*sum];
        ahead(simd, &before, (by, std::slice::from_ref(rate)), std::slice::from_mut(sum));
    }
}
