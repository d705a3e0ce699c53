//! Prediction errors of a model on logs: over whole runs, over windows, over single steps.
//!
//! The `measured` expression of a state is compared with the column of the log, so a bias or delay of a sensor is part of the
//! model.

use crate::data::{Dataset, Run};
use crate::error::{Error, Result};
use crate::model::System;
use crate::parallel;
use crate::progress::{Progress, step};
use crate::simulate::{Excitation, Rollout, Simulate, StateReader, latest};
use std::ops::Range;

/// One-step predictions made in a run at most, spread evenly over it.
const MOST_STEPS: usize = 2000;

/// Share of the largest value logged by which rounding alone moves a state that is zero, as the integrator counts it.
const ROUNDING: f64 = 1e-14;

/// Settings of a score.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scoring {
    /// How rollouts are integrated; `hold` counts.
    pub simulate: Simulate,
    /// Length of the windows, s; above 0. Default: a tenth of each run.
    pub window: Option<f64>,
}

/// The errors of one kind of prediction.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Errors {
    /// One entry a logged state, in the model's order.
    pub by_state: Vec<StateError>,
    /// Root mean square, over samples and logged columns, of the error divided by that column's standard
    /// deviation in the data. Columns that do not vary beyond rounding are left out; NaN where nothing is left.
    pub pooled: f64,
    /// Predictions started: runs, windows or steps.
    pub n_started: usize,
    /// Predictions that diverged or could not be integrated; their samples up to there still count.
    pub n_diverged: usize,
}

/// The error of one logged state.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StateError {
    /// The state's name.
    pub state: String,
    /// Its unit as text: the model's, else the log's.
    pub unit: String,
    /// Root mean square error, in that unit; NaN where no sample could be compared.
    pub rmse: f64,
    /// The same divided by the column's standard deviation in the data; NaN for a column that does not vary beyond rounding.
    pub normalised: f64,
    /// Samples compared.
    pub n_samples: usize,
}

/// The errors of a model on a dataset.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Score {
    /// Whole runs from their first sample.
    pub rollout: Errors,
    /// Windows, each started from the log; the samples they start from are not counted.
    pub windowed: Errors,
    /// From each sample to the next one, at most 2000 of a run.
    pub one_step: Errors,
}

/// Squared errors of one run.
struct Tally {
    squares: Vec<f64>,
    counts: Vec<usize>,
    n_started: usize,
    n_diverged: usize,
}

/// One run with everything that its predictions need.
struct Subject<'a> {
    system: &'a System,
    simulate: &'a Simulate,
    run: &'a Run,
    /// State and column of each compared pair.
    logged: &'a [(usize, usize)],
    excitation: Excitation,
    reader: StateReader,
    /// How late the latest sensor is, s.
    lateness: f64,
}

/// Scores `system` on every run of `data`.
///
/// # Errors
/// Data without any state of the model or without a control of it; a state that can't be read from a run
/// (see [`StateReader`]); a window that is not above 0. A diverging prediction is no error: it is counted.
pub fn score(system: &System, data: &Dataset, settings: &Scoring, progress: &dyn Progress) -> Result<Score> {
    if let Some(window) = settings.window
        && !(window.is_finite() && window > 0.0)
    {
        return Err(Error::range("window", "above 0 s", window));
    }
    let logged = logged_columns(system, data)?;
    let deviations = deviations(data, &logged);
    let largest = logged.iter().map(|&(_, column)| largest(data, column)).fold(0.0, f64::max);
    let settings = &Scoring { simulate: settings.simulate.beside(largest), ..*settings };
    let n_runs = data.runs().len();
    let tallies: Vec<[Tally; 3]> = parallel::try_map(data.runs().iter().enumerate(), |(i, run)| {
        let subject = Subject::new(system, settings, data, run, &logged)?;
        let found = [subject.whole()?, subject.windows(settings.window)?, subject.single_steps()?];
        step(progress, "score", i + 1, n_runs)?;
        Ok(found)
    })?;
    let errors = |kind: usize| pool(system, data, &logged, &deviations, tallies.iter().map(|t| &t[kind]));
    Ok(Score { rollout: errors(0), windowed: errors(1), one_step: errors(2) })
}

/// The states that the data carry: pairs of state and column, in the model's order.
fn logged_columns(system: &System, data: &Dataset) -> Result<Vec<(usize, usize)>> {
    let states = &system.model().states;
    let logged: Vec<(usize, usize)> =
        states.iter().enumerate().filter_map(|(j, s)| Some((j, data.index_of(&s.name).ok()?))).collect();
    if logged.is_empty() {
        return Err(Error::unknown("state", &states[0].name, data.channels().iter().map(|c| &c.name)));
    }
    Ok(logged)
}

/// Standard deviation of every compared column; 0 where it is a rest that only rounding moves.
fn deviations(data: &Dataset, logged: &[(usize, usize)]) -> Vec<f64> {
    let of_all = logged.iter().map(|&(_, column)| largest(data, column)).fold(0.0, f64::max);
    let of = |&(_, column): &(usize, usize)| {
        let deviation = deviation(data, column);
        let rounding = (ROUNDING * of_all).max(8.0 * f64::EPSILON * largest(data, column));
        if deviation > rounding { deviation } else { 0.0 }
    };
    logged.iter().map(of).collect()
}

/// Largest size in a column over all runs, missing cells left out.
fn largest(data: &Dataset, column: usize) -> f64 {
    let values = data.runs().iter().flat_map(|run| run.column(column));
    values.filter(|v| !v.is_nan()).fold(0.0, |largest: f64, v| largest.max(v.abs()))
}

/// Standard deviation of a column over all runs, missing cells left out.
fn deviation(data: &Dataset, column: usize) -> f64 {
    let known = || data.runs().iter().flat_map(|run| run.column(column)).filter(|v| !v.is_nan());
    let count = known().count() as f64;
    let mean = known().sum::<f64>() / count;
    (known().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

impl<'a> Subject<'a> {
    fn new(
        system: &'a System,
        settings: &'a Scoring,
        data: &'a Dataset,
        run: &'a Run,
        logged: &'a [(usize, usize)],
    ) -> Result<Self> {
        let excitation = Excitation::of_run(system, run, data.channels(), settings.simulate.hold)?;
        let reader = StateReader::new(system, run, data.channels(), &excitation)?;
        let lateness = latest(system, (run.time[0], run.time[run.n_samples() - 1]));
        Ok(Self { system, simulate: &settings.simulate, run, logged, excitation, reader, lateness })
    }

    fn whole(&self) -> Result<Tally> {
        let mut tally = Tally::new(self.logged.len());
        self.predict(&mut tally, 0..self.run.n_samples(), 0)?;
        Ok(tally)
    }

    fn windows(&self, length: Option<f64>) -> Result<Tally> {
        let time = &self.run.time;
        let length = length.unwrap_or((time[time.len() - 1] - time[0]) / 10.0);
        let mut tally = Tally::new(self.logged.len());
        let mut start = 0;
        while start + 1 < time.len() {
            // A sensor that reads late can be predicted only that much after the start.
            let first = time.partition_point(|&t| t <= time[start] + self.lateness);
            let next = time.partition_point(|&t| t < time[start] + length * (1.0 - 1e-9)).max(start + 1);
            let end = (next + 1).max(first + 1).min(time.len());
            self.predict(&mut tally, start..end, first - start)?;
            start = next;
        }
        Ok(tally)
    }

    fn single_steps(&self) -> Result<Tally> {
        let time = &self.run.time;
        let mut tally = Tally::new(self.logged.len());
        let n_starts = time.len() - 1;
        let stride = n_starts.div_ceil(MOST_STEPS).max(1);
        for start in (0..n_starts).step_by(stride) {
            let first = time.partition_point(|&t| t <= time[start] + self.lateness);
            if first < time.len() {
                self.predict(&mut tally, start..first + 1, first - start)?;
            }
        }
        Ok(tally)
    }

    /// Rolls the samples `range` out from the state in the log and compares all from its sample `skip` on.
    fn predict(&self, tally: &mut Tally, range: Range<usize>, skip: usize) -> Result<()> {
        tally.n_started += 1;
        let start = range.start;
        let initial = self.reader.at(start)?;
        let attempt = |range| self.simulate.rollout_range(self.system, &self.excitation, &initial, range);
        let rollout = match attempt(range.clone()) {
            Ok(rollout) => rollout,
            Err(Error::Diverged { time, .. }) => {
                tally.n_diverged += 1;
                let end = range.start + self.run.time[range].partition_point(|&t| t < time);
                match attempt(start..end.max(start + 1)) {
                    Ok(rollout) => rollout,
                    Err(_) => return Ok(()),
                }
            }
            Err(Error::NotConverged { .. }) => {
                tally.n_diverged += 1;
                return Ok(());
            }
            Err(other) => return Err(other),
        };
        self.compare(tally, &rollout, start, skip);
        Ok(())
    }

    fn compare(&self, tally: &mut Tally, rollout: &Rollout, start: usize, skip: usize) {
        for (k, &(state, column)) in self.logged.iter().enumerate() {
            let measured = self.run.column(column);
            for i in skip..rollout.time.len() {
                let error = rollout.outputs[(i, state)] - measured[start + i];
                if error.is_finite() {
                    tally.squares[k] += error * error;
                    tally.counts[k] += 1;
                }
            }
        }
    }
}

impl Tally {
    fn new(n: usize) -> Self {
        Self { squares: vec![0.0; n], counts: vec![0; n], n_started: 0, n_diverged: 0 }
    }
}

fn pool<'a>(
    system: &System,
    data: &Dataset,
    logged: &[(usize, usize)],
    deviations: &[f64],
    tallies: impl Iterator<Item = &'a Tally>,
) -> Errors {
    let mut total = Tally::new(logged.len());
    for tally in tallies {
        for k in 0..logged.len() {
            total.squares[k] += tally.squares[k];
            total.counts[k] += tally.counts[k];
        }
        total.n_started += tally.n_started;
        total.n_diverged += tally.n_diverged;
    }
    let (mut sum, mut count) = (0.0, 0);
    let mut by_state = Vec::with_capacity(logged.len());
    for (k, &(state, column)) in logged.iter().enumerate() {
        let (state, channel) = (&system.model().states[state], &data.channels()[column]);
        let rmse = (total.squares[k] / total.counts[k] as f64).sqrt();
        let varies = deviations[k] > 0.0;
        if varies {
            sum += total.squares[k] / deviations[k].powi(2);
            count += total.counts[k];
        }
        by_state.push(StateError {
            state: state.name.clone(),
            unit: if state.unit.is_empty() { channel.unit.clone() } else { state.unit.clone() },
            rmse,
            normalised: if varies { rmse / deviations[k] } else { f64::NAN },
            n_samples: total.counts[k],
        });
    }
    Errors { by_state, pooled: (sum / count as f64).sqrt(), n_started: total.n_started, n_diverged: total.n_diverged }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Channel;
    use crate::expression::Expression;
    use crate::model::{Control, Model, State};
    use crate::progress::Silent;
    use faer::Mat;

    fn model(equation: &str) -> Model {
        Model {
            states: vec![State::new("x", Expression::parse(equation).unwrap())],
            controls: vec![Control::new("u")],
            ..Model::default()
        }
    }

    fn data(n: usize, x: impl Fn(f64) -> f64) -> Dataset {
        let time: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
        let values = Mat::from_fn(n, 2, |i, j| if j == 0 { x(time[i]) } else { 1.0 });
        let run = |name: &str| Run { name: name.into(), time: time.clone(), values: values.clone() };
        Dataset::new(vec![Channel::new("x").with_unit("m"), Channel::new("u")], vec![run("a"), run("b")]).unwrap()
    }

    fn scored(model: &Model, data: &Dataset, window: f64) -> Score {
        let settings = Scoring { window: Some(window), ..Scoring::default() };
        score(&model.compile().unwrap(), data, &settings, &Silent).unwrap()
    }

    #[test]
    fn a_perfect_model_has_no_error() {
        let found = scored(&model("u"), &data(51, |t| t), 1.0);
        for errors in [&found.rollout, &found.windowed, &found.one_step] {
            assert!(errors.pooled < 1e-8, "{errors:?}");
            assert_eq!(errors.n_diverged, 0);
        }
        assert_eq!(found.rollout.n_started, 2);
        assert_eq!(found.windowed.n_started, 10);
        assert_eq!(found.one_step.n_started, 100);
    }

    #[test]
    fn a_wrong_slope_grows_with_the_length_of_the_prediction() {
        // The model rises with 1, the data with 1.1: the error is 0.1 t.
        let found = scored(&model("u"), &data(51, |t| 1.1 * t), 1.0);
        assert!((found.one_step.by_state[0].rmse - 0.01).abs() < 1e-9);
        let mean_square = |n: usize| (1..=n).map(|i| (0.01 * i as f64).powi(2)).sum::<f64>();
        assert!((found.windowed.by_state[0].rmse - (mean_square(10) / 10.0).sqrt()).abs() < 1e-9);
        assert!((found.rollout.by_state[0].rmse - (mean_square(50) / 51.0).sqrt()).abs() < 1e-9);
        // 51 even steps of 0.11 have a standard deviation of 0.11 sqrt((51^2 - 1)/12).
        let deviation = 0.11 * ((51.0_f64.powi(2) - 1.0) / 12.0).sqrt();
        assert!((found.rollout.pooled - found.rollout.by_state[0].rmse / deviation).abs() < 1e-9);
        assert_eq!(found.rollout.by_state[0].unit, "m");
    }

    #[test]
    fn what_measured_says_is_compared() {
        let mut sensor = model("u");
        sensor.states[0].measured = Some(Expression::parse("2*delay(x, 0.25) + 3").unwrap());
        let found = scored(&sensor, &data(51, |t| 2.0 * (t - 0.25) + 3.0), 1.0);
        assert!(found.one_step.pooled < 1e-8, "{}", found.one_step.pooled);
        assert!(found.windowed.pooled < 1e-8, "{}", found.windowed.pooled);
    }

    #[test]
    fn a_column_that_rests_but_for_rounding_has_no_relative_error() {
        // A joint at rest next to one that turns: what it logs is the rounding of the simulator.
        let mut two = model("u");
        two.states.push(State::new("rest", Expression::parse("1e-3*u").unwrap()));
        let time: Vec<f64> = (0..51).map(|i| 0.1 * i as f64).collect();
        let rounding = |i: usize| 1e-16 * (i as f64).sin();
        let values = Mat::from_fn(51, 3, |i, j| [time[i], 1.0, rounding(i)][j]);
        let channels = ["x", "u", "rest"].map(Channel::new).to_vec();
        let data = Dataset::new(channels, vec![Run { name: "a".into(), time, values }]).unwrap();
        let found = scored(&two, &data, 1.0).rollout;
        assert!(found.by_state[1].normalised.is_nan(), "{found:?}");
        assert!(found.by_state[1].rmse > 1e-3 && found.pooled < 1e-8, "{found:?}");
    }

    #[test]
    fn diverged_runs_are_counted() {
        let found = scored(&model("x^3 + u"), &data(51, |t| t), 1.0);
        assert_eq!(found.rollout.n_diverged, 2);
        assert!(found.rollout.by_state[0].n_samples < 60);
        assert_eq!(found.one_step.by_state[0].n_samples + found.one_step.n_diverged, 100);
    }

    #[test]
    fn the_callers_mistakes_are_stated() {
        let system = model("u").compile().unwrap();
        let settings = Scoring { window: Some(0.0), ..Scoring::default() };
        assert!(score(&system, &data(5, |t| t), &settings, &Silent).unwrap_err().to_string().contains("window"));
        let mut other = model("u");
        other.states[0].name = "z".into();
        let error = score(&other.compile().unwrap(), &data(5, |t| t), &Scoring::default(), &Silent).unwrap_err();
        assert_eq!(error.to_string(), "state `z` is unknown; known: x, u");
    }
}
