//! Sine, cosine, exponential and hyperbolic tangent of several lanes at once.
//!
//! Straight-line arithmetic without branches, which the compiler turns into vector instructions: a rollout
//! with friction or a pendulum spends most of its time here. The argument is reduced in parts that multiply
//! exactly, and a Taylor polynomial covers what remains; no fused operations, so that every processor gives the same
//! bits. Errors stay below two units in the last place.
//! Source: Cody and Waite 1980, Software Manual for the Elementary Functions, chapters 6, 8 and 13.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, LN_2, LOG2_E};

/// Added and taken away again, it rounds to an integer, which is then in the last bits.
const ROUND: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52

/// Angles beyond this are left to the standard library: the reduction keeps 20 bits for the number of quarter turns.
const LARGEST_ANGLE: f64 = 1e6;

/// The leading 33 bits of `value`, so that products with 20-bit integers are exact.
const fn leading(value: f64) -> f64 {
    f64::from_bits(value.to_bits() & !((1 << 20) - 1))
}

/// A quarter turn and log 2 in parts; the last number of each is what the nearest double leaves out.
const QUARTER: [f64; 3] = [leading(FRAC_PI_2), FRAC_PI_2 - leading(FRAC_PI_2), 6.123_233_995_736_766e-17];
const LOG_TWO: [f64; 2] = [leading(LN_2), LN_2 - leading(LN_2) + 2.319_046_813_846_299_6e-17];

/// `1/(first!), 1/((first+step)!), ...` with the signs of `sign` powers.
const fn factorials<const N: usize>(first: u32, step: u32, sign: f64) -> [f64; N] {
    let mut all = [0.0; N];
    let mut factorial = 1.0;
    let mut k = 1;
    while k <= first {
        factorial *= k as f64;
        k += 1;
    }
    let mut factor = 1.0;
    let mut i = 0;
    while i < N {
        all[i] = factor / factorial;
        factor *= sign;
        let mut j = 0;
        while j < step {
            factorial *= k as f64;
            k += 1;
            j += 1;
        }
        i += 1;
    }
    all
}

/// `sin(r) = r - r^3 s(r^2)`, `cos(r) = 1 - r^2/2 + r^4 c(r^2)`, `exp(r) = 1 + r + r^2 e(r)`; the first term left
/// out is below 1e-17 on half a quarter turn and on half of log 2.
const SINE: [f64; 7] = factorials(3, 2, -1.0);
const COSINE: [f64; 7] = factorials(4, 2, -1.0);
const EXPONENTIAL: [f64; 12] = factorials(2, 1, 1.0);

#[inline(always)]
fn polynomial<const N: usize>(coefficients: &[f64; N], z: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * z + c)
}

/// Sine, or cosine as the sine a quarter turn on.
#[inline(always)]
fn wave(x: f64, ahead: u64) -> f64 {
    let rounded = x * FRAC_2_PI + ROUND;
    let turns = rounded - ROUND;
    let r = ((x - turns * QUARTER[0]) - turns * QUARTER[1]) - turns * QUARTER[2];
    let z = r * r;
    let sine = r - r * z * polynomial(&SINE, z);
    let cosine = 1.0 - (0.5 * z - z * z * polynomial(&COSINE, z));
    let quadrant = rounded.to_bits().wrapping_add(ahead);
    let odd = (quadrant & 1).wrapping_neg();
    let value = (sine.to_bits() & !odd) | (cosine.to_bits() & odd);
    f64::from_bits(value ^ ((quadrant & 2) << 62))
}

/// All lanes through a function, compiled for every kind of vector instructions.
struct Each<'a, F, const L: usize> {
    x: &'a [f64; L],
    out: &'a mut [f64; L],
    one: F,
}

impl<F: Fn(f64) -> f64, const L: usize> pulp::WithSimd for Each<'_, F, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        for (out, &x) in self.out.iter_mut().zip(self.x) {
            *out = (self.one)(x);
        }
    }
}

#[inline(never)] // as a whole, so that the lanes stay together
fn waves<const L: usize, const AHEAD: u64>(x: &[f64; L], out: &mut [f64; L]) {
    pulp::Arch::new().dispatch(Each { x, out, one: |x| wave(x, AHEAD) });
    let exact = if AHEAD == 0 { f64::sin } else { f64::cos };
    for (out, &x) in out.iter_mut().zip(x) {
        if !(x.abs() < LARGEST_ANGLE) {
            *out = exact(x);
        }
    }
}

pub(crate) fn sin<const L: usize>(x: &[f64; L], out: &mut [f64; L]) {
    waves::<L, 0>(x, out);
}

pub(crate) fn cos<const L: usize>(x: &[f64; L], out: &mut [f64; L]) {
    waves::<L, 1>(x, out);
}

/// `x = k log 2 + r`: `exp(r) - 1`, and `k` with 2048 added.
#[inline(always)]
fn reduced(x: f64) -> (f64, u64) {
    let rounded = x * LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (x - k * LOG_TWO[0]) - k * LOG_TWO[1];
    (r + r * r * polynomial(&EXPONENTIAL, r), rounded.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(2048))
}

/// `2^(k - 1024)` for `k` from 2 to 2046.
#[inline(always)]
fn power_of_two(k: u64) -> f64 {
    f64::from_bits(k.wrapping_sub(1) << 52)
}

#[inline(always)]
fn exp_one(x: f64) -> f64 {
    // Beyond these the result is infinite or zero; comparisons so that NaN stays NaN.
    let x = if x > 710.0 { 710.0 } else { x };
    let x = if x < -746.0 { -746.0 } else { x };
    let (less_one, k) = reduced(x);
    // In two steps, because a subnormal result needs a factor that is none.
    let half = k >> 1;
    (less_one + 1.0) * power_of_two(half) * power_of_two(k.wrapping_sub(half))
}

#[inline(always)]
fn tanh_one(x: f64) -> f64 {
    let twice = 2.0 * x.abs();
    let twice = if twice > 40.0 { 40.0 } else { twice };
    let (less_one, k) = reduced(twice);
    let power = power_of_two(k.wrapping_sub(1024));
    let less_one = less_one * power + (power - 1.0);
    (less_one / (less_one + 2.0)).copysign(x)
}

#[inline(never)]
pub(super) fn exp<const L: usize>(x: &[f64; L], out: &mut [f64; L]) {
    pulp::Arch::new().dispatch(Each { x, out, one: exp_one });
}

#[inline(never)]
pub(super) fn tanh<const L: usize>(x: &[f64; L], out: &mut [f64; L]) {
    pulp::Arch::new().dispatch(Each { x, out, one: tanh_one });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<const L: usize>(f: fn(&[f64; L], &mut [f64; L]), x: [f64; L]) -> [f64; L] {
        let mut out = [0.0; L];
        f(&x, &mut out);
        out
    }

    /// Distance in units in the last place of the wanted value.
    fn ulps(found: f64, wanted: f64) -> f64 {
        let unit = wanted.abs().max(f64::MIN_POSITIVE) * f64::EPSILON;
        (found - wanted).abs() / unit
    }

    fn sweep(from: f64, to: f64) -> impl Iterator<Item = f64> {
        (0..40_000).map(move |i| from + (to - from) * (f64::from(i) + 0.37) / 40_000.0)
    }

    #[test]
    fn the_standard_library_agrees_to_two_units_in_the_last_place() {
        for x in sweep(-3.2, 3.2).chain(sweep(-1e3, 1e3)).chain(sweep(-9.9e5, 9.9e5)).chain(sweep(-1e-9, 1e-9)) {
            assert!(ulps(of(sin, [x])[0], x.sin()) <= 2.0, "sin {x:e}: {:e}", of(sin, [x])[0]);
            assert!(ulps(of(cos, [x])[0], x.cos()) <= 2.0, "cos {x:e}: {:e}", of(cos, [x])[0]);
        }
        for x in sweep(-3.0, 3.0).chain(sweep(-700.0, 700.0)).chain(sweep(-1e-9, 1e-9)) {
            assert!(ulps(of(exp, [x])[0], x.exp()) <= 2.0, "exp {x:e}: {:e}", of(exp, [x])[0]);
        }
        for x in sweep(-3.0, 3.0).chain(sweep(-30.0, 30.0)).chain(sweep(-1e-9, 1e-9)) {
            // Three: a quotient of two rounded values.
            assert!(ulps(of(tanh, [x])[0], x.tanh()) <= 3.0, "tanh {x:e}: {:e}", of(tanh, [x])[0]);
        }
    }

    #[test]
    fn multiples_of_a_quarter_turn_keep_their_digits() {
        // sin of the double next to k pi is the rounding error of that double, to all its digits.
        for k in [1.0, 2.0, 7.0, 1000.0, 200_000.0] {
            let x: f64 = k * std::f64::consts::PI;
            assert!(ulps(of(sin, [x])[0], x.sin()) <= 4.0, "{k}: {:e} {:e}", of(sin, [x])[0], x.sin());
        }
    }

    #[test]
    fn ends_of_the_range_and_nan() {
        assert_eq!(of(exp, [0.0, 1e4, -1e4, f64::INFINITY]), [1.0, f64::INFINITY, 0.0, f64::INFINITY]);
        assert_eq!(of(exp, [f64::NEG_INFINITY])[0], 0.0);
        assert!(of(exp, [709.7])[0].is_finite());
        assert!(of(exp, [-744.0])[0] > 0.0);
        assert_eq!(of(tanh, [0.0, 1e9, -1e9, f64::INFINITY]), [0.0, 1.0, -1.0, 1.0]);
        assert_eq!(of(sin, [0.0, -0.0, 1e9, 1e300]), [0.0, 0.0, 1e9f64.sin(), 1e300f64.sin()]);
        assert_eq!(of(cos, [0.0])[0], 1.0);
        for f in [sin::<1>, cos::<1>, exp::<1>, tanh::<1>] {
            assert!(of(f, [f64::NAN])[0].is_nan());
        }
        assert!(of(sin, [f64::INFINITY])[0].is_nan());
    }
}
