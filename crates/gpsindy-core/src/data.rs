//! Logs in memory: channels, runs, datasets. A dataset is always a list of runs.

use crate::error::{Error, Result};
use faer::Mat;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// A logged quantity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Name: a letter, then letters, digits and `_`.
    pub name: String,
    /// Unit as text, empty where none is known.
    pub unit: String,
}

impl Channel {
    /// A channel without a unit.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: String::new() }
    }

    /// The same channel with a unit.
    #[must_use]
    pub fn with_unit(mut self, unit: impl Into<String>) -> Self {
        self.unit = unit.into();
        self
    }
}

/// One uninterrupted log: sample times and a value of every channel at each.
#[derive(Debug, Clone)]
pub struct Run {
    /// Name shown in reports, usually the file's.
    pub name: String,
    /// Sample times, s, strictly increasing, r of them.
    pub time: Vec<f64>,
    /// (r x c), rows are samples, columns are the dataset's channels; NaN is a missing value.
    pub values: Mat<f64>,
}

impl Run {
    /// Number of samples r.
    pub fn n_samples(&self) -> usize {
        self.time.len()
    }

    /// The samples of channel `channel` (index into the dataset's channels), r of them.
    pub fn column(&self, channel: usize) -> &[f64] {
        self.values.col_as_slice(channel)
    }

    /// Whether column `c` climbs or falls in a straight line of time, within a millionth of its range: the digits of a log. A
    /// clock or a row number does.
    pub fn is_line_of_time(&self, c: usize) -> bool {
        let (time, values) = (&self.time, self.column(c));
        let last = values.len().saturating_sub(1);
        if last < 2 {
            return false;
        }
        let size = (values[last] - values[0]).abs();
        let slope = (values[last] - values[0]) / (time[last] - time[0]);
        let off = |i: usize| (values[i] - values[0] - slope * (time[i] - time[0])).abs();
        size > 0.0 && (0..=last).all(|i| off(i) <= 1e-6 * size)
    }

    /// Typical sampling period, s: the median of the steps. NaN for fewer than two samples.
    pub fn period(&self) -> f64 {
        let mut steps: Vec<f64> = self.time.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return f64::NAN;
        }
        steps.sort_by(f64::total_cmp);
        steps[steps.len() / 2]
    }
}

/// What a control does between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Hold {
    /// It keeps the value of the last sample.
    #[default]
    Zero,
    /// It is interpolated.
    Linear,
}

/// Runs that carry the same channels.
///
/// ```
/// use gpsindy_core::{Channel, Dataset, Run};
/// let values = faer::Mat::from_fn(3, 1, |i, _| i as f64);
/// let run = Run { name: "a".into(), time: vec![0.0, 0.1, 0.2], values };
/// let data = Dataset::new(vec![Channel::new("x").with_unit("m")], vec![run])?;
/// assert_eq!(data.n_samples(), 3);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Dataset {
    channels: Vec<Channel>,
    runs: Vec<Run>,
}

impl Dataset {
    /// Checks sizes, names, times and values once; what is built from it is trusted everywhere.
    ///
    /// # Errors
    /// A run whose sizes differ, times that do not increase, an infinite value, a name that
    /// occurs twice, or no run at all.
    pub fn new(channels: Vec<Channel>, runs: Vec<Run>) -> Result<Self> {
        let mut names = HashSet::with_capacity(channels.len());
        for channel in &channels {
            if !names.insert(channel.name.as_str()) {
                return Err(Error::Duplicate { kind: "channel".into(), name: channel.name.clone() });
            }
        }
        if runs.is_empty() {
            return Err(Error::data("the data hold no run; hand in at least one log"));
        }
        for run in &runs {
            check_run(&channels, run)?;
        }
        Ok(Self { channels, runs })
    }

    /// The channels, in the order of the columns.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The runs.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Samples of all runs together.
    pub fn n_samples(&self) -> usize {
        self.runs.iter().map(Run::n_samples).sum()
    }

    /// Column of the channel `name`.
    ///
    /// # Errors
    /// [`Error::UnknownName`] that lists the channels there are.
    pub fn index_of(&self, name: &str) -> Result<usize> {
        self.channels
            .iter()
            .position(|c| c.name == name)
            .ok_or_else(|| Error::unknown("column", name, self.channels.iter().map(|c| &c.name)))
    }

    /// The columns of several channels, in the order asked for.
    ///
    /// # Errors
    /// As [`Dataset::index_of`].
    pub fn indices_of<S: AsRef<str>>(&self, names: &[S]) -> Result<Vec<usize>> {
        names.iter().map(|n| self.index_of(n.as_ref())).collect()
    }

    /// The dataset with some of its runs, in the order asked for.
    ///
    /// # Errors
    /// An empty choice or an index out of range.
    pub fn with_runs(&self, indices: &[usize]) -> Result<Self> {
        let mut runs = Vec::with_capacity(indices.len());
        for &i in indices {
            let run = self.runs.get(i).ok_or_else(|| Error::range("run", &format!("below {}", self.runs.len()), i))?;
            runs.push(run.clone());
        }
        Self::new(self.channels.clone(), runs)
    }

    /// The runs of several datasets with the same channels, one after the other.
    ///
    /// # Errors
    /// A dataset that lacks a channel of the first.
    pub fn concat(parts: Vec<Self>) -> Result<Self> {
        let Some(channels) = parts.first().map(|d| d.channels.clone()) else {
            return Err(Error::data("the data hold no run; hand in at least one log"));
        };
        let mut runs = Vec::new();
        for part in parts {
            let order = part.indices_of(&channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>())?;
            for run in part.runs {
                let values = Mat::from_fn(run.n_samples(), channels.len(), |i, j| run.values[(i, order[j])]);
                runs.push(Run { values, ..run });
            }
        }
        Self::new(channels, runs)
    }

    /// Samples `keep` of every run: `keep(run, time)` says whether a sample stays.
    ///
    /// # Errors
    /// A run of which nothing stays.
    pub fn filter_samples(&self, keep: impl Fn(&Run, f64) -> bool) -> Result<Self> {
        let mut runs = Vec::with_capacity(self.runs.len());
        for run in &self.runs {
            let rows: Vec<usize> = (0..run.n_samples()).filter(|&i| keep(run, run.time[i])).collect();
            runs.push(Run {
                name: run.name.clone(),
                time: rows.iter().map(|&i| run.time[i]).collect(),
                values: Mat::from_fn(rows.len(), self.channels.len(), |i, j| run.values[(rows[i], j)]),
            });
        }
        Self::new(self.channels.clone(), runs)
    }

    /// Removes the jumps of a wrapped angle (rad) from channel `name`, in every run.
    ///
    /// A step of more than pi between neighbouring samples that are not missing counts as a wrap.
    /// Do this once, at the full sampling rate, before samples are dropped or noise is added.
    ///
    /// # Errors
    /// [`Error::UnknownName`] where there is no such channel.
    pub fn unwrap_angle(&mut self, name: &str) -> Result<()> {
        let column = self.index_of(name)?;
        for run in &mut self.runs {
            let mut previous = f64::NAN;
            for value in run.values.col_as_slice_mut(column) {
                if value.is_nan() {
                    continue;
                }
                if previous.is_finite() {
                    let turn = std::f64::consts::TAU;
                    *value -= turn * ((*value - previous) / turn).round();
                }
                previous = *value;
            }
        }
        Ok(())
    }
}

/// Standard deviation of white noise on smooth signals, from the differences of order `order` of samples at even steps; 0 where
/// no piece is longer than `order`.
///
/// `median |difference| / (0.6745 sqrt(g))`: differences of order k of white noise have `g = (2k)!/(k!)^2` times its variance,
/// those of a dense smooth signal next to none. The median, because a jump of a control makes a corner; of a normal variable's
/// size it is 0.6745 standard deviations. Differences over a missing value (NaN) are left out.
pub(crate) fn difference_noise<'a>(pieces: impl IntoIterator<Item = &'a [f64]>, order: usize) -> f64 {
    let mut weights = vec![0.0; order + 1];
    weights[0] = 1.0;
    for width in 1..=order {
        for k in (1..=width).rev() {
            weights[k] -= weights[k - 1];
        }
    }
    let gain: f64 = weights.iter().map(|w| w * w).sum();
    let difference = |w: &[f64]| w.iter().zip(&weights).map(|(v, weight)| v * weight).sum::<f64>().abs();
    let mut sizes: Vec<f64> = pieces
        .into_iter()
        .flat_map(|piece| piece.windows(order + 1).map(difference))
        .filter(|d| d.is_finite())
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).map_or(0.0, |median| median / (0.6745 * gain.sqrt()))
}

fn check_run(channels: &[Channel], run: &Run) -> Result<()> {
    let size = (run.values.nrows(), run.values.ncols());
    if size != (run.time.len(), channels.len()) {
        return Err(Error::shape(
            format!("run `{}`", run.name),
            format!("{} x {} (samples x channels)", run.time.len(), channels.len()),
            format!("{} x {}", size.0, size.1),
        ));
    }
    if run.time.is_empty() {
        return Err(Error::TooFewSamples { what: format!("run `{}`", run.name), needed: 1, found: 0 });
    }
    for (i, pair) in run.time.windows(2).enumerate() {
        // Written so that a time that is not a number fails too.
        if !(pair[1] > pair[0]) {
            return Err(Error::data(format!(
                "run `{}`: time must increase, but sample {} at {} s is followed by {} s; sort the samples or split the run",
                run.name,
                i + 1,
                pair[0],
                pair[1]
            )));
        }
    }
    if !run.time.iter().all(|t| t.is_finite()) {
        return Err(Error::NotFinite { what: format!("run `{}`, time", run.name) });
    }
    for (j, channel) in channels.iter().enumerate() {
        if let Some(i) = run.column(j).iter().position(|v| v.is_infinite()) {
            return Err(Error::NotFinite {
                what: format!("run `{}`, channel `{}`, sample {}", run.name, channel.name, i + 1),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(time: &[f64], values: &[f64]) -> Run {
        Run { name: "a".into(), time: time.into(), values: Mat::from_fn(values.len(), 1, |i, _| values[i]) }
    }

    #[test]
    fn time_that_stands_still_is_refused() {
        let error = Dataset::new(vec![Channel::new("x")], vec![run(&[0.0, 0.0], &[1.0, 2.0])]).unwrap_err();
        assert!(error.to_string().contains("time must increase"), "{error}");
    }

    #[test]
    fn an_infinite_value_is_refused_and_a_missing_one_is_not() {
        assert!(Dataset::new(vec![Channel::new("x")], vec![run(&[0.0, 1.0], &[1.0, f64::INFINITY])]).is_err());
        assert!(Dataset::new(vec![Channel::new("x")], vec![run(&[0.0, 1.0], &[1.0, f64::NAN])]).is_ok());
    }

    #[test]
    fn unwrapping_crosses_missing_samples() {
        let mut data =
            Dataset::new(vec![Channel::new("x")], vec![run(&[0.0, 1.0, 2.0, 3.0], &[3.0, f64::NAN, -3.0, -2.5])])
                .unwrap();
        data.unwrap_angle("x").unwrap();
        let turn = std::f64::consts::TAU;
        let values = data.runs()[0].column(0);
        assert_eq!(values[0], 3.0);
        assert!(values[1].is_nan());
        assert!((values[2] - (turn - 3.0)).abs() < 1e-12);
        assert!((values[3] - (turn - 2.5)).abs() < 1e-12);
    }

    #[test]
    fn the_noise_on_a_smooth_signal_is_told_by_differences_of_any_order() {
        use rand_chacha::ChaCha8Rng;
        use rand_core::SeedableRng;
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut values: Vec<f64> =
            (0..4000).map(|i| (0.01 * f64::from(i)).sin() + 0.1 * crate::random::normal(&mut random)).collect();
        values[700] = f64::NAN;
        for order in 1..=5 {
            let noise = difference_noise([&values[..2000], &values[2000..]], order);
            // The median of 4000 is known within 2 %, of correlated ones within 4 %.
            assert!((noise - 0.1).abs() < 0.012, "{order}: {noise}");
        }
        assert_eq!(difference_noise([&values[..3]], 3), 0.0);
    }

    #[test]
    fn concat_follows_names_and_not_positions() {
        let channels = |a: &str, b: &str| vec![Channel::new(a), Channel::new(b)];
        let values = |x: f64, y: f64| Mat::from_fn(1, 2, |_, j| if j == 0 { x } else { y });
        let one =
            Dataset::new(channels("a", "b"), vec![Run { name: "1".into(), time: vec![0.0], values: values(1.0, 2.0) }])
                .unwrap();
        let two =
            Dataset::new(channels("b", "a"), vec![Run { name: "2".into(), time: vec![0.0], values: values(4.0, 3.0) }])
                .unwrap();
        let both = Dataset::concat(vec![one, two]).unwrap();
        assert_eq!(both.runs()[1].values[(0, 0)], 3.0);
    }
}
