//! An extended Kalman filter: the likelihood of logs whose machine is also driven at random.
//!
//! A random force in a row is a state of its own that forgets, `d' = -d/tau`, driven by white noise to a standard deviation
//! (an Ornstein-Uhlenbeck process; Dryden's gusts have the same spectrum). The sensors' noise is known up to one factor for all
//! of them, which is fitted in closed form.
//!
//! Source: Jazwinski 1970, Stochastic Processes and Filtering Theory, chapter 8; the likelihood by innovations is Schweppe's
//! (1965, IEEE Trans. Inf. Theory 11(1)).

use crate::error::Result;
use crate::expression::Expression;
use crate::model::{Model, Parameter, State, System};
use crate::refine::lanes::Lanes;
use crate::refine::{Experiment, Window};
use nalgebra::{DMatrix, DVector};

/// Copies of a model that are rolled out at once.
const LANES: usize = 8;

/// Readings after which no further stretch is filtered: a force of a tenth of the noise stands ten deviations above it by then.
const MOST_READINGS: usize = 6000;

/// Step of a finite difference, in typical sizes.
const STEP: f64 = 1e-5;

/// A random force: in which row, its standard deviation in the row's unit, and how long it lasts, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Force {
    pub(crate) row: usize,
    pub(crate) deviation: f64,
    pub(crate) time: f64,
}

/// A model with a random force in some rows.
pub(crate) struct Filter {
    system: System,
    /// Number of the machine's own states; one a forced row follows.
    n: usize,
    /// Parameters of the machine.
    p: usize,
}

/// One reading as the filter took it in.
#[derive(Debug, Clone)]
struct Reading {
    slope: DVector<f64>,
    gain: DVector<f64>,
    variance: f64,
    innovation: f64,
    column: usize,
}

/// One sample as the filter went through it: its readings, then the way to the next sample.
#[derive(Debug, Clone)]
struct Sample {
    number: usize,
    readings: Vec<Reading>,
    /// States before the readings, and after them.
    expected: Vec<f64>,
    state: Vec<f64>,
    transition: DMatrix<f64>,
    /// By how much a constant unit force in each of the machine's rows moves the next states.
    pushed: DMatrix<f64>,
}

impl Sample {
    fn seen_by(&self, acts: Acts) -> &[f64] {
        match acts {
            Acts::Row(_) => &self.state,
            Acts::Column(_) => &self.expected,
        }
    }
}

/// What a filter found along the logs.
#[derive(Debug, Clone)]
pub(crate) struct Filtered {
    /// Log likelihood, up to the constant that all models share.
    pub(crate) likelihood: f64,
    pub(crate) count: usize,
    /// Variance of the innovations beside what the filter expects.
    level: f64,
    /// For every stretch its log and its samples; empty where they were not asked for.
    stretches: Vec<(usize, Vec<Sample>)>,
}

/// A function of the states and inputs, along every stretch: how much of it acts, sample by sample.
pub(crate) type Course = Vec<Vec<f64>>;

impl Filter {
    /// The machine with a random force in each of `rows`; nothing where a reading depends on the past of a state, or where the rates
    /// are the user's own.
    pub(crate) fn new(system: &System, rows: &[usize]) -> Result<Option<Self>> {
        if !system.late_states().is_empty() || system.simulator().is_some() {
            return Ok(None);
        }
        let mut model: Model = system.model().clone();
        let (n, p) = (model.states.len(), model.parameters.len());
        for j in 0..n {
            let name = format!("constant_force__{j}");
            model.states[j].equation = model.states[j].equation.clone().plus(Expression::variable(name.clone()));
            model.parameters.push(Parameter::new(name, 0.0));
        }
        for &row in rows {
            let (force, rate) = (format!("random_force__{row}"), format!("random_rate__{row}"));
            model.states[row].equation = model.states[row].equation.clone().plus(Expression::variable(force.clone()));
            let decay = Expression::variable(rate.clone()).times(Expression::variable(force.clone())).negated();
            model.states.push(State::new(force, decay));
            model.parameters.push(Parameter::new(rate, 1.0));
        }
        Ok(Some(Self { system: System::new(&model)?, n, p }))
    }

    /// Filters the logs of `experiment` from the starts of its windows; windows that follow each other are one stretch.
    ///
    /// `parameters`: those of the machine. Nothing where the filter diverges.
    pub(crate) fn run(
        &self,
        experiment: &Experiment,
        (parameters, starts): (&[f64], &[Vec<f64>]),
        forces: &[Force],
        keep: bool,
    ) -> Option<Filtered> {
        let mut values = parameters[..self.p].to_vec();
        values.extend((0..self.n).map(|_| 0.0));
        values.extend(forces.iter().map(|f| 1.0 / f.time));
        let mut all = Filtered { likelihood: 0.0, count: 0, level: 0.0, stretches: Vec::new() };
        let (mut logarithms, mut squares) = (0.0, 0.0);
        for (window, start) in stretches(&experiment.windows, starts) {
            if all.count > MOST_READINGS {
                break;
            }
            let mut pass = Pass::new(self, experiment, window, (&values, start), forces);
            let samples = pass.run(window, keep);
            logarithms += pass.logarithms;
            squares += pass.squares;
            all.count += pass.count;
            all.stretches.push((window.log, samples));
        }
        let count = all.count.max(1) as f64;
        all.level = squares / count;
        all.likelihood = -0.5 * (count * all.level.max(f64::MIN_POSITIVE).ln() + logarithms);
        (all.likelihood.is_finite() && squares > 0.0).then_some(all)
    }
}

/// Logarithm of a matrix near one, by its series; of one that is not, the first term.
fn logarithm(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    /// Terms: the last one is below a thousandth for states that change by half between two samples.
    const TERMS: i32 = 8;
    let beyond = matrix - DMatrix::identity(matrix.nrows(), matrix.ncols());
    let mut power = beyond.clone();
    let mut sum = beyond.clone();
    for k in 2..=TERMS {
        power = -(&power * &beyond);
        sum += &power / f64::from(k);
    }
    if power.amax() < 0.1 * beyond.amax() { sum } else { beyond }
}

/// Adds what the white noise of a random force does to the states over a step: the integral of `e^(A s) e_d e_d' e^(A' s)` over
/// the step, by three points of Gauss and Legendre.
fn driven(covariance: &mut DMatrix<f64>, rates: &DMatrix<f64>, (place, force): (usize, Force), step: f64) {
    /// Terms of the exponential: a force may decay by e^2 within a step.
    const TERMS: i32 = 10;
    let density = 2.0 * force.deviation * force.deviation / force.time;
    let far = 0.6f64.sqrt();
    for (point, weight) in [(-far, 5.0 / 18.0), (0.0, 8.0 / 18.0), (far, 5.0 / 18.0)] {
        let time = 0.5 * step * (1.0 + point);
        let mut term = DVector::zeros(rates.nrows());
        term[place] = 1.0;
        let mut moved = term.clone();
        for k in 1..=TERMS {
            term = rates * term * (time / f64::from(k));
            moved += &term;
        }
        covariance.ger(density * weight * step, &moved, &moved, 1.0);
    }
}

/// Windows that follow each other in one log, as one, and the start of the first.
fn stretches<'a>(windows: &[Window], starts: &'a [Vec<f64>]) -> Vec<(Window, &'a [f64])> {
    let mut all: Vec<(Window, &[f64])> = Vec::new();
    for (window, start) in windows.iter().zip(starts) {
        match all.last_mut() {
            Some((last, _)) if last.log == window.log && last.last + 1 == window.first => last.last = window.last,
            _ => all.push((*window, start)),
        }
    }
    all
}

/// The filter along one stretch.
struct Pass<'a> {
    filter: &'a Filter,
    experiment: &'a Experiment,
    lanes: Lanes<'a, LANES>,
    /// The same with a unit force in each row, a lane a row.
    pushed: Vec<Lanes<'a, LANES>>,
    scale: Vec<f64>,
    forces: &'a [Force],
    state: DVector<f64>,
    covariance: DMatrix<f64>,
    logarithms: f64,
    squares: f64,
    count: usize,
}

impl<'a> Pass<'a> {
    fn new(
        filter: &'a Filter,
        experiment: &'a Experiment,
        window: Window,
        (values, start): (&[f64], &[f64]),
        forces: &'a [Force],
    ) -> Self {
        let (log, past) = (&experiment.logs[window.log], (experiment.hold, experiment.past));
        let alike: Vec<[f64; LANES]> = values.iter().map(|&v| [v; LANES]).collect();
        let lanes = Lanes::new(&filter.system, log, past, &alike);
        let of_rows = |first: usize| {
            let mut values = alike.clone();
            for lane in 1..LANES.min(filter.n - first + 1) {
                let row = first + lane - 1;
                values[filter.p + row][lane] = experiment.scale[row];
            }
            Lanes::new(&filter.system, log, past, &values)
        };
        let pushed = (0..filter.n).step_by(LANES - 1).map(of_rows).collect();
        let mut scale = experiment.scale[..filter.n].to_vec();
        scale.extend(forces.iter().map(|f| f.deviation.max(f64::MIN_POSITIVE)));
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
            forces,
            state,
            covariance,
            logarithms: 0.0,
            squares: 0.0,
            count: 0,
        }
    }

    fn run(&mut self, window: Window, keep: bool) -> Vec<Sample> {
        let mut samples = Vec::new();
        for number in window.first..=window.last {
            let expected: Vec<f64> = self.state.iter().copied().collect();
            let readings = self.read(window.log, number, keep);
            let state: Vec<f64> = self.state.iter().copied().collect();
            if number == window.last || !self.state.iter().all(|v| v.is_finite()) {
                break;
            }
            let (next, transition) = self.ahead(number);
            let pushed = if keep { self.push(number, &next) } else { DMatrix::zeros(0, 0) };
            self.covariance = &transition * &self.covariance * transition.transpose();
            let time = &self.experiment.logs[window.log].time;
            let step = time[number + 1] - time[number];
            let rates = logarithm(&transition) / step;
            for (k, force) in self.forces.iter().enumerate() {
                driven(&mut self.covariance, &rates, (self.filter.n + k, *force), step);
            }
            self.state = next;
            if keep {
                samples.push(Sample { number, readings, expected, state, transition, pushed });
            }
        }
        samples
    }

    /// Takes in the readings of one sample, one after the other.
    fn read(&mut self, log: usize, number: usize, keep: bool) -> Vec<Reading> {
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
            if keep {
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
        for lane in 1..LANES.min(size - first + 1) {
            all[first + lane - 1][lane] += STEP * self.scale[first + lane - 1];
        }
        all
    }

    /// Expected readings at a sample, and their slopes: a row a column.
    fn outputs(&mut self, number: usize) -> (Vec<f64>, DMatrix<f64>) {
        let (size, columns) = (self.scale.len(), &self.experiment.columns);
        let mut expected = vec![0.0; columns.len()];
        let mut slopes = DMatrix::zeros(columns.len(), size);
        for first in (0..size).step_by(LANES - 1) {
            let starts = self.moved(first);
            let scale = &self.scale;
            self.lanes.roll((number, number), &starts, columns, 1, |_, c, values| {
                expected[c] = values[0];
                for lane in 1..LANES.min(size - first + 1) {
                    let place = first + lane - 1;
                    slopes[(c, place)] = (values[lane] - values[0]) / (STEP * scale[place]);
                }
            });
        }
        (expected, slopes)
    }

    /// States at the next sample, and how they depend on those of this one.
    fn ahead(&mut self, number: usize) -> (DVector<f64>, DMatrix<f64>) {
        let size = self.scale.len();
        let mut next = DVector::zeros(size);
        let mut transition = DMatrix::zeros(size, size);
        for first in (0..size).step_by(LANES - 1) {
            let starts = self.moved(first);
            let (scale, substeps) = (&self.scale, self.experiment.substeps);
            self.lanes.roll_states((number, number + 1), &starts, substeps, |sample, j, values| {
                if sample == number {
                    return;
                }
                next[j] = values[0];
                for lane in 1..LANES.min(size - first + 1) {
                    let place = first + lane - 1;
                    transition[(j, place)] = (values[lane] - values[0]) / (STEP * scale[place]);
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
        for (block, lanes) in self.pushed.iter_mut().enumerate() {
            let first = block * (LANES - 1);
            lanes.roll_states((number, number + 1), &starts, substeps, |sample, j, values| {
                for lane in 1..LANES.min(n - first + 1) {
                    if sample != number {
                        let row = first + lane - 1;
                        all[(j, row)] = (values[lane] - next[j]) / scale[row];
                    }
                }
            });
        }
        all
    }
}

/// Where a function acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Acts {
    /// In the equation of a state.
    Row(usize),
    /// On what a column reads, by its number among the logged ones.
    Column(usize),
}

impl Filtered {
    /// The states that a function sees, along every stretch: the log, and number and states of each sample.
    ///
    /// What acts on a reading sees the states before it: those after it hold its noise.
    pub(crate) fn path(&self, acts: Acts) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, &[f64])>)> {
        self.stretches
            .iter()
            .map(move |(log, samples)| (*log, samples.iter().map(move |s| (s.number, s.seen_by(acts)))))
    }

    /// Gain (twice the log likelihood) and degrees of freedom of a sum of functions with free amplitudes, for small ones.
    ///
    /// `courses`: one a function.
    pub(crate) fn gain(&self, acts: Acts, courses: &[Course]) -> (f64, usize) {
        let k = courses.len();
        let mut gram = DMatrix::zeros(k, k);
        let mut slope = DVector::zeros(k);
        for (place, (_, samples)) in self.stretches.iter().enumerate() {
            let Some(first) = samples.first() else { continue };
            // By how much the functions move the filter's states.
            let mut moved = DMatrix::zeros(first.state.len(), k);
            for (i, sample) in samples.iter().enumerate() {
                let now = DVector::from_iterator(k, courses.iter().map(|course| course[place][i]));
                for reading in &sample.readings {
                    let mut expected = moved.tr_mul(&reading.slope);
                    if acts == Acts::Column(reading.column) {
                        expected += &now;
                    }
                    gram.ger(1.0 / reading.variance, &expected, &expected, 1.0);
                    slope.axpy(reading.innovation / reading.variance, &expected, 1.0);
                    moved.ger(-1.0, &reading.gain, &expected, 1.0);
                }
                moved = &sample.transition * moved;
                if let Acts::Row(row) = acts {
                    moved.ger(1.0, &sample.pushed.column(row), &now, 1.0);
                }
            }
        }
        let lengths = gram.diagonal();
        let (mut gain, mut degrees) = (0.0, 0);
        for i in 0..k {
            let left = gram[(i, i)];
            if left > 1e-9 * lengths[i] && left > 0.0 {
                gain += slope[i] * slope[i] / left;
                degrees += 1;
                let (column, along) = (gram.column(i).clone_owned(), slope[i] / left);
                slope.axpy(-along, &column, 1.0);
                gram.ger(-1.0 / left, &column, &column, 1.0);
            }
        }
        (gain / self.level, degrees.max(1))
    }
}
