//! Whether a variable tells the time: in runs that begin and go on alike, an effect of time may be one of that variable.

use crate::diagnose::limits::catalogue::TELLS_TIME;

/// Whether the rank of a value gives away how long its run has lasted; pairs of time (s, since the run began) and value of all runs.
///
/// Spearman 1904, The proof and measurement of association between two things (American Journal of Psychology 15): the correlation of
/// the ranks is one where the value only rises, by the same course in every run.
pub(crate) fn tells_time(pairs: &[(f64, f64)]) -> bool {
    let present: Vec<(f64, f64)> = pairs.iter().copied().filter(|(_, value)| value.is_finite()).collect();
    let (times, values) = (ranks(present.iter().map(|p| p.0)), ranks(present.iter().map(|p| p.1)));
    let mean = 0.5 * (present.len().max(1) as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (product(&times, &times) * product(&values, &values)).sqrt();
    scale > 0.0 && product(&times, &values).abs() > TELLS_TIME * scale
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

    /// Pairs of several runs of 40 samples, by run and time.
    fn runs(count: usize, value: impl Fn(usize, f64) -> f64) -> Vec<(f64, f64)> {
        let one = |run: usize| (0..40).map(move |i| (run, 0.1 * f64::from(i)));
        (0..count).flat_map(one).map(|(run, t)| (t, value(run, t))).collect()
    }

    #[test]
    fn a_fall_tells_the_time_and_a_swing_or_runs_of_their_own_speeds_do_not() {
        assert!(tells_time(&runs(4, |run, t| -9.81 * t - 0.3 * run as f64)));
        assert!(!tells_time(&runs(4, |_, t| (2.0 * t).sin())));
        // The same laws, but every run begins at a speed of its own.
        assert!(!tells_time(&runs(4, |run, t| t - 3.0 * run as f64)));
        assert!(!tells_time(&runs(4, |_, _| 1.0)) && !tells_time(&[]));
    }

    #[test]
    fn equal_values_share_their_rank() {
        assert_eq!(ranks([2.0, 1.0, 2.0, 5.0].into_iter()), [1.5, 0.0, 1.5, 3.0]);
    }
}
