//! A generic smooth function in the augmented model for the remaining residual, on request.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::fit::contestant::{Entrant, Searches};
use crate::diagnose::limits::{Budget, STRUCTURE, STRUCTURED};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::{Judged, Left, Seat};

/// The outcome with the best function of what is left in it; the same where nothing is left, or it can't be fitted.
pub(crate) fn kept(contest: &Contest<'_>, mut judged: Judged) -> Judged {
    let outcome = &mut judged.outcome;
    let is_there = |left: &&Left| left.p_value < STRUCTURED && left.energy > STRUCTURE;
    let Some(left) = outcome.left.as_ref().filter(is_there) else { return judged };
    let rival = &contest.rivals[left.rival];
    let applied = rival.apply(outcome.best.system.model(), &contest.scene);
    let hypothesis = Hypothesis::nameless(rival);
    let start = vec![0.0; applied.fitted.len()];
    let entrant = Entrant::new(&hypothesis, Searches::of(contest.rivals.len()));
    if let Ok(fit) = contest.fitter.with(&outcome.best, &[entrant], &applied, &[start], Budget::Usual) {
        outcome.seats.push(Seat { hypothesis: hypothesis.clone(), alternatives: Vec::new(), removed: left.energy });
        outcome.best = fit;
        outcome.left = None;
    }
    judged
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::diagnose::catalogue::custom::CustomEffect;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::progress::Silent;

    #[test]
    fn a_kept_function_stays_in_the_model_that_lacks_a_named_cause() {
        let (model, data) = drive(None, |x| x + 0.6 * x * x.abs() + 0.15 * (8.0 * x).sin(), 0.003, (4, 300));
        let (train, holdout) = hold_out(&data).unwrap();
        let settings = Diagnose { effects: vec!["quadratic_drag".into()], keep_function: true, ..Diagnose::default() };
        let found = settings.run(&model, &train, &holdout, &Silent).unwrap();
        let causes: Vec<&str> = found.diagnosis.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(causes, ["quadratic_drag", "function"]);
        let [without_drag, without_function] = found.without.as_slice() else { panic!("{:?}", found.without) };
        for model in [without_drag, without_function] {
            assert!(model.compile().is_ok(), "{:?}", model.states[0].equation.to_string());
        }
        // The function's own sizes, as they were fitted.
        let size = |model: &crate::model::Model| model.parameter_index("rival_3").map(|k| model.parameters[k].value);
        assert_eq!(size(without_drag), size(&found.augmented));
        assert!(size(without_drag).is_some_and(|value| value != 0.0) && size(without_function).is_none());
    }

    #[test]
    fn an_effect_of_the_users_own_has_no_id_with_a_meaning() {
        let (model, data) = drive(None, |x| x, 0.01, (2, 40));
        for id in ["function", "bias"] {
            let parameters = Vec::new();
            let (state, form) = ("x".into(), Expression::parse("x").unwrap());
            let custom = vec![CustomEffect { id: id.into(), state, form, parameters }];
            let stated = Diagnose { custom, ..Diagnose::default() }.run(&model, &data, &data, &Silent).unwrap_err();
            assert!(stated.to_string().contains(&format!("the id `{id}`")), "{stated}");
        }
    }
}
