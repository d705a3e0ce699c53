//! How far a fit moves the parameters of a contestant, and their standard deviations.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{AT_END, BELIEVED, CONVINCING, EXPECTED, MATERIAL, TOLERABLE};

/// A tolerated parameter that the logs move.
pub(crate) struct Moved {
    /// Its index in the model.
    pub(crate) parameter: usize,
    /// Squared distance from its nominal value, in the standard deviations that the logs give it.
    pub(crate) squared: f64,
    /// Whether the move stays within what the user believes.
    pub(crate) is_believed: bool,
}

/// How far the logs alone move each tolerated parameter from its nominal value, in the standard
/// deviations that the logs give it.
pub(crate) fn moved(contestant: &Contestant) -> Vec<Moved> {
    let Contestant { refined, free, evidence, .. } = contestant;
    free.iter()
        .enumerate()
        .filter_map(|(place, f)| {
            let (mean, sd) = f.prior?;
            let information = 1.0 / refined.covariance[place][place] - 1.0 / (sd * sd);
            let distance = refined.parameters[f.parameter] - mean;
            let squared = distance * distance * information / evidence.inflation();
            let is_believed = distance.abs() <= EXPECTED * sd;
            (information > 0.0 && squared.is_finite()).then_some(Moved { parameter: f.parameter, squared, is_believed })
        })
        .collect()
}

/// The tolerated parameters that are moved clearly and materially, or that are at the end of their tolerance.
pub(crate) fn clearly_moved(contestant: &Contestant) -> Vec<usize> {
    let count = contestant.evidence.count().max(2) as f64;
    let convincing = |moved: &Moved| {
        let material = if moved.is_believed { TOLERABLE } else { MATERIAL };
        let noise = contestant.evidence.misfit().min(1.0);
        moved.squared > 2.0 * CONVINCING + count.ln() && moved.squared > material * count * noise
    };
    let mut all: Vec<usize> = moved(contestant).into_iter().filter(convincing).map(|m| m.parameter).collect();
    let strained = (0..contestant.free.len()).filter(|&place| is_strained(contestant, place));
    all.extend(strained.map(|place| contestant.free[place].parameter));
    all.sort_unstable();
    all.dedup();
    all
}

/// Whether free parameter number `place` is a tolerated one that is at the end of its tolerance.
pub(crate) fn is_strained(contestant: &Contestant, place: usize) -> bool {
    let free = &contestant.free[place];
    let value = contestant.refined.parameters[free.parameter];
    free.prior.is_some_and(|(mean, sd)| (value - mean).abs() >= AT_END * BELIEVED * sd)
}

/// Standard deviation of parameter `index` with the residual's own size and colour; none where it is not free.
pub(crate) fn deviation(contestant: &Contestant, index: usize) -> Option<f64> {
    let place = contestant.free.iter().position(|f| f.parameter == index)?;
    Some((contestant.refined.covariance[place][place] * contestant.evidence.inflation()).sqrt())
}
