//! Values of a kernel over many lags at once, the sum of its hyperparameter gradients against
//! weights, and its derivatives along time.
//!
//! A stationary leaf is a profile of the scaled squared distance q: the value `k(q)`, the slope
//! `h = -2 dk/dq`, so that `dk/d ln length_d = h (lag_d/length_d)^2`, and `m q` with
//! `m = -2 dh/dq`, so that along time `k' = -h lag/length^2` and `k'' = (m q - h)/length^2`.

use super::exp::exp_negative;
use super::kernel::Kernel;

/// Lags handled at once; the scratch of a level of `Sum` or `Product` stays on the stack.
const BLOCK: usize = 128;

/// Fills `out[i]` with the covariance at lag i; `lags[d][i]` is the difference of input d.
pub(crate) fn values(kernel: &Kernel, hyper: &[f64], lags: &[&[f64]], out: &mut [f64]) {
    let mut start = 0;
    while start < out.len() {
        let end = (start + BLOCK).min(out.len());
        block_values(kernel, hyper, &Lags { columns: lags, start, end }, &mut out[start..end]);
        start = end;
    }
}

/// Adds `sum_i weights[i] dk(lag_i)/d hyper_p` to `gradient[p]` for every hyperparameter.
pub(crate) fn contract(kernel: &Kernel, hyper: &[f64], lags: &[&[f64]], weights: &[f64], gradient: &mut [f64]) {
    let mut start = 0;
    while start < weights.len() {
        let end = (start + BLOCK).min(weights.len());
        block_contract(kernel, hyper, &Lags { columns: lags, start, end }, &weights[start..end], gradient);
        start = end;
    }
}

/// Value, first and second derivative with respect to the lag, for a scalar input (time).
///
/// The covariance of `f(t)` and `f'(t')` is minus the first, that of `f'(t)` and `f'(t')` minus
/// the second, both at lag t - t'. A kernel that holds a `Matern12` has no second derivative at
/// lag 0: NaN there.
pub(crate) fn derivatives(kernel: &Kernel, hyper: &[f64], lag: f64) -> [f64; 3] {
    match kernel {
        Kernel::Sum(a, b) => {
            let (left, right) = hyper.split_at(a.n_hyper(1));
            let (a, b) = (derivatives(a, left, lag), derivatives(b, right, lag));
            [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
        }
        Kernel::Product(a, b) => {
            let (left, right) = hyper.split_at(a.n_hyper(1));
            let (a, b) = (derivatives(a, left, lag), derivatives(b, right, lag));
            [a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]]
        }
        Kernel::Periodic => {
            let (s2, inverse_l2, rate) =
                ((2.0 * hyper[0]).exp(), (-2.0 * hyper[1]).exp(), std::f64::consts::TAU * (-hyper[2]).exp());
            let (sin_half, phase) = ((0.5 * rate * lag).sin(), rate * lag);
            let k = s2 * exp_negative(-2.0 * sin_half * sin_half * inverse_l2);
            let slope = -rate * phase.sin() * inverse_l2;
            [k, k * slope, k * (slope * slope - rate * rate * phase.cos() * inverse_l2)]
        }
        leaf => {
            let profile = Profile::new(leaf, hyper, 1);
            let inverse = (-2.0 * hyper[1]).exp();
            let [k, h, mq] = profile.at(lag * lag * inverse);
            [k, -h * lag * inverse, (mq - h) * inverse]
        }
    }
}

/// A window of the lag columns.
struct Lags<'a> {
    columns: &'a [&'a [f64]],
    start: usize,
    end: usize,
}

impl Lags<'_> {
    fn len(&self) -> usize {
        self.end - self.start
    }

    fn column(&self, d: usize) -> &[f64] {
        &self.columns[d][self.start..self.end]
    }

    /// q_i = sum_d (lag_d / length_d)^2, `log_lengths` are the d logarithms.
    fn squared_distance(&self, log_lengths: &[f64], q: &mut [f64]) {
        for (d, &log_length) in log_lengths.iter().enumerate() {
            let inverse = (-log_length).exp();
            for (q, &lag) in q.iter_mut().zip(self.column(d)) {
                let u = lag * inverse;
                *q = if d == 0 { u * u } else { *q + u * u };
            }
        }
    }
}

fn block_values(kernel: &Kernel, hyper: &[f64], lags: &Lags, out: &mut [f64]) {
    let dimension = lags.columns.len();
    match kernel {
        Kernel::Sum(a, b) | Kernel::Product(a, b) => {
            let (left, right) = hyper.split_at(a.n_hyper(dimension));
            let mut other = [0.0; BLOCK];
            let other = &mut other[..out.len()];
            block_values(a, left, lags, out);
            block_values(b, right, lags, other);
            let product = matches!(kernel, Kernel::Product(..));
            for (o, &v) in out.iter_mut().zip(&*other) {
                *o = if product { *o * v } else { *o + v };
            }
        }
        Kernel::Periodic => {
            let (s2, inverse_l2) = ((2.0 * hyper[0]).exp(), (-2.0 * hyper[1]).exp());
            let rate = std::f64::consts::PI * (-hyper[2]).exp();
            for (o, &lag) in out.iter_mut().zip(lags.column(0)) {
                let sine = (rate * lag).sin();
                *o = s2 * exp_negative(-2.0 * sine * sine * inverse_l2);
            }
        }
        leaf => {
            let mut q = [0.0; BLOCK];
            let q = &mut q[..out.len()];
            lags.squared_distance(&hyper[1..=dimension], q);
            pulp::Arch::new().dispatch(Fill::<false> {
                profile: Profile::new(leaf, hyper, dimension),
                q,
                k: out,
                h: &mut [],
            });
        }
    }
}

fn block_contract(kernel: &Kernel, hyper: &[f64], lags: &Lags, weights: &[f64], gradient: &mut [f64]) {
    let (dimension, n) = (lags.columns.len(), lags.len());
    match kernel {
        Kernel::Sum(a, b) => {
            let split = a.n_hyper(dimension);
            let (left, right) = gradient.split_at_mut(split);
            block_contract(a, &hyper[..split], lags, weights, left);
            block_contract(b, &hyper[split..], lags, weights, right);
        }
        Kernel::Product(a, b) => {
            let split = a.n_hyper(dimension);
            let (left, right) = gradient.split_at_mut(split);
            let mut scratch = [0.0; BLOCK];
            let other = &mut scratch[..n];
            block_values(b, &hyper[split..], lags, other);
            other.iter_mut().zip(weights).for_each(|(o, &w)| *o *= w);
            block_contract(a, &hyper[..split], lags, other, left);
            block_values(a, &hyper[..split], lags, other);
            other.iter_mut().zip(weights).for_each(|(o, &w)| *o *= w);
            block_contract(b, &hyper[split..], lags, other, right);
        }
        Kernel::Periodic => {
            let (s2, inverse_l2) = ((2.0 * hyper[0]).exp(), (-2.0 * hyper[1]).exp());
            let rate = std::f64::consts::PI * (-hyper[2]).exp();
            for (&w, &lag) in weights.iter().zip(lags.column(0)) {
                let phase = rate * lag;
                let (sine, cosine) = phase.sin_cos();
                let wk = w * s2 * exp_negative(-2.0 * sine * sine * inverse_l2);
                gradient[0] += 2.0 * wk;
                gradient[1] += 4.0 * wk * sine * sine * inverse_l2;
                gradient[2] += 4.0 * wk * inverse_l2 * sine * cosine * phase;
            }
        }
        leaf => {
            let (mut q, mut k, mut h) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
            let (q, k, h) = (&mut q[..n], &mut k[..n], &mut h[..n]);
            lags.squared_distance(&hyper[1..=dimension], q);
            let profile = Profile::new(leaf, hyper, dimension);
            pulp::Arch::new().dispatch(Fill::<true> { profile, q, k, h });
            gradient[0] += 2.0 * dot(weights, k);
            h.iter_mut().zip(weights).for_each(|(h, &w)| *h *= w);
            if dimension == 1 {
                gradient[1] += dot(h, q);
            } else {
                for d in 0..dimension {
                    let inverse = (-2.0 * hyper[1 + d]).exp();
                    let sum: f64 = h.iter().zip(lags.column(d)).map(|(&h, &lag)| h * lag * lag).sum();
                    gradient[1 + d] += inverse * sum;
                }
            }
            if let Kernel::RationalQuadratic = leaf {
                let alpha = profile.alpha;
                let slope = |&q: &f64| {
                    let x = 0.5 * q / alpha;
                    alpha * (x / (1.0 + x) - x.ln_1p())
                };
                gradient[1 + dimension] +=
                    weights.iter().zip(&*k).zip(&*q).map(|((&w, &k), q)| w * k * slope(q)).sum::<f64>();
            }
        }
    }
}

/// Dot product in eight running sums, so that it vectorises; the order is fixed.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for l in 0..8 {
            sums[l] += x[l] * y[l];
        }
    }
    let [s0, s1, s2, s3, s4, s5, s6, s7] = sums;
    ((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7)) + tail
}

/// A leaf as a function of the scaled squared distance.
#[derive(Clone, Copy)]
struct Profile {
    shape: Shape,
    s2: f64,
    alpha: f64,
}

#[derive(Clone, Copy)]
enum Shape {
    SquaredExponential,
    Matern12,
    Matern32,
    Matern52,
    RationalQuadratic,
}

impl Profile {
    fn new(leaf: &Kernel, hyper: &[f64], dimension: usize) -> Self {
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
    fn at(&self, q: f64) -> [f64; 3] {
        let s2 = self.s2;
        match self.shape {
            Shape::SquaredExponential => squared_exponential(s2, q),
            Shape::Matern12 => matern12(s2, q),
            Shape::Matern32 => matern32(s2, q),
            Shape::Matern52 => matern52(s2, q),
            Shape::RationalQuadratic => rational_quadratic(s2, self.alpha, q),
        }
    }
}

#[inline(always)]
fn squared_exponential(s2: f64, q: f64) -> [f64; 3] {
    let k = s2 * exp_negative(-0.5 * q);
    [k, k, k * q]
}

#[inline(always)]
fn matern12(s2: f64, q: f64) -> [f64; 3] {
    let r = q.sqrt();
    let k = s2 * exp_negative(-r);
    // h q must be 0 at lag 0, where h itself has no limit.
    let h = if r > 0.0 { k / r } else { 0.0 };
    [k, h, if r > 0.0 { k + h } else { f64::NAN }]
}

#[inline(always)]
fn matern32(s2: f64, q: f64) -> [f64; 3] {
    let r = (3.0 * q).sqrt();
    let e = s2 * exp_negative(-r);
    [(1.0 + r) * e, 3.0 * e, 3.0 * r * e]
}

#[inline(always)]
fn matern52(s2: f64, q: f64) -> [f64; 3] {
    let r = (5.0 * q).sqrt();
    let e = s2 * exp_negative(-r);
    [(1.0 + r + r * r * (1.0 / 3.0)) * e, (5.0 / 3.0) * (1.0 + r) * e, (5.0 / 3.0) * r * r * e]
}

#[inline(always)]
fn rational_quadratic(s2: f64, alpha: f64, q: f64) -> [f64; 3] {
    let base = 1.0 + 0.5 * q / alpha;
    let k = s2 * exp_negative(-alpha * base.ln());
    let h = k / base;
    [k, h, (1.0 + 1.0 / alpha) * h / base * q]
}

/// Fills k, and with `SLOPE` h too, from q, in a loop that is compiled for the processor at hand.
struct Fill<'a, const SLOPE: bool> {
    profile: Profile,
    q: &'a [f64],
    k: &'a mut [f64],
    h: &'a mut [f64],
}

impl<const SLOPE: bool> pulp::WithSimd for Fill<'_, SLOPE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Profile { shape, s2, alpha } = self.profile;
        match shape {
            Shape::SquaredExponential => fill::<SLOPE>(self.q, self.k, self.h, |q| squared_exponential(s2, q)),
            Shape::Matern12 => fill::<SLOPE>(self.q, self.k, self.h, |q| matern12(s2, q)),
            Shape::Matern32 => fill::<SLOPE>(self.q, self.k, self.h, |q| matern32(s2, q)),
            Shape::Matern52 => fill::<SLOPE>(self.q, self.k, self.h, |q| matern52(s2, q)),
            Shape::RationalQuadratic => {
                fill::<SLOPE>(self.q, self.k, self.h, |q| rational_quadratic(s2, alpha, q));
            }
        }
    }
}

#[inline(always)]
fn fill<const SLOPE: bool>(q: &[f64], k: &mut [f64], h: &mut [f64], profile: impl Fn(f64) -> [f64; 3]) {
    if SLOPE {
        for ((&q, k), h) in q.iter().zip(k).zip(h) {
            [*k, *h, _] = profile(q);
        }
    } else {
        for (&q, k) in q.iter().zip(k) {
            [*k, _, _] = profile(q);
        }
    }
}
