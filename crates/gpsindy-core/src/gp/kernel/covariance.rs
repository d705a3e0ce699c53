//! Values of a kernel over many lags at once, the sum of its hyperparameter gradients against
//! weights, and its derivatives along time.

use super::Kernel;
use super::exp::exp_negative;
use super::profile::{Profile, Shape, fill_rational_quadratic};

/// Lags handled at once; the scratch of a level of `Sum` or `Product` stays on the stack.
const BLOCK: usize = 128;

/// Differences `inputs[d][first + i] - origin[d]` of input d, i from 0.
#[derive(Clone, Copy)]
pub(crate) struct Lags<'a> {
    /// Columns of inputs.
    pub(crate) inputs: &'a [Vec<f64>],
    /// Row that the differences begin with.
    pub(crate) first: usize,
    /// One value an input.
    pub(crate) origin: &'a [f64],
}

impl Lags<'_> {
    fn skip(&self, rows: usize) -> Self {
        Self { first: self.first + rows, ..*self }
    }

    /// The inputs d of n rows, and what is subtracted from them.
    #[inline(always)]
    fn column(&self, d: usize, n: usize) -> (&[f64], f64) {
        (&self.inputs[d][self.first..self.first + n], self.origin[d])
    }
}

/// Fills `out[i]` with the covariance at lag i.
pub(crate) fn values(kernel: &Kernel, hyper: &[f64], lags: Lags, out: &mut [f64]) {
    for (k, out) in out.chunks_mut(BLOCK).enumerate() {
        block_values(kernel, hyper, lags.skip(k * BLOCK), out);
    }
}

/// Adds `sum_i weights[i] dk(lag_i)/d hyper_p` to `gradient[p]` for every hyperparameter.
pub(crate) fn contract(kernel: &Kernel, hyper: &[f64], lags: Lags, weights: &[f64], gradient: &mut [f64]) {
    for (k, weights) in weights.chunks(BLOCK).enumerate() {
        block_contract(kernel, hyper, lags.skip(k * BLOCK), weights, gradient);
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

fn block_values(kernel: &Kernel, hyper: &[f64], lags: Lags, out: &mut [f64]) {
    let dimension = lags.inputs.len();
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
            let (input, origin) = lags.column(0, out.len());
            for (o, x) in out.iter_mut().zip(input) {
                let sine = (rate * (x - origin)).sin();
                *o = s2 * exp_negative(-2.0 * sine * sine * inverse_l2);
            }
        }
        leaf => pulp::Arch::new().dispatch(Fill { profile: Profile::new(leaf, hyper, dimension), hyper, lags, out }),
    }
}

fn block_contract(kernel: &Kernel, hyper: &[f64], lags: Lags, weights: &[f64], gradient: &mut [f64]) {
    let (dimension, n) = (lags.inputs.len(), weights.len());
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
            let (input, origin) = lags.column(0, n);
            for (&w, x) in weights.iter().zip(input) {
                let phase = rate * (x - origin);
                let (sine, cosine) = phase.sin_cos();
                let wk = w * s2 * exp_negative(-2.0 * sine * sine * inverse_l2);
                gradient[0] += 2.0 * wk;
                gradient[1] += 4.0 * wk * sine * sine * inverse_l2;
                gradient[2] += 4.0 * wk * inverse_l2 * sine * cosine * phase;
            }
        }
        leaf => pulp::Arch::new().dispatch(Contract {
            profile: Profile::new(leaf, hyper, dimension),
            hyper,
            lags,
            weights,
            gradient,
        }),
    }
}

/// q_i = sum_d (lag_d / length_d)^2, `hyper[1 + d]` are the logarithms of the lengths.
#[inline(always)]
fn squared_distance(lags: Lags, hyper: &[f64], q: &mut [f64]) {
    for d in 0..lags.inputs.len() {
        let inverse = (-hyper[1 + d]).exp();
        let (input, origin) = lags.column(d, q.len());
        for (q, x) in q.iter_mut().zip(input) {
            let u = (x - origin) * inverse;
            *q = if d == 0 { u * u } else { *q + u * u };
        }
    }
}

/// Fills the values of a leaf, compiled for the processor at hand.
struct Fill<'a> {
    profile: Profile,
    hyper: &'a [f64],
    lags: Lags<'a>,
    out: &'a mut [f64],
}

impl pulp::WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let mut q = [0.0; BLOCK];
        let q = &mut q[..self.out.len()];
        squared_distance(self.lags, self.hyper, q);
        self.profile.fill::<false>(q, self.out, &mut []);
    }
}

/// Adds the weighted gradients of a leaf, compiled for the processor at hand.
struct Contract<'a> {
    profile: Profile,
    hyper: &'a [f64],
    lags: Lags<'a>,
    weights: &'a [f64],
    gradient: &'a mut [f64],
}

impl pulp::WithSimd for Contract<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { profile, hyper, lags, weights, gradient } = self;
        let (dimension, n) = (lags.inputs.len(), weights.len());
        let (mut q, mut k, mut h) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        let (q, k, h) = (&mut q[..n], &mut k[..n], &mut h[..n]);
        squared_distance(lags, hyper, q);
        if let Shape::RationalQuadratic = profile.shape {
            fill_rational_quadratic(profile, q, k, h);
            gradient[1 + dimension] += dot_inlined(weights, q);
        } else {
            profile.fill::<true>(q, k, h);
        }
        gradient[0] += 2.0 * dot_inlined(weights, k);
        h.iter_mut().zip(weights).for_each(|(h, &w)| *h *= w);
        for d in 0..dimension {
            let (input, origin) = lags.column(d, n);
            q.iter_mut().zip(input).for_each(|(q, x)| *q = (x - origin) * (x - origin));
            gradient[1 + d] += (-2.0 * hyper[1 + d]).exp() * dot_inlined(h, q);
        }
    }
}

/// Dot product in eight running sums, so that it vectorises; the order is fixed.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    dot_inlined(a, b)
}

#[inline(always)]
fn dot_inlined(a: &[f64], b: &[f64]) -> f64 {
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
