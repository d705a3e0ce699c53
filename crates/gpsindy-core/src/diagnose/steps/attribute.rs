//! Attribute: which effects cause the gap, and whether unmodelled structure remains.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{MOST_MOVES, SWAP};
use crate::diagnose::steps::charge::charge_tolerated;
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::detect::{Suspected, nameless_p_value};
use crate::diagnose::steps::findings::{Judged, Left, Outcome};
use crate::diagnose::steps::lengthen::lengthen;
use crate::diagnose::steps::places::{Place, places};
use crate::diagnose::steps::round::{Expansion, Tried, survey};
use crate::diagnose::steps::screen::nameless;
use crate::diagnose::steps::search::search;
use crate::diagnose::steps::simplify::{merged, pruned, strongest};
use crate::error::Result;

/// The causes of a detected gap.
///
/// Effects are added while they convince; then, place by place, every other suspect applies for the place of each, and the
/// best move of all is made until none is left. Looking at all places first, the order of the effects does not count.
pub(crate) fn attribute(contest: &Contest<'_>, suspected: Suspected) -> Result<Judged> {
    if !suspected.detected.gap {
        return Ok(suspected.without_gap());
    }
    let Suspected { nominal, first, nameless, detected } = suspected;
    let singles = first.singles();
    let (found, mut tried) = search(contest, &nominal, first)?;
    let (nominal, mut best, is_structured) = settle(contest, nominal, found, &mut tried)?;
    let mut seats = places(contest, &nominal, &best, is_structured, &mut tried)?;
    for _ in 0..MOST_MOVES {
        let next = match moved(contest, &best, &seats) {
            Some(next) => Some(next),
            // Where a rest is left anyhow, fewer effects explain it no better.
            None if is_structured => None,
            None => merged(contest, &nominal, &best, &seats, &mut tried)?,
        };
        let Some(next) = next else { break };
        best = next;
        seats = places(contest, &nominal, &best, is_structured, &mut tried)?;
    }
    let last = survey(contest, &best, "what is left")?;
    let left = left_over(contest, &best, &last)?;
    let nameless = if tried.was_cleared { self::nameless(contest, &nominal)? } else { nameless };
    let removed = seats.iter().map(|seat| seat.removed).collect();
    let alternatives = seats.into_iter().map(|seat| seat.fits).collect();
    let outcome = Outcome { best, alternatives, removed, singles, left, screened: last.screened };
    Ok(Judged { nominal, detected, nameless, outcome, forcing: None, was_asked_for_forces: false })
}

/// The nominal model and what was found, on the rollouts and with the tolerances by which causes are told, and whether
/// structure without a name is left beside them.
fn settle(
    contest: &Contest<'_>,
    nominal: Contestant,
    found: Contestant,
    tried: &mut Tried,
) -> Result<(Contestant, Contestant, bool)> {
    contest.run.begin("settling");
    let (found, _) = pruned(contest, &nominal, found)?;
    let before = (found.experiment.windows.clone(), nominal.free.len());
    let (nominal, found) = lengthen(contest, nominal, found)?;
    let (nominal, found) = charge_tolerated(contest, nominal, found)?;
    // Once more, because longer rollouts show what an effect is worth.
    let (found, is_structured) = pruned(contest, &nominal, found)?;
    if before != (found.experiment.windows.clone(), nominal.free.len()) {
        // What was tried on other rollouts says nothing of these.
        tried.clear();
    }
    Ok((nominal, found, is_structured))
}

/// The best move of all places: several effects for one, else one effect less, else another effect in its place.
fn moved(contest: &Contest<'_>, best: &Contestant, seats: &[Place]) -> Option<Contestant> {
    let first = |fits: Vec<&Contestant>| {
        let order = |a: &&Contestant, b: &&Contestant| contest.score(a).total_cmp(&contest.score(b));
        fits.into_iter().max_by(order).cloned()
    };
    let richer = seats.iter().filter_map(|seat| seat.richer.as_ref());
    let superfluous = |rest: &&Contestant| best.hypotheses.len() > 1 && !contest.is_convincing(best, rest);
    let simpler = seats.iter().filter_map(|seat| seat.rest.as_ref()).filter(superfluous);
    let is_better = |fit: &&Contestant| !fit.has_effects_of(best) && contest.score(fit) - contest.score(best) > SWAP;
    let other = seats.iter().filter_map(|seat| seat.fits.first()).filter(is_better);
    first(richer.collect()).or_else(|| first(simpler.collect())).or_else(|| first(other.collect()))
}

/// Structure that a function without a name, or one more effect, would still remove.
fn left_over(contest: &Contest<'_>, best: &Contestant, last: &Expansion) -> Result<Option<Left>> {
    let gains = nameless(contest, best)?;
    let Some((place, energy)) = strongest(best, &gains) else { return Ok(None) };
    // Two searches, both paid for.
    let p_value = (2.0 * nameless_p_value(&gains, best).min(last.p_value(best))).min(1.0);
    let rival = &contest.rivals[place];
    Ok(Some(Left { energy, p_value, state: rival.state, depends_on: rival.variables.clone() }))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::fixture::drive;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, Diagnosed, hold_out};
    use crate::progress::Silent;

    /// A drive with a tolerance of 5 % whose true rate is 1.03/s.
    fn slightly_off(noise: f64) -> Diagnosed {
        let (model, data) = drive(Some(0.05), |x| 1.03 * x, noise, (4, 300));
        let (train, holdout) = hold_out(&data).unwrap();
        Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap()
    }

    #[test]
    fn a_parameter_within_its_tolerance_is_a_cause_only_where_the_sensors_show_it() {
        // The outputs move by 0.02: a fifth of one noise, seven times the other.
        let unseen = slightly_off(0.1).diagnosis;
        assert_eq!(unseen.verdict, Verdict::NoGap, "{unseen:?}");
        let seen = slightly_off(0.003).diagnosis;
        assert_eq!(seen.verdict, Verdict::Explained, "{seen:?}");
        let first = &seen.causes[0];
        let names: Vec<&str> = std::iter::once(&first.effect).chain(&first.equivalent).map(String::as_str).collect();
        assert!(first.included && names.contains(&"parameter_error"), "{:?}", seen.causes);
    }
}
