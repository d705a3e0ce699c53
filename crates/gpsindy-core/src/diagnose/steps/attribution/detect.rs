//! Detect: is there a gap that is significant, material, and beyond the tolerances of the parameters?

use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{chi_squared_tail, gain_tail, log_likelihood, with_fitted_level};
use crate::diagnose::fit::moved::{Moved, moved};
use crate::diagnose::fit::substeps::finer;
use crate::diagnose::limits::{Budget, CERTAIN, CHANCE, TOLERABLE};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::round::{Expansion, expand, expand_further};
use crate::diagnose::steps::attribution::screen::nameless;
use crate::diagnose::steps::findings::{Detected, Judged, Outcome};
use crate::error::Result;

/// A nominal model after every suspect was tried once: whether it has a gap.
pub(crate) struct Suspected {
    pub(crate) nominal: Contestant,
    pub(crate) first: Expansion,
    /// Of every function without a name, where they were asked.
    pub(crate) nameless: Option<Vec<(f64, usize)>>,
    pub(crate) detected: Detected,
}

impl Suspected {
    /// The verdict where no gap was detected.
    pub(crate) fn without_gap(self) -> Judged {
        let outcome = Outcome {
            best: self.nominal.clone(),
            seats: Vec::new(),
            singles: self.first.singles(),
            near: self.first.fits,
            left: None,
            screened: self.first.screened,
        };
        Judged {
            nominal: self.nominal,
            detected: self.detected,
            nameless: self.nameless.unwrap_or_default(),
            outcome,
            forcing: None,
            was_asked_for_forces: false,
            notes: Vec::new(),
        }
    }
}

/// Tries every suspect, and every function without a name, once.
pub(crate) fn detect(contest: &Contest<'_>, nominal: Contestant) -> Result<Suspected> {
    let (nominal, first) = suspects(contest, nominal)?;
    // Functions without a name are asked only where the suspects leave a doubt; where they lie, later.
    let detected = judge(&first, None, &nominal);
    if detected.p_value < CERTAIN {
        return Ok(Suspected { nominal, first, nameless: None, detected });
    }
    let nameless = nameless(contest, &nominal)?;
    let detected = judge(&first, Some(&nameless), &nominal);
    Ok(Suspected { nominal, first, nameless: Some(nameless), detected })
}

/// The same after the hypotheses behind the leaders of a gap were tried, too, each of which an effect that leads imitates.
pub(crate) fn detect_behind(contest: &mut Contest<'_>, suspected: Suspected) -> Result<Suspected> {
    if !suspected.detected.gap {
        return Ok(suspected);
    }
    let new = contest.calls(suspected.first.leaders());
    if new.is_empty() {
        return Ok(suspected);
    }
    let Suspected { nominal, first, nameless, .. } = suspected;
    let first = expand_further(contest, &nominal, first, new)?;
    let detected = judge(&first, nameless.as_deref(), &nominal);
    Ok(Suspected { nominal, first, nameless, detected })
}

/// Every hypothesis tried at the nominal model, with integration steps short enough for the best of them.
///
/// Ripples and edges need shorter ones than the nominal model does, and lose the contest without.
fn suspects(contest: &Contest<'_>, mut nominal: Contestant) -> Result<(Contestant, Expansion)> {
    loop {
        let first = expand(contest, &nominal, &nominal, "suspects")?;
        let Some(finer) = first.fits.first().and_then(finer) else { return Ok((nominal, first)) };
        nominal = contest.fitter.on(&nominal, &finer, Budget::Usual)?;
    }
}

/// Chance that noise and negligible structure give as large a gain as the best rival (Bonferroni).
pub(crate) fn nameless_p_value(gains: &[(f64, usize)], at: &Contestant) -> f64 {
    let (count, spent) = (at.evidence.count(), at.evidence.spent());
    let allowed = at.evidence.negligible() * count as f64;
    let tail =
        |&(gain, degrees): &(f64, usize)| gain_tail(with_fitted_level(gain - allowed, count), degrees, count, spent);
    Searches::of(gains.len()).pay(gains.iter().map(tail).fold(1.0, f64::min))
}

/// Judges the nominal model by all that was tried at it.
fn judge(first: &Expansion, nameless: Option<&[(f64, usize)]>, nominal: &Contestant) -> Detected {
    let evidence = &nominal.evidence;
    let count = evidence.count();
    let allowed = evidence.negligible() * count as f64;
    // A smooth gap in a short log looks like coloured noise to the screening, but not compared with a fit that explains it.
    let refitted = first.fits.iter().map(|fit| {
        let gain = 2.0 * (log_likelihood(&fit.evidence.colours) - log_likelihood(&evidence.colours));
        gain_tail(gain - allowed, fit.evidence.complexity(), count, evidence.spent())
    });
    let refitted = first.searches.pay(refitted.fold(1.0, f64::min));
    let nameless = nameless.map_or(1.0, |gains| nameless_p_value(gains, nominal));
    let searches = [refitted, first.p_value(nominal), nameless, strained(nominal)];
    let p_value = Searches::of(searches.len()).pay(searches.into_iter().fold(1.0, f64::min));
    Detected { gap: p_value <= CHANCE, p_value }
}

/// Chance that the tolerated parameters move as far where the nominal model is right.
fn strained(nominal: &Contestant) -> f64 {
    let (evidence, free) = (&nominal.evidence, &nominal.free);
    let count = evidence.count() as f64;
    let allowed = |is_believed: bool| match is_believed {
        true => TOLERABLE + evidence.model_error,
        false => evidence.negligible(),
    };
    let moved = moved(nominal);
    // Several tolerated parameters may replace each other: then none is determined alone, but all together are.
    let together = evidence.strain - allowed(moved.iter().all(|m| m.is_believed));
    let together = chi_squared_tail(together * count / evidence.inflation(), free.len());
    let one = |moved: &Moved| chi_squared_tail(moved.squared - allowed(moved.is_believed) * count, 1);
    let alone = Searches::of(free.len()).pay(moved.iter().map(one).fold(1.0, f64::min));
    alone.min(together)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::fixture::drive_of;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;

    #[test]
    fn at_most_one_in_twenty_logs_without_a_gap_has_a_p_value_below_the_level() {
        let alarms = (0..40).filter(|&seed| {
            let (model, data) = drive_of(seed, None, |x| x, 0.02, (3, 120));
            let (train, holdout) = hold_out(&data).unwrap();
            let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
            assert_eq!(found.gap.detected, found.gap.p_value <= 0.05);
            found.gap.detected
        });
        // Six or more of 40 have a chance of 0.014 at a level of 5 %.
        assert!(alarms.count() < 6);
    }
}
