//! A share with its Wilson interval, and the calibration of probabilities.

use serde::Serialize;

/// Hits out of a number of trials, with the 95 % Wilson interval of their rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    /// Trials with the outcome.
    pub hits: usize,
    /// All trials.
    pub of: usize,
    /// `hits / of`; absent without trials.
    pub rate: Option<f64>,
    /// Lower end of the interval; absent without trials.
    pub low: Option<f64>,
    /// Upper end of the interval; absent without trials.
    pub high: Option<f64>,
}

impl Rate {
    /// Counts the trials and those that came out true.
    pub fn count(trials: impl IntoIterator<Item = bool>) -> Self {
        let (mut hits, mut of) = (0, 0);
        for hit in trials {
            of += 1;
            hits += usize::from(hit);
        }
        Self::new(hits, of)
    }

    /// The interval of `hits` out of `of`.
    ///
    /// Source: Wilson 1927, Probable inference, the law of succession, and statistical inference.
    pub fn new(hits: usize, of: usize) -> Self {
        if of == 0 {
            return Self { hits, of, rate: None, low: None, high: None };
        }
        // The 97.5 % point of the normal distribution.
        let z = 1.959_963_984_540_054_f64;
        let (n, p) = (of as f64, hits as f64 / of as f64);
        let scale = 1.0 + z * z / n;
        let centre = (p + z * z / (2.0 * n)) / scale;
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt() / scale;
        let low = if hits == 0 { 0.0 } else { centre - half };
        let high = if hits == of { 1.0 } else { centre + half };
        Self { hits, of, rate: Some(p), low: Some(low), high: Some(high) }
    }
}

/// How far stated probabilities and outcomes agree.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Of the causes stated with 0.9 or more, the right ones.
    pub stated_090: Rate,
    /// Mean squared difference of probability and outcome (1 right, 0 wrong); absent without causes.
    pub brier: Option<f64>,
    /// Mean difference of the bins' stated and seen shares, weighted by their size; absent without causes.
    pub expected_error: Option<f64>,
    /// Ten equal bins of probability; the empty ones too.
    pub bins: Vec<Bin>,
}

/// Causes whose probability lies in `from..to` (the last bin holds 1 too).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// Mean stated probability; absent in an empty bin.
    pub stated: Option<f64>,
    /// What was right.
    pub right: Rate,
}

impl Calibration {
    /// From pairs of a stated probability and whether it came true.
    pub fn new(stated: &[(f64, bool)]) -> Self {
        let bins: Vec<Bin> = (0..10)
            .map(|i| {
                let inside: Vec<_> =
                    stated.iter().filter(|(p, _)| ((p * 10.0).floor().clamp(0.0, 9.0) as usize) == i).collect();
                Bin {
                    from: i as f64 / 10.0,
                    to: (i + 1) as f64 / 10.0,
                    stated: mean(inside.iter().map(|(p, _)| *p)),
                    right: Rate::count(inside.iter().map(|(_, right)| *right)),
                }
            })
            .collect();
        let total = stated.len() as f64;
        let error =
            bins.iter().filter_map(|bin| Some((bin.stated? - bin.right.rate?).abs() * bin.right.of as f64 / total));
        Self {
            stated_090: Rate::count(stated.iter().filter(|(p, _)| *p >= 0.9).map(|(_, right)| *right)),
            brier: mean(stated.iter().map(|(p, right)| (p - f64::from(u8::from(*right))).powi(2))),
            expected_error: (!stated.is_empty()).then(|| error.sum()),
            bins,
        }
    }
}

/// Mean; absent without values.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), v| (sum + v, n + 1));
    (n > 0).then(|| sum / n as f64)
}

/// Quantile with linear interpolation between the sorted values; absent without values.
pub(crate) fn quantile(values: &[f64], level: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = level * (sorted.len().checked_sub(1)? as f64);
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Newcombe 1998, Interval estimation for the difference, and the closed forms at the ends.
    #[test]
    fn wilson_intervals_have_their_known_values() {
        let rate = Rate::new(81, 263);
        assert!((rate.low.unwrap() - 0.2553).abs() < 5e-5);
        assert!((rate.high.unwrap() - 0.3662).abs() < 5e-5);
        // With no hit the upper end is z^2 / (n + z^2).
        let rate = Rate::new(0, 20);
        assert_eq!(rate.low, Some(0.0));
        assert!((rate.high.unwrap() - 3.841459 / 23.841459).abs() < 1e-6);
        assert_eq!(Rate::new(7, 7).high, Some(1.0));
        assert_eq!(Rate::new(0, 0).rate, None);
    }

    #[test]
    fn perfect_and_hopeless_probabilities_score_zero_and_one() {
        assert_eq!(Calibration::new(&[(1.0, true), (0.0, false)]).brier, Some(0.0));
        assert_eq!(Calibration::new(&[(0.0, true), (1.0, false)]).brier, Some(1.0));
        assert_eq!(Calibration::new(&[]).brier, None);
    }

    #[test]
    fn nine_in_ten_right_at_nine_tenths_is_calibrated() {
        let stated: Vec<_> = (0..10).map(|i| (0.9, i != 0)).collect();
        let calibration = Calibration::new(&stated);
        assert_eq!((calibration.stated_090.hits, calibration.stated_090.of), (9, 10));
        assert!(calibration.expected_error.unwrap() < 1e-12);
        assert_eq!(calibration.bins[9].right.of, 10);
    }

    #[test]
    fn a_quantile_lies_between_its_neighbours() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&[0.0, 1.0], 0.1), Some(0.1));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
