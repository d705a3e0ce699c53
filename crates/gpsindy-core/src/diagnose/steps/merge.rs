//! Two effects for which one other stands.

use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::steps::attribute::without;
use crate::diagnose::steps::contest::{Contest, Known};
use crate::error::Result;

/// The winner with one effect in the place of two, where the two say nothing that convinces beyond it. One of the two is
/// the effect that removes least (`removed`, by effect).
///
/// A search that adds one effect at a time, beside tolerated parameters that give way, can come to several where one
/// alone would do: taking one out at a time does not lead back.
pub(crate) fn merged(
    contest: &Contest<'_>,
    nominal: &Fitted,
    best: &Fitted,
    removed: &[f64],
    known: &mut Vec<Known>,
) -> Result<Option<Fitted>> {
    let count = best.hypotheses.len();
    let mut simplest: Option<Fitted> = None;
    let Some(weakest) = (0..removed.len()).min_by(|&a, &b| removed[a].total_cmp(&removed[b])) else { return Ok(None) };
    for other in (0..count).filter(|&o| o != weakest) {
        let Ok(one_less) = without(contest, nominal, best, weakest.max(other)) else { continue };
        let Ok(rest) = without(contest, nominal, &one_less, weakest.min(other)) else { continue };
        let fits = contest.expand_once(&rest, "one for two", known)?;
        let fits = fits.iter().filter(|f| f.hypotheses.len() == count - 1);
        if let Some(fit) = fits.max_by(|a, b| contest.score(a).total_cmp(&contest.score(b)))
            && simplest.as_ref().is_none_or(|s| contest.score(fit) > contest.score(s))
        {
            simplest = Some(fit.clone());
        }
    }
    Ok(simplest.map(|s| s.again(&contest.settings)).filter(|s| !contest.is_convincing(best, s)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::excited::Scene;
    use crate::diagnose::catalogue::hypothesis::{Hypothesis, enumerate};
    use crate::diagnose::catalogue::joint;
    use crate::diagnose::fixture::drive;
    use crate::model::System;
    use crate::progress::Silent;
    use crate::refine::{Experiment, Refine};

    /// What one effect can stand for, of a cubic and a linear loss together, in a drive that loses `loses(x)`.
    fn one_for_two(loses: impl Fn(f64) -> f64) -> Option<Vec<String>> {
        let (model, data) = drive(None, loses, 0.002, (2, 400));
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.002])).unwrap();
        let settings = Refine::default();
        let nominal = Fitted::nominal(system.clone(), experiment, Vec::new(), &settings).unwrap();
        let scene = Scene::new(&system, &nominal.experiment, &nominal.refined.parameters, &nominal.refined.initial);
        let hypotheses = enumerate(&model, &scene, &[0], &[]).unwrap();
        let contest = Contest { hypotheses, joint: Vec::new(), most: 6, scene, settings, progress: &Silent };
        let find = |id: &str| contest.hypotheses.iter().find(|h| h.id() == id).unwrap();
        let both: [&Hypothesis; 2] = [find("viscous_friction"), find("cubic_stiffness")];
        let applied = joint::apply(&both, &model, &contest.scene).unwrap();
        let best = nominal.with_all(&both, &applied, &[vec![0.3, 0.3]], &contest.settings).unwrap();
        let removed: Vec<f64> =
            (0..2).map(|place| without(&contest, &nominal, &best, place).unwrap().misfit() - best.misfit()).collect();
        let found = merged(&contest, &nominal, &best, &removed, &mut Vec::new()).unwrap();
        found.map(|f| f.hypotheses.iter().map(|h| h.id().to_string()).collect())
    }

    #[test]
    fn a_linear_and_a_cubic_loss_give_way_to_the_quadratic_one_that_they_stand_for() {
        assert_eq!(one_for_two(|x| x + 0.8 * x * x.abs()), Some(vec!["quadratic_drag".to_string()]));
    }

    #[test]
    fn two_losses_that_are_both_there_stay() {
        assert_eq!(one_for_two(|x| 1.5 * x + 0.8 * x * x * x), None);
    }
}
