//! Residuals, their derivatives by finite differences in lanes.

pub(crate) use super::blocks::{Block, Jacobian, Point, prior_cost};

use super::blocks::difference;
use super::lanes::Lanes;
use super::tally::Purpose;
use super::{Experiment, Free, Job, Kept, Tangent, roll_together};
use crate::error::{Error, Result};
use crate::model::System;
use nalgebra::{DMatrix, DVector};

impl Jacobian {
    pub(crate) fn new(system: &System, experiment: &Experiment, point: &Point, free: &[Free]) -> Result<Self> {
        Self::beside(system, experiment, point, free, None)
    }

    /// The same with the columns that an earlier fit of the same windows has `kept`, as it has them.
    pub(crate) fn beside(
        system: &System,
        experiment: &Experiment,
        point: &Point,
        free: &[Free],
        kept: Option<&Kept>,
    ) -> Result<Self> {
        if system.engine().is_some() {
            return super::stepped::jacobian(system, experiment, point, free, kept);
        }
        let n = system.n_states();
        let mut blocks = empty_blocks(experiment, n + free.len());
        let mut is_known = |column: usize| {
            let of = |(window, block): (usize, &mut Block)| {
                kept.is_some_and(|kept| kept.fill((system, experiment, free), (window, column), block))
            };
            // One window without it, and all of them are passed anew.
            blocks.iter_mut().enumerate().all(of)
        };
        let unknown = (0..n + free.len()).filter(|&column| !is_known(column));
        // Lane 0 of the first pass is the point itself; every other lane moves one value.
        let moved: Vec<Option<usize>> = std::iter::once(None).chain(unknown.map(Some)).collect();
        for (number, lanes_of) in moved.chunks(8).enumerate() {
            let pass = if lanes_of.len() <= 4 { self::pass::<4> } else { self::pass::<8> };
            pass(system, experiment, point, free, number == 0, lanes_of, &mut blocks)?;
        }
        Ok(Self { blocks, n_states: n })
    }
}

fn empty_blocks(experiment: &Experiment, width: usize) -> Vec<Block> {
    let empty = |w: &super::Window| {
        let rows = (w.last - w.first + 1) * experiment.columns.len();
        Block { residual: DVector::zeros(rows), derivative: DMatrix::zeros(rows, width), present: vec![false; rows] }
    };
    experiment.windows.iter().map(empty).collect()
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
    experiment.tally.pass(Purpose::Derivatives, experiment.n_samples());
    // By what the change of a reading is divided, and the column of derivatives that it is in.
    let moved = |noise: &f64| -> Vec<(usize, usize, f64)> {
        let of = |(lane, column): (usize, &Option<usize>)| {
            column.map(|column| (lane, column, noise * difference(experiment, n, free, column)))
        };
        lanes_of.iter().enumerate().filter_map(of).collect()
    };
    let moved: Vec<_> = experiment.noise.iter().map(moved).collect();
    // What is held at rest by more than what acts in motion slides off where it is moved by anything: no derivative is that of its start.
    let held = system.sticks().map_or_else(Vec::new, |sticks| sticks.firmly_held(&point.parameters));
    let mut diverged = None;
    for (log_index, log) in experiment.logs.iter().enumerate() {
        let mut lanes = Lanes::<L>::new(system, log, (experiment.hold, experiment.past), &parameters);
        for (w, window) in experiment.windows.iter().enumerate().filter(|(_, w)| w.log == log_index) {
            let mut initial: Vec<[f64; L]> = point.initial[w].iter().map(|&v| [v; L]).collect();
            for (lane, column) in lanes_of.iter().enumerate() {
                let rests = |c: usize| held.contains(&c) && point.initial[w][c] == 0.0;
                if let Some(column) = column.filter(|&c| c < n && !rests(c)) {
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
                for &(lane, column, by) in &moved[c] {
                    let slope = (v[lane] - base) / by;
                    block.derivative[(row, column)] = if slope.is_finite() { slope } else { 0.0 };
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
    misses(system, experiment, points, None, |point, _, row, missed| {
        sums[point] += experiment.starts.weight(row / columns) * (missed * missed);
    });
    let all = sums.iter().zip(points).map(|(sum, point)| sum + prior_cost(&point.parameters, free));
    all.map(|cost| if cost.is_finite() { cost } else { f64::INFINITY }).collect()
}

/// Derivatives along which a simulator that steps need not be rolled out, and which of their windows those of an experiment are.
pub(crate) type Lines<'a> = (&'a Tangent, &'a [usize]);

/// Residuals of several points: `receive(point, window, row, (measured - model)/noise)`, rows as those of a [`Block`].
pub(crate) fn misses(
    system: &System,
    experiment: &Experiment,
    points: &[Point],
    lines: Option<Lines<'_>>,
    mut receive: impl FnMut(usize, usize, usize, f64),
) {
    const L: usize = 4;
    if system.engine().is_some() {
        return misses_in_lockstep(system, experiment, points, lines, &mut receive);
    }
    let n_columns = experiment.columns.len();
    experiment.tally.pass(Purpose::Trials, points.len().div_ceil(L) * experiment.n_samples());
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

/// The same where the simulator steps on its own.
fn misses_in_lockstep(
    system: &System,
    experiment: &Experiment,
    points: &[Point],
    lines: Option<Lines<'_>>,
    receive: &mut impl FnMut(usize, usize, usize, f64),
) {
    let job = |window: usize, point: &Point| Job {
        window,
        parameters: point.parameters.clone(),
        initial: point.initial[window].clone(),
    };
    let windows = 0..experiment.windows.len();
    let jobs: Vec<Job> = windows.flat_map(|w| points.iter().map(move |point| job(w, point))).collect();
    let mut receive = |job: usize, sample: usize, c: usize, value: f64| {
        let (w, point) = (job / points.len(), job % points.len());
        let window = experiment.windows[w];
        let measured = experiment.logs[window.log].measured[c][sample];
        if measured.is_finite() {
            let row = (sample - window.first) * experiment.columns.len() + c;
            receive(point, w, row, (measured - value) / experiment.noise[c]);
        }
    };
    let columns = &experiment.columns[..];
    let samples = points.len() * experiment.n_samples();
    match lines {
        Some((tangent, windows)) => {
            experiment.tally.pass(Purpose::Responses, samples);
            tangent.roll(system, (experiment, windows), &jobs, (columns, true), &mut receive);
        }
        None => {
            experiment.tally.pass(Purpose::Trials, samples);
            roll_together(system, experiment, &jobs, Some(columns), &mut receive);
        }
    }
}
