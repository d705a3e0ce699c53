//! Residuals of a simulator that steps, and their derivatives by finite differences: rollouts of many windows in one go.

use crate::error::{Error, Result};
use crate::model::System;
use crate::refine::blocks::{Block, Point, difference};
use crate::refine::tally::Purpose;
use crate::refine::{Experiment, Free, Job, roll_together};
use nalgebra::{DMatrix, DVector};

/// By how many times more than a smooth model's a value is moved: what the simulator's own solver leaves undone must not count.
const ROUGHER: f64 = 10.0;

/// Share of a reading's noise by which a logged state's start is moved by coarse slopes, and of its typical size at most: nearer
/// than that nothing is known of the start, and a slope over so much does not end at the nearest stop or saturation.
const START: (f64, f64) = (0.5, 0.01);

/// Over how much a start is moved for a derivative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slopes {
    /// As much as is not known of it: the slope of a search, which passes over stops and saturations.
    Coarse,
    /// As little as rounding allows: the derivative.
    Fine,
}

/// A fit's point, and what is rolled out there.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) system: &'a System,
    pub(super) experiment: &'a Experiment,
    pub(super) free: &'a [Free],
}

impl Scene<'_> {
    /// Residuals of every job: (measured - model)/noise, sample by sample; zero where a value is missing.
    pub(super) fn residuals(self, purpose: Purpose, jobs: &[Job]) -> Vec<DVector<f64>> {
        let Self { system, experiment, .. } = self;
        let n_columns = experiment.columns.len();
        let samples = |job: &Job| experiment.windows[job.window].last - experiment.windows[job.window].first + 1;
        let mut all: Vec<DVector<f64>> = jobs.iter().map(|job| DVector::zeros(samples(job) * n_columns)).collect();
        experiment.tally.pass(purpose, jobs.iter().map(samples).sum());
        roll_together(system, experiment, jobs, Some(&experiment.columns), &mut |job, sample, c, value| {
            let window = experiment.windows[jobs[job].window];
            let measured = experiment.logs[window.log].measured[c][sample];
            if measured.is_finite() {
                all[job][(sample - window.first) * n_columns + c] = (measured - value) / experiment.noise[c];
            }
        });
        all
    }

    /// A rollout of a window as `point` has it.
    pub(super) fn job(point: &Point, window: usize) -> Job {
        Job { window, parameters: point.parameters.clone(), initial: point.initial[window].clone() }
    }

    /// Blocks with the residuals at `point`, and with derivatives of zero.
    ///
    /// # Errors
    /// A rollout that leaves all bounds.
    pub(super) fn blocks(self, point: &Point) -> Result<Vec<Block>> {
        let Self { system, experiment, free } = self;
        let (width, n_columns) = (system.n_states() + free.len(), experiment.columns.len());
        let jobs: Vec<Job> = (0..experiment.windows.len()).map(|w| Self::job(point, w)).collect();
        let blocks =
            self.residuals(Purpose::Trials, &jobs).into_iter().zip(&experiment.windows).map(|(residual, window)| {
                let log = &experiment.logs[window.log];
                let at = |row: usize| (row % n_columns, window.first + row / n_columns);
                if let Some(row) = residual.iter().position(|e| !e.is_finite()) {
                    let (c, sample) = at(row);
                    return Err(Error::Diverged {
                        what: format!("the simulator `{}` in run `{}`", system.model().name, log.name),
                        time: log.time[sample],
                        state: system.model().states[experiment.columns[c]].name.clone(),
                        value: residual[row],
                    });
                }
                let present = |row: usize| {
                    let (c, sample) = at(row);
                    log.measured[c][sample].is_finite()
                };
                let rows = residual.len();
                Ok(Block {
                    residual,
                    derivative: DMatrix::zeros(rows, width),
                    present: (0..rows).map(present).collect(),
                })
            });
        blocks.collect()
    }

    /// Derivatives of the `wanted` (window, column), at the point whose residuals the blocks have.
    pub(super) fn differentiate(self, point: &Point, slopes: Slopes, wanted: &[(usize, usize)], blocks: &mut [Block]) {
        let n = self.system.n_states();
        let job = |&(window, column): &(usize, usize)| {
            let mut job = Self::job(point, window);
            match column.checked_sub(n) {
                None => job.initial[column] += self.by(slopes, column),
                Some(place) => job.parameters[self.free[place].parameter] += self.by(slopes, column),
            }
            job
        };
        let moved = self.residuals(Purpose::Derivatives, &wanted.iter().map(job).collect::<Vec<Job>>());
        for (&(window, column), moved) in wanted.iter().zip(moved) {
            let by = self.by(slopes, column);
            let Block { residual, derivative, .. } = &mut blocks[window];
            for (row, (then, now)) in residual.iter().zip(moved.iter()).enumerate() {
                let slope = (then - now) / by;
                derivative[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
            }
        }
    }

    /// All derivatives of these windows.
    pub(super) fn all_of(self, windows: impl Iterator<Item = usize>) -> Vec<(usize, usize)> {
        let width = self.system.n_states() + self.free.len();
        windows.flat_map(|w| (0..width).map(move |column| (w, column))).collect()
    }

    /// By how much the value of a column is moved.
    fn by(self, slopes: Slopes, column: usize) -> f64 {
        let Self { system, experiment, free } = self;
        let n = system.n_states();
        let least = ROUGHER * difference(experiment, n, free, column);
        match experiment.column_of(column).filter(|_| column < n && slopes == Slopes::Coarse) {
            Some(c) => least.max((START.0 * experiment.noise[c]).min(START.1 * experiment.scale[column])),
            None => least,
        }
    }
}
