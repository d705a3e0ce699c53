//! Three numbers a lane to one, in vectors; the compiler does not find them where lanes are counted.

use pulp::Simd;

/// `vector` on whole vectors, `scalar` on the lanes that are left.
#[inline(always)]
pub(crate) fn vectors<S: Simd, const L: usize>(
    [a, b, c]: [&[f64; L]; 3],
    out: &mut [f64; L],
    vector: impl Fn(S::f64s, S::f64s, S::f64s) -> S::f64s,
    scalar: impl Fn(f64, f64, f64) -> f64,
) {
    let ((a, a_rest), (b, b_rest), (c, c_rest)) = (S::as_simd_f64s(a), S::as_simd_f64s(b), S::as_simd_f64s(c));
    let (out, out_rest) = S::as_mut_simd_f64s(out);
    for (((out, &a), &b), &c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out = vector(a, b, c);
    }
    for (((out, &a), &b), &c) in out_rest.iter_mut().zip(a_rest).zip(b_rest).zip(c_rest) {
        *out = scalar(a, b, c);
    }
}
