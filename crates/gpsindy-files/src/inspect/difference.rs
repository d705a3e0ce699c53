//! Whether a column is a filtered difference of another column, and thus not a measurement of its own.

use super::Sheet;

/// Columns of a topic that are compared with each other.
const MOST: usize = 48;

/// Samples that are looked at.
const SAMPLES: usize = 5_000;

/// Share of the changes of a column that a difference leaves: an own sensor's noise is as large as the changes of the
/// difference; a copy leaves rounding.
const LEFT: f64 = 0.02;

/// A column that is made of another.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Made {
    pub(crate) column: usize,
    pub(crate) of: usize,
    pub(crate) how: How,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum How {
    /// The difference over so many samples.
    Difference(usize),
    /// The difference through a low pass of first order; its weight of the past.
    LowPass(f64),
}

/// The columns of a topic that are differences of others.
pub(crate) fn find(sheet: &Sheet) -> Vec<Made> {
    let end = sheet.runs.get(1).copied().unwrap_or(sheet.stamps.len()).min(SAMPLES);
    let numeric = sheet.columns.iter().enumerate().filter(|(_, c)| c.numeric && c.kept.len() >= end && end > 50);
    let places: Vec<usize> = numeric.map(|(i, _)| i).take(MOST).collect();
    let mut found = Vec::new();
    for &b in &places {
        let of = |&&a: &&usize| a != b;
        let made = places.iter().filter(of).find_map(|&a| {
            let how = how(&sheet.stamps[..end], &sheet.columns[a].kept[..end], &sheet.columns[b].kept[..end])?;
            Some(Made { column: b, of: a, how })
        });
        found.extend(made);
    }
    found
}

/// How `b` is made of `a`, if it is.
fn how(t: &[f64], a: &[f64], b: &[f64]) -> Option<How> {
    let rate = |i: usize, k: usize| (a[i] - a[i - k]) / (t[i] - t[i - k]);
    for k in 1..=10 {
        let left = (k + 1..t.len()).map(|i| b[i] - rate(i, k));
        if left_over(left, b, k + 1) {
            return Some(How::Difference(k));
        }
    }
    // b_i - d_i = past (b_{i-1} - d_i)
    let (mut top, mut below) = (0.0, 0.0);
    for i in 2..t.len() {
        let (x, y) = (b[i - 1] - rate(i, 1), b[i] - rate(i, 1));
        if x.is_finite() && y.is_finite() {
            top += x * y;
            below += x * x;
        }
    }
    let past = top / below;
    if !(0.01..0.999).contains(&past) {
        return None;
    }
    let left = (2..t.len()).map(|i| b[i] - past * b[i - 1] - (1.0 - past) * rate(i, 1));
    left_over(left, b, 2).then_some(How::LowPass(past))
}

/// Whether what is left is next to nothing compared with the changes of `b`.
fn left_over(left: impl Iterator<Item = f64>, b: &[f64], begin: usize) -> bool {
    let (mut rest, mut change, mut count, mut moved) = (0.0, 0.0, 0_usize, 0_usize);
    for (i, r) in left.enumerate() {
        let step = b[begin + i] - b[begin + i - 1];
        if r.is_finite() && step.is_finite() {
            rest += r * r;
            change += step * step;
            count += 1;
            moved += usize::from(step != 0.0);
        }
    }
    count > 40 && moved * 10 > count && rest < LEFT * LEFT * change
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An angle with the noise of its encoder, and its speed.
    fn motion(seed: u64) -> (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut state = seed;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let t: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let a = t.iter().map(|t| (2.0 * t).sin() + 1e-3 * noise()).collect();
        let v = t.iter().map(|t| 2.0 * (2.0 * t).cos()).collect();
        let w = t.iter().map(|t| 2.0 * (2.0 * t).cos() + 1e-2 * noise()).collect();
        (t, a, v, w)
    }

    #[test]
    fn differences_and_low_passes_are_told_and_sensors_left_alone() {
        for seed in 0..20 {
            let (t, a, exact, sensor) = motion(seed);
            let difference = |k: usize| -> Vec<f64> {
                (0..t.len()).map(|i| if i < k { 0.0 } else { (a[i] - a[i - k]) / (t[i] - t[i - k]) }).collect()
            };
            assert_eq!(how(&t, &a, &difference(1)), Some(How::Difference(1)));
            assert_eq!(how(&t, &a, &difference(4)), Some(How::Difference(4)));
            let mut low = difference(1);
            for i in 1..low.len() {
                low[i] = 0.8 * low[i - 1] + 0.2 * low[i];
            }
            let Some(How::LowPass(past)) = how(&t, &a, &low) else { panic!("seed {seed}") };
            assert!((past - 0.8).abs() < 1e-3, "{past}");
            assert_eq!(how(&t, &a, &sensor), None);
            assert_eq!(how(&t, &a, &exact), None);
            // Without any noise the speed is still no difference: that lags by half a sample.
            let clean: Vec<f64> = t.iter().map(|t| (2.0 * t).sin()).collect();
            assert_eq!(how(&t, &clean, &exact), None);
        }
    }
}
