//! Posterior and leave-one-out quantities of the Matern kernels in O(n): a Kalman filter forwards,
//! an adjoint pass backwards, no inverses.
//!
//! Source: Bryson & Frazier 1963; de Jong & Mackinnon 1988, Covariances for smoothed estimates in
//! state space models.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::kernel::Kernel;
use super::likelihood::LeaveOneOut;
use super::matern::{FiveHalves, Form, Half, Matrix, ThreeHalves, Vector};
use super::points::{Points, all_finite};
use super::posterior::Quantity;
use super::state_space::{Scaled, sandwich, times};
use super::steps::Steps;
use super::stretches::{self, Wanted};
use faer::Mat;
use std::borrow::Cow;
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

/// Mean, variance and (where asked for) joint covariance of `quantities` at the times `at`, in any
/// order, all of standardised targets.
pub(super) fn posterior(
    kernel: &Kernel,
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    at: &[f64],
    quantities: &[Quantity],
    joint: bool,
) -> Option<Law> {
    match kernel {
        Kernel::Matern12 => predict::<1, Half>(hyper, points, jitter, at, quantities, joint),
        Kernel::Matern32 => predict::<2, ThreeHalves>(hyper, points, jitter, at, quantities, joint),
        Kernel::Matern52 => predict::<3, FiveHalves>(hyper, points, jitter, at, quantities, joint),
        _ => None,
    }
}

/// Means, variances and (where asked for) joint covariance.
pub(super) type Law = (Vec<f64>, Vec<f64>, Option<Mat<f64>>);

/// Times in order, each with a measurement or without.
pub(super) struct Events<'a> {
    pub(super) time: Cow<'a, [f64]>,
    /// NaN where there is no measurement.
    pub(super) target: Cow<'a, [f64]>,
    /// Empty where all are 1.
    noise_weights: Cow<'a, [f64]>,
    /// Step of a uniform clock, all of it measured.
    clock: Option<f64>,
}

impl<'a> Events<'a> {
    /// Measurements and the times `at` without one.
    pub(super) fn new(points: &'a Points, at: &[f64]) -> Self {
        let measured = &points.inputs[0];
        if at.is_empty() || at == measured {
            return Self {
                time: Cow::Borrowed(measured),
                target: Cow::Borrowed(&points.targets),
                noise_weights: Cow::Borrowed(&points.noise_weights),
                clock: points.uniform_step(),
            };
        }
        let mut extra: Vec<f64> = at.to_vec();
        extra.sort_by(f64::total_cmp);
        extra.dedup();
        let size = points.len() + extra.len();
        let weighted = !points.noise_weights.is_empty();
        let (mut time, mut target) = (Vec::with_capacity(size), Vec::with_capacity(size));
        let mut noise_weights = Vec::with_capacity(if weighted { size } else { 0 });
        let mut push = |t: f64, y: f64, weight: f64| {
            time.push(t);
            target.push(y);
            if weighted {
                noise_weights.push(weight);
            }
        };
        let mut next = 0;
        for (i, &now) in measured.iter().enumerate() {
            while next < extra.len() && extra[next] < now {
                push(extra[next], f64::NAN, 1.0);
                next += 1;
            }
            if next < extra.len() && extra[next] == now {
                next += 1;
            }
            push(now, points.targets[i], points.noise_weight(i));
        }
        extra[next..].iter().for_each(|&now| push(now, f64::NAN, 1.0));
        let clock = if time.len() == points.len() { points.uniform_step() } else { None };
        Self { time: Cow::Owned(time), target: Cow::Owned(target), noise_weights: Cow::Owned(noise_weights), clock }
    }

    /// Factor on the noise variance of event i.
    #[inline(always)]
    pub(super) fn noise_weight(&self, i: usize) -> f64 {
        self.noise_weights.get(i).copied().unwrap_or(1.0)
    }

    /// Where each of `at` stands; neighbours are looked for near each other.
    fn places(&self, at: &[f64]) -> Vec<usize> {
        let mut last = 0;
        let find = |&t: &f64| {
            let near = |i: usize| self.time[i] >= t && (i == 0 || self.time[i - 1] < t);
            let ahead = last..(last + 3).min(self.time.len());
            last = ahead.into_iter().find(|&i| near(i)).unwrap_or_else(|| self.time.partition_point(|e| *e < t));
            last
        };
        at.iter().map(find).collect()
    }
}

/// What the filter leaves at an event, for unit amplitude.
#[derive(Clone, Copy)]
struct Filtered<const M: usize> {
    /// Before the measurement.
    mean: Vector<M>,
    covariance: Matrix<M>,
    gain: Vector<M>,
    /// Innovation over its variance, and one over its variance; 0 without measurement.
    innovation: f64,
    precision: f64,
}

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
    let mut columns: [&mut [f64]; 4] = [&mut weights, &mut diagonal, &mut [], &mut []];
    if !stretches::smooth::<M, S>(&scaled, &events, Wanted::LeftOut, &mut columns) {
        sweep::<M, S>(&scaled, &events, BLOCK, |i, _, at| {
            (weights[i], diagonal[i]) = (at.weight, at.diagonal);
        })?;
    }
    weights.iter_mut().chain(&mut diagonal).for_each(|w| *w /= scaled.s2);
    Some(LeaveOneOut { weights, diagonal })
}

fn predict<const M: usize, S: Form<M>>(
    hyper: &[f64],
    points: &Points,
    jitter: f64,
    at: &[f64],
    quantities: &[Quantity],
    joint: bool,
) -> Option<Law> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let events = Events::new(points, at);
    let n = events.time.len();
    // Value and then derivative (without the factor to the unit of time) at all events.
    let (mut mean, mut variance) = (vec![0.0; 2 * n], vec![0.0; 2 * n]);
    let (value, derivative) = mean.split_at_mut(n);
    let (value_variance, derivative_variance) = variance.split_at_mut(n);
    let mut columns: [&mut [f64]; 4] = [value, derivative, value_variance, derivative_variance];
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
                columns[c][i] = f.mean[c] + shift;
                columns[2 + c][i] = (0..M).map(|k| p[c][k] * after[k]).sum();
                if joint {
                    left[i][c] = after;
                }
            }
        })?;
        remembered = joint.then_some(Remembered { filtered, left });
    }
    let scale = |q: Quantity| if q == Quantity::Value { 1.0 } else { scaled.lambda };
    let everywhere = at == points.inputs[0] && *quantities == [Quantity::Value, Quantity::Derivative];
    if !everywhere {
        let place = events.places(at);
        let pick = |column: &[f64]| -> Vec<f64> {
            let of = |q: &Quantity| if *q == Quantity::Value { &column[..n] } else { &column[n..] };
            quantities.iter().flat_map(|q| place.iter().map(move |&i| of(q)[i])).collect()
        };
        (mean, variance) = (pick(&mean), pick(&variance));
    }
    for ((mean, variance), &q) in
        mean.chunks_mut(at.len().max(1)).zip(variance.chunks_mut(at.len().max(1))).zip(quantities)
    {
        let (factor, square) = (scale(q), scaled.s2 * scale(q) * scale(q));
        mean.iter_mut().for_each(|m| *m *= factor);
        variance.iter_mut().for_each(|v| *v = (square * *v).max(0.0));
    }
    let finite = all_finite(&mean) && all_finite(&variance);
    let covariance = remembered.map(|r| r.covariance::<S>(&scaled, &events, at, quantities));
    finite.then_some((mean, variance, covariance))
}

/// What the filter left of every event, and what the later measurements leave of the error.
struct Remembered<const M: usize> {
    filtered: Vec<Filtered<M>>,
    left: Vec<[Vector<M>; 2]>,
}

impl<const M: usize> Remembered<M> {
    /// Joint covariance of the quantities at the times `at`.
    fn covariance<S: Form<M>>(
        &self,
        scaled: &Scaled,
        events: &Events,
        at: &[f64],
        quantities: &[Quantity],
    ) -> Mat<f64> {
        // Component of the state and the factor to the unit of time.
        let component = |q: Quantity| if q == Quantity::Value { (0, 1.0) } else { (1, scaled.lambda) };
        let place = events.places(at);
        let size = at.len() * quantities.len();
        let mut out = Mat::zeros(size, size);
        let mut order: Vec<usize> = (0..at.len()).collect();
        order.sort_by_key(|&k| place[k]);
        let mut steps = Steps::<M>::new();
        let transitions: Vec<Matrix<M>> = (0..events.time.len())
            .map(|i| match i {
                0 => [[0.0; M]; M],
                _ => {
                    let place = steps.reach::<S>(scaled.lambda, &events.time, i);
                    steps.at(place).0
                }
            })
            .collect();
        for (qa, &quantity_a) in quantities.iter().enumerate() {
            let (ca, factor_a) = component(quantity_a);
            for (rank, &ka) in order.iter().enumerate() {
                // The row of the covariance carried along the filter's error.
                let mut row = self.filtered[place[ka]].covariance[ca];
                let mut here = place[ka];
                for &kb in &order[rank..] {
                    while here < place[kb] {
                        let f = &self.filtered[here];
                        let first = row[0];
                        let updated: Vector<M> = std::array::from_fn(|k| row[k] - f.gain[k] * first);
                        here += 1;
                        row = times::<M, false>(&transitions[here], &updated);
                    }
                    for (qb, &quantity_b) in quantities.iter().enumerate() {
                        let (cb, factor_b) = component(quantity_b);
                        let left = &self.left[place[kb]][cb];
                        let value: f64 = (0..M).map(|k| row[k] * left[k]).sum();
                        let value = scaled.s2 * factor_a * factor_b * value;
                        let (r, c) = (qa * at.len() + ka, qb * at.len() + kb);
                        (out[(r, c)], out[(c, r)]) = (value, value);
                    }
                }
            }
        }
        out
    }
}

/// Column c of `1 - information P`: what the later measurements leave of the error.
fn remaining<const M: usize>(p: &Matrix<M>, information: &Matrix<M>, c: usize) -> Vector<M> {
    std::array::from_fn(|i| {
        let taken: f64 = (0..M).map(|k| information[i][k] * p[k][c]).sum();
        if i == c { 1.0 - taken } else { -taken }
    })
}
