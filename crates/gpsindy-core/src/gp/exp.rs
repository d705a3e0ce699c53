//! Exponential of a non-positive number, written so that a loop over it vectorises.
//!
//! Argument reduction by Cody and Waite, then a Taylor polynomial of degree 13: 2 units in the
//! last place. Plain multiplications and additions only (no fused ones), so the bits are the
//! same on every processor.

/// Below this the result is 0: exp(-200) = 1e-87 adds nothing to a covariance, and products of
/// such numbers would become denormal and slow.
const LOWEST: f64 = -200.0;
/// 1.5 * 2^52: adding it rounds to an integer that then stands in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; the first has enough trailing zeros for the product with an integer to be exact.
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// exp(x) for x <= 0; 0 below -200. A value that is not a number stays one.
#[inline(always)]
pub(super) fn exp_negative(x: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

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
