//! How much of the preceding series a segment must include until its filter has forgotten the start, and a check of it.
//!
//! Source: Anderson & Moore 1979, Optimal Filtering, section 4.4.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::events::Events;
use super::matern::{Form, Matrix, Vector};
use super::scaled::{Scaled, sandwich};
use super::steps::Step;

/// Stretches side by side.
pub(super) const LANES: usize = 4;
/// Points of a stretch, where its overlaps do not ask for more: the records of four stay near the processor.
const LENGTH: usize = 1024;
/// Series of fewer points are left to the serial way.
const FEWEST: usize = 512;
/// Steps in which the filter must have forgotten its start.
const LONGEST_MEMORY: usize = 4096;
/// Relative change of covariances in eight steps that is rounding.
const STEADY: f64 = 1e-13;

/// Relative difference of two stretches, where they meet, that is rounding.
pub(super) const AGREE: f64 = 1e-11;

/// Where stretches begin, and how far they overlap.
pub(super) struct Plan {
    /// Points of a stretch.
    pub(super) length: usize,
    /// Points that a stretch is entered early, at least ...
    pub(super) early: usize,
    /// ... and the same in time.
    pub(super) span: f64,
}

impl Plan {
    pub(super) fn new<const M: usize, S: Form<M>>(scaled: &Scaled, events: &Events) -> Option<Self> {
        let n = events.time.len();
        if n < FEWEST {
            return None;
        }
        let step = (events.time[n - 1] - events.time[0]) / (n - 1) as f64;
        // Covariances forget with the square of what means do.
        let early = 2 * memory::<M, S>(scaled, step)?;
        let rows = n.div_ceil(LANES * LENGTH.max(6 * early));
        let length = n.div_ceil(LANES * rows);
        (length >= 2 * early).then_some(Self { length, early, span: early as f64 * step })
    }

    /// Points by which the four stretches from `first` on are entered early and left late.
    pub(super) fn overlap(&self, time: &[f64], first: usize) -> usize {
        let mut overlap = self.early;
        for border in (0..=LANES).map(|l| first + l * self.length).filter(|b| *b < time.len()) {
            let before = time.partition_point(|t| *t < time[border] - self.span);
            let after = time.partition_point(|t| *t <= time[border] + self.span);
            overlap = overlap.max(border - before).max(after - border);
        }
        overlap
    }
}

/// Steps after which the covariance of a filter on a clock no longer changes.
fn memory<const M: usize, S: Form<M>>(scaled: &Scaled, step: f64) -> Option<usize> {
    let mut one = Step::<M>::new();
    one.set::<S>(scaled.lambda, step);
    let own = scaled.rho + scaled.jitter;
    let (mut p, mut before) = (S::STATIONARY, S::STATIONARY);
    for k in 1..=LONGEST_MEMORY {
        let inverse = 1.0 / (p[0][0] + own);
        let column: Vector<M> = std::array::from_fn(|i| p[i][0]);
        for i in 0..M {
            for j in 0..M {
                p[i][j] = if i * j == 0 { p[i][j] * own * inverse } else { p[i][j] - column[i] * column[j] * inverse };
            }
        }
        p = sandwich::<M, false>(&one.transition, &p);
        p.iter_mut().flatten().zip(one.noise.iter().flatten()).for_each(|(p, q)| *p += q);
        if k % 8 == 0 {
            if (0..M).all(|i| (p[i][i] - before[i][i]).abs() <= STEADY * p[i][i]) {
                return Some(k);
            }
            before = p;
        }
    }
    None
}

/// All that two stretches must agree on where they meet.
pub(super) struct Border<const M: usize> {
    pub(super) mean: Vector<M>,
    pub(super) covariance: Matrix<M>,
    pub(super) adjoint: Vector<M>,
    pub(super) information: Matrix<M>,
}

impl<const M: usize> Border<M> {
    pub(super) fn agrees(&self, other: &Self) -> bool {
        let scale: Vector<M> = std::array::from_fn(|i| self.covariance[i][i].sqrt());
        (0..M).all(|i| {
            let moved = (self.mean[i] - other.mean[i]).abs();
            let pulled = (self.adjoint[i] - other.adjoint[i]).abs() * scale[i];
            moved <= AGREE * (scale[i] + self.mean[i].abs())
                && pulled <= AGREE * (1.0 + self.adjoint[i].abs() * scale[i])
                && (0..M).all(|j| {
                    let spread = (self.covariance[i][j] - other.covariance[i][j]).abs();
                    let stated = (self.information[i][j] - other.information[i][j]).abs();
                    let each = scale[i] * scale[j];
                    spread <= AGREE * each && stated * each <= AGREE * (1.0 + self.information[i][j].abs() * each)
                })
        })
    }
}
