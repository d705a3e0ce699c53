//! Places: what else may replace each effect of the winner, and what the winner is without it.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, CONVINCING, IN_SIGHT};
use crate::diagnose::steps::attribution::contained::contained;
use crate::diagnose::steps::attribution::contest::{Contest, keep_first_of_each};
use crate::diagnose::steps::attribution::round::expand;
use crate::error::Result;

/// The place of one effect of the winner.
pub(crate) struct Place {
    /// The winner without the effect; none where the others can't be simulated without it.
    pub(crate) rest: Option<Contestant>,
    /// Contestants with one effect in its place, the winner among them, best first.
    pub(crate) fits: Vec<Contestant>,
    /// Mean squared residual (noise units) that the effect removes, taken last.
    pub(crate) removed: f64,
}

/// Every place of `best`, of the `fits` one move away from it; `rests`: what it is without each of its effects, where that is known.
pub(crate) fn places(
    contest: &Contest<'_>,
    nominal: &Contestant,
    best: &Contestant,
    fits: &[Contestant],
    rests: Option<Vec<Option<Contestant>>>,
) -> Result<Vec<Place>> {
    contest.run.begin("places of the winner's effects");
    let rests = match rests {
        Some(rests) => rests,
        None if best.hypotheses.len() == 1 => vec![Some(nominal.clone())],
        None => contest.without_each(nominal, best, if is_moot(best) { Budget::Rough } else { Budget::Usual })?,
    };
    // It stands in every place, and is the same in all.
    let whole = finished(contest, best, best.clone(), contest.score(best))?;
    let one = |(place, rest)| at(contest, nominal, (best, &whole), fits, (place, rest));
    rests.into_iter().enumerate().map(one).collect()
}

/// A fit in a place of `best` carried on, where it is not at rest and in sight of the score of a `leader`.
fn finished(contest: &Contest<'_>, best: &Contestant, fit: Contestant, leader: f64) -> Result<Contestant> {
    let is_open = |f: &Contestant, within: f64| !f.refined.converged && contest.score(f) > leader - within;
    if !is_open(&fit, IN_SIGHT) {
        return Ok(fit);
    }
    let fit = contest.fitter.carried_on(fit, if is_moot(best) { Budget::Rough } else { Budget::Usual })?;
    // To the end goes only what may be a twin, or better.
    match is_open(&fit, CONVINCING) && !is_moot(best) {
        true => contest.fitter.carried_on(fit, Budget::Thorough),
        false => Ok(fit),
    }
}

/// Whether none of its effects is believed much, because more than noise is left: a few steps then say what stands beside each.
fn is_moot(best: &Contestant) -> bool {
    best.evidence.leaves_a_rest()
}

/// Whether the effect at a place has states whose starts are fitted in every window or log. They take up what another effect in its place would do, so that no
/// straight line from this fit shows it.
fn has_own_starts(best: &Contestant, place: usize) -> bool {
    let is_beside = best.hypotheses.len() > 1 && best.system.engine().is_none();
    is_beside && best.hypotheses[place].added_states() > 0 && best.added_starts() + best.given_starts() > 0
}

fn at(
    contest: &Contest<'_>,
    nominal: &Contestant,
    (best, whole): (&Contestant, &Contestant),
    fits: &[Contestant],
    (place, rest): (usize, Option<Contestant>),
) -> Result<Place> {
    let others: Vec<_> = best.hypotheses.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, h)| h).collect();
    let stands_there = |fit: &&Contestant| {
        fit.hypotheses.len() == best.hypotheses.len() && others.iter().all(|h| fit.hypotheses.contains(h))
    };
    let mut fits: Vec<Contestant> = fits.iter().filter(stands_there).cloned().collect();
    fits.extend(contained(contest, nominal, best, place, &best.entrants_without(&[place]))?);
    if let Some(rest) = rest.as_ref().filter(|_| has_own_starts(best, place) && !is_moot(best)) {
        fits.extend(expand(contest, nominal, rest, "in its place")?.fits.into_iter().filter(|fit| stands_there(&fit)));
    }
    let scores = fits.iter().chain([whole]).map(|f| contest.score(f));
    let leader = scores.fold(f64::NEG_INFINITY, f64::max);
    let mut fits = best.each(fits, |fit| finished(contest, best, fit, leader))?;
    fits.push(whole.clone());
    contest.sort(&mut fits);
    let without = rest.as_ref().map_or(nominal, |rest| rest);
    let removed = (without.evidence.misfit() - best.evidence.misfit()).max(0.0);
    Ok(Place { rest, fits: keep_first_of_each(fits), removed })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::Diagnose;
    use crate::diagnose::fixture::model_of;
    use crate::model::{Control, Parameter};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A boat that turns at the rate `w` and loses 0.906 of it a second, whose rudder comes two samples late; 50 Hz.
    fn boat(run: u64) -> Run {
        const FINE: f64 = 0.02 / 10.0;
        let mut random = ChaCha8Rng::seed_from_u64(run);
        let command = |i: usize| 0.6 * ((i as u64 / 27 * 5 + 3 * run) % 11) as f64 / 5.0 - 0.6;
        let (mut psi, mut w, mut values) = (0.0, 0.0_f64, Mat::zeros(400, 3));
        for i in 0..400 {
            values[(i, 0)] = psi + 1e-3 * normal(&mut random);
            values[(i, 1)] = w + 1e-3 * normal(&mut random);
            values[(i, 2)] = command(i);
            let late = command(i.saturating_sub(2));
            for _ in 0..10 {
                let rate = |w: f64| 1.435 * late - 0.906 * w - 0.422 * w * w.abs();
                let next = w + FINE * rate(w + 0.5 * FINE * rate(w));
                psi += 0.5 * FINE * (w + next);
                w = next;
            }
        }
        Run { name: format!("{run}"), time: (0..400).map(|i| 0.02 * f64::from(i)).collect(), values }
    }

    #[test]
    fn a_wrong_parameter_beside_a_late_command_is_not_a_warming_with_starts_of_its_own() {
        let mut model = model_of(&[("psi", "", "w"), ("w", "", "-a*w - c*w*abs(w) + g*u")]);
        model.controls = vec![Control::new("u")];
        model.parameters =
            [("a", 0.733), ("c", 0.422), ("g", 1.435)].map(|(name, value)| Parameter::new(name, value)).into();
        let data = |runs: std::ops::Range<u64>| {
            Dataset::new(["psi", "w", "u"].map(Channel::new).into(), runs.map(boat).collect()).unwrap()
        };
        let found = Diagnose::default().run(&model, &data(0..3), &data(3..4), &Silent).unwrap().diagnosis;
        let mut named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        named.sort_unstable();
        assert_eq!(named, ["input_delay", "parameter_error"], "{:?}", found.causes);
    }
}
