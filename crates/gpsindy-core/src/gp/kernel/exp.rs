//! Exponential of a non-positive number and logarithm of one plus a non-negative one, written so
//! that loops over them vectorise.
//!
//! Exponential: argument reduction by Cody and Waite, then a Taylor polynomial of degree 13.
//! Logarithm: exponent and mantissa in sqrt(1/2)..sqrt(2), then the series of the inverse
//! hyperbolic tangent to degree 21. 2 units in the last place both. Plain multiplications,
//! additions and divisions only (no fused ones), so the bits are the same on every processor.

/// Below this the result is 0: exp(-200) = 1e-87 adds nothing to a covariance, and products of
/// such numbers would become denormal and slow.
const LOWEST: f64 = -200.0;
/// 1.5 * 2^52: adding it rounds to an integer that is then in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; the first has enough trailing zeros for the product with an integer to be exact.
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// exp(x) for x <= 0; 0 below -200. A value that is not a number stays one.
#[inline(always)]
pub(in crate::gp) fn exp_negative(x: f64) -> f64 {
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let mut p = 1.0 / 6_227_020_800.0;
    p = p * r + 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    let scale = f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52);
    if x < LOWEST { 0.0 } else { p * scale }
}

/// Bits of sqrt(1/2), at which the mantissa's range begins.
const HALF_ROOT: u64 = 0x3fe6_a09e_667f_3bcd;
/// 2^52 + 1023: an exponent field written into the mantissa of 2^52 is read back less this.
const EXPONENT_OFFSET: f64 = 4_503_599_627_371_519.0;

/// ln(1 + x) for x from 0 to 1e300, also where x is tiny. A value that is not a number stays one.
#[inline(always)]
pub(super) fn ln_1p_positive(x: f64) -> f64 {
    let u = 1.0 + x;
    // What the sum lost over u; above 1 less than a unit in the last place, below 1 over u near enough to 1.
    let lost = if x < 1.0 { x - (u - 1.0) } else { 0.0 * x };
    let shifted = u.to_bits().wrapping_add(0x3ff0_0000_0000_0000 - HALF_ROOT);
    let exponent = f64::from_bits((shifted >> 52) | 0x4330_0000_0000_0000) - EXPONENT_OFFSET;
    let mantissa = f64::from_bits((shifted & 0x000f_ffff_ffff_ffff) + HALF_ROOT);
    let f = mantissa - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let mut p = 2.0 / 21.0;
    p = p * z + 2.0 / 19.0;
    p = p * z + 2.0 / 17.0;
    p = p * z + 2.0 / 15.0;
    p = p * z + 2.0 / 13.0;
    p = p * z + 2.0 / 11.0;
    p = p * z + 2.0 / 9.0;
    p = p * z + 2.0 / 7.0;
    p = p * z + 2.0 / 5.0;
    p = p * z + 2.0 / 3.0;
    // ln(1 + f) = 2 s + s (series) and 2 s = f - s f, of which the second part is small.
    exponent * LN2_HIGH + (f + (s * (z * p - f) + (exponent * LN2_LOW + lost)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_agrees_with_the_standard_library() {
        assert_eq!(ln_1p_positive(0.0), 0.0);
        for i in 0..200_000 {
            let x = 1e-20 * 1.002f64.powi(i / 2) * (1.0 + 1e-3 * f64::from(i % 7));
            if x > 1e300 {
                break;
            }
            let (mine, exact) = (ln_1p_positive(x), x.ln_1p());
            // Two units in the last place and the standard library's own.
            assert!((mine - exact).abs() <= 7e-16 * exact, "{x:e}: {mine:e} {exact:e}");
        }
        assert!(ln_1p_positive(f64::NAN).is_nan());
    }

    #[test]
    fn agrees_with_the_standard_library_to_two_units_in_the_last_place() {
        for i in 0..200_000 {
            let x = -f64::from(i) * 1e-3 * 0.999;
            let (mine, exact) = (exp_negative(x), x.exp());
            // 2 ulp = 4.5e-16 relative.
            assert!((mine - exact).abs() <= 4.5e-16 * exact, "{x}: {mine:e} {exact:e}");
        }
        assert_eq!(exp_negative(0.0), 1.0);
        assert_eq!(exp_negative(-1e4), 0.0);
        assert_eq!(exp_negative(f64::NEG_INFINITY), 0.0);
        assert!(exp_negative(f64::NAN).is_nan());
    }
}
