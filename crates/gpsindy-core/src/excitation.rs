//! Which windows of long logs hold most information: those in which the columns move, and some of every part of the logs.

/// Root mean square of what the columns move within a window, each in units of its spread over all logs.
///
/// `columns`: the values in the window, NaN where they are missing, and the column's spread. A column that never moves counts nothing.
pub(crate) fn excitation<'a>(columns: impl IntoIterator<Item = (&'a [f64], f64)>) -> f64 {
    let of = |(values, spread): (&[f64], f64)| if spread > 0.0 { variance(values) / (spread * spread) } else { 0.0 };
    columns.into_iter().map(of).sum::<f64>().sqrt()
}

/// Variance of the values that are there, 0 where there are none.
pub(crate) fn variance(values: &[f64]) -> f64 {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().sum::<f64>() / count;
    finite().map(|v| (v - mean).powi(2)).sum::<f64>() / count
}

/// Places of `count` windows, in their order: half of them the best of as many equal parts of the list, so that all parts are seen, and
/// half the best of what is left.
pub(crate) fn choose(excitation: &[f64], count: usize) -> Vec<usize> {
    let total = excitation.len();
    if count >= total {
        return (0..total).collect();
    }
    // The first of equals: the choice is the same everywhere.
    let better = |&a: &usize, &b: &usize| excitation[b].total_cmp(&excitation[a]).then(a.cmp(&b));
    let parts = count.div_ceil(2);
    let mut chosen: Vec<usize> =
        (0..parts).filter_map(|k| (k * total / parts..(k + 1) * total / parts).min_by(better)).collect();
    let mut others: Vec<usize> = (0..total).filter(|i| chosen.binary_search(i).is_err()).collect();
    others.sort_by(better);
    chosen.extend(others.into_iter().take(count - parts));
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_that_moves_excites_more_than_one_at_rest() {
        let (moving, rest) = ([0.0, 1.0, 0.0, -1.0], [0.5, 0.5, f64::NAN, 0.5]);
        assert!((excitation([(&moving[..], 1.0)]) - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(excitation([(&rest[..], 1.0), (&moving[..], 0.0), (&[f64::NAN][..], 1.0)]), 0.0);
    }

    #[test]
    fn every_part_is_seen_and_the_rest_are_the_best() {
        let mut excitation = vec![0.0; 100];
        excitation[70..80].fill(5.0);
        excitation[3] = 1.0;
        let chosen = choose(&excitation, 8);
        assert_eq!(chosen, [3, 25, 70, 71, 72, 73, 74, 75]);
        assert_eq!(choose(&excitation, 200).len(), 100);
        assert_eq!(choose(&[1.0, 1.0, 1.0], 1), [0]);
        assert!(choose(&[], 0).is_empty());
    }
}
