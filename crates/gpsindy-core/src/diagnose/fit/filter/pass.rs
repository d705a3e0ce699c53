//! The filter along one stretch of a log.

use super::driven::{driven, logarithm};
use super::{Acts, Filter, Pace, Process, Reading, Sample};
use crate::diagnose::limits::DIFFERENCE;
use crate::refine::lanes::Lanes;
use crate::refine::{Experiment, Window};
use nalgebra::{DMatrix, DVector};

/// Copies of a model that are rolled out at once. Exact.
const LANES: usize = 8;

/// The lanes beside the first, and what each of them moves: of `size` things those from number `first` on.
fn moving(first: usize, size: usize) -> impl Iterator<Item = (usize, usize)> {
    (1..LANES.min(size - first + 1)).map(move |lane| (lane, first + lane - 1))
}

/// Numbers from which the lanes start anew until all of `size` things were moved.
fn blocks(size: usize) -> impl Iterator<Item = usize> {
    (0..size).step_by(LANES - 1)
}

/// The filter along one stretch.
pub(super) struct Pass<'a> {
    filter: &'a Filter,
    experiment: &'a Experiment,
    lanes: Lanes<'a, LANES>,
    /// The same with a force in each row, a lane a row; empty where no function is asked for.
    pushed: Vec<Lanes<'a, LANES>>,
    scale: Vec<f64>,
    processes: &'a [Process],
    state: DVector<f64>,
    covariance: DMatrix<f64>,
    pub(super) logarithms: f64,
    pub(super) squares: f64,
    pub(super) count: usize,
    pace: Pace,
}

impl<'a> Pass<'a> {
    pub(super) fn new(
        filter: &'a Filter,
        experiment: &'a Experiment,
        window: Window,
        (values, start): (&[f64], &[f64]),
        processes: &'a [Process],
        pace: Pace,
    ) -> Self {
        let (log, past) = (&experiment.logs[window.log], (experiment.hold, experiment.past));
        let alike: Vec<[f64; LANES]> = values.iter().map(|&v| [v; LANES]).collect();
        let lanes = Lanes::new(&filter.system, log, past, &alike);
        let of_rows = |first: usize| {
            let mut values = alike.clone();
            for (lane, row) in moving(first, filter.n) {
                values[filter.p + row][lane] = experiment.scale[row];
            }
            Lanes::new(&filter.system, log, past, &values)
        };
        let pushed = blocks(filter.n).filter(|_| pace == Pace::Samples).map(of_rows).collect();
        let mut scale = experiment.scale[..filter.n].to_vec();
        scale.extend(processes.iter().map(|f| f.deviation.max(f64::MIN_POSITIVE)));
        let size = scale.len();
        let mut state = DVector::zeros(size);
        state.rows_mut(0, filter.n).copy_from_slice(&start[..filter.n]);
        // Nothing is known of the start but the size of the motion.
        let covariance = DMatrix::from_diagonal(&DVector::from_iterator(size, scale.iter().map(|s| s * s)));
        Self {
            filter,
            experiment,
            lanes,
            pushed,
            scale,
            processes,
            state,
            covariance,
            logarithms: 0.0,
            squares: 0.0,
            count: 0,
            pace,
        }
    }

    pub(super) fn run(&mut self, window: Window) -> Vec<Sample> {
        let mut samples = Vec::new();
        for number in window.first..=window.last {
            let expected: Vec<f64> = self.state.iter().copied().collect();
            let readings = self.read(window.log, number);
            let state: Vec<f64> = self.state.iter().copied().collect();
            if number == window.last || !self.state.iter().all(|v| v.is_finite()) {
                if self.pace != Pace::Likelihood {
                    // The step after it is never taken.
                    let (transition, pushed) = (DMatrix::zeros(0, 0), DMatrix::zeros(0, 0));
                    samples.push(Sample { number, readings, expected, state, transition, pushed });
                }
                break;
            }
            let (next, transition) = self.ahead(number);
            self.covariance = &transition * &self.covariance * transition.transpose();
            let time = &self.experiment.logs[window.log].time;
            let step = time[number + 1] - time[number];
            let rates = logarithm(&transition) / step;
            for (k, process) in self.processes.iter().enumerate() {
                driven(&mut self.covariance, &rates, (self.filter.n + k, *process), step);
            }
            if self.pace != Pace::Likelihood {
                let pushed = self.push(number, &next);
                samples.push(Sample { number, readings, expected, state, transition, pushed });
            }
            self.state = next;
        }
        samples
    }

    /// Takes in the readings of one sample, one after the other.
    fn read(&mut self, log: usize, number: usize) -> Vec<Reading> {
        let mut all = Vec::new();
        let measured = &self.experiment.logs[log].measured;
        if measured.iter().all(|column| column[number].is_nan()) {
            return all;
        }
        let start = self.state.clone();
        let (expected, slopes) = self.outputs(number);
        for (c, column) in measured.iter().enumerate() {
            if column[number].is_nan() {
                continue;
            }
            let slope = slopes.row(c).transpose();
            let innovation = column[number] - expected[c] - slope.dot(&(&self.state - &start));
            let along = &self.covariance * &slope;
            let variance = slope.dot(&along) + self.experiment.noise[c].powi(2);
            let gain = &along / variance;
            self.state.axpy(innovation, &gain, 1.0);
            self.covariance.ger(-1.0, &gain, &along, 1.0);
            self.logarithms += variance.ln();
            self.squares += innovation * innovation / variance;
            self.count += 1;
            if self.pace != Pace::Likelihood {
                all.push(Reading { slope, gain, variance, innovation, column: c });
            }
        }
        // Rounding makes the two triangles differ.
        self.covariance = 0.5 * (&self.covariance + self.covariance.transpose());
        all
    }

    /// Starts of the lanes: the state in the first, one of its entries moved in each of the others.
    fn moved(&self, first: usize) -> Vec<[f64; LANES]> {
        let size = self.scale.len();
        let mut all: Vec<[f64; LANES]> = self.state.iter().map(|&v| [v; LANES]).collect();
        for (lane, place) in moving(first, size) {
            all[place][lane] += DIFFERENCE * self.scale[place];
        }
        all
    }

    /// Expected readings at a sample, and their slopes: a row a column.
    fn outputs(&mut self, number: usize) -> (Vec<f64>, DMatrix<f64>) {
        let (size, columns) = (self.scale.len(), &self.experiment.columns);
        let mut expected = vec![0.0; columns.len()];
        let mut slopes = DMatrix::zeros(columns.len(), size);
        for first in blocks(size) {
            let starts = self.moved(first);
            let scale = &self.scale;
            self.lanes.roll((number, number), &starts, columns, 1, |_, c, values| {
                expected[c] = values[0];
                for (lane, place) in moving(first, size) {
                    slopes[(c, place)] = (values[lane] - values[0]) / (DIFFERENCE * scale[place]);
                }
            });
        }
        for (k, process) in self.processes.iter().enumerate() {
            if let Acts::Column(c) = process.acts {
                expected[c] += self.state[self.filter.n + k];
                slopes[(c, self.filter.n + k)] = 1.0;
            }
        }
        (expected, slopes)
    }

    /// States at the next sample, and how they depend on those of this one.
    fn ahead(&mut self, number: usize) -> (DVector<f64>, DMatrix<f64>) {
        let size = self.scale.len();
        let mut next = DVector::zeros(size);
        let mut transition = DMatrix::zeros(size, size);
        for first in blocks(size) {
            let starts = self.moved(first);
            let (scale, substeps) = (&self.scale, self.experiment.substeps);
            self.lanes.roll_states((number, number + 1), &starts, substeps, |sample, j, values| {
                if sample == number {
                    return;
                }
                next[j] = values[0];
                for (lane, place) in moving(first, size) {
                    transition[(j, place)] = (values[lane] - values[0]) / (DIFFERENCE * scale[place]);
                }
            });
        }
        (next, transition)
    }

    /// By how much a unit force in each row moves the next states.
    fn push(&mut self, number: usize, next: &DVector<f64>) -> DMatrix<f64> {
        let (size, n) = (self.scale.len(), self.filter.n);
        let mut all = DMatrix::zeros(size, n);
        let starts: Vec<[f64; LANES]> = self.state.iter().map(|&v| [v; LANES]).collect();
        let (scale, substeps) = (&self.scale, self.experiment.substeps);
        for (first, lanes) in blocks(n).zip(&mut self.pushed) {
            lanes.roll_states((number, number + 1), &starts, substeps, |sample, j, values| {
                for (lane, row) in moving(first, n) {
                    if sample != number {
                        all[(j, row)] = (values[lane] - next[j]) / scale[row];
                    }
                }
            });
        }
        all
    }
}
