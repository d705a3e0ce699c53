//! An extended Kalman filter: the likelihood of logs whose machine is also driven at random, or whose sensors err with a memory.
//!
//! A random force in a row is a state of its own that forgets, `d' = -d/tau`, driven by white noise to a standard deviation
//! (an Ornstein-Uhlenbeck process; Dryden's gusts have the same spectrum). The same process on a column is an error of its sensor
//! beside the white one. The white noise of the sensors is known up to one factor for all of them, which is fitted in closed form.
//!
//! Source: Jazwinski 1970, Stochastic Processes and Filtering Theory, chapter 8; the likelihood by innovations is Schweppe's
//! (1965, IEEE Trans. Inf. Theory 11(1)).

mod decay;
mod driven;
mod linear;
mod moments;
mod pass;

use crate::diagnose::fit::linear::elimination;
use crate::error::Result;
use crate::expression::Expression;
use crate::model::{Model, Parameter, State, System};
use crate::refine::{Experiment, Window};
pub(crate) use linear::Linear;
use nalgebra::{DMatrix, DVector};
use pass::Pass;

/// Share of a function's information below which nothing of it is left beside the others. Rounding.
const NOTHING: f64 = 1e-9;

/// Where something acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Acts {
    /// In the equation of a state.
    Row(usize),
    /// On what a column reads, by its number among the logged ones.
    Column(usize),
}

/// An Ornstein-Uhlenbeck process: where it acts, its standard deviation in the unit there, and its correlation time, s.
///
/// In a row it is a random force, on a column coloured noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Process {
    pub(crate) acts: Acts,
    pub(crate) deviation: f64,
    pub(crate) time: f64,
}

impl Process {
    /// The row that it forces.
    pub(crate) fn row(&self) -> Option<usize> {
        match self.acts {
            Acts::Row(row) => Some(row),
            Acts::Column(_) => None,
        }
    }
}

/// A model with random processes in some rows and on some columns.
#[derive(Clone)]
pub(crate) struct Filter {
    system: System,
    /// Number of the machine's own states; one a process follows.
    n: usize,
    /// Parameters of the machine.
    p: usize,
}

/// What a pass of the filter is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pace {
    /// For the likelihood.
    Likelihood,
    /// For what the filter saw on the way, too.
    Path,
    /// For what a force in each row would have moved, too.
    Samples,
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
    /// By how much a constant unit force in each of the machine's rows moves the next states; empty where it was not asked for.
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
    pub(crate) level: f64,
    /// For every stretch its log and its samples; empty where they were not asked for.
    stretches: Vec<(usize, Vec<Sample>)>,
}

/// A function of the states and inputs, along every stretch: how much of it acts, sample by sample.
pub(crate) type Course = Vec<Vec<f64>>;

impl Filter {
    /// Whether a model can be filtered: no reading depends on the past of a state, and the rates are not the user's own.
    pub(crate) fn takes(system: &System) -> bool {
        system.late_states().is_empty() && system.simulator().is_none()
    }

    /// The machine with a random process at each of `places`; nothing where no filter takes it.
    pub(crate) fn new(system: &System, places: impl IntoIterator<Item = Acts>) -> Result<Option<Self>> {
        if !Self::takes(system) {
            return Ok(None);
        }
        let mut model: Model = system.model().clone();
        let (n, p) = (model.states.len(), model.parameters.len());
        for j in 0..n {
            let name = format!("constant_force__{j}");
            model.states[j].equation = model.states[j].equation.clone().plus(Expression::variable(name.clone()));
            model.parameters.push(Parameter::new(name, 0.0));
        }
        for (k, acts) in places.into_iter().enumerate() {
            let (process, rate) = (format!("random__{k}"), format!("random_rate__{k}"));
            if let Acts::Row(row) = acts {
                let equation = &mut model.states[row].equation;
                *equation = equation.clone().plus(Expression::variable(process.clone()));
            }
            let decay = Expression::variable(rate.clone()).times(Expression::variable(process.clone())).negated();
            model.states.push(State::new(process, decay));
            model.parameters.push(Parameter::new(rate, 1.0));
        }
        Ok(Some(Self { system: System::new(&model)?, n, p }))
    }

    /// Filters the logs of `experiment` from the starts of its windows; windows that follow each other are one stretch.
    ///
    /// `parameters`: those of the machine. `most`: samples after which the logs end. Nothing where the filter diverges.
    pub(crate) fn run(
        &self,
        (experiment, most): (&Experiment, usize),
        (parameters, starts): (&[f64], &[Vec<f64>]),
        processes: &[Process],
        pace: Pace,
    ) -> Option<Filtered> {
        let mut values = parameters[..self.p].to_vec();
        values.extend((0..self.n).map(|_| 0.0));
        values.extend(processes.iter().map(|process| 1.0 / process.time));
        let mut all = Filtered { likelihood: 0.0, count: 0, level: 0.0, stretches: Vec::new() };
        let (mut logarithms, mut squares) = (0.0, 0.0);
        for (window, start) in stretches(&experiment.windows, starts, most) {
            let mut pass = Pass::new(self, experiment, window, (&values, start), processes, pace);
            let samples = pass.run(window);
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

    /// The filter linearised about the path that it takes with `processes`; nothing where it diverges.
    pub(crate) fn linear(
        &self,
        (experiment, most): (&Experiment, usize),
        machine: (&[f64], &[Vec<f64>]),
        processes: &[Process],
    ) -> Option<Linear> {
        let path = self.run((experiment, most), machine, processes, Pace::Path)?;
        Some(Linear::about(&path, experiment, self.n, processes))
    }
}

/// Windows that follow each other in one log, as one, and the start of the first; the first `most` samples of them all.
fn stretches<'a>(windows: &[Window], starts: &'a [Vec<f64>], most: usize) -> Vec<(Window, &'a [f64])> {
    let mut all: Vec<(Window, &[f64])> = Vec::new();
    let mut left = most;
    for (window, start) in windows.iter().zip(starts) {
        let count = (window.last + 1 - window.first).min(left);
        if count == 0 {
            break;
        }
        left -= count;
        let window = Window { last: window.first + count - 1, ..*window };
        match all.last_mut() {
            Some((last, _)) if last.log == window.log && last.last + 1 == window.first => last.last = window.last,
            _ => all.push((window, start)),
        }
    }
    all
}

impl Filtered {
    /// The innovations in deviations that the filter expects of them, reading after reading.
    pub(crate) fn whitened(&self) -> Vec<f64> {
        let readings = self.stretches.iter().flat_map(|(_, samples)| samples).flat_map(|sample| &sample.readings);
        readings.map(|reading| reading.innovation / reading.variance.sqrt()).collect()
    }

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
                if i + 1 == samples.len() {
                    break;
                }
                moved = &sample.transition * moved;
                if let Acts::Row(row) = acts {
                    moved.ger(1.0, &sample.pushed.column(row), &now, 1.0);
                }
            }
        }
        let lengths = gram.diagonal();
        let (gain, degrees) = elimination::gain(&mut gram, &mut slope, 0..k, |i| NOTHING * lengths[i]);
        (gain / self.level, degrees.max(1))
    }
}
