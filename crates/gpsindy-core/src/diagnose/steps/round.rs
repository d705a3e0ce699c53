//! One round of the contest: screens all hypotheses at a contestant and refits the promising ones.

use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::refit::refit;
use crate::diagnose::steps::screen::{Screened, Summary, screen};
use crate::error::Result;

/// What was found one step on from a contestant.
#[derive(Clone)]
pub(crate) struct Expansion {
    /// Contestants with one more effect, best first.
    pub(crate) fits: Vec<Contestant>,
    /// Straight-line gain of every hypothesis under coloured noise, in their order.
    pub(crate) screened: Vec<Summary>,
    /// How many starts were tried in all: what the search must pay for.
    pub(crate) searches: Searches,
}

impl Expansion {
    fn of(screened: &[Option<Screened>]) -> Self {
        let summary = screened.iter().map(|s| s.as_ref().map_or_else(Summary::default, Screened::summary)).collect();
        let tried = screened.iter().flatten().map(|s| s.gains.len()).sum();
        Self { fits: Vec::new(), screened: summary, searches: Searches::of(tried) }
    }

    /// Contestants with one effect.
    pub(crate) fn singles(&self) -> Vec<Contestant> {
        self.fits.iter().filter(|f| f.hypotheses.len() == 1).cloned().collect()
    }

    /// Chance that noise and negligible structure give as large a gain somewhere in the search.
    pub(crate) fn p_value(&self, at: &Contestant) -> f64 {
        let (count, spent) = (at.evidence.count(), at.evidence.spent());
        let allowed = at.evidence.negligible() * count as f64;
        let best = self
            .screened
            .iter()
            .map(|s| gain_tail(with_fitted_level(s.gain - allowed, count), s.degrees, count, spent));
        self.searches.pay(best.fold(1.0, f64::min))
    }
}

/// Screens everything at `base` and refits what is promising; `stage` is what this is for.
pub(crate) fn expand(contest: &Contest<'_>, base: &Contestant, stage: &str) -> Result<Expansion> {
    let screened = screen(contest, base, &format!("{stage}: screening"))?;
    let surveyed = Expansion::of(&screened);
    let fits = refit(contest, base, &screened, surveyed.searches, &format!("{stage}: fitting"))?;
    Ok(Expansion { fits, ..surveyed })
}

/// As [`expand`] without the refits: what straight lines say.
pub(crate) fn survey(contest: &Contest<'_>, base: &Contestant, stage: &str) -> Result<Expansion> {
    Ok(Expansion::of(&screen(contest, base, stage)?))
}

/// What was tried: sets of effects, and the contestants one step on from each; so that a set is tried once only.
#[derive(Default)]
pub(crate) struct Tried {
    rounds: Vec<(Contestant, Vec<Contestant>)>,
    /// Whether rounds were forgotten because the windows or the tolerated parameters are others now.
    pub(crate) was_cleared: bool,
}

impl Tried {
    pub(crate) fn keep(&mut self, base: &Contestant, fits: &[Contestant]) {
        self.rounds.push((base.clone(), fits.to_vec()));
    }

    pub(crate) fn clear(&mut self) {
        self.rounds.clear();
        self.was_cleared = true;
    }

    /// Contestants one step on from `base`, tried now where they were not before.
    pub(crate) fn expand(&mut self, contest: &Contest<'_>, base: &Contestant, stage: &str) -> Result<Vec<Contestant>> {
        if let Some((_, fits)) = self.rounds.iter().find(|(known, _)| known.has_effects_of(base)) {
            return Ok(fits.clone());
        }
        if contest.run.is_out_of_time() {
            return Ok(Vec::new());
        }
        let fits = expand(contest, base, stage)?.fits;
        self.keep(base, &fits);
        Ok(fits)
    }
}
