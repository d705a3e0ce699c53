//! Attribute: which effects cause the gap, and is anything left that has no name.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{ALIKE, BEAM, Budget, IN_SIGHT, NAMED};
use crate::diagnose::steps::charge::charge_tolerated;
use crate::diagnose::steps::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::detect::{Suspected, nameless_p_value};
use crate::diagnose::steps::findings::{Judged, Left, Outcome};
use crate::diagnose::steps::lengthen::lengthen;
use crate::diagnose::steps::round::{Expansion, Known, expand, expand_once, survey};
use crate::diagnose::steps::screen::nameless;
use crate::diagnose::steps::simplify::{gap_size, merged, pruned, strongest};
use crate::error::Result;
use rayon::prelude::*;

/// The causes of a detected gap.
pub(crate) fn attribute(contest: &Contest<'_>, suspected: Suspected) -> Result<Judged> {
    if !suspected.detected.gap {
        return Ok(suspected.without_gap());
    }
    let Suspected { nominal: first_nominal, first, nameless: first_nameless, detected } = suspected;
    let singles = first.singles();
    let (rough, mut known) = run(contest, &first_nominal, first)?;
    let (rough, _) = pruned(contest, &first_nominal, rough)?;
    let windows = rough.experiment.windows.clone();
    let (lengthened, rough) = lengthen(contest.fitter, &contest.run.notes, first_nominal, rough)?;
    let n_tolerated = lengthened.free.len();
    let (nominal, charged) = charge_tolerated(contest, lengthened, rough)?;
    // Once more, because longer rollouts show what an effect is worth.
    let (mut best, is_structured) = pruned(contest, &nominal, charged)?;
    let unchanged = best.experiment.windows == windows && nominal.free.len() == n_tolerated;
    if !unchanged {
        known.clear();
    }
    let mut alternatives: Vec<Vec<Contestant>> = Vec::new();
    let mut removed: Vec<f64> = Vec::new();
    // Swap: leave each effect out in turn, and let all others apply for its place.
    let mut swaps = 0;
    let mut place = 0;
    loop {
        if place == best.hypotheses.len() {
            // Where a rest is left anyhow, fewer effects explain it no better.
            let simpler = if is_structured { None } else { merged(contest, &nominal, &best, &removed, &mut known)? };
            match simpler {
                Some(simpler) => best = simpler,
                None => break,
            }
            alternatives.clear();
            removed.clear();
            place = 0;
        }
        let Some(rest) = contest.without(&nominal, &best, &[place])? else {
            // Without this one the others can't even be simulated: it has no alternative.
            alternatives.push(vec![best.clone()]);
            removed.push(gap_size(&nominal, &best).max(0.0));
            place += 1;
            continue;
        };
        let mut fits = expand_once(contest, &rest, "alternatives", &mut known)?;
        // Several that apply together for the place of one must convince; they are no alternatives to one.
        let several = fits.iter().find(|f| f.hypotheses.len() > best.hypotheses.len());
        if let Some(richer) = several.filter(|f| swaps < 4 && contest.is_convincing(f, &best)) {
            best = contest.fitter.carried_on(richer.clone(), Budget::Thorough)?;
            alternatives.clear();
            removed.clear();
            swaps += 1;
            place = 0;
            continue;
        }
        // While structure is left, its use to a more flexible effect is no evidence for that one.
        let slight = NAMED * gap_size(&nominal, &best);
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
        let fits = keep_first_of_each(fits);
        let gain = contest.score(&fits[0]) - contest.score(&best);
        let same = fits[0].hypotheses.iter().all(|h| best.hypotheses.contains(h));
        if !contest.is_convincing(&best, &rest) && best.hypotheses.len() > 1 {
            // Others have made this effect superfluous.
            best = rest;
            alternatives.clear();
            removed.clear();
            place = 0;
            continue;
        }
        if !same && gain > 0.5 && swaps < 4 {
            best = fits[0].clone();
            alternatives.clear();
            removed.clear();
            swaps += 1;
            place = 0;
            continue;
        }
        alternatives.push(fits);
        removed.push((rest.evidence.misfit() - best.evidence.misfit()).max(0.0));
        place += 1;
    }
    let last = survey(contest, &best, "what is left")?;
    let left = left_over(contest, &best, &last)?;
    let outcome = Outcome { best, alternatives, removed, singles, left, screened: last.screened };
    Ok(Judged { nominal, detected, nameless: first_nameless, outcome })
}

/// Adds effects as long as they convince; returns the winner, and what was tried on the way.
fn run(contest: &Contest<'_>, nominal: &Contestant, first: Expansion) -> Result<(Contestant, Vec<Known>)> {
    let mut best = nominal.clone();
    let mut known = vec![Known::new(nominal, &first.fits)];
    let mut beam = different(first.fits);
    for round in 1..=contest.most {
        let Some(leader) = beam.first() else { break };
        if !contest.is_convincing(leader, &best) {
            break;
        }
        best = leader.clone();
        // With as many effects as may be, or nothing left, no more are added.
        if round == contest.most || best.hypotheses.len() >= contest.most || best.evidence.misfit() < 1e-12 {
            break;
        }
        let mut next = Vec::new();
        for (place, contestant) in beam.iter().filter(|f| f.hypotheses.len() < contest.most).enumerate() {
            // Where nothing is left at the leader, the others need not be tried with more.
            if place > 0 && next.is_empty() {
                break;
            }
            let stage = format!("effects together: {}", round + 1);
            let fits = expand(contest, contestant, &stage)?.fits;
            known.push(Known::new(contestant, &fits));
            next.extend(fits.into_iter().take(2 * BEAM));
        }
        contest.sort(&mut next);
        beam = different(keep_first_of_each(next));
    }
    Ok((best, known))
}

/// The first contestants whose outputs differ: what cannot be told apart now need not be carried on twice, and
/// leaves room for another account of the logs. The final swaps bring the twins back.
fn different(fits: Vec<Contestant>) -> Vec<Contestant> {
    let mut kept: Vec<Contestant> = Vec::with_capacity(BEAM);
    for fit in fits {
        if kept.len() == BEAM {
            break;
        }
        let is_known =
            |other: &Contestant| other.distance(&fit) < ALIKE * other.evidence.misfit().min(fit.evidence.misfit());
        if !kept.iter().any(is_known) {
            kept.push(fit);
        }
    }
    kept
}

/// Structure that a function without a name, or one more effect, would still remove.
fn left_over(contest: &Contest<'_>, best: &Contestant, last: &Expansion) -> Result<Option<Left>> {
    let gains = nameless(contest, best)?;
    let Some((place, energy)) = strongest(best, &gains) else { return Ok(None) };
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
