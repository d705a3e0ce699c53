//! Residuals, their derivatives by finite differences in lanes, and the normal equations.

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

/// How far an initial state may sit from its guess, in typical sizes (1 sigma): only holds what the
/// logs do not tell.
const INITIAL_BELIEF: f64 = 30.0;

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
        if system.engine().is_some() {
            return Self::in_lockstep(system, experiment, point, free);
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
    fn in_lockstep(system: &System, experiment: &Experiment, point: &Point, free: &[Free]) -> Result<Self> {
        let n = system.n_states();
        let n_columns = experiment.columns.len();
        let width = n + free.len();
        let mut blocks = empty_blocks(experiment, width);
        let by = |column: usize| STEPPED_DIFFERENCE / DIFFERENCE * difference(experiment, n, free, column);
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
    const L: usize = 4;
    if system.engine().is_some() {
        return costs_in_lockstep(system, experiment, points, free);
    }
    let mut all = Vec::with_capacity(points.len());
    for chunk in points.chunks(L) {
        let lane_point = |lane: usize| &chunk[lane.min(chunk.len() - 1)];
        let parameters: Vec<[f64; L]> =
            (0..system.n_parameters()).map(|p| std::array::from_fn(|lane| lane_point(lane).parameters[p])).collect();
        let mut sums = [0.0; L];
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
                            let weight = experiment.starts.weight(i - window.first);
                            for lane in 0..L {
                                sums[lane] += weight * ((measured - v[lane]) / experiment.noise[c]).powi(2);
                            }
                        }
                    },
                );
            }
        }
        for (lane, point) in chunk.iter().enumerate() {
            let cost = sums[lane] + prior_cost(&point.parameters, free);
            all.push(if cost.is_finite() { cost } else { f64::INFINITY });
        }
    }
    all
}

/// The same where the simulator steps by itself.
fn costs_in_lockstep(system: &System, experiment: &Experiment, points: &[Point], free: &[Free]) -> Vec<f64> {
    let job = |window: usize, point: &Point| Job {
        window,
        parameters: point.parameters.clone(),
        initial: point.initial[window].clone(),
    };
    let windows = 0..experiment.windows.len();
    let jobs: Vec<Job> = windows.flat_map(|w| points.iter().map(move |point| job(w, point))).collect();
    let mut sums = vec![0.0; points.len()];
    roll_together(system, experiment, &jobs, Some(&experiment.columns), &mut |job, sample, c, value| {
        let window = experiment.windows[job / points.len()];
        let measured = experiment.logs[window.log].measured[c][sample];
        if measured.is_finite() {
            let weight = experiment.starts.weight(sample - window.first);
            sums[job % points.len()] += weight * ((measured - value) / experiment.noise[c]).powi(2);
        }
    });
    let all = sums.iter().zip(points).map(|(sum, point)| sum + prior_cost(&point.parameters, free));
    all.map(|cost| if cost.is_finite() { cost } else { f64::INFINITY }).collect()
}

/// The normal equations with every window's initial state kept apart.
pub(crate) struct Normal {
    /// Per window: initial x initial, initial x parameters, gradient of the initial state.
    windows: Vec<(DMatrix<f64>, DMatrix<f64>, DVector<f64>)>,
    parameters: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Normal {
    pub(crate) fn new(jacobian: &Jacobian, experiment: &Experiment, point: &Point, free: &[Free]) -> Self {
        let n = jacobian.n_states;
        let q = free.len();
        let Starts { samples, more } = experiment.starts;
        let mut parameters = DMatrix::zeros(q, q);
        let mut gradient = DVector::zeros(q);
        for (i, f) in free.iter().enumerate() {
            if let Some((mean, sd)) = f.prior {
                parameters[(i, i)] += 1.0 / (sd * sd);
                gradient[i] += (mean - point.parameters[f.parameter]) / (sd * sd);
            }
        }
        let windows = jacobian
            .blocks
            .iter()
            .map(|block| {
                let mut product = block.derivative.tr_mul(&block.derivative);
                let mut slope = block.derivative.tr_mul(&block.residual);
                if more > 0.0 {
                    let first = (samples * experiment.columns.len()).min(block.residual.len());
                    let derivative = block.derivative.rows(0, first);
                    product += more * derivative.tr_mul(&derivative);
                    slope += more * derivative.tr_mul(&block.residual.rows(0, first));
                }
                parameters += product.view((n, n), (q, q));
                gradient += slope.rows(n, q);
                let mut initial = product.view((0, 0), (n, n)).into_owned();
                for j in 0..n {
                    initial[(j, j)] += (INITIAL_BELIEF * experiment.scale[j]).powi(-2);
                }
                (initial, product.view((0, n), (n, q)).into_owned(), slope.rows(0, n).into_owned())
            })
            .collect();
        Self { windows, parameters, gradient }
    }

    /// The point one damped Gauss-Newton step on, kept inside the bounds.
    pub(crate) fn step(&self, point: &Point, free: &[Free], damping: f64) -> Option<Point> {
        let mut reduced = damped(&self.parameters, damping);
        let mut gradient = self.gradient.clone();
        let mut solved = Vec::with_capacity(self.windows.len());
        for (initial, mixed, slope) in &self.windows {
            let factor = damped(initial, damping).cholesky()?;
            let weights = factor.solve(mixed);
            let own = factor.solve(slope);
            reduced -= mixed.tr_mul(&weights);
            gradient -= mixed.tr_mul(&own);
            solved.push((weights, own));
        }
        let applied = bounded_solution(&reduced, &gradient, point, free)?;
        let mut next = point.clone();
        for (f, change) in free.iter().zip(applied.iter()) {
            next.parameters[f.parameter] = (point.parameters[f.parameter] + change).clamp(f.lower, f.upper);
        }
        for (initial, (weights, own)) in next.initial.iter_mut().zip(&solved) {
            let move_by = own - weights * &applied;
            for (value, step) in initial.iter_mut().zip(move_by.iter()) {
                *value += step;
            }
        }
        next.parameters.iter().chain(next.initial.iter().flatten()).all(|v| v.is_finite()).then_some(next)
    }

    /// Covariance of the free parameters with the initial states free, infinite where they are not told; and the windows
    /// whose equations for the initial state are not positive definite to rounding, which tell nothing.
    pub(crate) fn covariance(&self) -> (DMatrix<f64>, Vec<usize>) {
        let q = self.gradient.len();
        let mut reduced = self.parameters.clone();
        let mut left_out = Vec::new();
        for (w, (initial, mixed, _)) in self.windows.iter().enumerate() {
            match initial.clone().cholesky() {
                Some(factor) => reduced -= mixed.tr_mul(&factor.solve(mixed)),
                None => left_out.push(w),
            }
        }
        let covariance = match reduced.cholesky() {
            Some(factor) => factor.inverse(),
            None => DMatrix::from_diagonal_element(q, q, f64::INFINITY),
        };
        (covariance, left_out)
    }
}

/// Solves for the change of the free parameters; what would leave its bounds stops there, and the others are solved
/// again without it (an active set that only grows).
fn bounded_solution(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    point: &Point,
    free: &[Free],
) -> Option<DVector<f64>> {
    let q = free.len();
    let mut stopped: Vec<Option<f64>> = vec![None; q];
    for _ in 0..=q {
        let mut matrix = matrix.clone();
        let mut right = gradient.clone();
        for (i, change) in stopped.iter().enumerate() {
            if let Some(change) = *change {
                right.axpy(-change, &matrix.column(i).clone_owned(), 1.0);
                matrix.fill_row(i, 0.0);
                matrix.fill_column(i, 0.0);
                matrix[(i, i)] = 1.0;
            }
        }
        for (value, change) in right.iter_mut().zip(&stopped) {
            *value = change.unwrap_or(*value);
        }
        let solution = if q > 0 { matrix.cholesky()?.solve(&right) } else { right };
        let mut all_inside = true;
        for (i, f) in free.iter().enumerate().filter(|(i, _)| solution[*i].is_finite()) {
            let old = point.parameters[f.parameter];
            let new = (old + solution[i]).clamp(f.lower, f.upper);
            if stopped[i].is_none() && new != old + solution[i] {
                stopped[i] = Some(new - old);
                all_inside = false;
            }
        }
        if all_inside {
            return Some(solution);
        }
    }
    None
}

/// The matrix with its diagonal raised by `damping` of itself (Marquardt's scaling).
fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut damped = matrix.clone();
    for i in 0..matrix.nrows() {
        damped[(i, i)] = matrix[(i, i)] * (1.0 + damping) + f64::MIN_POSITIVE;
    }
    damped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_the_covariance_leaves_out_are_named() {
        let window = |own: f64| {
            (DMatrix::from_element(1, 1, own), DMatrix::from_element(1, 1, 1.0), DVector::from_element(1, 0.0))
        };
        let normal = |own: [f64; 2]| Normal {
            windows: own.map(window).into(),
            parameters: DMatrix::from_element(1, 1, 10.0),
            gradient: DVector::from_element(1, 0.0),
        };
        // Each window takes 1/2 of the information; the second tells nothing where its own is no number.
        let (covariance, left_out) = normal([2.0, 2.0]).covariance();
        assert!((covariance[(0, 0)] - 1.0 / 9.0).abs() < 1e-15 && left_out.is_empty());
        let (covariance, left_out) = normal([2.0, -2.0]).covariance();
        assert!((covariance[(0, 0)] - 1.0 / 9.5).abs() < 1e-15);
        assert_eq!(left_out, [1]);
    }
}
