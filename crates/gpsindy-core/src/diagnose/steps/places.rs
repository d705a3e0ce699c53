//! Places: replaces each effect of the winner in turn by every other effect, and keeps a better one.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::contestant::{Contestant, Entrant};
use crate::diagnose::limits::{Budget, IN_SIGHT, NAMED};
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::findings::gap_size;
use crate::diagnose::steps::round::Tried;
use crate::error::Result;
use crate::parallel::*;

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
    fits.extend(contained(contest, nominal, best, place)?);
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
    let mut fits = fits.into_par_iter().map(finish).collect::<Result<Vec<Contestant>>>()?;
    contest.sort(&mut fits);
    let removed = (rest.evidence.misfit() - best.evidence.misfit()).max(0.0);
    Ok(Place { rest: Some(rest), richer, fits: keep_first_of_each(fits), removed })
}

/// The winner with an effect that the one at `place` contains in its stead, from the values that it has there.
///
/// A screening sees little difference between the two, and the list of those that it lets through may end before the simpler one.
fn contained(contest: &Contest<'_>, nominal: &Contestant, best: &Contestant, place: usize) -> Result<Vec<Contestant>> {
    let wide = &best.hypotheses[place];
    let narrow = |effect: Effect| {
        let is_it = |h: &&Hypothesis| {
            h.is(effect)
                && (h.state, &h.site) == (wide.state, &wide.site)
                && h.variables.first() == wide.variables.first()
        };
        contest.hypotheses.iter().find(is_it).filter(|h| !best.hypotheses.contains(h))
    };
    let values = best.values(place);
    let mut all = Vec::new();
    for hypothesis in wide.effect().into_iter().flat_map(|effect| effect.contains()).filter_map(|&e| narrow(e)) {
        let mut effects = best.entrants_without(&[place]);
        let own = values.first().into_iter().chain(values.last()).copied().collect();
        effects.push((Entrant { hypothesis, searches: best.searches[place] }, own));
        all.extend(contest.again_with(nominal, best, &effects)?);
    }
    Ok(all)
}
