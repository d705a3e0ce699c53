//! Residuals, their derivatives by finite differences in lanes.

use super::lanes::Lanes;
use super::{Experiment, Free, Job, Starts, roll_together};
use crate::error::{Error, Result};
use crate::model::System;
use nalgebra::{DMatrix, DVector};

/// Share of the typical size by which a value is moved for a finite difference: the root of the
/// rounding error, a compromise between truncation and cancellation.
const DIFFERENCE: f64 = 1e-6;

/// The same for a simulator that steps by itself: what its own solver leaves undone must not count.
const STEPPED_DIFFERENCE: f64 = 1e-5;

/// Share of a reading's noise by which a logged state's start is moved there, and of its typical size at most: nearer than that
/// nothing is known of the start, and a slope over so much does not end at the nearest stop or saturation.
const STEPPED_START: (f64, f64) = (0.5, 0.01);

/// Over how much a start is moved for a derivative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slopes {
    /// As much as is not known of it: the slope of a search, which passes over stops and saturations.
    Coarse,
    /// As little as rounding allows: the derivative.
    Fine,
}

/// Where a search stands: all parameters, and every window's initial state.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) parameters: Vec<f64>,
    pub(crate) initial: Vec<Vec<f64>>,
}

/// One window's residuals and derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// (measured - model)/noise, sample by sample; zero where a value is missing.
    pub(crate) residual: DVector<f64>,
    /// Derivatives of model/noise: initial states first, then the free parameters.
    pub(crate) derivative: DMatrix<f64>,
    /// Whether a value is there.
    pub(crate) present: Vec<bool>,
}

/// Residuals and derivatives of every window.
#[derive(Debug, Clone)]
pub(crate) struct Jacobian {
    pub(crate) blocks: Vec<Block>,
    pub(crate) n_states: usize,
}

/// Sum of the beliefs' squared, scaled distances.
pub(crate) fn prior_cost(parameters: &[f64], free: &[Free]) -> f64 {
    free.iter().filter_map(|f| f.prior.map(|(mean, sd)| ((parameters[f.parameter] - mean) / sd).powi(2))).sum()
}

impl Jacobian {
    pub(crate) fn new(system: &System, experiment: &Experiment, point: &Point, free: &[Free]) -> Result<Self> {
        Self::with_slopes(system, experiment, point, free, Slopes::Fine)
    }

    /// As [`Jacobian::new`], with such slopes where the simulator steps by itself.
    pub(crate) fn with_slopes(
        system: &System,
        experiment: &Experiment,
        point: &Point,
        free: &[Free],
        slopes: Slopes,
    ) -> Result<Self> {
        if system.engine().is_some() {
            return Self::in_lockstep(system, experiment, point, free, slopes);
        }
        if 1 + system.n_states() + free.len() <= 4 {
            Self::with_lanes::<4>(system, experiment, point, free)
        } else {
            Self::with_lanes::<8>(system, experiment, point, free)
        }
    }

    fn with_lanes<const L: usize>(
        system: &System,
        experiment: &Experiment,
        point: &Point,
        free: &[Free],
    ) -> Result<Self> {
        let n = system.n_states();
        let width = n + free.len();
        let mut blocks = empty_blocks(experiment, width);
        // Lane 0 of the first pass is the point itself; every other lane moves one value.
        let mut moved: Vec<Option<usize>> = vec![None];
        moved.extend((0..width).map(Some));
        for (pass, lanes_of) in moved.chunks(L).enumerate() {
            self::pass::<L>(system, experiment, point, free, pass == 0, lanes_of, &mut blocks)?;
        }
        Ok(Self { blocks, n_states: n })
    }

    /// The same where the simulator steps by itself: every window and every moved value in one go.
    fn in_lockstep(
        system: &System,
        experiment: &Experiment,
        point: &Point,
        free: &[Free],
        slopes: Slopes,
    ) -> Result<Self> {
        let n = system.n_states();
        let n_columns = experiment.columns.len();
        let width = n + free.len();
        let mut blocks = empty_blocks(experiment, width);
        let by = |column: usize| {
            let least = STEPPED_DIFFERENCE / DIFFERENCE * difference(experiment, n, free, column);
            match experiment.column_of(column).filter(|_| column < n && slopes == Slopes::Coarse) {
                Some(c) => {
                    least.max((STEPPED_START.0 * experiment.noise[c]).min(STEPPED_START.1 * experiment.scale[column]))
                }
                None => least,
            }
        };
        let mut jobs = Vec::with_capacity(experiment.windows.len() * (1 + width));
        for window in 0..experiment.windows.len() {
            for moved in std::iter::once(None).chain((0..width).map(Some)) {
                let (mut parameters, mut initial) = (point.parameters.clone(), point.initial[window].clone());
                match moved {
                    Some(column) if column < n => initial[column] += by(column),
                    Some(column) => parameters[free[column - n].parameter] += by(column),
                    None => {}
                }
                jobs.push(Job { window, parameters, initial });
            }
        }
        let mut diverged = None;
        roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut |job, sample, c, value| {
            let (w, moved) = (job / (1 + width), job % (1 + width));
            let window = experiment.windows[w];
            let log = &experiment.logs[window.log];
            let measured = log.measured[c][sample];
            if !measured.is_finite() {
                return;
            }
            let row = (sample - window.first) * n_columns + c;
            let scaled = value / experiment.noise[c];
            let block = &mut blocks[w];
            if moved == 0 {
                block.residual[row] = measured / experiment.noise[c] - scaled;
                block.present[row] = true;
                if !value.is_finite() && diverged.is_none() {
                    diverged = Some((log.name.clone(), log.time[sample], experiment.columns[c], value));
                }
            } else {
                // Outputs for now; a job's own point may come after it.
                block.derivative[(row, moved - 1)] = scaled;
            }
        });
        if let Some((run, time, state, value)) = diverged {
            return Err(Error::Diverged {
                what: format!("the simulator `{}` in run `{run}`", system.model().name),
                time,
                state: system.model().states[state].name.clone(),
                value,
            });
        }
        for (block, window) in blocks.iter_mut().zip(&experiment.windows) {
            let log = &experiment.logs[window.log];
            for row in (0..block.residual.len()).filter(|&row| block.present[row]) {
                let c = row % n_columns;
                let base = log.measured[c][window.first + row / n_columns] / experiment.noise[c] - block.residual[row];
                for column in 0..width {
                    let slope = (block.derivative[(row, column)] - base) / by(column);
                    block.derivative[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
                }
            }
        }
        Ok(Self { blocks, n_states: n })
    }

    /// Sum of squares with the beliefs' terms.
    pub(crate) fn cost(&self, experiment: &Experiment, point: &Point, free: &[Free]) -> f64 {
        let Starts { samples, more } = experiment.starts;
        let first = |b: &Block| b.residual.iter().take(samples * experiment.columns.len()).map(|e| e * e).sum::<f64>();
        let squares = self.blocks.iter().map(|b| b.residual.norm_squared() + more * first(b)).sum::<f64>();
        squares + prior_cost(&point.parameters, free)
    }

    /// Residuals with NaN for what is missing.
    pub(crate) fn residuals(&self) -> Vec<Vec<f64>> {
        self.blocks
            .iter()
            .map(|b| b.residual.iter().zip(&b.present).map(|(&e, &there)| if there { e } else { f64::NAN }).collect())
            .collect()
    }
}

fn empty_blocks(experiment: &Experiment, width: usize) -> Vec<Block> {
    let empty = |w: &super::Window| {
        let rows = (w.last - w.first + 1) * experiment.columns.len();
        Block { residual: DVector::zeros(rows), derivative: DMatrix::zeros(rows, width), present: vec![false; rows] }
    };
    experiment.windows.iter().map(empty).collect()
}

/// Step of the finite difference of column `column`.
fn difference(experiment: &Experiment, n_states: usize, free: &[Free], column: usize) -> f64 {
    DIFFERENCE * if column < n_states { experiment.scale[column] } else { free[column - n_states].scale }
}

fn pass<const L: usize>(
    system: &System,
    experiment: &Experiment,
    point: &Point,
    free: &[Free],
    is_first: bool,
    lanes_of: &[Option<usize>],
    blocks: &mut [Block],
) -> Result<()> {
    let n = system.n_states();
    let n_columns = experiment.columns.len();
    let mut parameters: Vec<[f64; L]> = point.parameters.iter().map(|&v| [v; L]).collect();
    for (lane, column) in lanes_of.iter().enumerate() {
        if let Some(column) = column.filter(|&c| c >= n) {
            parameters[free[column - n].parameter][lane] += difference(experiment, n, free, column);
        }
    }
    let mut diverged = None;
    for (log_index, log) in experiment.logs.iter().enumerate() {
        let mut lanes = Lanes::<L>::new(system, log, (experiment.hold, experiment.past), &parameters);
        for (w, window) in experiment.windows.iter().enumerate().filter(|(_, w)| w.log == log_index) {
            let mut initial: Vec<[f64; L]> = point.initial[w].iter().map(|&v| [v; L]).collect();
            for (lane, column) in lanes_of.iter().enumerate() {
                if let Some(column) = column.filter(|&c| c < n) {
                    initial[column][lane] += difference(experiment, n, free, column);
                }
            }
            let block = &mut blocks[w];
            lanes.roll((window.first, window.last), &initial, &experiment.columns, experiment.substeps, |i, c, v| {
                let measured = log.measured[c][i];
                if !measured.is_finite() {
                    return;
                }
                let row = (i - window.first) * n_columns + c;
                let noise = experiment.noise[c];
                if is_first {
                    block.residual[row] = (measured - v[0]) / noise;
                    block.present[row] = true;
                    if !v[0].is_finite() && diverged.is_none() {
                        diverged = Some((log.name.clone(), log.time[i], experiment.columns[c], v[0]));
                    }
                }
                // The point's own output, once its residual is known.
                let base = measured - block.residual[row] * noise;
                for (lane, column) in lanes_of.iter().enumerate() {
                    if let Some(column) = *column {
                        let slope = (v[lane] - base) / (noise * difference(experiment, n, free, column));
                        block.derivative[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
                    }
                }
            });
        }
    }
    match diverged {
        None => Ok(()),
        Some((run, time, state, value)) => Err(Error::Diverged {
            what: format!("the model `{}` in run `{run}`", system.model().name),
            time,
            state: system.model().states[state].name.clone(),
            value,
        }),
    }
}

/// Costs of several points; infinite where the model diverges.
pub(crate) fn costs(system: &System, experiment: &Experiment, points: &[Point], free: &[Free]) -> Vec<f64> {
    let columns = experiment.columns.len();
    let mut sums = vec![0.0; points.len()];
    misses(system, experiment, points, |point, _, row, missed| {
        sums[point] += experiment.starts.weight(row / columns) * (missed * missed);
    });
    let all = sums.iter().zip(points).map(|(sum, point)| sum + prior_cost(&point.parameters, free));
    all.map(|cost| if cost.is_finite() { cost } else { f64::INFINITY }).collect()
}

/// Costs of several points, where every window of a point starts as it does or as it does in `old`, whichever suits it:
/// windows do not know of each other, and one that a step drives over a stop need not hold up all others. The points with the
/// starts that were taken, and their costs.
pub(crate) fn costs_by_window(
    system: &System,
    experiment: &Experiment,
    points: Vec<Point>,
    old: &Point,
    free: &[Free],
) -> (Vec<Point>, Vec<f64>) {
    let columns = experiment.columns.len();
    let still = points.iter().map(|p| Point { parameters: p.parameters.clone(), initial: old.initial.clone() });
    let mut all: Vec<Point> = points.iter().cloned().chain(still).collect();
    let mut sums = vec![vec![0.0; experiment.windows.len()]; all.len()];
    misses(system, experiment, &all, |point, window, row, missed| {
        sums[point][window] += experiment.starts.weight(row / columns) * (missed * missed);
    });
    all.truncate(points.len());
    let mut costs = Vec::with_capacity(all.len());
    for (k, point) in all.iter_mut().enumerate() {
        let mut cost = prior_cost(&point.parameters, free);
        // Where the parameters stay, every other step's start is as good a choice.
        let rivals: Vec<usize> = if free.is_empty() { (0..sums.len()).collect() } else { vec![k, k + points.len()] };
        for (w, start) in point.initial.iter_mut().enumerate() {
            let own = |r: &usize| if sums[*r][w].is_finite() { sums[*r][w] } else { f64::INFINITY };
            let best = rivals.iter().copied().min_by(|a, b| own(a).total_cmp(&own(b))).unwrap_or(k);
            let from = if best < points.len() { &points[best] } else { old };
            start.clone_from(&from.initial[w]);
            cost += own(&best);
        }
        costs.push(cost);
    }
    (all, costs)
}

/// Residuals of several points: `receive(point, window, row, (measured - model)/noise)`, rows as those of a [`Block`].
pub(crate) fn misses(
    system: &System,
    experiment: &Experiment,
    points: &[Point],
    mut receive: impl FnMut(usize, usize, usize, f64),
) {
    const L: usize = 4;
    if system.engine().is_some() {
        return misses_in_lockstep(system, experiment, points, &mut receive);
    }
    let n_columns = experiment.columns.len();
    for (number, chunk) in points.chunks(L).enumerate() {
        let lane_point = |lane: usize| &chunk[lane.min(chunk.len() - 1)];
        let parameters: Vec<[f64; L]> =
            (0..system.n_parameters()).map(|p| std::array::from_fn(|lane| lane_point(lane).parameters[p])).collect();
        for (log_index, log) in experiment.logs.iter().enumerate() {
            let mut lanes = Lanes::<L>::new(system, log, (experiment.hold, experiment.past), &parameters);
            for (w, window) in experiment.windows.iter().enumerate().filter(|(_, w)| w.log == log_index) {
                let initial: Vec<[f64; L]> = (0..system.n_states())
                    .map(|j| std::array::from_fn(|lane| lane_point(lane).initial[w][j]))
                    .collect();
                lanes.roll(
                    (window.first, window.last),
                    &initial,
                    &experiment.columns,
                    experiment.substeps,
                    |i, c, v| {
                        let measured = log.measured[c][i];
                        if measured.is_finite() {
                            let row = (i - window.first) * n_columns + c;
                            for lane in 0..chunk.len() {
                                receive(number * L + lane, w, row, (measured - v[lane]) / experiment.noise[c]);
                            }
                        }
                    },
                );
            }
        }
    }
}

/// The same where the simulator steps by itself.
fn misses_in_lockstep(
    system: &System,
    experiment: &Experiment,
    points: &[Point],
    receive: &mut impl FnMut(usize, usize, usize, f64),
) {
    let job = |window: usize, point: &Point| Job {
        window,
        parameters: point.parameters.clone(),
        initial: point.initial[window].clone(),
    };
    let windows = 0..experiment.windows.len();
    let jobs: Vec<Job> = windows.flat_map(|w| points.iter().map(move |point| job(w, point))).collect();
    roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut |job, sample, c, value| {
        let (w, point) = (job / points.len(), job % points.len());
        let window = experiment.windows[w];
        let measured = experiment.logs[window.log].measured[c][sample];
        if measured.is_finite() {
            let row = (sample - window.first) * experiment.columns.len() + c;
            receive(point, w, row, (measured - value) / experiment.noise[c]);
        }
    });
}
