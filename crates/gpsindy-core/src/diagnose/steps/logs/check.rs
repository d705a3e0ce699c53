//! Checks before any computation: logs without values or motion, and a model that diverges from them at once, are refused.

use crate::data::{Dataset, Run};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::ASTRAY;
use crate::diagnose::notes::Note;
use crate::error::{Error, Result};
use crate::model::{Model, System};
use crate::refine::Experiment;

/// Position and values of every logged state, run by run.
fn logged(model: &Model, data: &Dataset) -> Vec<(String, Vec<Vec<f64>>)> {
    let values = |column: usize| {
        let one = |run: &Run| run.column(column).iter().copied().filter(|v| v.is_finite()).collect();
        data.runs().iter().map(one).collect()
    };
    model.states.iter().filter_map(|s| Some((s.name.clone(), values(data.index_of(&s.name).ok()?)))).collect()
}

/// Refuses logs in which the states have no value.
fn values(model: &Model, data: &Dataset) -> Result<()> {
    let columns = logged(model, data);
    for (i, run) in data.runs().iter().enumerate() {
        if !columns.is_empty() && columns.iter().all(|(_, values)| values[i].is_empty()) {
            return Err(Error::data(format!("run `{}`: no state of the model has a value; leave it out", run.name)));
        }
    }
    match columns.iter().find(|(_, values)| values.iter().all(Vec::is_empty)) {
        Some((name, _)) => Err(Error::data(format!("column `{name}` has no value in any run; leave it out"))),
        None => Ok(()),
    }
}

/// Whether any logged state moves at all.
fn moves(model: &Model, data: &Dataset) -> bool {
    let columns = logged(model, data);
    columns.is_empty() || columns.iter().any(|(_, runs)| runs.iter().any(|v| v.windows(2).any(|w| w[0] != w[1])))
}

/// Refuses logs without values or motion; a note where only the held-out ones are at rest.
pub(crate) fn logs(model: &Model, train: &Dataset, holdout: &Dataset) -> Result<Option<Note>> {
    values(model, train)?;
    values(model, holdout)?;
    if !moves(model, train) {
        return Err(Error::data(
            "no state moves in the logs: every value of a column is the same; record a motion, or check the sensors",
        ));
    }
    Ok((!moves(model, holdout)).then_some(Note::StillHoldout))
}

/// Every state must be logged, be the rate of one that is, or have a start that its equation or `initial` gives.
pub(crate) fn columns(system: &System, experiment: &Experiment) -> Result<()> {
    let model = system.model();
    for (j, state) in model.states.iter().enumerate() {
        let is_rate = model.integral_of(j).is_some_and(|i| experiment.column_of(i).is_some());
        let own = |name: &String| *name == state.name || model.state_index(name).is_none();
        let follows_input = state.equation.variables().iter().all(own);
        let known_start = model.initial.contains_key(&state.name);
        if experiment.column_of(j).is_none() && !is_rate && !follows_input && !known_start {
            return Err(Error::data(format!(
                "the logs have no column for state `{}`, and no logged state has it as its rate; log it, rename a column, or give it an [initial] value",
                state.name
            )));
        }
    }
    // As many as a window's start and the shortest noise model take.
    let needed = 8;
    for log in experiment.logs.iter() {
        if log.time.len() < needed {
            return Err(Error::TooFewSamples { what: format!("run `{}`", log.name), needed, found: log.time.len() });
        }
    }
    Ok(())
}

/// Refuses a nominal model whose rollouts are nowhere near the logs, however short they are.
pub(crate) fn nominal(fitted: &Contestant) -> Result<()> {
    let experiment = &fitted.experiment;
    for (c, colour) in fitted.evidence.colours.iter().enumerate() {
        let missed = experiment.noise[c] * colour.variance().sqrt();
        let state = experiment.columns[c];
        let spread = experiment.scale[state];
        if !(missed <= ASTRAY * spread) {
            let length = experiment.windows.iter().map(|w| {
                let time = &experiment.logs[w.log].time;
                time[w.last] - time[w.first]
            });
            return Err(Error::model(format!(
                "the model leaves the logs at once: over {:.3} s it misses `{}` by {:.0e}, while the logs spread by {spread:.2e}; check its signs, units and values",
                length.fold(0.0, f64::max),
                fitted.system.model().states[state].name,
                missed
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Model, Parameter, State};
    use crate::progress::Silent;
    use faer::Mat;

    fn refusal(rate: f64, value: impl Fn(usize) -> f64) -> String {
        let model = Model {
            states: vec![State::new("v", Expression::parse("-b*v").unwrap())],
            parameters: vec![Parameter::new("b", rate)],
            ..Model::default()
        };
        let runs = (0..3).map(|run| Run {
            name: format!("run {run}"),
            time: (0..100).map(|i| 0.05 * f64::from(i)).collect(),
            values: Mat::from_fn(100, 1, |i, _| value(i)),
        });
        let (train, holdout) = hold_out(&Dataset::new(vec![Channel::new("v")], runs.collect()).unwrap()).unwrap();
        Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap_err().to_string()
    }

    #[test]
    fn logs_without_values_or_motion_are_refused() {
        assert!(refusal(0.2, |_| f64::NAN).contains("no state of the model has a value"));
        assert!(refusal(0.2, |_| 0.5).contains("no state moves in the logs"));
    }

    #[test]
    fn a_model_that_explodes_within_a_sample_is_refused() {
        let decay = |i: usize| (-0.01 * i as f64).exp() + 0.01 * (1.7 * (i * i) as f64).sin();
        assert!(refusal(-500.0, decay).contains("leaves the logs at once"));
    }
}
