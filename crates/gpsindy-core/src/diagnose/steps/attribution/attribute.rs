//! Attribute: which effects cause the gap, and whether unmodelled structure remains.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::weigh::LEAST_REST;
use crate::diagnose::limits::{Budget, CHANCE, IN_SIGHT, MOST_MOVES, NAMED, SWAP};
use crate::diagnose::notes::Note;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::detect::{Suspected, nameless_p_value};
use crate::diagnose::steps::attribution::moves::scatter::resettled;
use crate::diagnose::steps::attribution::places::{self, Place};
use crate::diagnose::steps::attribution::round::{Expansion, expand, expand_behind, expand_further};
use crate::diagnose::steps::attribution::screen::nameless;
use crate::diagnose::steps::attribution::search::{Found, is_exchange, richer, search};
use crate::diagnose::steps::attribution::settle::{Settled, settle};
use crate::diagnose::steps::attribution::simplify::{is_structured, strongest};
use crate::diagnose::steps::findings::{Judged, Left, Outcome, Seat, counts};
use crate::error::Result;

/// The causes of a detected gap.
///
/// Effects are added, and exchanged for others, while that convinces; then once more on the rollouts by which causes are distinguished, until
/// no move is left. All places are looked at in every round, so the order of the effects does not count.
pub(crate) fn attribute(contest: &mut Contest<'_>, suspected: Suspected) -> Result<Judged> {
    if !suspected.detected.gap {
        return Ok(suspected.without_gap());
    }
    let Suspected { nominal, first, nameless, detected, is_pinned } = suspected;
    let singles = first.singles();
    let Found { nominal, best: found, mut round, rounds, is_lengthened, is_quieter } = search(contest, nominal, first)?;
    let Settled { nominal, mut best, rests, left, mut notes, is_moved, is_redrawn } = settle(contest, nominal, &found)?;
    if is_lengthened && !notes.contains(&Note::Lengthened) {
        notes.push(Note::Lengthened);
    }
    if is_pinned {
        notes.push(Note::Pinned);
    }
    best = resettled(contest, best)?;
    let is_structured = is_structured(&best, &left);
    // What was tried on other rollouts, or with another set of effects, says nothing of these.
    let is_known = !is_moved && best.has_effects_of(&found);
    let again = |contest: &Contest<'_>, best: &Contestant| match rounds.at(contest, best).filter(|_| !is_moved) {
        Some(known) => Ok(known.clone()),
        None => expand(contest, &nominal, best, "alternatives"),
    };
    if !is_known {
        round = again(contest, &best)?;
        // What longer rollouts leave, shorter ones did not ask for.
        round = expand_behind(contest, &nominal, &best, &round)?.unwrap_or(round);
    }
    // Beside a rest what waits was asked at the beginning; what is left of less may be what waits behind an effect that never led.
    let is_little = !best.evidence.leaves_a_rest() && nameless_p_value(&left, &best) <= CHANCE;
    if is_little && !contest.run.is_out_of_time() {
        let waiting = contest.calls_all();
        round = expand_further(contest, &nominal, (&best, round), waiting)?;
    }
    if is_redrawn && is_known {
        round.fits = from_starts_of(contest, &best, &found, round.fits)?;
    }
    let mut places = places::places(contest, &nominal, &best, &round.fits, rests)?;
    let mut known: Vec<Contestant> = Vec::new();
    for _ in 0..MOST_MOVES {
        known.push(best.clone());
        let Some(next) = moved(contest, &nominal, &best, &places, &round.fits, is_structured) else { break };
        // Fits of one set may end at different points, so that one effect more convinces beside the worse of them and is superfluous
        // beside the better: the set without it stays.
        let is_again = known.iter().any(|other| other.has_effects_of(&next));
        if contest.run.is_out_of_time() || (is_again && next.hypotheses.len() >= best.hypotheses.len()) {
            break;
        }
        let is_same = is_exchange(contest, &best, &next);
        let last = std::mem::replace(&mut best, next);
        if is_same {
            round.fits.push(last);
        } else {
            round = again(contest, &best)?;
        }
        places = places::places(contest, &nominal, &best, &round.fits, None)?;
        if is_again || is_same {
            break;
        }
    }
    let left = if known.len() > 1 { self::nameless(contest, &best)? } else { left };
    let left = left_over(contest, &best, &left, &round);
    let nameless = nameless
        .filter(|_| !is_moved && !is_lengthened && !is_quieter)
        .map_or_else(|| self::nameless(contest, &nominal), Ok)?;
    let seat = |(hypothesis, place): (&Hypothesis, Place)| Seat {
        hypothesis: hypothesis.clone(),
        alternatives: place.fits,
        removed: place.removed,
    };
    let seats = best.hypotheses.iter().zip(places).map(seat).collect();
    let outcome = Outcome { best, seats, singles, near: round.fits, left, screened: round.screened };
    Ok(Judged {
        nominal,
        detected,
        nameless,
        outcome,
        forcing: None,
        was_asked_for_forces: false,
        sensors: Vec::new(),
        notes,
    })
}

/// The `fits` that were in sight of what was `found`, from the starts that were drawn for it since: it must not beat its rivals by those.
fn from_starts_of(
    contest: &Contest<'_>,
    best: &Contestant,
    found: &Contestant,
    fits: Vec<Contestant>,
) -> Result<Vec<Contestant>> {
    let in_sight = contest.score(found) - IN_SIGHT;
    let one = |fit: Contestant| match contest.score(&fit) > in_sight && !contest.run.is_out_of_time() {
        true => contest.fitter.with_starts_of(fit, best, Budget::Usual),
        false => Ok(fit),
    };
    best.each(fits, one)
}

/// The best move of all: one more effect, else one effect less, else another one in its place, else one in the place of two.
fn moved(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    places: &[Place],
    fits: &[Contestant],
    is_structured: bool,
) -> Option<Contestant> {
    let own = best.hypotheses.len();
    let superfluous = |rest: &&Contestant| own > 1 && !contest.is_convincing(best, rest);
    let simpler = places.iter().filter_map(|place| place.rest.as_ref()).filter(superfluous);
    let is_better = |fit: &&Contestant| !fit.has_effects_of(best) && contest.lead(fit, best) > SWAP;
    let other = contest.best(places.iter().flat_map(|place| &place.fits).filter(is_better));
    // Where a rest is left anyhow, fewer effects explain it no better.
    let is_one_for_two =
        |fit: &&Contestant| !is_structured && fit.hypotheses.len() < own && !contest.is_convincing(best, fit);
    // Where a rest is left anyhow, what removes little of the gap is a use for that.
    let share = |fit: &Contestant| if fit.evidence.leaves_a_rest() { NAMED } else { LEAST_REST };
    let that_count = fits.iter().filter(|fit| counts(nominal, fit, best, share(fit)));
    richer(contest, other.unwrap_or(best), that_count)
        .or_else(|| contest.best(simpler))
        .or(other)
        .or_else(|| contest.best(fits.iter().filter(is_one_for_two)))
        .cloned()
}

/// Structure that a function without a name (`gains`), or one more effect, would still remove.
fn left_over(contest: &Contest<'_>, best: &Contestant, gains: &[(f64, usize)], last: &Expansion) -> Option<Left> {
    let (place, energy) = strongest(best, gains)?;
    // Two searches, both paid for.
    let p_value = (2.0 * nameless_p_value(gains, best).min(last.p_value(best))).min(1.0);
    Some(Left { energy, p_value, rival: place, depends_on: contest.rivals[place].variables.clone() })
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
