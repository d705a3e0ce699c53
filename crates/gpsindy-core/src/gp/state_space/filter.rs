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

use super::lanes::{Lanes, Portable};
use super::matern::{FiveHalves, Form, Half, Matrix, ThreeHalves};
use super::scaled::Scaled;
use super::steps::Steps;
use crate::gp::kernel::Kernel;
use crate::gp::points::Points;

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
    match kernel {
        Kernel::Matern12 => filter::<1, Half>(hyper, points, jitter, gradient),
        Kernel::Matern32 => filter::<2, ThreeHalves>(hyper, points, jitter, gradient),
        Kernel::Matern52 => filter::<3, FiveHalves>(hyper, points, jitter, gradient),
        _ => None,
    }
}

/// Mean and covariance of the state: of the value, its derivatives by `ln rho` and `ln lambda`, and of nothing, side by side.
#[derive(Clone, Copy)]
struct Bundle<const M: usize, V> {
    mean: [V; M],
    covariance: [[V; M]; M],
}

/// What a measurement does to a [`Bundle`] of a given covariance.
#[derive(Clone, Copy)]
struct Update<const M: usize, V> {
    /// Gain of the filter, in all four places.
    gain: [V; M],
    /// Variance of the innovation, and its derivatives.
    variance: V,
    /// `(column_i - gain_i variance)`: how the gain's numerator moves; 0 in the place of the value.
    moved: [V; M],
    inverse: f64,
}

/// Places of the derivatives.
const RHO: usize = 1;
const LAMBDA: usize = 2;
/// Points between two looks at whether the covariances still change, on a uniform clock ...
const LOOK: usize = 32;
/// ... and the relative change that is rounding.
const STEADY: f64 = 1e-14;

/// Sums over all points, with their derivatives.
struct Sums {
    /// Of `e^2/v`.
    fit: [f64; 4],
    /// Of `ln v`.
    log_determinant: [f64; 4],
}

/// The filter over all points.
struct Filter<'a, const M: usize, S, N> {
    scaled: &'a Scaled,
    points: &'a Points,
    lanes: N,
    form: std::marker::PhantomData<S>,
}

impl<const M: usize, S: Form<M>, N: Lanes> Filter<'_, M, S, N> {
    #[inline(always)]
    fn stationary(&self) -> Bundle<M, N::V> {
        let entry = |i: usize, j: usize| self.lanes.four([S::STATIONARY[i][j], 0.0, 0.0, 0.0]);
        Bundle {
            mean: [self.lanes.splat(0.0); M],
            covariance: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))),
        }
    }

    #[inline(always)]
    fn advance_mean(&self, bundle: &mut Bundle<M, N::V>, transition: &Matrix<M>, stretch: N::V) {
        let n = self.lanes;
        let mut mean = [n.splat(0.0); M];
        for i in 0..M {
            for k in 0..M {
                let a = n.splat(transition[i][k]);
                mean[i] = if k == 0 { n.times(a, bundle.mean[k]) } else { n.plus(a, bundle.mean[k], mean[i]) };
            }
        }
        // What ln lambda adds by stretching the step.
        let turned = S::turn(std::array::from_fn(|i| n.first(mean[i])));
        bundle.mean = std::array::from_fn(|i| n.plus(n.splat(turned[i]), stretch, mean[i]));
    }

    #[inline(always)]
    fn advance_covariance(
        &self,
        bundle: &mut Bundle<M, N::V>,
        transition: &Matrix<M>,
        noise: &Matrix<M>,
        stretch: N::V,
    ) {
        let n = self.lanes;
        let wide: [[N::V; M]; M] = std::array::from_fn(|i| std::array::from_fn(|j| n.splat(transition[i][j])));
        let mut left = [[n.splat(0.0); M]; M];
        for i in 0..M {
            for j in 0..M {
                left[i][j] = n.times(wide[i][0], bundle.covariance[0][j]);
                for k in 1..M {
                    left[i][j] = n.plus(wide[i][k], bundle.covariance[k][j], left[i][j]);
                }
            }
        }
        let mut out = left;
        for i in 0..M {
            for j in i..M {
                let mut sum = n.four([noise[i][j], 0.0, 0.0, 0.0]);
                for k in 0..M {
                    sum = n.plus(left[i][k], wide[j][k], sum);
                }
                (out[i][j], out[j][i]) = (sum, sum);
            }
        }
        // a (F P + P F' + Q e e').
        let turned: Matrix<M> = std::array::from_fn(|j| S::turn(std::array::from_fn(|k| n.first(out[k][j]))));
        for i in 0..M {
            for j in i..M {
                let driven = if i == M - 1 && j == M - 1 { S::Q } else { 0.0 };
                let sum = n.splat(turned[j][i] + turned[i][j] + driven);
                out[i][j] = n.plus(sum, stretch, out[i][j]);
                out[j][i] = out[i][j];
            }
        }
        bundle.covariance = out;
    }

    /// `own` is what the noise of the point adds to the variance of the innovation.
    #[inline(always)]
    fn update(&self, bundle: &Bundle<M, N::V>, own: f64) -> Update<M, N::V> {
        let n = self.lanes;
        let variance = n.add(bundle.covariance[0][0], n.four([own + self.scaled.jitter, own, 0.0, 0.0]));
        let inverse = 1.0 / n.first(variance);
        let gain = std::array::from_fn(|i| n.splat(n.first(bundle.covariance[i][0]) * inverse));
        let moved = std::array::from_fn(|i| n.minus(gain[i], variance, bundle.covariance[i][0]));
        Update { gain, variance, moved, inverse }
    }

    /// Takes a measurement into the means; returns what it adds to the sums of `e^2/v`.
    #[inline(always)]
    fn update_mean(&self, bundle: &mut Bundle<M, N::V>, update: &Update<M, N::V>, target: f64) -> N::V {
        let n = self.lanes;
        let innovation = n.sub(n.four([target, 0.0, 0.0, 0.0]), bundle.mean[0]);
        let u = n.splat(n.first(innovation) * update.inverse);
        for i in 0..M {
            bundle.mean[i] = n.plus(update.gain[i], innovation, n.plus(update.moved[i], u, bundle.mean[i]));
        }
        n.times(u, n.minus(u, update.variance, n.add(innovation, innovation)))
    }

    #[inline(always)]
    fn update_covariance(&self, bundle: &mut Bundle<M, N::V>, update: &Update<M, N::V>) {
        let n = self.lanes;
        let column: [N::V; M] = std::array::from_fn(|i| bundle.covariance[i][0]);
        for i in 0..M {
            for j in i..M {
                let kept = n.minus(update.gain[i], update.moved[j], bundle.covariance[i][j]);
                bundle.covariance[i][j] = n.minus(column[i], update.gain[j], kept);
                bundle.covariance[j][i] = bundle.covariance[i][j];
            }
        }
    }

    /// Largest change of a covariance since `before`, relative to the largest of its place.
    fn change(&self, bundle: &Bundle<M, N::V>, before: &Bundle<M, N::V>) -> f64 {
        let (mut size, mut moved) = ([f64::MIN_POSITIVE; 4], [0.0f64; 4]);
        for (now, old) in bundle.covariance.iter().flatten().zip(before.covariance.iter().flatten()) {
            let (now, old) = (self.lanes.get(*now), self.lanes.get(*old));
            for l in 0..4 {
                size[l] = size[l].max(now[l].abs());
                moved[l] = moved[l].max((now[l] - old[l]).abs());
            }
        }
        (0..4).map(|l| moved[l] / size[l]).fold(0.0, f64::max)
    }

    #[inline(always)]
    fn run(self) -> Sums {
        let (n, scaled, time) = (self.lanes, self.scaled, &self.points.inputs[0]);
        let clock = self.points.uniform_step();
        let mut bundle = self.stationary();
        let mut before = bundle;
        let mut steps = Steps::<M>::new();
        let (mut fit, mut slopes) = (n.splat(0.0), n.splat(0.0));
        let (mut log_determinant, mut product) = (0.0, 1.0);
        let stretched = |a: f64| n.four([0.0, 0.0, a, 0.0]);
        for i in 0..time.len() {
            if i > 0 {
                let place = match clock {
                    Some(step) => steps.fill_once::<S>(scaled.lambda, step),
                    None => steps.reach::<S>(scaled.lambda, time, i),
                };
                let (transition, noise, a) = steps.at(place);
                self.advance_mean(&mut bundle, &transition, stretched(a));
                self.advance_covariance(&mut bundle, &transition, &noise, stretched(a));
            }
            let update = self.update(&bundle, scaled.rho * self.points.noise_weight(i));
            fit = n.add(fit, self.update_mean(&mut bundle, &update, self.points.targets[i]));
            self.update_covariance(&mut bundle, &update);
            slopes = n.plus(update.variance, n.splat(update.inverse), slopes);
            product *= n.first(update.variance);
            // One logarithm for many points, before the product leaves the range of numbers.
            if !(1e-100..1e100).contains(&product) {
                log_determinant += product.ln();
                product = 1.0;
            }
            if clock.is_some() && i > 0 && i % LOOK == 0 {
                if self.change(&bundle, &before) <= STEADY {
                    // The covariances have settled; only the means still change.
                    let (transition, noise, a) = steps.at(0);
                    let stretch = stretched(a);
                    self.advance_covariance(&mut bundle, &transition, &noise, stretch);
                    let update = self.update(&bundle, scaled.rho);
                    for &target in &self.points.targets[i + 1..] {
                        self.advance_mean(&mut bundle, &transition, stretch);
                        fit = n.add(fit, self.update_mean(&mut bundle, &update, target));
                    }
                    let left = (time.len() - i - 1) as f64;
                    log_determinant += left * n.first(update.variance).ln();
                    slopes = n.plus(update.variance, n.splat(left * update.inverse), slopes);
                    break;
                }
                before = bundle;
            }
        }
        let [_, by_rho, by_lambda, _] = n.get(slopes);
        Sums { fit: n.get(fit), log_determinant: [log_determinant + product.ln(), by_rho, by_lambda, 0.0] }
    }
}

#[cfg(target_arch = "x86_64")]
impl<const M: usize, S: Form<M>> pulp::WithSimd for Filter<'_, M, S, pulp::x86::V3> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> Sums {
        self.run()
    }
}

fn sums<const M: usize, S: Form<M>>(scaled: &Scaled, points: &Points) -> Sums {
    let form = std::marker::PhantomData::<S>;
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = pulp::x86::V3::try_new() {
        return pulp::Simd::vectorize(lanes, Filter { scaled, points, lanes, form });
    }
    Filter { scaled, points, lanes: Portable, form }.run()
}

fn filter<const M: usize, S: Form<M>>(
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    gradient: &mut [f64],
) -> Option<f64> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let Sums { fit, log_determinant } = sums::<M, S>(&scaled, points);
    let n = points.len() as f64;
    let nll = 0.5 * (log_determinant[0] + fit[0] / scaled.s2 + n * (scaled.s2.ln() + std::f64::consts::TAU.ln()));
    if !nll.is_finite() {
        return None;
    }
    if !gradient.is_empty() {
        let slope = |l: usize| 0.5 * (log_determinant[l] + fit[l] / scaled.s2);
        gradient.copy_from_slice(&[n - fit[0] / scaled.s2 - 2.0 * slope(RHO), -slope(LAMBDA), 2.0 * slope(RHO)]);
        return gradient.iter().all(|g| g.is_finite()).then_some(nll);
    }
    Some(nll)
}
