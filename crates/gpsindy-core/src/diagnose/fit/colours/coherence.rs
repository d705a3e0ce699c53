//! Coherence: whether the residuals of two columns move together.
//!
//! Sensors err on their own. What a force that no model knows does to a machine shows in all of its columns, so that the residual of one says
//! something of another's beyond what that one's own past says: Granger 1969, Econometrica 37(3), "Investigating causal relations by
//! econometric models and cross-spectral methods".

use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::gain_tail;

use crate::diagnose::limits::{MAX_ORDER, MEANS};
use nalgebra::{DMatrix, DVector};

/// Chance that sensors which err on their own leave residuals of which one predicts another as well as the best pair of columns does; one
/// where a single column is logged.
///
/// They are compared sample by sample, and in means over two, four and more samples: of what a slow force does, little is new from one sample
/// to the next.
pub(crate) fn chance_of_coherence(fit: &Contestant) -> f64 {
    let columns = fit.experiment.columns.len();
    let pairs: Vec<(usize, usize)> = (0..columns)
        .flat_map(|one| (0..columns).filter(move |&other| other != one).map(move |other| (one, other)))
        .collect();
    let spent = fit.evidence.spent() / columns.max(1);
    let (mut white, mut chances) = (whitened(fit), Vec::new());
    while white.iter().any(|values| values.len() > columns * MEANS) {
        chances.extend(pairs.iter().map(|&pair| chance(&white, columns, pair, spent)));
        white.iter_mut().for_each(|values| *values = halved(values, columns));
    }
    Searches::of(chances.len().max(1)).pay(chances.into_iter().fold(1.0, f64::min))
}

/// Sums of two samples each, interleaved.
fn halved(values: &DVector<f64>, columns: usize) -> DVector<f64> {
    let count = values.len() / columns / 2;
    DVector::from_fn(count * columns, |place, _| {
        let (sample, column) = (place / columns, place % columns);
        values[2 * sample * columns + column] + values[(2 * sample + 1) * columns + column]
    })
}

/// The residuals of every window, less what the past of each column predicts, interleaved; missing ones are zero.
fn whitened(fit: &Contestant) -> Vec<DVector<f64>> {
    let of = |(window, residuals): (usize, &Vec<f64>)| {
        let present: Vec<bool> = residuals.iter().map(|e| e.is_finite()).collect();
        let repeats = fit.experiment.repeats(&fit.experiment.windows[window]);
        let mut values =
            DVector::from_iterator(residuals.len(), residuals.iter().map(|&e| if e.is_finite() { e } else { 0.0 }));
        Whitener::new(&fit.evidence.colours, &present, &repeats).whiten(&mut values);
        values
    };
    fit.refined.residuals.iter().enumerate().map(of).collect()
}

/// Chance of what the `other` column says of `one` at the same sample and those before it, beyond what `one` says of itself.
fn chance(white: &[DVector<f64>], columns: usize, (one, other): (usize, usize), spent: usize) -> f64 {
    let degrees = MAX_ORDER + 1;
    let terms = MAX_ORDER + degrees;
    let (mut gram, mut slope) = (DMatrix::zeros(terms, terms), DVector::zeros(terms));
    let (mut squares, mut count) = (0.0, 0);
    for values in white {
        let at = |sample: usize, column: usize| values[sample * columns + column];
        for sample in MAX_ORDER..values.len() / columns {
            let target = at(sample, one);
            if target == 0.0 {
                continue;
            }
            let before = DVector::from_fn(terms, |term, _| match term.checked_sub(MAX_ORDER) {
                None => at(sample - 1 - term, one),
                Some(lag) => at(sample - lag, other),
            });
            gram.ger(1.0, &before, &before, 1.0);
            slope.axpy(target, &before, 1.0);
            squares += target * target;
            count += 1;
        }
    }
    let left = |terms: usize| {
        let (gram, slope) = (gram.view((0, 0), (terms, terms)).into_owned(), slope.rows(0, terms).into_owned());
        gram.cholesky().map(|gram| squares - gram.solve(&slope).dot(&slope))
    };
    let (Some(own), Some(both)) = (left(MAX_ORDER), left(terms)) else { return 1.0 };
    let gain = count as f64 * (own / both.max(f64::EPSILON * own)).ln();
    gain_tail(gain, degrees, count, spent + MAX_ORDER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::normal;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// Chances of two columns of which the second repeats a share of the first, two samples later, in eight windows of 200 samples.
    fn chances(share: f64) -> [f64; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let window = |_| {
            let noise: Vec<f64> = (0..400).map(|_| normal(&mut random)).collect();
            let late = |i: usize| if i >= 4 { noise[i - 4] } else { 0.0 };
            DVector::from_fn(400, |i, _| if i % 2 == 0 { noise[i] } else { noise[i] + share * late(i - 1) })
        };
        let white: Vec<DVector<f64>> = (0..8).map(window).collect();
        [(1, 0), (0, 1)].map(|pair| chance(&white, 2, pair, 4))
    }

    /// Two columns under noise of their own, to which one slow force adds a `share` of it: its value to the first, its past to the second.
    fn chance_at_some_scale(share: f64, seed: u64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut white: Vec<DVector<f64>> = (0..4)
            .map(|_| {
                let (mut force, mut moved) = (0.0, 0.0);
                let rows: Vec<[f64; 2]> = (0..1000)
                    .map(|_| {
                        force = 0.98 * force + 0.2 * normal(&mut random);
                        moved = 0.9 * moved + 0.1 * force;
                        [share * force + normal(&mut random), share * moved + normal(&mut random)]
                    })
                    .collect();
                DVector::from_fn(2000, |i, _| rows[i / 2][i % 2])
            })
            .collect();
        let mut least: f64 = 1.0;
        for _ in 0..5 {
            least = least.min(chance(&white, 2, (0, 1), 4)).min(chance(&white, 2, (1, 0), 4));
            white.iter_mut().for_each(|values| *values = halved(values, 2));
        }
        least
    }

    #[test]
    fn a_slow_force_shows_in_means_over_many_samples() {
        assert!(chance_at_some_scale(0.5, 3) < 1e-12);
        // Ten chances a log: one log in a hundred has one below a thousandth.
        let small = (0..50).filter(|&seed| chance_at_some_scale(0.0, seed) < 1e-3).count();
        assert!(small <= 3, "{small}");
    }

    #[test]
    fn a_column_that_follows_another_is_predicted_by_it_and_not_the_other_way() {
        let [follows, leads] = chances(0.3);
        assert!(follows < 1e-12 && leads > 0.01, "{follows} {leads}");
        assert!(chances(0.0).iter().all(|&chance| chance > 0.01));
    }
}
