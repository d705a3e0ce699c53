//! Places: replaces each effect of the winner in turn by every other effect, and keeps a better one.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, IN_SIGHT, NAMED};
use crate::diagnose::steps::contained::contained;
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::findings::gap_size;
use crate::diagnose::steps::round::Tried;
use crate::error::Result;
use crate::parallel::each;

/// The place of one effect of the winner.
pub(crate) struct Place {
    /// The winner without the effect; none where the others can't be simulated without it.
    pub(crate) rest: Option<Contestant>,
    /// The winner with several effects in the place of this one, where they convince.
    pub(crate) richer: Option<Contestant>,
    /// Contestants with one effect in its place, the winner among them, best first.
    pub(crate) fits: Vec<Contestant>,
    /// Mean squared residual (noise units) that the effect removes, taken last.
    pub(crate) removed: f64,
}

/// Every place of `best`; `is_structured`: whether structure without a name is left.
pub(crate) fn places(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    is_structured: bool,
    tried: &mut Tried,
) -> Result<Vec<Place>> {
    (0..best.hypotheses.len()).map(|place| at(contest, nominal, best, is_structured, place, tried)).collect()
}

fn at(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    is_structured: bool,
    place: usize,
    tried: &mut Tried,
) -> Result<Place> {
    let Some(rest) = contest.without(nominal, best, &[place])? else {
        let removed = gap_size(nominal, best).max(0.0);
        return Ok(Place { rest: None, richer: None, fits: vec![best.clone()], removed });
    };
    let stage = format!("alternatives to effect {} of {}", place + 1, best.hypotheses.len());
    let mut fits = tried.expand(contest, &rest, &stage)?;
    fits.extend(contained(contest, nominal, best, place, &best.entrants_without(&[place]))?);
    // Several that apply together for the place of one must convince; they are no alternatives to one.
    let several = fits.iter().find(|f| f.hypotheses.len() > best.hypotheses.len());
    let richer = several.filter(|f| contest.is_convincing(f, best)).cloned();
    let richer = richer.map(|f| contest.fitter.carried_on(f, Budget::Thorough)).transpose()?;
    // While structure is left, its use to a more flexible effect is no evidence for that one.
    let slight = NAMED * gap_size(nominal, best);
    let is_plain = |f: &Contestant| {
        !is_structured
            || f.evidence.complexity() <= best.evidence.complexity()
            || f.evidence.misfit() < best.evidence.misfit() - slight
    };
    fits.retain(|f| f.hypotheses.len() == best.hypotheses.len() && is_plain(f));
    fits.push(best.clone());
    let leader = fits.iter().map(|f| contest.score(f)).fold(f64::NEG_INFINITY, f64::max);
    let finish = |f: Contestant| match contest.score(&f) > leader - IN_SIGHT {
        true => contest.fitter.carried_on(f, Budget::Thorough),
        false => Ok(f),
    };
    let mut fits = each(best.fits_in_turn(), fits, finish)?;
    contest.sort(&mut fits);
    let removed = (rest.evidence.misfit() - best.evidence.misfit()).max(0.0);
    Ok(Place { rest: Some(rest), richer, fits: keep_first_of_each(fits), removed })
}
