//! Simplify: removes effects that only fit unexplained structure.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{Budget, CHANCE, NAMED, REST, STRUCTURE};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::detect::nameless_p_value;
use crate::diagnose::steps::attribution::screen::nameless;
use crate::diagnose::steps::findings::counts;
use crate::error::Result;

/// The winner without effects that remove next to nothing of the gap; where structure without a name is left anyhow,
/// without those that remove little of it.
pub(crate) fn pruned(contest: &Contest<'_>, nominal: &Contestant, mut best: Contestant) -> Result<Pruned> {
    while best.hypotheses.len() > 1 && !contest.run.is_out_of_time() {
        // An effect without which nothing can be fitted is none to leave out.
        let rests = contest.without_each(nominal, &best, Budget::Usual)?;
        let misfit = |rest: &&Contestant| rest.evidence.misfit();
        let least = rests.iter().flatten().min_by(|a, b| misfit(a).total_cmp(&misfit(b)));
        match least {
            Some(rest) if is_superfluous(contest, nominal, &best, rest)? => best = rest.clone(),
            _ => return Ok(Pruned { best, rests: Some(rests) }),
        }
    }
    Ok(Pruned { best, rests: None })
}

/// Whether the effect that `rest` lacks of those of `fit` removes next to nothing of the gap, or little of it where structure without a name
/// is left anyhow; what is left is asked for only where it decides.
pub(crate) fn is_superfluous(
    contest: &Contest<'_>,
    nominal: &Contestant,
    fit: &Contestant,
    rest: &Contestant,
) -> Result<bool> {
    let is_little = !counts(nominal, fit, rest, NAMED);
    Ok(is_little && (!counts(nominal, fit, rest, REST) || is_structured(fit, &nameless(contest, fit)?)))
}

/// The winner, and what is left of it without each of its effects, where that was looked at.
pub(crate) struct Pruned {
    pub(crate) best: Contestant,
    pub(crate) rests: Option<Vec<Option<Contestant>>>,
}

/// Whether structure is left that has no name, by the `gains` of functions at `best`.
pub(crate) fn is_structured(best: &Contestant, gains: &[(f64, usize)]) -> bool {
    let is_large = strongest(best, gains).is_some_and(|(_, energy)| energy > STRUCTURE);
    let is_significant = nameless_p_value(gains, best) <= CHANCE;
    is_large && is_significant || best.evidence.is_predictable()
}

/// The function without a name that gains most at `best`, and the mean squared residual that it would remove.
pub(crate) fn strongest(best: &Contestant, gains: &[(f64, usize)]) -> Option<(usize, f64)> {
    let count = best.evidence.count().max(1) as f64;
    let innovation = best.evidence.colours.iter().map(|c| c.innovation * c.count as f64).sum::<f64>() / count;
    // By Akaike's criterion, so that large families do not win by their number.
    let (place, &(gain, degrees)) = gains
        .iter()
        .enumerate()
        .max_by(|a, b| (a.1.0 - 2.0 * a.1.1 as f64).total_cmp(&(b.1.0 - 2.0 * b.1.1 as f64)))?;
    Some((place, (gain - degrees as f64).max(0.0) / count * innovation))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::hypothesis::Hypothesis;
    use crate::diagnose::catalogue::joint;
    use crate::diagnose::fit::contestant::{Entrant, Searches};
    use crate::diagnose::fixture::{drive, fitted};
    use crate::diagnose::limits::Budget;
    use crate::diagnose::run::Run;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::progress::Silent;

    /// What is named of a drive that loses `loses(x)`, where its model loses `x`.
    fn named(loses: impl Fn(f64) -> f64) -> Vec<String> {
        let (model, data) = drive(None, loses, 0.002, (4, 200));
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        found.included().map(|cause| cause.effect.clone()).collect()
    }

    #[test]
    fn an_effect_that_stays_when_another_is_left_out_still_pays_for_the_search_that_chose_it() {
        let (model, data) = drive(None, |x| 1.5 * x + 0.8 * x * x * x, 0.002, (2, 200));
        let (fitter, nominal) = fitted(&model, &data, 0.002);
        let run = Run::new(&Silent, None);
        let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
        let find = |id: &str| contest.hypotheses.iter().find(|h| h.id() == id).unwrap();
        let both: [&Hypothesis; 2] = [find("viscous_friction"), find("cubic_stiffness")];
        let applied = joint::apply(&both, &model, &contest.scene).unwrap();
        let entrants = [30, 70].map(Searches::of);
        let entrants = [0, 1].map(|i| Entrant::new(both[i], entrants[i]));
        let best = fitter.with(&nominal, &entrants, &applied, &[vec![0.3, 0.3]], Budget::Usual).unwrap();
        let rest = contest.without_each(&nominal, &best, Budget::Usual).unwrap().swap_remove(0).unwrap();
        assert_eq!(rest.searches_beyond(&nominal), Searches::of(70));
        assert_eq!(best.searches_beyond(&rest), Searches::of(30));
        assert_eq!(fitter.carried_on(rest, Budget::Usual).unwrap().searches_beyond(&nominal), Searches::of(70));
    }

    #[test]
    fn a_quadratic_loss_is_one_effect_though_a_linear_and_a_cubic_one_could_stand_for_it() {
        assert_eq!(named(|x| x + 0.8 * x * x.abs()), ["quadratic_drag"]);
    }

    #[test]
    fn two_losses_that_are_both_there_stay() {
        let found = named(|x| 1.5 * x + 0.8 * x * x * x);
        let linear = ["viscous_friction", "linear_stiffness", "parameter_error"];
        assert!(found.len() == 2 && found.contains(&"cubic_stiffness".to_string()), "{found:?}");
        assert!(found.iter().any(|name| linear.contains(&name.as_str())), "{found:?}");
    }
}
