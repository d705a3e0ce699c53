//! Is there a gap: beyond noise, what no test should find, and what the user tolerates?

use crate::diagnose::fit::evidence::{chi_squared_tail, gain_tail, log_likelihood, with_fitted_level};
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::fit::tolerance::Moved;
use crate::diagnose::steps::contest::Expansion;

/// Whether there is a gap.
#[derive(Debug, Clone)]
pub(crate) struct Detected {
    pub(crate) gap: bool,
    pub(crate) p_value: f64,
}

/// Share of gap-free logs that may be called a gap: the contract's.
const LEVEL: f64 = 0.05;

/// Structure (mean square, noise units) that no test calls a gap: a fourteenth of the noise's standard deviation.
///
/// A coarse integration, a rounded column or a control logged with few digits leave as much, and in a long
/// log a test of exactly nothing would find them.
pub(crate) const NEGLIGIBLE: f64 = 0.005;

/// Mean squared change of the outputs (noise units) that a parameter may make within its tolerance and be no cause.
///
/// Half the noise's standard deviation: the user expects the parameter to be off by as much, and does not see it.
pub(crate) const TOLERABLE: f64 = 0.25;

/// Chance that noise and negligible structure give as large a gain as the best rival (Bonferroni).
pub(crate) fn rival_p_value(gains: &[(f64, usize)], at: &Fitted) -> f64 {
    let (count, spent) = (at.count(), at.spent());
    let allowed = at.negligible() * count as f64;
    let tail =
        |&(gain, degrees): &(f64, usize)| gain_tail(with_fitted_level(gain - allowed, count), degrees, count, spent);
    (gains.iter().map(tail).fold(1.0, f64::min) * gains.len() as f64).min(1.0)
}

/// Judges the nominal model by all that was tried at it.
pub(crate) fn detect(first: &Expansion, rivals: &[(f64, usize)], nominal: &Fitted) -> Detected {
    let strain = |moved: Moved| {
        let allowed = if moved.is_believed { TOLERABLE + nominal.model_error } else { nominal.negligible() };
        chi_squared_tail(moved.squared - allowed * nominal.count() as f64, 1)
    };
    let moved = nominal.moved();
    // Several tolerated parameters may stand for each other: then none is told by itself, but all together are.
    let is_believed = moved.iter().all(|m| m.is_believed);
    let allowed = if is_believed { TOLERABLE + nominal.model_error } else { nominal.negligible() };
    let together = (nominal.strain() - allowed) * nominal.count() as f64 / nominal.inflation();
    let together = chi_squared_tail(together, nominal.free.len());
    let alone = moved.into_iter().map(strain).fold(1.0, f64::min) * nominal.free.len().max(1) as f64;
    let strained = alone.min(together);
    // A smooth gap in a short log looks like coloured noise to the screening, but not beside a fit that explains it.
    let count = nominal.count();
    let allowed = nominal.negligible() * count as f64;
    let refitted = first.fits.iter().map(|fit| {
        let gain = 2.0 * (log_likelihood(&fit.colours) - log_likelihood(&nominal.colours));
        gain_tail(gain - allowed, fit.complexity(), count, nominal.spent())
    });
    let refitted = (refitted.fold(1.0, f64::min) * first.tried as f64).min(1.0);
    let smallest = refitted.min(first.p_value(nominal)).min(rival_p_value(rivals, nominal)).min(strained.min(1.0));
    // Four searches, each paid for.
    let p_value = (4.0 * smallest).min(1.0);
    Detected { gap: p_value <= LEVEL, p_value }
}
