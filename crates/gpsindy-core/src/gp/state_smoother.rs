//! Posterior and leave-one-out quantities of the Matern kernels in O(n): a Kalman filter forwards,
//! an adjoint pass backwards, no inverses.
//!
//! Source: Bryson & Frazier 1963; de Jong & Mackinnon 1988, Covariances for smoothed estimates in
//! state space models.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::kernel::Kernel;
use super::likelihood::LeaveOneOut;
use super::points::Points;
use super::posterior::Quantity;
use super::state_space::{FiveHalves, Form, Half, Matrix, Scaled, Step, ThreeHalves, Vector, sandwich, times};
use faer::Mat;

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

/// A time, with a measurement (target, noise weight) or without.
#[derive(Clone, Copy)]
struct Event {
    time: f64,
    measured: Option<(f64, f64)>,
}

/// What the filter leaves at an event, for unit amplitude.
#[derive(Clone, Copy)]
struct Filtered<const M: usize> {
    /// Step from the event before.
    transition: Matrix<M>,
    /// Before the measurement.
    mean: Vector<M>,
    covariance: Matrix<M>,
    gain: Vector<M>,
    /// Innovation over its variance, and one over its variance; 0 without measurement.
    innovation: f64,
    precision: f64,
}

/// Adjoint of the state before the measurement, and the measurement's row of `K^-1`.
#[derive(Clone, Copy)]
struct Adjoint<const M: usize> {
    mean: Vector<M>,
    information: Matrix<M>,
    weight: f64,
    diagonal: f64,
}

fn forward<const M: usize, S: Form<M>>(scaled: &Scaled, events: &[Event]) -> Option<Vec<Filtered<M>>> {
    let mut mean = [0.0; M];
    let mut covariance = S::STATIONARY;
    let mut step = Step::<M>::new();
    let mut out = Vec::with_capacity(events.len());
    for (i, event) in events.iter().enumerate() {
        if i > 0 {
            step.set::<S>(scaled.lambda, event.time - events[i - 1].time);
            mean = times(&step.transition, &mean);
            covariance = sandwich(&step.transition, &covariance);
            for (row, noise) in covariance.iter_mut().zip(&step.noise) {
                row.iter_mut().zip(noise).for_each(|(p, q)| *p += q);
            }
        }
        let mut filtered =
            Filtered { transition: step.transition, mean, covariance, gain: [0.0; M], innovation: 0.0, precision: 0.0 };
        if let Some((target, weight)) = event.measured {
            let v = covariance[0][0] + scaled.rho * weight + scaled.jitter;
            if v.is_nan() || v <= 0.0 {
                return None;
            }
            let gain: Vector<M> = std::array::from_fn(|k| covariance[k][0] / v);
            let e = target - mean[0];
            filtered.gain = gain;
            filtered.innovation = e / v;
            filtered.precision = 1.0 / v;
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
    Some(out)
}

fn backward<const M: usize>(filtered: &[Filtered<M>]) -> Vec<Adjoint<M>> {
    let zero = Adjoint { mean: [0.0; M], information: [[0.0; M]; M], weight: 0.0, diagonal: 0.0 };
    let mut out = vec![zero; filtered.len()];
    let (mut mean, mut information) = ([0.0; M], [[0.0; M]; M]);
    for (i, f) in filtered.iter().enumerate().rev() {
        // mean and information are those after the measurement here.
        if f.precision > 0.0 {
            let along: f64 = (0..M).map(|k| f.gain[k] * mean[k]).sum();
            let turned = times(&information, &f.gain);
            let spread: f64 = (0..M).map(|k| f.gain[k] * turned[k]).sum();
            out[i].weight = f.innovation - along;
            out[i].diagonal = f.precision + spread;
            // (1 - h K') information (1 - K h') + h h'/v with h = (1, 0, ..).
            mean[0] += out[i].weight;
            for k in 0..M {
                information[0][k] -= turned[k];
                information[k][0] -= turned[k];
            }
            information[0][0] += spread + f.precision;
        }
        out[i].mean = mean;
        out[i].information = information;
        if i > 0 {
            let transposed = transpose(&f.transition);
            mean = times(&transposed, &mean);
            information = sandwich(&transposed, &information);
        }
    }
    out
}

fn transpose<const M: usize>(a: &Matrix<M>) -> Matrix<M> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn left_out<const M: usize, S: Form<M>>(hyper: &[f64], points: &Points, jitter: f64) -> Option<LeaveOneOut> {
    let scaled = Scaled::new(hyper, S::RATE, jitter)?;
    let filtered = forward::<M, S>(&scaled, &events(points, &[]))?;
    let adjoint = backward(&filtered);
    let weights = adjoint.iter().map(|a| a.weight / scaled.s2).collect();
    let diagonal = adjoint.iter().map(|a| a.diagonal / scaled.s2).collect();
    Some(LeaveOneOut { weights, diagonal })
}

/// Measurements and the times without one, in order.
fn events(points: &Points, at: &[f64]) -> Vec<Event> {
    let mut extra: Vec<f64> = at.to_vec();
    extra.sort_by(f64::total_cmp);
    extra.dedup();
    let mut out = Vec::with_capacity(points.len() + extra.len());
    let mut next = 0;
    for i in 0..points.len() {
        let time = points.inputs[0][i];
        while next < extra.len() && extra[next] < time {
            out.push(Event { time: extra[next], measured: None });
            next += 1;
        }
        if next < extra.len() && extra[next] == time {
            next += 1;
        }
        out.push(Event { time, measured: Some((points.targets[i], points.noise_weight(i))) });
    }
    out.extend(extra[next..].iter().map(|&time| Event { time, measured: None }));
    out
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
    let events = events(points, at);
    let filtered = forward::<M, S>(&scaled, &events)?;
    let adjoint = backward(&filtered);
    // Component of the state and the factor to the unit of time.
    let component = |q: Quantity| if q == Quantity::Value { (0, 1.0) } else { (1, scaled.lambda) };
    let place: Vec<usize> = at.iter().map(|t| events.partition_point(|e| e.time < *t)).collect();
    let size = at.len() * quantities.len();
    let (mut mean, mut variance) = (Vec::with_capacity(size), Vec::with_capacity(size));
    for &q in quantities {
        let (c, factor) = component(q);
        for &i in &place {
            let (p, a) = (&filtered[i].covariance, &adjoint[i]);
            let shift: f64 = (0..M).map(|k| p[c][k] * a.mean[k]).sum();
            mean.push(factor * (filtered[i].mean[c] + shift));
            let after = remaining(p, &a.information, c);
            let own: f64 = (0..M).map(|k| p[c][k] * after[k]).sum();
            variance.push((scaled.s2 * factor * factor * own).max(0.0));
        }
    }
    let covariance = joint.then(|| {
        let mut out = Mat::zeros(size, size);
        let columns: Vec<Vec<Vector<M>>> = quantities
            .iter()
            .map(|&q| {
                place
                    .iter()
                    .map(|&j| remaining(&filtered[j].covariance, &adjoint[j].information, component(q).0))
                    .collect()
            })
            .collect();
        let mut order: Vec<usize> = (0..at.len()).collect();
        order.sort_by_key(|&k| place[k]);
        for (qa, &quantity_a) in quantities.iter().enumerate() {
            let (ca, factor_a) = component(quantity_a);
            for (rank, &ka) in order.iter().enumerate() {
                // The row of the covariance carried along the filter's error.
                let mut row = filtered[place[ka]].covariance[ca];
                let mut here = place[ka];
                for &kb in &order[rank..] {
                    while here < place[kb] {
                        let f = &filtered[here];
                        let first = row[0];
                        let updated: Vector<M> = std::array::from_fn(|k| row[k] - f.gain[k] * first);
                        here += 1;
                        row = times(&filtered[here].transition, &updated);
                    }
                    for (qb, &quantity_b) in quantities.iter().enumerate() {
                        let value: f64 = (0..M).map(|k| row[k] * columns[qb][kb][k]).sum();
                        let value = scaled.s2 * factor_a * component(quantity_b).1 * value;
                        let (r, c) = (qa * at.len() + ka, qb * at.len() + kb);
                        (out[(r, c)], out[(c, r)]) = (value, value);
                    }
                }
            }
        }
        out
    });
    (mean.iter().chain(&variance).all(|v| v.is_finite())).then_some((mean, variance, covariance))
}

/// Column c of `1 - information P`: what the later measurements leave of the error.
fn remaining<const M: usize>(p: &Matrix<M>, information: &Matrix<M>, c: usize) -> Vector<M> {
    std::array::from_fn(|i| {
        let taken: f64 = (0..M).map(|k| information[i][k] * p[k][c]).sum();
        if i == c { 1.0 - taken } else { -taken }
    })
}
