//! How far a variable moves, which way, and whether it shows the time.

use crate::diagnose::limits::catalogue::{REVERSES, SHOWS_TIME, STRAYS, TURNED};

/// How a variable moves over all training logs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Excursion {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Standard deviation.
    pub(crate) spread: f64,
    /// Root mean square.
    pub(crate) rms: f64,
    /// Standard deviation of the noise in the values; zero where they have none.
    noise: f64,
    /// Absolute values, sorted, thinned to a few hundred.
    sizes: Vec<f64>,
}

impl Excursion {
    pub(crate) fn of(values: &[f64]) -> Self {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let count = finite.len().max(1) as f64;
        let mean = finite.iter().sum::<f64>() / count;
        let square = finite.iter().map(|v| v * v).sum::<f64>() / count;
        let mut sizes: Vec<f64> = finite.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let stride = (sizes.len() / 400).max(1);
        Self {
            low: finite.iter().copied().fold(f64::INFINITY, f64::min),
            high: finite.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            spread: (square - mean * mean).max(0.0).sqrt(),
            rms: square.sqrt(),
            noise: 0.0,
            sizes: sizes.into_iter().step_by(stride).collect(),
        }
    }

    /// The same of values that are measured with `noise`.
    pub(crate) fn with_noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// Whether no value is below zero but by what noise, or the error of a start, takes there.
    pub(crate) fn is_never_negative(&self) -> bool {
        self.low >= -(REVERSES * self.size()).max(STRAYS * self.noise)
    }

    /// Size below which a share `part` of the samples stays.
    pub(crate) fn size_quantile(&self, part: f64) -> f64 {
        let last = self.sizes.len().saturating_sub(1);
        self.sizes.get((part * last as f64).round() as usize).copied().unwrap_or(0.0)
    }

    /// A size that is never zero: the rms, or one.
    pub(crate) fn size(&self) -> f64 {
        if self.rms.is_finite() && self.rms > 0.0 { self.rms } else { 1.0 }
    }

    pub(crate) fn range(&self) -> f64 {
        if self.high > self.low { self.high - self.low } else { 0.0 }
    }
}

/// Whether a variable that is measured with `noise` goes back, in either direction, by many deviations of it.
///
/// `runs`: its values, run by run; NaN is a missing value.
pub(crate) fn turns<'a>(runs: impl Iterator<Item = &'a [f64]>, noise: f64) -> bool {
    let (mut up, mut down) = (0.0f64, 0.0f64);
    for values in runs {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &value in values.iter().filter(|v| v.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
            (up, down) = (up.max(value - low), down.max(high - value));
        }
    }
    up.min(down) > TURNED * noise
}

/// Whether the rank of a value gives away how long its run has lasted, so that an effect of time may be one of that variable; pairs of
/// time (s, since the run began) and value of all runs.
///
/// Spearman 1904, The proof and measurement of association between two things (American Journal of Psychology 15): the correlation of
/// the ranks is one where the value only rises, by the same course in every run.
pub(crate) fn shows_time(pairs: &[(f64, f64)]) -> bool {
    let present: Vec<(f64, f64)> = pairs.iter().copied().filter(|(_, value)| value.is_finite()).collect();
    let (times, values) = (ranks(present.iter().map(|p| p.0)), ranks(present.iter().map(|p| p.1)));
    let mean = 0.5 * (present.len().max(1) as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (product(&times, &times) * product(&values, &values)).sqrt();
    scale > 0.0 && product(&times, &values).abs() > SHOWS_TIME * scale
}

/// Ranks from zero, equal values at the mean of theirs.
fn ranks(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let values: Vec<f64> = values.collect();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    for (place, alike) in order.chunk_by(|&a, &b| values[a] == values[b]).scan(0, |next, alike| {
        let first = *next;
        *next += alike.len();
        Some((first as f64 + 0.5 * (alike.len() as f64 - 1.0), alike))
    }) {
        alike.iter().for_each(|&i| ranks[i] = place);
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fall_does_not_turn_and_a_swing_does() {
        let fall: Vec<f64> = (0..50).map(|i| -0.02 * f64::from(i * i) + 0.1 * f64::from(i % 2)).collect();
        let swing: Vec<f64> = (0..50).map(|i| (0.3 * f64::from(i)).sin()).collect();
        assert!(!turns([fall.as_slice()].into_iter(), 0.05));
        assert!(turns([swing.as_slice()].into_iter(), 0.05));
        assert!(turns([fall.as_slice(), &[0.0, f64::NAN, 3.0]].into_iter(), 0.05));
    }

    /// Pairs of several runs of 40 samples, by run and time.
    fn runs(count: usize, value: impl Fn(usize, f64) -> f64) -> Vec<(f64, f64)> {
        let one = |run: usize| (0..40).map(move |i| (run, 0.1 * f64::from(i)));
        (0..count).flat_map(one).map(|(run, t)| (t, value(run, t))).collect()
    }

    #[test]
    fn a_fall_shows_the_time_and_a_swing_or_runs_of_their_own_speeds_do_not() {
        assert!(shows_time(&runs(4, |run, t| -9.81 * t - 0.3 * run as f64)));
        assert!(!shows_time(&runs(4, |_, t| (2.0 * t).sin())));
        // The same laws, but every run begins at a speed of its own.
        assert!(!shows_time(&runs(4, |run, t| t - 3.0 * run as f64)));
        assert!(!shows_time(&runs(4, |_, _| 1.0)) && !shows_time(&[]));
    }

    #[test]
    fn equal_values_share_their_rank() {
        assert_eq!(ranks([2.0, 1.0, 2.0, 5.0].into_iter()), [1.5, 0.0, 1.5, 3.0]);
    }
}
