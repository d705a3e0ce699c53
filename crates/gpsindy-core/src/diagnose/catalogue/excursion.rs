//! How far a variable moves.

use crate::diagnose::limits::catalogue::TURNED;

/// How a variable moves over all training logs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Excursion {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Standard deviation.
    pub(crate) spread: f64,
    /// Root mean square.
    pub(crate) rms: f64,
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
            sizes: sizes.into_iter().step_by(stride).collect(),
        }
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
}
