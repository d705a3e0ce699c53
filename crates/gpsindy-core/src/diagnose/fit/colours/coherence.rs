//! Coherence: whether the residuals of two columns move together.
//!
//! Sensors err on their own. What a force that no model knows does to a machine shows in all of its columns, so that the residual of one says
//! something of another's beyond what that one's own past says: Granger 1969, Econometrica 37(3), "Investigating causal relations by
//! econometric models and cross-spectral methods".

use crate::diagnose::fit::colours::whitening::Whitener;
use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::gain_tail;
use crate::diagnose::limits::MAX_ORDER;
use nalgebra::{DMatrix, DVector};

/// Chance that sensors which err on their own leave residuals of which one predicts another as well as the best pair of columns does; one
/// where a single column is logged.
pub(crate) fn chance_of_coherence(fit: &Contestant) -> f64 {
    let columns = fit.experiment.columns.len();
    let white = whitened(fit);
    let pairs =
        (0..columns).flat_map(|one| (0..columns).filter(move |&other| other != one).map(move |other| (one, other)));
    let spent = fit.evidence.spent() / columns.max(1);
    let chances: Vec<f64> = pairs.map(|pair| chance(&white, columns, pair, spent)).collect();
    Searches::of(chances.len().max(1)).pay(chances.into_iter().fold(1.0, f64::min))
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

/// Chance of what the `other` column says of `one` at the same sample and those before it.
fn chance(white: &[DVector<f64>], columns: usize, (one, other): (usize, usize), spent: usize) -> f64 {
    let degrees = MAX_ORDER + 1;
    let (mut gram, mut slope) = (DMatrix::zeros(degrees, degrees), DVector::zeros(degrees));
    let (mut squares, mut count) = (0.0, 0);
    for values in white {
        let at = |sample: usize, column: usize| values[sample * columns + column];
        for sample in MAX_ORDER..values.len() / columns {
            let target = at(sample, one);
            if target == 0.0 {
                continue;
            }
            let before = DVector::from_fn(degrees, |lag, _| at(sample - lag, other));
            gram.ger(1.0, &before, &before, 1.0);
            slope.axpy(target, &before, 1.0);
            squares += target * target;
            count += 1;
        }
    }
    let Some(solved) = gram.cholesky().map(|gram| gram.solve(&slope)) else { return 1.0 };
    let explained = (solved.dot(&slope) / squares).min(1.0 - f64::EPSILON);
    gain_tail(-(count as f64) * (-explained).ln_1p(), degrees, count, spent)
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

    #[test]
    fn a_column_that_follows_another_is_predicted_by_it_and_not_the_other_way() {
        let [follows, leads] = chances(0.3);
        assert!(follows < 1e-12 && leads > 0.01, "{follows} {leads}");
        assert!(chances(0.0).iter().all(|&chance| chance > 0.01));
    }
}
