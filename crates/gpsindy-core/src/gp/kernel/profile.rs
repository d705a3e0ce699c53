//! A stationary leaf of a kernel as a profile of the scaled squared distance q: the value `k(q)`,
//! the slope `h = -2 dk/dq`, so that `dk/d ln length_d = h (lag_d/length_d)^2`, and `m q` with
//! `m = -2 dh/dq`, so that along time `k' = -h lag/length^2` and `k'' = (m q - h)/length^2`.

use super::Kernel;
use super::exp::{exp_negative, ln_1p_positive};

/// A leaf as a function of the scaled squared distance.
#[derive(Clone, Copy)]
pub(super) struct Profile {
    pub(super) shape: Shape,
    s2: f64,
    alpha: f64,
}

#[derive(Clone, Copy)]
pub(super) enum Shape {
    SquaredExponential,
    Matern12,
    Matern32,
    Matern52,
    RationalQuadratic,
}

impl Profile {
    pub(super) fn new(leaf: &Kernel, hyper: &[f64], dimension: usize) -> Self {
        let shape = match leaf {
            Kernel::Matern12 => Shape::Matern12,
            Kernel::Matern32 => Shape::Matern32,
            Kernel::Matern52 => Shape::Matern52,
            Kernel::RationalQuadratic => Shape::RationalQuadratic,
            _ => Shape::SquaredExponential,
        };
        let alpha = if let Shape::RationalQuadratic = shape { hyper[1 + dimension].exp() } else { 1.0 };
        Self { shape, s2: (2.0 * hyper[0]).exp(), alpha }
    }

    /// `[k, h, m q]` at one distance.
    pub(super) fn at(&self, q: f64) -> [f64; 3] {
        let (s2, alpha) = (self.s2, self.alpha);
        match self.shape {
            Shape::SquaredExponential => SquaredExponential::at(s2, alpha, q),
            Shape::Matern12 => Matern12::at(s2, alpha, q),
            Shape::Matern32 => Matern32::at(s2, alpha, q),
            Shape::Matern52 => Matern52::at(s2, alpha, q),
            Shape::RationalQuadratic => RationalQuadratic::at(s2, alpha, q),
        }
    }

    /// Fills k, and with `SLOPE` h too, from q.
    #[inline(always)]
    pub(super) fn fill<const SLOPE: bool>(self, q: &[f64], k: &mut [f64], h: &mut [f64]) {
        let Self { shape, s2, alpha } = self;
        match shape {
            Shape::SquaredExponential => fill::<SLOPE, SquaredExponential>(s2, alpha, q, k, h),
            Shape::Matern12 => fill::<SLOPE, Matern12>(s2, alpha, q, k, h),
            Shape::Matern32 => fill::<SLOPE, Matern32>(s2, alpha, q, k, h),
            Shape::Matern52 => fill::<SLOPE, Matern52>(s2, alpha, q, k, h),
            Shape::RationalQuadratic => fill::<SLOPE, RationalQuadratic>(s2, alpha, q, k, h),
        }
    }
}

/// A profile as a type: unlike a closure it can be inlined into the loop, where it vectorises.
trait Leaf {
    /// `[k, h, m q]` at one distance.
    fn at(s2: f64, alpha: f64, q: f64) -> [f64; 3];
}

struct SquaredExponential;
struct Matern12;
struct Matern32;
struct Matern52;
struct RationalQuadratic;

impl Leaf for SquaredExponential {
    #[inline(always)]
    fn at(s2: f64, _: f64, q: f64) -> [f64; 3] {
        let k = s2 * exp_negative(-0.5 * q);
        [k, k, k * q]
    }
}

impl Leaf for Matern12 {
    #[inline(always)]
    fn at(s2: f64, _: f64, q: f64) -> [f64; 3] {
        let r = q.sqrt();
        let k = s2 * exp_negative(-r);
        // h q must be 0 at lag 0, where h itself has no limit.
        let h = if r > 0.0 { k / r } else { 0.0 };
        [k, h, if r > 0.0 { k + h } else { f64::NAN }]
    }
}

impl Leaf for Matern32 {
    #[inline(always)]
    fn at(s2: f64, _: f64, q: f64) -> [f64; 3] {
        let r = (3.0 * q).sqrt();
        let e = s2 * exp_negative(-r);
        [(1.0 + r) * e, 3.0 * e, 3.0 * r * e]
    }
}

impl Leaf for Matern52 {
    #[inline(always)]
    fn at(s2: f64, _: f64, q: f64) -> [f64; 3] {
        let r = (5.0 * q).sqrt();
        let e = s2 * exp_negative(-r);
        [(1.0 + r + r * r * (1.0 / 3.0)) * e, (5.0 / 3.0) * (1.0 + r) * e, (5.0 / 3.0) * r * r * e]
    }
}

impl Leaf for RationalQuadratic {
    #[inline(always)]
    fn at(s2: f64, alpha: f64, q: f64) -> [f64; 3] {
        let [k, h, _] = rational_quadratic(s2, alpha, q);
        [k, h, (1.0 + 1.0 / alpha) * h / (1.0 + (0.5 / alpha) * q) * q]
    }
}

/// `[k, h, dk/d ln alpha]`.
#[inline(always)]
fn rational_quadratic(s2: f64, alpha: f64, q: f64) -> [f64; 3] {
    let x = (0.5 / alpha) * q;
    let logarithm = ln_1p_positive(x);
    let k = s2 * exp_negative(-alpha * logarithm);
    let h = k / (1.0 + x);
    [k, h, alpha * (x * h - k * logarithm)]
}

/// Fills k, h and the gradient by `ln alpha` of a rational quadratic from q, which it replaces.
#[inline(always)]
pub(super) fn fill_rational_quadratic(profile: Profile, q: &mut [f64], k: &mut [f64], h: &mut [f64]) {
    for ((q, k), h) in q.iter_mut().zip(k).zip(h) {
        [*k, *h, *q] = rational_quadratic(profile.s2, profile.alpha, *q);
    }
}

#[inline(always)]
fn fill<const SLOPE: bool, L: Leaf>(s2: f64, alpha: f64, q: &[f64], k: &mut [f64], h: &mut [f64]) {
    if SLOPE {
        for ((&q, k), h) in q.iter().zip(k).zip(h) {
            [*k, *h, _] = L::at(s2, alpha, q);
        }
    } else {
        for (&q, k) in q.iter().zip(k) {
            [*k, _, _] = L::at(s2, alpha, q);
        }
    }
}
