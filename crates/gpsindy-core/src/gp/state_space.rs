//! Exact likelihood of the Matern kernels in O(n): the process is the output of a linear
//! stochastic differential equation, and a Kalman filter evaluates it at any ordered times.
//!
//! The state is (x, x'/lambda, x''/lambda^2), so that its stationary covariance is a constant
//! matrix and the transition over `a = lambda dt` is `exp(F a)`. With the amplitude factored out
//! only the noise ratio `rho = noise^2/s^2` and lambda remain, and their sensitivities run along.
//! Source: Hartikainen & Sarkka 2010, Kalman filtering and smoothing solutions to temporal
//! Gaussian process regression models; Sarkka 2013, Bayesian Filtering and Smoothing.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::kernel::Kernel;
use super::points::Points;

pub(super) type Matrix<const M: usize> = [[f64; M]; M];
pub(super) type Vector<const M: usize> = [f64; M];

/// A Matern process in scaled state-space form: `dz = F z da + e_last dw`, spectral density `Q`.
pub(super) trait Form<const M: usize> {
    /// lambda times the length of the kernel.
    const RATE: f64;
    /// Feedback matrix.
    const F: Matrix<M>;
    /// Stationary covariance for unit amplitude.
    const STATIONARY: Matrix<M>;
    /// Density of the driving noise; it acts on the last component.
    const Q: f64;
    /// `exp(F a)`, given a and `exp(-a)`.
    fn transition(a: f64, decay: f64) -> Matrix<M>;
    /// Covariance that the driving noise adds over a; accurate relative to each element, however small a is.
    fn process_noise(a: f64, decay: f64) -> Matrix<M>;
}

pub(super) struct Half;
pub(super) struct ThreeHalves;
pub(super) struct FiveHalves;

impl Form<1> for Half {
    const RATE: f64 = 1.0;
    const F: Matrix<1> = [[-1.0]];
    const STATIONARY: Matrix<1> = [[1.0]];
    const Q: f64 = 2.0;

    #[inline(always)]
    fn transition(_: f64, decay: f64) -> Matrix<1> {
        [[decay]]
    }

    #[inline(always)]
    fn process_noise(a: f64, _: f64) -> Matrix<1> {
        [[-(-2.0 * a).exp_m1()]]
    }
}

impl Form<2> for ThreeHalves {
    const RATE: f64 = 1.732_050_807_568_877_2;
    const F: Matrix<2> = [[0.0, 1.0], [-1.0, -2.0]];
    const STATIONARY: Matrix<2> = [[1.0, 0.0], [0.0, 1.0]];
    const Q: f64 = 4.0;

    #[inline(always)]
    fn transition(a: f64, decay: f64) -> Matrix<2> {
        [[decay * (1.0 + a), decay * a], [-decay * a, decay * (1.0 - a)]]
    }

    #[inline(always)]
    fn process_noise(a: f64, decay: f64) -> Matrix<2> {
        // The impulse response is e^-s (s, 1 - s).
        let [i0, i1, i2, ..] = moments(a, decay);
        let cross = Self::Q * (i1 - i2);
        [[Self::Q * i2, cross], [cross, Self::Q * (i0 - 2.0 * i1 + i2)]]
    }
}

impl Form<3> for FiveHalves {
    const RATE: f64 = 2.236_067_977_499_79;
    const F: Matrix<3> = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -3.0, -3.0]];
    const STATIONARY: Matrix<3> = [[1.0, 0.0, -1.0 / 3.0], [0.0, 1.0 / 3.0, 0.0], [-1.0 / 3.0, 0.0, 1.0]];
    const Q: f64 = 16.0 / 3.0;

    #[inline(always)]
    fn transition(a: f64, decay: f64) -> Matrix<3> {
        // exp(F a) = e^-a (1 + N a + N^2 a^2/2) with the nilpotent N = F + 1.
        let (l, q) = (decay * a, decay * a * a * 0.5);
        [
            [decay + l + q, l + 2.0 * q, q],
            [-q, decay + l - 2.0 * q, l - q],
            [q - l, 2.0 * q - 3.0 * l, decay - 2.0 * l + q],
        ]
    }

    #[inline(always)]
    fn process_noise(a: f64, decay: f64) -> Matrix<3> {
        // The impulse response is e^-s (s^2/2, s - s^2/2, 1 - 2 s + s^2/2).
        let [i0, i1, i2, i3, i4] = moments(a, decay);
        let q00 = Self::Q * 0.25 * i4;
        let q01 = Self::Q * (0.5 * i3 - 0.25 * i4);
        let q02 = Self::Q * (0.5 * i2 - i3 + 0.25 * i4);
        let q11 = Self::Q * (i2 - i3 + 0.25 * i4);
        let q12 = Self::Q * (i1 - 2.5 * i2 + 1.5 * i3 - 0.25 * i4);
        let q22 = Self::Q * (i0 - 4.0 * i1 + 5.0 * i2 - 2.0 * i3 + 0.25 * i4);
        [[q00, q01, q02], [q01, q11, q12], [q02, q12, q22]]
    }
}

/// `I_k = int_0^a s^k e^(-2 s) ds` for k = 0..4, each accurate relative to itself.
#[inline(always)]
fn moments(a: f64, decay: f64) -> [f64; 5] {
    let end = decay * decay;
    let powers = [1.0, a, a * a, a * a * a, a * a * a * a];
    let mut i = [0.0; 5];
    if a > 2.0 {
        // By parts upwards: here nothing cancels.
        i[0] = 0.5 * (1.0 - end);
        for k in 1..5 {
            i[k] = 0.5 * (k as f64 * i[k - 1] - powers[k] * end);
        }
        return i;
    }
    // By parts the other way is a sum of positive terms; then downwards, positive again.
    let (mut term, mut sum, mut k) = (1.0, 1.0, 6.0);
    while term > 1e-17 * sum {
        term *= 2.0 * a / k;
        sum += term;
        k += 1.0;
    }
    i[4] = end * powers[4] * a / 5.0 * sum;
    for k in (1..5).rev() {
        i[k - 1] = (2.0 * i[k] + powers[k] * end) / k as f64;
    }
    i
}

/// Transition and process noise of the last step, kept while steps repeat.
pub(super) struct Step<const M: usize> {
    dt: f64,
    pub(super) a: f64,
    pub(super) transition: Matrix<M>,
    pub(super) noise: Matrix<M>,
}

impl<const M: usize> Step<M> {
    pub(super) fn new() -> Self {
        Self { dt: f64::NAN, a: 0.0, transition: [[0.0; M]; M], noise: [[0.0; M]; M] }
    }

    #[inline(always)]
    pub(super) fn set<S: Form<M>>(&mut self, lambda: f64, dt: f64) {
        // Steps of a uniform clock differ by rounding; a relative difference of 1e-12 changes nothing.
        if (dt - self.dt).abs() <= 1e-12 * self.dt {
            return;
        }
        self.dt = dt;
        // Beyond 300 the memory is gone (e^-300), and polynomials of a stay finite.
        self.a = (lambda * dt).min(300.0);
        let decay = (-self.a).exp();
        self.transition = S::transition(self.a, decay);
        self.noise = S::process_noise(self.a, decay);
    }
}

#[inline(always)]
pub(super) fn times<const M: usize>(a: &Matrix<M>, x: &Vector<M>) -> Vector<M> {
    std::array::from_fn(|i| (0..M).map(|k| a[i][k] * x[k]).sum())
}

/// `A P A'` for a symmetric P.
#[inline(always)]
pub(super) fn sandwich<const M: usize>(a: &Matrix<M>, p: &Matrix<M>) -> Matrix<M> {
    let mut left = [[0.0; M]; M];
    for i in 0..M {
        for j in 0..M {
            for k in 0..M {
                left[i][j] += a[i][k] * p[k][j];
            }
        }
    }
    let mut out = [[0.0; M]; M];
    for i in 0..M {
        for j in i..M {
            let mut sum = 0.0;
            for k in 0..M {
                sum += left[i][k] * a[j][k];
            }
            (out[i][j], out[j][i]) = (sum, sum);
        }
    }
    out
}

/// Log hyperparameters as the filter needs them.
pub(super) struct Scaled {
    /// Variance of the process.
    pub(super) s2: f64,
    pub(super) lambda: f64,
    /// Noise variance over the variance of the process.
    pub(super) rho: f64,
    /// Relative jitter, added to every noise ratio.
    pub(super) jitter: f64,
}

impl Scaled {
    pub(super) fn new(hyper: &[f64], rate: f64, jitter: f64) -> Option<Self> {
        let &[amplitude, length, noise] = hyper else { return None };
        let s2 = (2.0 * amplitude).exp();
        let out = Self { s2, lambda: rate * (-length).exp(), rho: (2.0 * noise).exp() / s2, jitter };
        (out.s2.is_normal() && out.lambda.is_normal() && out.rho.is_normal()).then_some(out)
    }
}

/// Negative log marginal likelihood and, where `gradient` is not empty, its gradient.
/// `None` where the kernel has no such form, the times are not ordered or a number overflows.
pub(crate) fn likelihood(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    gradient: &mut [f64],
) -> Option<f64> {
    if !points.ordered() {
        return None;
    }
    match (kernel, gradient.is_empty()) {
        (Kernel::Matern12, true) => filter::<1, Half, false>(hyper, points, jitter, gradient),
        (Kernel::Matern12, false) => filter::<1, Half, true>(hyper, points, jitter, gradient),
        (Kernel::Matern32, true) => filter::<2, ThreeHalves, false>(hyper, points, jitter, gradient),
        (Kernel::Matern32, false) => filter::<2, ThreeHalves, true>(hyper, points, jitter, gradient),
        (Kernel::Matern52, true) => filter::<3, FiveHalves, false>(hyper, points, jitter, gradient),
        (Kernel::Matern52, false) => filter::<3, FiveHalves, true>(hyper, points, jitter, gradient),
        _ => None,
    }
}

/// Mean and covariance of the state with a derivative of both.
#[derive(Clone, Copy)]
struct Chain<const M: usize> {
    mean: Vector<M>,
    covariance: Matrix<M>,
}

impl<const M: usize> Chain<M> {
    const ZERO: Self = Self { mean: [0.0; M], covariance: [[0.0; M]; M] };

    #[inline(always)]
    fn advance(&mut self, transition: &Matrix<M>) {
        self.mean = times(transition, &self.mean);
        self.covariance = sandwich(transition, &self.covariance);
    }

    /// Derivative of a measurement update; `dv` is the derivative of the innovation variance
    /// without this chain's own part. Returns the derivatives of `e^2/v` and `ln v`.
    #[inline(always)]
    fn update(&mut self, gain: &Vector<M>, e: f64, v: f64, dv: f64) -> [f64; 2] {
        let dv = dv + self.covariance[0][0];
        let de = -self.mean[0];
        let column: Vector<M> = std::array::from_fn(|i| self.covariance[i][0]);
        let inverse = 1.0 / v;
        for i in 0..M {
            let slope = (column[i] - gain[i] * dv) * inverse;
            self.mean[i] += slope * e + gain[i] * de;
            for j in i..M {
                let change = column[i] * gain[j] + gain[i] * column[j] - gain[i] * gain[j] * dv;
                self.covariance[i][j] -= change;
                self.covariance[j][i] = self.covariance[i][j];
            }
        }
        let u = e * inverse;
        [2.0 * u * de - u * u * dv, dv * inverse]
    }
}

fn filter<const M: usize, S: Form<M>, const GRADIENT: bool>(
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    gradient: &mut [f64],
) -> Option<f64> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let (time, n) = (&points.inputs[0], points.len());
    let mut value = Chain { mean: [0.0; M], covariance: S::STATIONARY };
    let (mut by_rho, mut by_lambda) = (Chain::<M>::ZERO, Chain::<M>::ZERO);
    let mut step = Step::<M>::new();
    // Sums of e^2/v and ln v, and their derivatives by ln rho and ln lambda.
    let (mut fit, mut log_determinant, mut product) = (0.0, 0.0, 1.0);
    let (mut rho_slopes, mut lambda_slopes) = ([0.0; 2], [0.0; 2]);
    for i in 0..n {
        if i > 0 {
            step.set::<S>(scaled.lambda, time[i] - time[i - 1]);
            value.advance(&step.transition);
            for (row, noise) in value.covariance.iter_mut().zip(&step.noise) {
                row.iter_mut().zip(noise).for_each(|(p, q)| *p += q);
            }
            if GRADIENT {
                by_rho.advance(&step.transition);
                by_lambda.advance(&step.transition);
                stretch::<M, S>(&mut by_lambda, &value, step.a);
            }
        }
        let own = scaled.rho * points.noise_weight(i);
        let v = value.covariance[0][0] + own + scaled.jitter;
        let e = points.targets[i] - value.mean[0];
        let inverse = 1.0 / v;
        let gain: Vector<M> = std::array::from_fn(|k| value.covariance[k][0] * inverse);
        if GRADIENT {
            let slopes = by_rho.update(&gain, e, v, own);
            rho_slopes = [rho_slopes[0] + slopes[0], rho_slopes[1] + slopes[1]];
            let slopes = by_lambda.update(&gain, e, v, 0.0);
            lambda_slopes = [lambda_slopes[0] + slopes[0], lambda_slopes[1] + slopes[1]];
        }
        for k in 0..M {
            value.mean[k] += gain[k] * e;
        }
        let column: Vector<M> = std::array::from_fn(|k| value.covariance[k][0]);
        for k in 0..M {
            for l in k..M {
                value.covariance[k][l] -= gain[k] * column[l];
                value.covariance[l][k] = value.covariance[k][l];
            }
        }
        fit += e * e * inverse;
        product *= v;
        // One logarithm for many points, before the product leaves the range of numbers.
        if !(1e-100..1e100).contains(&product) {
            log_determinant += product.ln();
            product = 1.0;
        }
    }
    log_determinant += product.ln();
    let n = n as f64;
    let nll = 0.5 * (log_determinant + fit / scaled.s2 + n * (scaled.s2.ln() + std::f64::consts::TAU.ln()));
    if !nll.is_finite() {
        return None;
    }
    if GRADIENT {
        let rho = 0.5 * (rho_slopes[1] + rho_slopes[0] / scaled.s2);
        let lambda = 0.5 * (lambda_slopes[1] + lambda_slopes[0] / scaled.s2);
        gradient.copy_from_slice(&[n - fit / scaled.s2 - 2.0 * rho, -lambda, 2.0 * rho]);
        return gradient.iter().all(|g| g.is_finite()).then_some(nll);
    }
    Some(nll)
}

/// What ln lambda adds by stretching the step: `a (F P + P F' + Q e e')` to the covariance, `a F m` to the mean.
#[inline(always)]
fn stretch<const M: usize, S: Form<M>>(chain: &mut Chain<M>, value: &Chain<M>, a: f64) {
    let turned = times(&S::F, &value.mean);
    for i in 0..M {
        chain.mean[i] += a * turned[i];
        for j in i..M {
            let mut sum = if i == M - 1 && j == M - 1 { S::Q } else { 0.0 };
            for k in 0..M {
                sum += S::F[i][k] * value.covariance[k][j] + value.covariance[i][k] * S::F[j][k];
            }
            chain.covariance[i][j] += a * sum;
            chain.covariance[j][i] = chain.covariance[i][j];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_process_noise_is_what_the_transition_takes_from_the_stationary_covariance() {
        fn check<const M: usize, S: Form<M>>() {
            for a in [0.3f64, 1.0, 1.9, 2.1, 5.0, 40.0] {
                let decay = (-a).exp();
                let kept = sandwich(&S::transition(a, decay), &S::STATIONARY);
                let added = S::process_noise(a, decay);
                for i in 0..M {
                    for j in 0..M {
                        // A few roundings of numbers of order one.
                        assert!((kept[i][j] + added[i][j] - S::STATIONARY[i][j]).abs() < 2e-15, "{a} {i} {j}");
                    }
                }
            }
        }
        check::<1, Half>();
        check::<2, ThreeHalves>();
        check::<3, FiveHalves>();
    }

    #[test]
    fn a_short_step_adds_noise_of_the_right_order() {
        let a = 1e-4f64;
        let q = FiveHalves::process_noise(a, (-a).exp());
        // Leading term 16/3 a^5/20; the next is 1e-4 relative.
        assert!((q[0][0] / (16.0 / 3.0 * a.powi(5) / 20.0) - 1.0).abs() < 2e-4);
    }
}
