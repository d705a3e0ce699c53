//! Which exclusions say something: on a variable that never moved, an effect of any size would stay hidden.

use crate::diagnose::report::Excluded;

/// The exclusions without those of an effect on one of the `resting` columns.
pub(crate) fn telling(mut all: Vec<Excluded>, resting: &[&str]) -> Vec<Excluded> {
    all.retain(|row| !row.variables.iter().any(|name| resting.contains(&name.as_str())));
    all
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::drive;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::State;
    use crate::progress::Silent;
    use faer::Mat;

    #[test]
    fn a_joint_that_never_moved_excludes_no_effect_on_itself() {
        let (mut model, data) = drive(None, |x| x, 0.01, (3, 200));
        model.states.push(State::new("rest", Expression::parse("-rest").unwrap()));
        let still = |run: &Run| Run {
            values: Mat::from_fn(run.n_samples(), 3, |i, c| if c < 2 { run.values[(i, c)] } else { 0.0 }),
            ..run.clone()
        };
        let channels = ["x", "u", "rest"].map(Channel::new).to_vec();
        let data = Dataset::new(channels, data.runs().iter().map(still).collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let on = |name: &str| found.excluded.iter().filter(|row| row.variables.iter().any(|v| v == name)).count();
        assert!(on("x") > 0, "{:?}", found.excluded);
        assert_eq!(on("rest"), 0, "{:?}", found.excluded);
    }

    #[test]
    fn a_delay_that_would_have_shown_is_excluded_above_a_share_of_a_period() {
        // Readings every 0.02 s of a command that steps, and a drag that the model lacks.
        let (model, data) = drive(None, |x| x + 0.8 * x * x.abs(), 0.01, (3, 400));
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let delay = found.excluded.iter().find(|row| row.effect == "input_delay").unwrap();
        assert_eq!(delay.unit, "s");
        assert!(delay.above > 0.0 && delay.above < 0.02, "{delay:?}");
    }
}
