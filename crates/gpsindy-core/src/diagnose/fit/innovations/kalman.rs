//! Kalman's filter and the smoother of Rauch, Tung and Striebel along a path of a simulator that steps.

use crate::diagnose::fit::guide::whiten;
use crate::diagnose::limits::innovations::LEAST_PUSH;
use crate::model::System;
use crate::refine::{Block, Experiment, Guided};
use nalgebra::{Cholesky, DMatrix, DVector};
use std::sync::Arc;

/// A Kalman filter of the simulator's states, each in units of its typical size; readings in units of their noise.
pub(super) struct Filter {
    scale: DVector<f64>,
    /// State and slope of each column; none where it does not show a state as it is.
    columns: Vec<Option<(usize, f64)>>,
    /// Variance by which a push at random moves each state from one sample to the next.
    pushes: DVector<f64>,
    /// The same below which a push counts as this.
    least: DVector<f64>,
}

/// One sample of a pass, the states as differences from the path.
pub(super) struct Sample {
    /// Before the readings (one for all later samples), and after them.
    expected: DVector<f64>,
    spread_before: DMatrix<f64>,
    pub(super) state: DVector<f64>,
    spread: DMatrix<f64>,
    gain: DMatrix<f64>,
    /// Variance of the innovations.
    variance: DMatrix<f64>,
    /// To the next sample: the derivative, and by how much the path's own next state is missed.
    transition: DMatrix<f64>,
    missed: DVector<f64>,
}

impl Filter {
    pub(super) fn new(system: &System, experiment: &Experiment) -> Option<Self> {
        let n = system.simulator()?.n_states();
        let scale = DVector::from_iterator(n, experiment.scale.iter().take(n).map(|s| s.max(f64::MIN_POSITIVE)));
        let column = |(c, &j): (usize, &usize)| shows(system, j).then(|| (j, scale[j] / experiment.noise[c]));
        let columns: Vec<Option<(usize, f64)>> = experiment.columns.iter().enumerate().map(column).collect();
        let noise = |j: usize| columns.iter().flatten().find(|(i, _)| *i == j).map_or(1.0, |(_, slope)| 1.0 / slope);
        let least = DVector::from_fn(n, |j, _| (LEAST_PUSH * noise(j)).powi(2));
        let pushes = DVector::from_fn(n, |j, _| noise(j).powi(2));
        Some(Self { scale, columns, pushes, least })
    }

    /// Adds a difference from the path, in units of the filter, to a state.
    pub(super) fn put(&self, moved: &DVector<f64>, state: &mut [f64]) {
        state.iter_mut().zip(moved.iter().zip(&self.scale)).for_each(|(x, (moved, scale))| *x += moved * scale);
    }

    /// The gain of a sample in the units of states and readings.
    pub(super) fn gain(&self, sample: &Sample, noise: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(self.scale.len(), noise.len(), |j, c| sample.gain[(j, c)] * self.scale[j] / noise[c])
    }

    /// Filters all windows along a path.
    pub(super) fn passes(&self, guided: &Guided, experiment: &Experiment) -> Option<Vec<Vec<Sample>>> {
        (0..experiment.windows.len()).map(|window| self.pass(guided, experiment, window)).collect()
    }

    fn pass(&self, guided: &Guided, experiment: &Experiment, number: usize) -> Option<Vec<Sample>> {
        let (n, c) = (self.scale.len(), self.columns.len());
        let window = experiment.windows[number];
        let log = &experiment.logs[window.log];
        let path = guided.path(number);
        let mut expected = DVector::zeros(n);
        let mut spread = DMatrix::from_diagonal(&DVector::from_fn(n, |j, _| {
            self.columns.iter().flatten().find(|(i, _)| *i == j).map_or(1.0, |(_, slope)| slope.powi(-2))
        }));
        let mut samples = Vec::with_capacity(path.len());
        for (k, at) in path.iter().enumerate() {
            let mut slopes = DMatrix::zeros(c, n);
            let mut innovation = DVector::zeros(c);
            for (column, shown) in self.columns.iter().enumerate() {
                let reading = log.measured[column][window.first + k];
                if let Some((j, slope)) = shown.filter(|_| reading.is_finite()) {
                    slopes[(column, j)] = slope;
                    innovation[column] = (reading - at[j]) / experiment.noise[column] - slope * expected[j];
                }
            }
            let variance = &slopes * &spread * slopes.transpose() + DMatrix::identity(c, c);
            let inverse = Cholesky::new(variance.clone())?.inverse();
            let gain = &spread * slopes.transpose() * inverse;
            let state = &expected + &gain * innovation;
            let mut after = &spread - &gain * &slopes * &spread;
            after = 0.5 * (&after + after.transpose());
            let (missed, transition) = if k + 1 < path.len() {
                let (next, transition) = guided.transition(number, k)?;
                let in_units = DMatrix::from_fn(n, n, |i, j| transition[(i, j)] * self.scale[j] / self.scale[i]);
                (DVector::from_fn(n, |j, _| (next[j] - path[k + 1][j]) / self.scale[j]), in_units)
            } else {
                (DVector::zeros(n), DMatrix::identity(n, n))
            };
            let next = &missed + &transition * &state;
            let mut before = &transition * &after * transition.transpose();
            (0..n).for_each(|j| before[(j, j)] += self.pushes[j]);
            if !next.iter().all(|v| v.is_finite()) {
                return None;
            }
            samples.push(Sample {
                expected: std::mem::replace(&mut expected, next),
                spread_before: std::mem::replace(&mut spread, before),
                state,
                spread: after,
                gain,
                variance,
                transition,
                missed,
            });
        }
        Some(samples)
    }

    /// One round of expectation maximisation: the pushes as large as the smoothed states say.
    pub(super) fn expect(&mut self, guided: &Guided, experiment: &Experiment) -> Option<()> {
        let n = self.scale.len();
        let mut squares: DVector<f64> = DVector::zeros(n);
        let mut count = 0.0;
        for number in 0..experiment.windows.len() {
            let samples = self.pass(guided, experiment, number)?;
            let Some(last) = samples.last() else { continue };
            let (mut later, mut later_spread) = (last.state.clone(), last.spread.clone());
            for pair in samples.windows(2).rev() {
                let (now, next) = (&pair[0], &pair[1]);
                let inverse = Cholesky::new(next.spread_before.clone())?.inverse();
                let back = &now.spread * now.transition.transpose() * inverse;
                let state = &now.state + &back * (&later - &next.expected);
                let spread = &now.spread + &back * (&later_spread - &next.spread_before) * back.transpose();
                let push = &later - &now.missed - &now.transition * &state;
                let between = &later_spread * back.transpose();
                let carried = &now.transition * between.transpose();
                let own = &now.transition * &spread * now.transition.transpose();
                for j in 0..n {
                    squares[j] += push[j] * push[j] + later_spread[(j, j)] - 2.0 * carried[(j, j)] + own[(j, j)];
                }
                count += 1.0;
                (later, later_spread) = (state, spread);
            }
        }
        if count > 0.0 {
            self.pushes = DVector::from_fn(n, |j, _| (squares[j] / count).max(self.least[j]));
        }
        self.pushes.iter().all(|v| v.is_finite()).then_some(())
    }

    /// By what the innovations become white and of unit size.
    pub(super) fn whitening(&self, passes: &[Vec<Sample>], blocks: &[Block]) -> Vec<Arc<Vec<DMatrix<f64>>>> {
        let c = self.columns.len();
        // A column that does not show a state as it is was not filtered: its innovations are as large as they are.
        let own = |column: usize| {
            let values = blocks.iter().flat_map(|b| b.residual.iter().skip(column).step_by(c));
            let present = blocks.iter().flat_map(|b| b.present.iter().skip(column).step_by(c)).filter(|p| **p).count();
            values.map(|v| v * v).sum::<f64>() / present.max(1) as f64
        };
        let unseen: Vec<Option<f64>> = self
            .columns
            .iter()
            .enumerate()
            .map(|(column, shown)| shown.is_none().then(|| own(column).max(1.0)))
            .collect();
        let factor = |sample: &Sample| {
            let mut variance = sample.variance.clone();
            unseen.iter().enumerate().for_each(|(column, own)| {
                if let Some(own) = own {
                    variance[(column, column)] = *own;
                }
            });
            let identity = DMatrix::identity(c, c);
            Cholesky::new(variance).and_then(|root| root.l().solve_lower_triangular(&identity)).unwrap_or(identity)
        };
        let mut all: Vec<Vec<DMatrix<f64>>> = passes.iter().map(|pass| pass.iter().map(factor).collect()).collect();
        let (mut squares, mut count) = (0.0, 0);
        for (by_sample, block) in all.iter().zip(blocks) {
            let mut values = block.residual.clone();
            whiten(by_sample, &mut values);
            squares += values.norm_squared();
            count += block.present.iter().filter(|present| **present).count();
        }
        let level = (squares / count.max(1) as f64).max(f64::MIN_POSITIVE).sqrt();
        all.iter_mut().flatten().for_each(|by| *by /= level);
        all.into_iter().map(Arc::new).collect()
    }
}

/// Whether what is read of a state of the simulator is the state itself.
pub(super) fn shows(system: &System, state: usize) -> bool {
    let own = system.simulator().map_or(0, |s| s.n_states());
    state < own && system.outputs().bare_variable(state) == Some(state)
}
