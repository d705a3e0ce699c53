//! Simpler effects that a wider one contains, in its stead.
//!
//! A screening sees little difference between the two, and the list of those that it lets through may end before the simpler one.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::fit::contestant::{Contestant, Entrant};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::error::Result;

/// `best` with an effect that the one at `place` contains in its stead, from the values that it has there; `base` has none of the
/// `others`, which stay.
pub(crate) fn contained(
    contest: &Contest<'_>,
    base: &Contestant,
    best: &Contestant,
    place: usize,
    others: &[(Entrant<'_>, Vec<f64>)],
) -> Result<Vec<Contestant>> {
    let wide = &best.hypotheses[place];
    let values = best.values(place);
    let contained = wide.effect().into_iter().flat_map(Effect::contains);
    let narrow = contained.filter_map(|&effect| narrow(contest, base, wide, effect, &values));
    let new = narrow.filter(|(hypothesis, _)| !best.hypotheses.contains(hypothesis));
    let sets = new.map(|(hypothesis, own)| {
        let entrant = Entrant::new(hypothesis, best.searches[place]);
        others.iter().cloned().chain([(entrant, own)]).collect::<Vec<_>>()
    });
    let fits = base.each(sets.collect(), |effects| contest.again_with(base, best, &effects))?;
    Ok(fits.into_iter().flatten().collect())
}

/// The hypothesis of `effect` where `wide` acts, and its values: a number of the simulator's own where that carries the effect.
fn narrow<'a>(
    contest: &'a Contest<'_>,
    base: &Contestant,
    wide: &Hypothesis,
    effect: Effect,
    values: &[f64],
) -> Option<(&'a Hypothesis, Vec<f64>)> {
    let is_it = |h: &&Hypothesis| {
        h.is(effect) && (h.state, &h.site) == (wide.state, &wide.site) && h.variables.first() == wide.variables.first()
    };
    if effect == Effect::ParameterError {
        let name = wide.variables.first()?;
        let nominal = base.refined.parameters[base.system.model().parameter_index(name)?];
        let found = contest.hypotheses.iter().find(|h| h.frees() == Some(name))?;
        // As warm as it gets under its typical load.
        return Some((found, vec![nominal * (1.0 + values.first()?)]));
    }
    if let Some(found) = contest.all().find(is_it) {
        return Some((found, as_in(wide, effect, values)?));
    }
    let (_, parameter) = wide.site.as_ref()?.carried.iter().find(|(id, _)| *id == effect.id())?;
    let found = contest.hypotheses.iter().find(|h| h.frees() == Some(parameter))?;
    let nominal = base.refined.parameters[base.system.model().parameter_index(parameter)?];
    Some((found, vec![nominal + values.first()?]))
}

/// The values of `effect` with which it does what the wide one with these values does but for what sets the two apart.
fn as_in(wide: &Hypothesis, effect: Effect, values: &[f64]) -> Option<Vec<f64>> {
    match (wide.effect()?, effect) {
        // The level at rest is that at standstill.
        (Effect::StribeckFriction, Effect::Stiction) => Some(vec![*values.first()?, values.first()? + values.get(1)?]),
        // What has no corner of its own holds at rest.
        (Effect::Stiction, _) => Some(vec![*values.first()?, 0.0]),
        _ => Some(values.first().into_iter().chain(values.last()).copied().collect()),
    }
}
