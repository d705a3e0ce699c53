//! The noise of every column and the outliers in it, from the logs alone.

use crate::diagnose::catalogue::excited::repeats::{Repeats, readings};
use crate::diagnose::limits::verify::LOG_DIGITS;
use crate::diagnose::limits::{BENT, OF_MEDIAN, OUTLIER, SPIKE_LIKE, TRIMMED};
use crate::refine::{Log, present};

/// Noise standard deviation of each column from differences of its samples, in its unit.
///
/// Differences of order 2 to 5, scaled to unit noise gain; the smallest is least spoilt by the signal.
/// Never below the noise of the sensor's step. Of a sensor that is slower than the log, differences of its readings.
pub(crate) fn noise_levels(logs: &[Log], n_columns: usize) -> Vec<f64> {
    (0..n_columns)
        .map(|column| {
            let samples = samples(logs, column);
            let by_order = (2..=5).map(|order| difference_noise(&samples, order));
            let smallest = by_order.filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
            let step = resolution(logs, column) / 12f64.sqrt();
            let size = logs
                .iter()
                .flat_map(|l| l.measured[column].iter())
                .filter(|v| v.is_finite())
                .fold(0.0, |a: f64, v| a.max(v.abs()));
            let measured = if smallest.is_finite() { smallest } else { 0.0 };
            // Without any noise at all the arithmetic of the log's digits remains.
            measured.max(step).max(1e-9 * size).max(f64::MIN_POSITIVE)
        })
        .collect()
}

/// Gives columns that never move, which say nothing of their noise, the largest noise of the columns of the same unit: a joint at rest is
/// read by the same kind of sensor. Without such a column it is a billionth of what counts as large there.
///
/// All that such a column says is where it rests, which is one reading and not as many as there are rows: its noise is larger by the root
/// of their number. Else a joint that rests a little off its command would be nearly all of a gap.
pub(crate) fn still_levels(noise: &mut [f64], logs: &[Log], units: &[&str], scale: &[f64]) {
    let still: Vec<bool> = (0..noise.len()).map(|column| !moves(logs, column)).collect();
    for column in (0..noise.len()).filter(|&c| still[c]) {
        let alike = (0..noise.len()).filter(|&c| !still[c] && units[c] == units[column]).map(|c| noise[c]);
        let readings = logs.iter().flat_map(|l| &l.measured[column]).filter(|v| v.is_finite()).count();
        noise[column] = alike.fold(noise[column].max(1e-9 * scale[column]), f64::max) * (readings.max(1) as f64).sqrt();
    }
}

/// Whether a column moves in any log by more than one step of its sensor, or the rounding of its digits.
pub(crate) fn moves(logs: &[Log], column: usize) -> bool {
    let values = || logs.iter().flat_map(|l| l.measured[column].iter().copied()).filter(|v| v.is_finite());
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let size = low.abs().max(high.abs());
    high - low > (1.0 + LOG_DIGITS) * resolution(logs, column).max(LOG_DIGITS * size)
}

/// Share of the values of each column that are readings.
pub(crate) fn news(logs: &[Log], n_columns: usize) -> Vec<f64> {
    (0..n_columns).map(|column| Repeats::of(logs, column).map_or(1.0, |repeats| repeats.news)).collect()
}

/// What a column read, log by log, and in which rows.
///
/// A column with a rate of its own has no value in the rows of the others: its samples follow each other across those.
fn samples(logs: &[Log], column: usize) -> Vec<Vec<(usize, f64)>> {
    let of: fn(&[f64]) -> Vec<(usize, f64)> = if Repeats::of(logs, column).is_some() { readings } else { present };
    logs.iter().map(|log| of(&log.measured[column])).collect()
}

fn difference_noise(present: &[Vec<(usize, f64)>], order: usize) -> f64 {
    let binomial = |k: usize| (0..k).fold(1.0, |b, i| b * (order - i) as f64 / (i + 1) as f64);
    let weights: Vec<f64> = (0..=order).map(|k| if k % 2 == 0 { binomial(k) } else { -binomial(k) }).collect();
    let gain: f64 = weights.iter().map(|w| w * w).sum();
    let usual = usual_step(present);
    let mut squares: Vec<f64> = present
        .iter()
        .flat_map(|samples| samples.windows(order + 1))
        .filter(|window| window.windows(2).all(|pair| pair[1].0 - pair[0].0 <= usual))
        .map(|window| window.iter().zip(&weights).map(|((_, v), w)| v * w).sum::<f64>().powi(2))
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    squares.sort_by(f64::total_cmp);
    // The largest fiftieth may be outliers and jumps; a normal variable keeps most of its variance without it.
    let kept = squares.len() - squares.len() / 50;
    let trimmed = squares[..kept].iter().sum::<f64>() / kept as f64;
    let share_kept = if squares.len() >= 50 { TRIMMED } else { 1.0 };
    (trimmed / share_kept / gain).sqrt()
}

/// Rows from one value to the next, but for the longest tenth: these are holes.
fn usual_step(present: &[Vec<(usize, f64)>]) -> usize {
    let steps = present.iter().flat_map(|samples| samples.windows(2).map(|pair| pair[1].0 - pair[0].0));
    let mut steps: Vec<usize> = steps.collect();
    steps.sort_unstable();
    steps.get(steps.len() * 9 / 10).copied().unwrap_or(1)
}

/// Smallest step between different values, where the column looks quantised; else zero.
pub(crate) fn resolution(logs: &[Log], column: usize) -> f64 {
    let mut values: Vec<f64> =
        logs.iter().flat_map(|l| l.measured[column].iter().copied()).filter(|v| v.is_finite()).collect();
    let total = values.len();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() < 2 || values.len() * 2 > total {
        return 0.0;
    }
    values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min)
}

/// Marks isolated spikes as missing; returns how many.
pub(crate) fn remove_outliers(logs: &mut [Log], noise: &[f64]) -> usize {
    let mut removed = 0;
    for c in 0..noise.len() {
        let present = samples(logs, c);
        let (usual, noise) = (usual_step(&present), noise[c]);
        for (log, there) in logs.iter_mut().zip(&present) {
            // Beside a hole nothing says how far the column may have moved.
            let is_hole = |w: &[(usize, f64)]| w.windows(2).any(|pair| pair[1].0 - pair[0].0 > usual);
            let bend = |w: &[(usize, f64)]| if is_hole(w) { f64::NAN } else { w[1].1 - 0.5 * (w[0].1 + w[2].1) };
            let bend: Vec<f64> = there.windows(3).map(bend).collect();
            let mut sizes: Vec<f64> = bend.iter().map(|b| b.abs()).filter(|b| b.is_finite()).collect();
            sizes.sort_by(f64::total_cmp);
            let typical = sizes.get(sizes.len() / 2).map_or(0.0, |m| OF_MEDIAN * m).max(BENT * noise);
            let spikes: Vec<usize> = (1..bend.len().saturating_sub(1))
                .filter(|&i| {
                    // A spike bends its neighbours half as much the other way; a corner does not.
                    let neighbours = -0.5 * bend[i];
                    let like = |b: f64| (b - neighbours).abs() < SPIKE_LIKE * bend[i].abs();
                    bend[i].abs() > OUTLIER * typical && like(bend[i - 1]) && like(bend[i + 1])
                })
                .collect();
            removed += spikes.len();
            for i in spikes {
                // With its repeats, where it has any.
                let (first, value) = there[i + 1];
                let repeated = log.measured[c][first..there[i + 2].0].iter_mut();
                repeated.filter(|v| **v == value).for_each(|v| *v = f64::NAN);
            }
        }
    }
    removed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow swing with a jitter of one tenth, deterministic; no value in the rows that `is_empty` names.
    fn log(count: usize, is_empty: impl Fn(usize) -> bool) -> Log {
        let mut sample = 0;
        let mut value = |row: usize| {
            if is_empty(row) {
                return f64::NAN;
            }
            sample += 1;
            (0.01 * f64::from(sample)).sin() + 0.1 * (f64::from(sample * sample) * 1.7).sin()
        };
        let measured = vec![(0..count).map(&mut value).collect()];
        Log {
            name: "a".into(),
            time: (0..count).map(|i| i as f64).collect(),
            controls: Vec::new(),
            measured,
            ..Log::default()
        }
    }

    #[test]
    fn rows_of_another_topic_change_nothing_in_the_noise_of_a_column() {
        let alone = noise_levels(&[log(600, |_| false)], 1);
        // Two samples of the column, one of the other topic, and so on.
        let between = noise_levels(&[log(900, |row| row % 3 == 2)], 1);
        let in_turns = noise_levels(&[log(1200, |row| row % 2 == 1)], 1);
        assert!(alone[0] > 0.05 && alone[0] < 0.1, "{alone:?}");
        assert_eq!((&between, &in_turns), (&alone, &alone));
    }

    #[test]
    fn a_column_that_never_changes_has_the_noise_of_its_kind() {
        let mut log = log(600, |_| false);
        let moving = log.measured[0].clone();
        log.measured.extend([vec![0.0; 600], vec![3.0; 600], moving.iter().map(|v| 2.0 * v).collect()]);
        let logs = [log];
        let mut noise = noise_levels(&logs, 4);
        let alone = noise.clone();
        still_levels(&mut noise, &logs, &["rad", "rad", "V", "rad/s"], &[1.0, 1.0, 2.0, 1.0]);
        let all = 600_f64.sqrt();
        assert_eq!((noise[0], noise[1], noise[3]), (alone[0], all * alone[0], alone[3]));
        assert_eq!(noise[2], all * alone[2], "without a column of its unit by its own size");
    }

    #[test]
    fn a_hole_is_not_taken_for_a_step() {
        let whole = noise_levels(&[log(600, |_| false)], 1);
        let holed = noise_levels(&[log(640, |row| (300..340).contains(&row))], 1);
        assert!((holed[0] / whole[0] - 1.0).abs() < 0.05, "{holed:?} {whole:?}");
    }
}
