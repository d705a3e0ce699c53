//! Joint posterior covariance of many times in the state-space form: the filter's error is carried from each time to the
//! later ones, and what the measurements after those leave of it is taken there.
//!
//! Source: de Jong & Mackinnon 1988, Covariances for smoothed estimates in state space models.

use super::events::Events;
use super::matern::{Form, Matrix, Vector};
use super::posterior::Quantity;
use super::state_smoother::Filtered;
use super::state_space::{Scaled, times};
use super::steps::Steps;
use faer::Mat;

/// What the filter left of every event, and what the later measurements leave of the error.
pub(super) struct Remembered<const M: usize> {
    pub(super) filtered: Vec<Filtered<M>>,
    pub(super) left: Vec<[Vector<M>; 2]>,
}

impl<const M: usize> Remembered<M> {
    /// Joint covariance of the quantities at the times `at`.
    pub(super) fn covariance<S: Form<M>>(
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
