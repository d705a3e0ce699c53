//! One round of the contest: screens all hypotheses at a contestant and fits the promising moves.

use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::limits::FINALISTS;
use crate::diagnose::steps::attribution::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::attribution::moves::moves;
use crate::diagnose::steps::attribution::screen::screen;
use crate::diagnose::steps::attribution::survey::{Screened, Summary, Survey};
use crate::error::Result;
use std::ops::Range;

/// What was found one move away from a contestant.
#[derive(Clone)]
pub(crate) struct Expansion {
    /// Contestants with one more effect, or others in the place of some, best first.
    pub(crate) fits: Vec<Contestant>,
    /// Straight-line gain of every hypothesis under coloured noise, in their order.
    pub(crate) screened: Vec<Summary>,
    /// How many starts were tried in all: what the search must pay for.
    pub(crate) searches: Searches,
}

impl Expansion {
    /// The best contestants, by which it is decided what else is tried.
    pub(crate) fn leaders(&self) -> &[Contestant] {
        &self.fits[..self.fits.len().min(FINALISTS)]
    }

    /// Contestants with one effect.
    pub(crate) fn singles(&self) -> Vec<Contestant> {
        self.fits.iter().filter(|f| f.hypotheses.len() == 1).cloned().collect()
    }

    /// The same with what a further search at its contestant found.
    fn with(mut self, contest: &Contest<'_>, fits: Vec<Contestant>, searches: Searches) -> Self {
        self.fits.extend(fits);
        contest.sort(&mut self.fits);
        Self { fits: keep_first_of_each(self.fits), searches: self.searches.and(searches), ..self }
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

/// Screens everything at `base` and fits what is promising; `stage` is what this is for.
pub(crate) fn expand(contest: &Contest<'_>, nominal: &Contestant, base: &Contestant, stage: &str) -> Result<Expansion> {
    expand_by(contest, nominal, base, Asked { stage, only: None, is_behind: false }, None)
}

/// The `round` at `base` with what the `new` hypotheses add to it, which became suspects by it. Those that do not lead then wait again.
pub(crate) fn expand_further(
    contest: &mut Contest<'_>,
    nominal: &Contestant,
    (base, round): (&Contestant, Expansion),
    new: Range<usize>,
) -> Result<Expansion> {
    if new.is_empty() {
        return Ok(round);
    }
    let known = if base.hypotheses.is_empty() { round.fits.first() } else { Some(base) };
    let asked = Asked { stage: "further suspects", only: Some(new.clone()), is_behind: false };
    let more = expand_by(contest, nominal, base, asked, known)?;
    let mut all = round.with(contest, more.fits, more.searches);
    let stay = contest.dismisses(new.clone(), all.leaders());
    all.fits.retain(|fit| !fit.hypotheses.iter().any(|h| contest.is_waiting(h)));
    // Sets that apply together come behind all hypotheses.
    all.screened.splice(new.start..new.start, stay.iter().map(|&number| more.screened[number].clone()));
    Ok(all)
}

/// The round at `best` with what stands behind its effects, for an imitator that leads only beside others hid it until then; and with the same
/// effects in other places, for one of a few had called them there. `None` where nothing waits.
pub(crate) fn expand_behind(
    contest: &mut Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    round: &Expansion,
) -> Result<Option<Expansion>> {
    if contest.run.is_out_of_time() {
        return Ok(None);
    }
    let new = contest.calls_beside(best);
    if new.is_empty() {
        return Ok(None);
    }
    let asked = Asked { stage: "what stands behind", only: Some(new.clone()), is_behind: true };
    let more = expand_by(contest, nominal, best, asked, Some(best))?;
    let mut all = round.clone().with(contest, more.fits, more.searches);
    contest.with_places(&mut all.screened);
    all.screened[new.clone()].clone_from_slice(&more.screened[new]);
    Ok(Some(all))
}

/// Who is asked in a round.
struct Asked<'a> {
    stage: &'a str,
    /// Numbers of the hypotheses; of all where there are none.
    only: Option<Range<usize>>,
    /// Whether only what stands behind an effect that is there, in its place, and what marks a place.
    is_behind: bool,
}

fn expand_by(
    contest: &Contest<'_>,
    nominal: &Contestant,
    base: &Contestant,
    Asked { stage, only, is_behind }: Asked<'_>,
    known: Option<&Contestant>,
) -> Result<Expansion> {
    if contest.run.is_out_of_time() {
        let none = vec![Summary::default(); contest.hypotheses.len() + contest.joint.len()];
        return Ok(Expansion { fits: Vec::new(), screened: none, searches: Searches::NONE });
    }
    let survey = screen(contest, nominal, base, (&format!("{stage}: screening"), only))?;
    let survey = Survey { is_behind, ..survey };
    let Survey { suspects, .. } = &survey;
    let screened = suspects.iter().map(|s| s.as_ref().map_or_else(Summary::default, Screened::summary)).collect();
    let searches = Searches::of(suspects.iter().flatten().map(|s| s.gains.len()).sum());
    let fits = moves(contest, nominal, base, (&survey, searches), (&format!("{stage}: fitting"), known))?;
    Ok(Expansion { fits, screened, searches })
}
