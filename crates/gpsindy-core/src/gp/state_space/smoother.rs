//! Posterior and leave-one-out quantities of the Matern kernels in O(n): a Kalman filter forwards,
//! an adjoint pass backwards, no inverses.
//!
//! Source: Bryson & Frazier 1963; de Jong & Mackinnon 1988, Covariances for smoothed estimates in
//! state space models.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::events::{Column, Events, Unit};
use super::filtered::Filtered;
use super::joint::Remembered;
use super::matern::{FiveHalves, Form, Half, Matrix, ThreeHalves, Vector};
use super::scaled::{Scaled, sandwich, times};
use super::steps::Steps;
use super::stretches::{self, Wanted};
use crate::gp::kernel::Kernel;
use crate::gp::leave_one_out::LeaveOneOut;
use crate::gp::points::{Points, all_finite};
use crate::gp::quantity::Quantity;
use faer::Mat;
use std::ops::Range;

/// `K^-1 y` and the diagonal of `K^-1`; `None` where the kernel has no such form or a number overflows.
pub(crate) fn leave_one_out(kernel: &Kernel, hyper: &[f64], points: &Points, jitter: f64) -> Option<LeaveOneOut> {
    match kernel {
        Kernel::Matern12 => left_out::<1, Half>(hyper, points, jitter),
        Kernel::Matern32 => left_out::<2, ThreeHalves>(hyper, points, jitter),
        Kernel::Matern52 => left_out::<3, FiveHalves>(hyper, points, jitter),
        _ => None,
    }
}

/// Mean, variance and (where asked for) joint covariance of quantities at times, in any order: means and variances of the
/// targets as they were before `offset` was taken from them and they were divided by `scale`, the joint covariance of the
/// standardised ones.
pub(in crate::gp) fn posterior(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    asked: (&[f64], &[Quantity], bool),
    unit: (f64, f64),
) -> Option<Law> {
    match kernel {
        Kernel::Matern12 => predict::<1, Half>(hyper, points, jitter, asked, unit),
        Kernel::Matern32 => predict::<2, ThreeHalves>(hyper, points, jitter, asked, unit),
        Kernel::Matern52 => predict::<3, FiveHalves>(hyper, points, jitter, asked, unit),
        _ => None,
    }
}

/// Covariances of the value at each of the ascending times `at` with the values at the next two of them, of the standardised
/// targets.
pub(in crate::gp) fn neighbours(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    at: &[f64],
) -> Option<Vec<[f64; 2]>> {
    match kernel {
        Kernel::Matern12 => band::<1, Half>(hyper, points, jitter, at),
        Kernel::Matern32 => band::<2, ThreeHalves>(hyper, points, jitter, at),
        Kernel::Matern52 => band::<3, FiveHalves>(hyper, points, jitter, at),
        _ => None,
    }
}

/// Means, variances and (where asked for) joint covariance.
pub(in crate::gp) type Law = (Vec<f64>, Vec<f64>, Option<Mat<f64>>);

/// Events that are filtered and then smoothed at once: what the filter leaves of them stays near the processor.
const BLOCK: usize = 16_384;

/// Mean and covariance of the state after a measurement.
#[derive(Clone, Copy)]
struct State<const M: usize> {
    mean: Vector<M>,
    covariance: Matrix<M>,
}

/// Adjoint of the state before a measurement, and the measurement's row of `K^-1`.
struct Adjoint<const M: usize> {
    mean: Vector<M>,
    information: Matrix<M>,
    weight: f64,
    diagonal: f64,
}

/// The way forth and back over all events, which shows `visit` each with its adjoint.
///
/// Of more than `block` events only the state before each block is kept on the way forth; on the way back the block is
/// filtered again. That costs less than the memory of all.
struct Sweep<'a, const M: usize, S, F> {
    scaled: &'a Scaled,
    events: &'a Events<'a>,
    block: usize,
    visit: F,
    form: std::marker::PhantomData<S>,
}

impl<const M: usize, S: Form<M>, F: FnMut(usize, &Filtered<M>, &Adjoint<M>)> Sweep<'_, M, S, F> {
    /// What the filter left of the first block, which is all where there is one; `None` where a variance is not positive.
    #[inline(always)]
    fn run<const FUSED: bool>(mut self) -> Option<Vec<Filtered<M>>> {
        let (n, block) = (self.events.time.len(), self.block.max(1));
        let mut filtered = Vec::with_capacity(block.min(n));
        let mut checkpoints = Vec::with_capacity(n / block + 1);
        let mut state = State { mean: [0.0; M], covariance: S::STATIONARY };
        for start in (0..n).step_by(block) {
            checkpoints.push(state);
            self.forward::<FUSED>(start..(start + block).min(n), &mut state, &mut filtered)?;
        }
        let mut at = Adjoint { mean: [0.0; M], information: [[0.0; M]; M], weight: 0.0, diagonal: 0.0 };
        for (k, checkpoint) in checkpoints.iter().enumerate().rev() {
            let range = k * block..((k + 1) * block).min(n);
            if range.end < n {
                self.forward::<FUSED>(range.clone(), &mut checkpoint.clone(), &mut filtered)?;
            }
            self.backward::<FUSED>(range.start, &filtered, &mut at);
        }
        Some(filtered)
    }

    #[inline(always)]
    fn forward<const FUSED: bool>(
        &self,
        range: Range<usize>,
        state: &mut State<M>,
        out: &mut Vec<Filtered<M>>,
    ) -> Option<()> {
        let (scaled, events) = (self.scaled, self.events);
        let State { mean, covariance } = state;
        let mut steps = Steps::<M>::new();
        out.clear();
        for i in range {
            if i > 0 {
                let place = match events.clock {
                    Some(step) => steps.fill_once::<S>(scaled.lambda, step),
                    None => steps.reach::<S>(scaled.lambda, &events.time, i),
                };
                let (transition, noise, _) = steps.at(place);
                *mean = times::<M, FUSED>(&transition, mean);
                *covariance = sandwich::<M, FUSED>(&transition, covariance);
                for (row, noise) in covariance.iter_mut().zip(&noise) {
                    row.iter_mut().zip(noise).for_each(|(p, q)| *p += q);
                }
            }
            let mut filtered =
                Filtered { mean: *mean, covariance: *covariance, gain: [0.0; M], innovation: 0.0, precision: 0.0 };
            if !events.target[i].is_nan() {
                let v = covariance[0][0] + scaled.rho * events.noise_weight(i) + scaled.jitter;
                if v.is_nan() || v <= 0.0 {
                    return None;
                }
                let inverse = 1.0 / v;
                let gain: Vector<M> = std::array::from_fn(|k| covariance[k][0] * inverse);
                let e = events.target[i] - mean[0];
                filtered.gain = gain;
                filtered.innovation = e * inverse;
                filtered.precision = inverse;
                let column: Vector<M> = std::array::from_fn(|k| covariance[k][0]);
                for k in 0..M {
                    mean[k] += gain[k] * e;
                    for l in k..M {
                        covariance[k][l] -= gain[k] * column[l];
                        covariance[l][k] = covariance[k][l];
                    }
                }
            }
            out.push(filtered);
        }
        Some(())
    }

    #[inline(always)]
    fn backward<const FUSED: bool>(&mut self, start: usize, filtered: &[Filtered<M>], at: &mut Adjoint<M>) {
        let mut steps = Steps::<M>::new();
        for (i, f) in filtered.iter().enumerate().rev() {
            let i = start + i;
            // Mean and information are those after the measurement here.
            (at.weight, at.diagonal) = (0.0, 0.0);
            if f.precision > 0.0 {
                let along: f64 = (0..M).map(|k| f.gain[k] * at.mean[k]).sum();
                let turned = times::<M, FUSED>(&at.information, &f.gain);
                let spread: f64 = (0..M).map(|k| f.gain[k] * turned[k]).sum();
                at.weight = f.innovation - along;
                at.diagonal = f.precision + spread;
                // (1 - h K') information (1 - K h') + h h'/v with h = (1, 0, ..).
                at.mean[0] += at.weight;
                for k in 0..M {
                    at.information[0][k] -= turned[k];
                    at.information[k][0] -= turned[k];
                }
                at.information[0][0] += spread + f.precision;
            }
            (self.visit)(i, f, at);
            if i > 0 {
                let place = match self.events.clock {
                    Some(step) => steps.fill_once::<S>(self.scaled.lambda, step),
                    None => steps.reach_back::<S>(self.scaled.lambda, &self.events.time, i),
                };
                let transposed = transpose(&steps.at(place).0);
                at.mean = times::<M, FUSED>(&transposed, &at.mean);
                at.information = sandwich::<M, FUSED>(&transposed, &at.information);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<const M: usize, S: Form<M>, F: FnMut(usize, &Filtered<M>, &Adjoint<M>)> pulp::WithSimd for Sweep<'_, M, S, F> {
    type Output = Option<Vec<Filtered<M>>>;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> Self::Output {
        self.run::<true>()
    }
}

/// Sweeps with fused operations where the processor has them.
fn sweep<const M: usize, S: Form<M>>(
    scaled: &Scaled,
    events: &Events,
    block: usize,
    visit: impl FnMut(usize, &Filtered<M>, &Adjoint<M>),
) -> Option<Vec<Filtered<M>>> {
    let sweep = Sweep { scaled, events, block, visit, form: std::marker::PhantomData::<S> };
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        return pulp::Simd::vectorize(simd, sweep);
    }
    sweep.run::<false>()
}

fn transpose<const M: usize>(a: &Matrix<M>) -> Matrix<M> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn left_out<const M: usize, S: Form<M>>(hyper: &[f64], points: &Points, jitter: f64) -> Option<LeaveOneOut> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let events = Events::new(points, &[]);
    let (mut weights, mut diagonal) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    let unit = Unit { factor: 1.0 / scaled.s2, offset: 0.0, lowest: f64::NEG_INFINITY };
    let mut columns = [Column::new(&mut weights, unit), Column::new(&mut diagonal, unit)];
    if !stretches::smooth::<M, S>(&scaled, &events, Wanted::LeftOut, &mut columns) {
        sweep::<M, S>(&scaled, &events, BLOCK, |i, _, at| {
            columns[0].put(i, at.weight);
            columns[1].put(i, at.diagonal);
        })?;
    }
    Some(LeaveOneOut { weights, diagonal })
}

fn predict<const M: usize, S: Form<M>>(
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    (at, quantities, joint): (&[f64], &[Quantity], bool),
    (offset, scale): (f64, f64),
) -> Option<Law> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let events = Events::new(points, at);
    let n = events.time.len();
    // Value and then derivative at all events.
    let (mut mean, mut variance) = (vec![0.0; 2 * n], vec![0.0; 2 * n]);
    let (value, derivative) = mean.split_at_mut(n);
    let (value_variance, derivative_variance) = variance.split_at_mut(n);
    let signed = |factor, offset| Unit { factor, offset, lowest: f64::NEG_INFINITY };
    let square = |factor: f64| Unit { factor: factor * factor * scaled.s2, offset: 0.0, lowest: 0.0 };
    let mut columns = [
        Column::new(value, signed(scale, offset)),
        Column::new(derivative, signed(scale * scaled.lambda, 0.0)),
        Column::new(value_variance, square(scale)),
        Column::new(derivative_variance, square(scale * scaled.lambda)),
    ];
    let mut remembered = None;
    if joint || !stretches::smooth::<M, S>(&scaled, &events, Wanted::Law, &mut columns) {
        // What the later measurements leave of the error.
        let mut left = vec![[[0.0; M]; 2]; if joint { n } else { 0 }];
        // The joint covariance needs what the filter left of every event.
        let block = if joint { usize::MAX } else { BLOCK };
        let filtered = sweep::<M, S>(&scaled, &events, block, |i, f, adjoint| {
            for c in 0..M.min(2) {
                let p = &f.covariance;
                let after = remaining(p, &adjoint.information, c);
                let shift: f64 = (0..M).map(|k| p[c][k] * adjoint.mean[k]).sum();
                columns[c].put(i, f.mean[c] + shift);
                columns[2 + c].put(i, (0..M).map(|k| p[c][k] * after[k]).sum());
                if joint {
                    left[i][c] = after;
                }
            }
        })?;
        remembered = joint.then_some(Remembered { filtered, left });
    }
    if at != points.inputs[0] || *quantities != [Quantity::Value, Quantity::Derivative] {
        let place = events.places(at);
        let pick = |column: &[f64]| -> Vec<f64> {
            let of = |q: &Quantity| if *q == Quantity::Value { &column[..n] } else { &column[n..] };
            quantities.iter().flat_map(|q| place.iter().map(move |&i| of(q)[i])).collect()
        };
        (mean, variance) = (pick(&mean), pick(&variance));
    }
    let finite = all_finite(&mean) && all_finite(&variance);
    let covariance = remembered.map(|r| r.covariance::<S>(&scaled, &events, at, quantities));
    finite.then_some((mean, variance, covariance))
}

fn band<const M: usize, S: Form<M>>(hyper: &[f64], points: &Points, jitter: f64, at: &[f64]) -> Option<Vec<[f64; 2]>> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let events = Events::new(points, at);
    let mut left = vec![[[0.0; M]; 2]; events.time.len()];
    let filtered = sweep::<M, S>(&scaled, &events, usize::MAX, |i, f, adjoint| {
        left[i][0] = remaining(&f.covariance, &adjoint.information, 0);
    })?;
    Some(Remembered { filtered, left }.band::<S, 2>(&scaled, &events, at))
}

/// Column c of `1 - information P`: what the later measurements leave of the error.
fn remaining<const M: usize>(p: &Matrix<M>, information: &Matrix<M>, c: usize) -> Vector<M> {
    std::array::from_fn(|i| {
        let taken: f64 = (0..M).map(|k| information[i][k] * p[k][c]).sum();
        if i == c { 1.0 - taken } else { -taken }
    })
}
