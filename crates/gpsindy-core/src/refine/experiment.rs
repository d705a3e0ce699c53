//! The data of a fit: logs, their windows, and the noise of every logged column.

use crate::data::{Dataset, Hold, Run};
use crate::error::{Error, Result};
use crate::model::{LateState, System};
use crate::refine::tally::Tally;
use std::sync::Arc;

/// What a sensor that answers late shows until its delay has passed since the log began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Past {
    /// The first state: the machine did not move, or the simulator fills its buffer with it.
    #[default]
    Still,
    /// The state on its tangent: the machine was moving already.
    Moving,
}

/// One run as a fit sees it.
#[derive(Debug, Clone, Default)]
pub struct Log {
    /// Name of the run.
    pub name: String,
    /// Sample times, s, r of them.
    pub time: Vec<f64>,
    /// One row a control, r values each; a missing value holds the last known one.
    pub controls: Vec<Vec<f64>>,
    /// One row a logged column, r values each; NaN is a missing value.
    pub measured: Vec<Vec<f64>>,
    /// Parameters that have a value of their own in this run: which, and by how much it is more than that of all runs.
    pub own: Vec<(usize, f64)>,
    /// Controls that a limited rate has not brought to their first value as the run begins: which, and by how much it is more there.
    pub begun: Vec<(usize, f64)>,
    /// Slow sensors whose clock begins anew with each run: which state they read, and a moment at which they sample it here, s. The phase of a
    /// hold counts from there.
    pub sampled: Vec<(usize, f64)>,
}

impl Log {
    /// How late every state that is read late is read in this run, as [`LateState::amounts`](crate::model::LateState::amounts) has it.
    pub(crate) fn lateness<const L: usize>(&self, system: &System, parameters: &[[f64; L]]) -> Vec<[[f64; 2]; L]> {
        let of = |late: &LateState| {
            let mut amounts = late.amounts(parameters);
            let own = self.sampled.iter().find(|(state, _)| late.is_held() && *state == late.state);
            let from = own.map_or(0.0, |(_, from)| *from);
            amounts.iter_mut().for_each(|amounts| amounts[1] += from);
            amounts
        };
        system.late_states().iter().map(of).collect()
    }

    /// The parameters of a rollout of this run, of those of all runs.
    pub(crate) fn parameters<const L: usize>(&self, all: &[[f64; L]]) -> Vec<[f64; L]> {
        let mut own = all.to_vec();
        for &(parameter, more) in &self.own {
            own.get_mut(parameter).into_iter().flatten().for_each(|value| *value += more);
        }
        own
    }
}

/// A stretch of a log that is rolled out from an initial state of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Which log.
    pub log: usize,
    /// First sample.
    pub first: usize,
    /// Last sample, included.
    pub last: usize,
}

/// By how much the first samples of every window count more than the others.
///
/// Where rollouts leave the logs by more than the noise, the first samples show far better than all that follow where a
/// window starts; a start that is free would take up a part of what the equations should explain.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Starts {
    /// How many samples of every window.
    pub samples: usize,
    /// How many times more their squared residuals count.
    pub more: f64,
}

impl Starts {
    /// How many times the squared residual of a window's sample number `sample` counts.
    pub(crate) fn weight(&self, sample: usize) -> f64 {
        if sample < self.samples { 1.0 + self.more } else { 1.0 }
    }
}

/// Logs prepared for the fit of a system's parameters.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// The runs; shared, so that an experiment with other windows costs little.
    pub logs: Arc<Vec<Log>>,
    /// Which states the columns of `measured` are; the system's outputs of these numbers are compared.
    pub columns: Vec<usize>,
    /// Standard deviation of the noise of every logged column, in the column's unit.
    pub noise: Vec<f64>,
    /// Share of every logged column's values that are readings: a sensor that is slower than the log repeats its last one, with its noise.
    pub(crate) news: Vec<f64>,
    /// The stretches that are rolled out.
    pub windows: Vec<Window>,
    /// Control between the samples.
    pub hold: Hold,
    /// States before a log's first sample, as a late sensor sees them.
    pub past: Past,
    /// How the first samples of the windows count, relative to the others.
    pub starts: Starts,
    /// Integration steps between two samples.
    pub substeps: usize,
    /// Typical size of every state, in its unit: sets the steps of finite differences.
    pub scale: Vec<f64>,
    /// What was done with the logs so far.
    pub(crate) tally: Arc<Tally>,
}

impl Experiment {
    /// Takes the columns that `system` names out of `data`; every run is one window.
    ///
    /// `noise` has one value a logged state, in the order of the system's states; where it is absent the
    /// spread of each column serves, so that columns count alike.
    ///
    /// # Errors
    /// A control that the data lack, data without any state of the system, or a control without a value.
    pub fn new(system: &System, data: &Dataset, noise: Option<&[f64]>) -> Result<Self> {
        let model = system.model();
        let mut columns = Vec::new();
        let mut channels = Vec::new();
        for (j, state) in model.states.iter().enumerate() {
            if let Ok(channel) = data.index_of(&state.name) {
                columns.push(j);
                channels.push(channel);
            }
        }
        if columns.is_empty() {
            let known = data.channels().iter().map(|c| &c.name);
            return Err(Error::unknown("state", &model.states[0].name, known));
        }
        let controls = data.indices_of(&model.controls.iter().map(|c| &c.name).collect::<Vec<_>>())?;
        let logs = data.runs().iter().map(|run| log(run, &channels, &controls, model)).collect::<Result<Vec<_>>>()?;
        let windows =
            logs.iter().enumerate().map(|(i, l)| Window { log: i, first: 0, last: l.time.len() - 1 }).collect();
        let spread: Vec<f64> = (0..columns.len()).map(|c| spread(&logs, c)).collect();
        let noise = match noise {
            Some(noise) if noise.len() != columns.len() => {
                return Err(Error::shape("noise", format!("{} values", columns.len()), noise.len()));
            }
            Some(noise) => noise.to_vec(),
            None => spread.clone(),
        };
        let scale = state_scales(system, &logs, &columns, &spread);
        Ok(Self {
            logs: logs.into(),
            news: vec![1.0; columns.len()],
            columns,
            noise,
            windows,
            hold: Hold::Zero,
            past: Past::Still,
            starts: Starts::default(),
            substeps: 1,
            scale,
            tally: Arc::default(),
        })
    }

    /// Position among the logged columns of state `state`, where it is logged.
    pub fn column_of(&self, state: usize) -> Option<usize> {
        self.columns.iter().position(|&c| c == state)
    }

    /// Mean sampling step of the longest log, s; 1 without one.
    pub(crate) fn sampling_step(&self) -> f64 {
        let longest = self.logs.iter().max_by_key(|log| log.time.len());
        longest.map_or(1.0, |log| (log.time[log.time.len() - 1] - log.time[0]) / (log.time.len() - 1).max(1) as f64)
    }

    /// Duration of the longest window, s.
    pub(crate) fn longest_window(&self) -> f64 {
        let duration = |w: &Window| self.logs[w.log].time[w.last] - self.logs[w.log].time[w.first];
        self.windows.iter().map(duration).fold(0.0, f64::max)
    }

    /// Cuts every log into windows of about `length` seconds that share their end samples with nobody.
    #[must_use]
    pub fn with_windows_of(mut self, length: f64) -> Self {
        self.windows.clear();
        for (i, log) in self.logs.iter().enumerate() {
            let total = log.time[log.time.len() - 1] - log.time[0];
            let count = ((total / length).round() as usize).clamp(1, (log.time.len() / 4).max(1));
            let mut first = 0;
            for part in 0..count {
                let end = log.time[0] + total * (part + 1) as f64 / count as f64;
                let last =
                    if part + 1 == count { log.time.len() - 1 } else { log.time.partition_point(|&t| t <= end) - 1 };
                if last > first {
                    self.windows.push(Window { log: i, first, last });
                    first = last + 1;
                }
            }
        }
        self
    }

    /// What each run has of its own of the parameters.
    pub(crate) fn own_parameters(&self) -> Vec<Vec<(usize, f64)>> {
        self.logs.iter().map(|log| log.own.clone()).collect()
    }

    /// Whether a value repeats the one before, sample by sample as residuals are; nothing where no column repeats its readings.
    pub(crate) fn repeats(&self, window: &Window) -> Vec<bool> {
        if self.news.iter().all(|&news| news >= 1.0) {
            return Vec::new();
        }
        let columns = self.columns.len();
        let mut repeats = vec![false; (window.last - window.first + 1) * columns];
        for (c, _) in self.news.iter().enumerate().filter(|(_, news)| **news < 1.0) {
            let there = present(&self.logs[window.log].measured[c][window.first..=window.last]);
            there.windows(2).filter(|pair| pair[1].1 == pair[0].1).for_each(|pair| {
                repeats[pair[1].0 * columns + c] = true;
            });
        }
        repeats
    }

    /// Samples that one pass over all windows takes.
    pub(crate) fn n_samples(&self) -> usize {
        self.windows.iter().map(|w| w.last - w.first + 1).sum()
    }

    /// Rows from one value of a column to its next, on average and at least one: more where every topic has rows of its own.
    pub(crate) fn rows_a_value(&self) -> usize {
        let rows: usize = self.logs.iter().map(|log| log.time.len()).sum();
        let columns = self.logs.iter().flat_map(|log| &log.measured);
        let values: usize = columns.map(|c| c.iter().filter(|v| v.is_finite()).count()).sum();
        (rows as f64 * self.columns.len() as f64 / values.max(1) as f64).round().max(1.0) as usize
    }

    /// Number of values that are compared, missing ones left out.
    pub fn n_values(&self) -> usize {
        self.windows
            .iter()
            .map(|w| {
                let log = &self.logs[w.log];
                log.measured.iter().map(|c| c[w.first..=w.last].iter().filter(|v| v.is_finite()).count()).sum::<usize>()
            })
            .sum()
    }
}

fn log(run: &Run, channels: &[usize], controls: &[usize], model: &crate::model::Model) -> Result<Log> {
    let mut filled = Vec::with_capacity(controls.len());
    for (&column, control) in controls.iter().zip(&model.controls) {
        let values = run.column(column);
        let Some(&first) = values.iter().find(|v| v.is_finite()) else {
            return Err(Error::data(format!("run `{}`: control `{}` has no value at all", run.name, control.name)));
        };
        let mut last = first;
        filled.push(
            values
                .iter()
                .map(|&v| {
                    if v.is_finite() {
                        last = v;
                    }
                    last
                })
                .collect(),
        );
    }
    Ok(Log {
        name: run.name.clone(),
        time: run.time.clone(),
        controls: filled,
        measured: channels.iter().map(|&c| run.column(c).to_vec()).collect(),
        own: Vec::new(),
        begun: Vec::new(),
        sampled: Vec::new(),
    })
}

/// The rows that have a value, and the values: the samples of a column whose topic has rows of its own follow each other in it.
pub(crate) fn present(column: &[f64]) -> Vec<(usize, f64)> {
    column.iter().copied().enumerate().filter(|(_, value)| value.is_finite()).collect()
}

/// Standard deviation of a logged column over all runs.
fn spread(logs: &[Log], column: usize) -> f64 {
    let values = || logs.iter().flat_map(|l| l.measured[column].iter().copied()).filter(|v| v.is_finite());
    let count = values().count().max(1) as f64;
    let mean = values().sum::<f64>() / count;
    let variance = values().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    let largest = values().fold(0.0, |a: f64, v| a.max(v.abs()));
    // A constant column has no spread; its size, or one, then sets the scale.
    if variance > 1e-24 * largest * largest {
        variance.sqrt()
    } else if largest > 0.0 {
        largest
    } else {
        1.0
    }
}

/// Typical sizes: of a logged state its spread; of an unlogged velocity the slopes of its
/// position; of any other state one.
fn state_scales(system: &System, logs: &[Log], columns: &[usize], spreads: &[f64]) -> Vec<f64> {
    let model = system.model();
    (0..model.states.len())
        .map(|j| {
            if let Some(c) = columns.iter().position(|&c| c == j) {
                return spreads[c];
            }
            let place = model.integral_of(j).and_then(|i| Some((i, columns.iter().position(|&c| c == i)?)));
            let Some((place, c)) = place else { return 1.0 };
            // Over a fortieth of the log, so that noise and encoder steps do not count as motion.
            let mut sum = 0.0;
            let mut count = 0.0;
            for log in logs {
                let there = present(&log.measured[c]);
                let lag = (there.len() / 40).max(1);
                for ((before, from), (after, to)) in there.iter().zip(there.iter().skip(lag)) {
                    let rate = (to - from) / (log.time[*after] - log.time[*before]);
                    sum += rate * rate;
                    count += 1.0;
                }
            }
            ((sum / f64::max(count, 1.0)).sqrt() / model.per_rate(place).abs()).max(f64::MIN_POSITIVE)
        })
        .collect()
}
