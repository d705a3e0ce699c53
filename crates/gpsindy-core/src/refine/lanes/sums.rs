//! The sums of a Runge-Kutta step in vectors; the compiler does not find them where lanes are counted.

use pulp::Simd;

/// `out = x + by*rate`, every state by the factor of its lane.
#[inline(always)]
pub(super) fn ahead<S: Simd, const L: usize>(
    simd: S,
    x: &[[f64; L]],
    (by, rate): (&[f64; L], &[[f64; L]]),
    out: &mut [[f64; L]],
) {
    let (by, by_rest) = S::as_simd_f64s(by);
    for ((x, rate), out) in x.iter().zip(rate).zip(out) {
        let ((x, x_rest), (rate, rate_rest)) = (S::as_simd_f64s(x), S::as_simd_f64s(rate));
        let (out, out_rest) = S::as_mut_simd_f64s(out);
        for (((out, &x), &by), &rate) in out.iter_mut().zip(x).zip(by).zip(rate) {
            *out = simd.add_f64s(x, simd.mul_f64s(by, rate));
        }
        for (((out, &x), &by), &rate) in out_rest.iter_mut().zip(x_rest).zip(by_rest).zip(rate_rest) {
            *out = x + by * rate;
        }
    }
}

/// `sum += by*rate`, likewise.
#[inline(always)]
pub(super) fn add<S: Simd, const L: usize>(simd: S, sum: &mut [[f64; L]], by: &[f64; L], rate: &[[f64; L]]) {
    let (by, by_rest) = S::as_simd_f64s(by);
    for (sum, rate) in sum.iter_mut().zip(rate) {
        let ((sum, sum_rest), (rate, rate_rest)) = (S::as_mut_simd_f64s(sum), S::as_simd_f64s(rate));
        for ((sum, &by), &rate) in sum.iter_mut().zip(by).zip(rate) {
            *sum = simd.add_f64s(*sum, simd.mul_f64s(by, rate));
        }
        for ((sum, &by), &rate) in sum_rest.iter_mut().zip(by_rest).zip(rate_rest) {
            *sum += by * rate;
        }
    }
}
