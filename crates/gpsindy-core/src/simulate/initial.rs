//! The state in which a simulation starts, read from a log: measured, differentiated or at rest.

use super::Simulate;
use super::excitation::Excitation;
use super::inversion::{Inversion, ends};
use super::local_fit::{local_derivative, noise_level};
use super::rates::Rates;
use crate::data::{Channel, Hold, Run};
use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Tape};
use crate::model::{Model, System};
use faer::Mat;
use nalgebra::{DMatrix, DVector};

/// The state of `system` at the first sample of `run`; as [`StateReader::at`] with held controls.
///
/// # Errors
/// As [`StateReader::new`] and [`StateReader::at`].
pub fn initial_state(system: &System, run: &Run, channels: &[Channel]) -> Result<Vec<f64>> {
    let excitation = Excitation::of_run(system, run, channels, Hold::Zero)?;
    StateReader::new(system, run, channels, &excitation)?.at(0)
}

/// The logged states in their own units: `measured` inverted where it is affine in its own state.
///
/// (r x n), NaN where a state is not logged, its cell is missing or its `measured` can't be inverted. A state
/// that is read late is interpolated back to the sample's time.
///
/// # Errors
/// As [`StateReader::new`].
pub fn unmeasure(system: &System, run: &Run, channels: &[Channel]) -> Result<Mat<f64>> {
    let excitation = Excitation::of_run(system, run, channels, Hold::Zero)?;
    let reader = StateReader::new(system, run, channels, &excitation)?;
    Ok(Mat::from_fn(run.n_samples(), system.n_states(), |i, j| match &reader.sources[j] {
        Source::Logged(series) if series.cells[i].is_nan() && series.delay == 0.0 => f64::NAN,
        Source::Logged(series) => series.interpolate(run.time[i]).unwrap_or(f64::NAN),
        _ => f64::NAN,
    }))
}

/// A logged state in its own unit.
#[derive(Debug, Clone)]
struct Series {
    /// The state at each sample's time less the delay; NaN is missing.
    cells: Vec<f64>,
    /// How much later the sensor reads it, s.
    delay: f64,
    /// The known values alone, and their times, s.
    time: Vec<f64>,
    values: Vec<f64>,
    /// Standard deviation of their noise.
    noise: f64,
}

impl Series {
    fn new(time: &[f64], cells: Vec<f64>, delay: f64) -> Self {
        let known = (0..cells.len()).filter(|&i| cells[i].is_finite());
        let (time, values): (Vec<f64>, Vec<f64>) = known.map(|i| (time[i] - delay, cells[i])).unzip();
        let noise = noise_level(&values);
        Self { cells, delay, time, values, noise }
    }

    /// In a straight line between known values; the nearest one outside them.
    fn interpolate(&self, t: f64) -> Option<f64> {
        let next = self.time.partition_point(|&known| known < t);
        let (Some(&after), Some(before)) = (self.values.get(next), next.checked_sub(1)) else {
            return if next == 0 { self.values.first().copied() } else { self.values.last().copied() };
        };
        let share = (t - self.time[before]) / (self.time[next] - self.time[before]);
        Some(self.values[before] + share * (after - self.values[before]))
    }
}

/// Where the value of a state comes from.
#[derive(Debug, Clone)]
enum Source {
    Logged(Series),
    /// Derivative number `order` of the logged state `of`, of which one is `per` in its unit.
    Derivative {
        of: usize,
        order: usize,
        per: f64,
    },
    /// What makes the equation of the logged state `of` hold, with the columns of the run without gaps.
    Solved {
        of: usize,
        inversion: Inversion,
        columns: Vec<Vec<f64>>,
    },
    /// Moved by the controls alone: its values at all samples.
    Driven(Vec<f64>),
    /// The model's own initial value.
    Given(f64),
}

/// Reads the states of a model from a run, for a simulation to start anywhere in it.
///
/// - A logged state: its value, `measured` inverted; a missing cell is interpolated, before the first known
///   value that value holds.
/// - A state that is the time derivative of a logged state: a local polynomial fit of that column.
/// - In a model that was identified, a state in the equation of a logged one, with no other that is missing: what makes that equation
///   hold with the slope of the logged state.
/// - States that depend on themselves and the controls alone (a lag): at rest at the first sample, or at the model's
///   `initial`, then driven by the controls.
/// - Any other: the model's `initial`.
#[derive(Debug, Clone)]
pub struct StateReader {
    time: Vec<f64>,
    sources: Vec<Source>,
}

impl StateReader {
    /// Looks at the run once; [`StateReader::at`] then reads any sample.
    ///
    /// # Errors
    /// A state that is neither logged nor has a source by the rules above; a lag that fails to integrate.
    pub fn new(system: &System, run: &Run, channels: &[Channel], excitation: &Excitation) -> Result<Self> {
        let model = system.model();
        let mut found: Vec<Option<Source>> =
            logged_states(system, run, channels, excitation)?.into_iter().map(|s| s.map(Source::Logged)).collect();
        for j in 0..model.states.len() {
            if found[j].is_none() {
                found[j] = derivative_of_logged(model, &found, j);
            }
        }
        if model.identification.is_some() {
            for j in 0..model.states.len() {
                if found[j].is_none() {
                    found[j] = solved(model, &found, j, (run, channels));
                }
            }
        }
        let driven = driven_states(model, &found);
        if !driven.is_empty()
            && let Some(values) = drive(model, &driven, excitation)?
        {
            for (column, &j) in values.into_iter().zip(&driven) {
                found[j] = Some(Source::Driven(column));
            }
        }
        let mut sources = Vec::with_capacity(found.len());
        for (source, state) in found.into_iter().zip(&model.states) {
            let source = source.or_else(|| model.initial.get(&state.name).map(|&v| Source::Given(v)));
            sources.push(source.ok_or_else(|| {
                Error::data(format!(
                    "state `{}` is not in run `{}`, is not the time derivative of a logged state and has no initial value; log it or add it under [initial]",
                    state.name, run.name
                ))
            })?);
        }
        Ok(Self { time: run.time.clone(), sources })
    }

    /// The states (n) at sample `sample`.
    ///
    /// # Errors
    /// [`Error::TooFewSamples`] where a derivative has too few known values.
    pub fn at(&self, sample: usize) -> Result<Vec<f64>> {
        let t = self.time[sample];
        self.sources
            .iter()
            .map(|source| match source {
                Source::Logged(series) => Ok(series.interpolate(t).unwrap_or(f64::NAN)),
                Source::Derivative { of, order, per } => match &self.sources[*of] {
                    Source::Logged(series) => local_derivative(&series.time, &series.values, series.noise, t, *order)
                        .map(|derivative| derivative / per)
                        .ok_or_else(|| too_few(order + 2, series)),
                    _ => Err(Error::data("a derivative's state is not logged")),
                },
                Source::Solved { of, inversion, columns } => match &self.sources[*of] {
                    Source::Logged(series) => local_derivative(&series.time, &series.values, series.noise, t, 1)
                        .map(|slope| inversion.at(&|c| columns[c][sample], t, slope))
                        .ok_or_else(|| too_few(2, series)),
                    _ => Err(Error::data("the state of the equation that is solved is not logged")),
                },
                Source::Driven(values) => Ok(values[sample]),
                Source::Given(value) => Ok(*value),
            })
            .collect()
    }
}

fn too_few(needed: usize, series: &Series) -> Error {
    Error::TooFewSamples { what: "derivative of a logged state".into(), needed, found: series.values.len() }
}

/// State `hidden` from the equation of a logged state, where it is the only one in it that is not logged.
fn solved(
    model: &Model,
    found: &[Option<Source>],
    hidden: usize,
    (run, channels): (&Run, &[Channel]),
) -> Option<Source> {
    let name = &model.states[hidden].name;
    let logged = |j: usize| matches!(found[j], Some(Source::Logged(_)));
    let mut rows = (0..found.len()).filter(|&j| logged(j) && model.states[j].equation.contains(name));
    let (of, equation) = rows.next().map(|j| (j, &model.states[j].equation))?;
    let numbers: Vec<(String, f64)> = model.parameters.iter().map(|p| (p.name.clone(), p.value)).collect();
    let column = |name: &str| channels.iter().position(|channel| channel.name == name);
    let inversion = Inversion::new(equation, name, &numbers, &column).ok()?;
    let filled = |c: usize| match model.state_index(&channels[c].name).map(|j| &found[j]) {
        Some(Some(Source::Logged(series))) => {
            run.time.iter().map(|t| series.interpolate(*t).unwrap_or(f64::NAN)).collect()
        }
        _ => {
            let known = Series::new(&run.time, run.column(c).to_vec(), 0.0);
            run.time.iter().map(|t| known.interpolate(*t).unwrap_or(f64::NAN)).collect()
        }
    };
    Some(Source::Solved { of, inversion, columns: (0..channels.len()).map(filled).collect() })
}

/// Per state its column with `measured` inverted, where there is such a column with a value in it.
fn logged_states(
    system: &System,
    run: &Run,
    channels: &[Channel],
    excitation: &Excitation,
) -> Result<Vec<Option<Series>>> {
    let model = system.model();
    let n = model.states.len();
    let columns: Vec<Option<&[f64]>> = model
        .states
        .iter()
        .map(|s| channels.iter().position(|c| c.name == s.name).map(|column| run.column(column)))
        .collect();
    let mut cells: Vec<Option<Vec<f64>>> = columns.iter().map(|c| c.map(<[f64]>::to_vec)).collect();
    let mut delays = vec![0.0; n];
    let mut inverted = Vec::new();
    for (j, state) in model.states.iter().enumerate() {
        if let (Some(measured), Some(_)) = (&state.measured, columns[j]) {
            if is_affine(measured, &state.name) {
                delays[j] = sensor_delay(model, measured, &state.name)?;
                inverted.push(j);
            } else if ends(measured, &state.name) {
                // At an end the state is there or beyond: the end is the nearest value.
            } else if let Some(seen) = reads_another(model, measured) {
                // A sensor that smooths: what it shows, and near enough what it sees.
                let shown = cells[j].clone();
                cells[seen] = shown;
            } else {
                cells[j] = None;
            }
        }
    }
    // A sensor that reads other states as well needs their values first: a few rounds settle that.
    let rounds = if inverted.len() > 1 { 4 } else { 1 };
    let mut rates = Rates::new(system, excitation);
    let late: Vec<usize> = system.late_states().iter().map(|l| l.state).collect();
    let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
    for _ in 0..rounds {
        for &j in &inverted {
            for (i, &t) in run.time.iter().enumerate() {
                x.iter_mut().zip(&cells).for_each(|(value, c)| *value = c.as_ref().map_or(f64::NAN, |c| c[i]));
                let mut read = |own: f64| {
                    x[j] = own;
                    let late: Vec<f64> = late.iter().map(|&k| x[k]).collect();
                    rates.output(t, &x, &late, &mut y);
                    y[j]
                };
                let (offset, unit) = (read(0.0), read(1.0));
                if let (Some(cells), Some(column)) = (&mut cells[j], columns[j]) {
                    cells[i] = (column[i] - offset) / (unit - offset);
                }
            }
        }
    }
    Ok(cells
        .into_iter()
        .zip(delays)
        .map(|(cells, delay)| Some(Series::new(&run.time, cells?, delay)).filter(|series| !series.values.is_empty()))
        .collect())
}

/// Whether `measured` is affine in the state `name`, read late or not.
fn is_affine(measured: &Expression, name: &str) -> bool {
    let at_once = measured.map(&|part| match part {
        Expression::Call(function, ref arguments)
            if function.has_memory() && arguments[0] == Expression::variable(name) =>
        {
            arguments[0].clone()
        }
        other => other,
    });
    at_once.contains(name) && at_once.derivative(name).is_ok_and(|slope| !slope.contains(name))
}

/// The state without a column that `measured` shows, where it shows just one: a filtered sensor.
fn reads_another(model: &Model, measured: &Expression) -> Option<usize> {
    match measured {
        Expression::Variable(name) => model.state_index(name),
        _ => None,
    }
}

/// How late a sensor reads its state on average, s.
fn sensor_delay(model: &Model, measured: &Expression, name: &str) -> Result<f64> {
    let mut amount = None;
    measured.visit(&mut |part| {
        if let Expression::Call(function, arguments) = part
            && function.has_memory()
            && arguments[0] == Expression::variable(name)
        {
            let share = if *function == Function::SampleHold { 0.5 } else { 1.0 };
            amount = Some(Expression::Number(share).times(arguments[1].clone()));
        }
    });
    let Some(amount) = amount else { return Ok(0.0) };
    let names: Vec<String> = model.parameters.iter().map(|p| p.name.clone()).collect();
    let values: Vec<f64> = model.parameters.iter().map(|p| p.value).collect();
    Ok(Tape::new(&[amount], &names)?.evaluate_once(&values, 0.0)[0])
}

fn derivative_of_logged(model: &Model, found: &[Option<Source>], state: usize) -> Option<Source> {
    let (mut of, mut order, mut per) = (state, 0, 1.0);
    while order < 3 {
        of = model.integral_of(of)?;
        order += 1;
        per *= model.per_rate(of);
        if matches!(found[of], Some(Source::Logged(_))) {
            return Some(Source::Derivative { of, order, per });
        }
    }
    None
}

/// The states without a source whose equations read no state with one; a simulator's own have no state of rest that we know.
fn driven_states(model: &Model, found: &[Option<Source>]) -> Vec<usize> {
    let mut driven: Vec<usize> = (0..found.len()).filter(|&j| found[j].is_none() && !model.is_simulated(j)).collect();
    loop {
        let closed = |&j: &usize| {
            let reads = |k: usize| model.states[j].equation.contains(&model.states[k].name);
            (0..found.len()).all(|k| driven.contains(&k) || !reads(k))
        };
        let kept: Vec<usize> = driven.iter().copied().filter(closed).collect();
        if kept.len() == driven.len() {
            return kept;
        }
        driven = kept;
    }
}

/// The states `driven` at all samples, at rest at the first; None where they have no state of rest.
fn drive(model: &Model, driven: &[usize], excitation: &Excitation) -> Result<Option<Vec<Vec<f64>>>> {
    let states = driven.iter().map(|&j| crate::model::State { measured: None, ..model.states[j].clone() }).collect();
    let part = Model { states, initial: Default::default(), identification: None, ..model.clone() };
    let system = part.compile()?;
    let excitation = excitation.for_system(&system)?;
    let guess: Vec<f64> = part.states.iter().map(|s| model.initial.get(&s.name).copied().unwrap_or(0.0)).collect();
    // A state that has its own end of speed is at rest where its control is.
    let controls: Vec<Vec<f64>> = excitation.first_controls().map(|u| vec![u; guess.len()]).collect();
    let mut guesses = std::iter::once(guess).chain(controls);
    let Some(mut rest) = guesses.find_map(|guess| state_of_rest(&system, &excitation, guess)) else { return Ok(None) };
    for (value, state) in rest.iter_mut().zip(&part.states) {
        *value = model.initial.get(&state.name).copied().unwrap_or(*value);
    }
    let rollout = Simulate::default().rollout(&system, &excitation, &rest)?;
    Ok(Some((0..driven.len()).map(|j| rollout.states.col_as_slice(j).to_vec()).collect()))
}

/// Where the rates are zero under the first controls, by Newton's method.
fn state_of_rest(system: &System, excitation: &Excitation, mut x: Vec<f64>) -> Option<Vec<f64>> {
    let n = x.len();
    let first = excitation.time()[0];
    let mut rates = Rates::new(system, excitation);
    rates.enter(first, first + 1e-6 * excitation.period());
    let (mut f, mut moved) = (vec![0.0; n], vec![0.0; n]);
    for _ in 0..50 {
        rates.rate(first, &x, &mut f);
        let mut jacobian = DMatrix::zeros(n, n);
        for k in 0..n {
            let before = x[k];
            x[k] = before + 1e-7 * before.abs().max(1.0);
            let step = x[k] - before;
            rates.rate(first, &x, &mut moved);
            x[k] = before;
            (0..n).for_each(|j| jacobian[(j, k)] = (moved[j] - f[j]) / step);
        }
        let change = jacobian.lu().solve(&DVector::from_column_slice(&f))?;
        let mut settled = true;
        for j in 0..n {
            x[j] -= change[j];
            settled &= change[j].abs() <= 1e-10 * x[j].abs().max(1e-10);
        }
        if !x.iter().all(|v| v.is_finite()) {
            return None;
        }
        if settled {
            return Some(x);
        }
    }
    None
}
