//! Joint posterior covariance of many times in the state-space form: the filter's error is carried from each time to the
//! later ones, and what the measurements after those leave of it is taken there.
//!
//! Source: de Jong & Mackinnon 1988, Covariances for smoothed estimates in state space models.

use super::events::Events;
use super::filtered::Filtered;
use super::matern::{Form, Matrix, Vector};
use super::scaled::{Scaled, times};
use super::steps::Steps;
use crate::gp::quantity::Quantity;
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
        let transitions = transitions::<M, S>(scaled, events);
        for (qa, &quantity_a) in quantities.iter().enumerate() {
            let (ca, factor_a) = component(quantity_a);
            for (rank, &ka) in order.iter().enumerate() {
                // The row of the covariance carried along the filter's error.
                let mut row = self.filtered[place[ka]].covariance[ca];
                let mut here = place[ka];
                for &kb in &order[rank..] {
                    while here < place[kb] {
                        row = self.carried(row, here, &transitions);
                        here += 1;
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
    /// Covariances of the value at each of the ascending times `at` with the values at the next `W` of them; 0 beyond the last.
    pub(super) fn band<S: Form<M>, const W: usize>(
        &self,
        scaled: &Scaled,
        events: &Events,
        at: &[f64],
    ) -> Vec<[f64; W]> {
        let place = events.places(at);
        let transitions = transitions::<M, S>(scaled, events);
        let of = |i: usize| {
            let (mut row, mut here) = (self.filtered[place[i]].covariance[0], place[i]);
            let mut out = [0.0; W];
            for (value, &there) in out.iter_mut().zip(&place[i + 1..]) {
                while here < there {
                    row = self.carried(row, here, &transitions);
                    here += 1;
                }
                *value = scaled.s2 * (0..M).map(|k| row[k] * self.left[there][0][k]).sum::<f64>();
            }
            out
        };
        (0..at.len()).map(of).collect()
    }

    /// A row of the filter's covariance after the measurement at event `here`, carried to the next event.
    fn carried(&self, row: Vector<M>, here: usize, transitions: &[Matrix<M>]) -> Vector<M> {
        let gain = &self.filtered[here].gain;
        let updated: Vector<M> = std::array::from_fn(|k| row[k] - gain[k] * row[0]);
        times::<M, false>(&transitions[here + 1], &updated)
    }
}

/// Transition from the event before to each event; of the first there is none.
fn transitions<const M: usize, S: Form<M>>(scaled: &Scaled, events: &Events) -> Vec<Matrix<M>> {
    let mut steps = Steps::<M>::new();
    let mut to = |i: usize| match i {
        0 => [[0.0; M]; M],
        _ => {
            let place = steps.reach::<S>(scaled.lambda, &events.time, i);
            steps.at(place).0
        }
    };
    (0..events.time.len()).map(&mut to).collect()
}
