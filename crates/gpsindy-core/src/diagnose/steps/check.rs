//! What no diagnosis can be made from, told before any work: logs without values or motion, a model that leaves them at once.

use crate::data::{Dataset, Run};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::ASTRAY;
use crate::error::{Error, Result};
use crate::model::Model;

/// Position and values of every logged state, run by run.
fn logged(model: &Model, data: &Dataset) -> Vec<(String, Vec<Vec<f64>>)> {
    let values = |column: usize| {
        let one = |run: &Run| run.column(column).iter().copied().filter(|v| v.is_finite()).collect();
        data.runs().iter().map(one).collect()
    };
    model.states.iter().filter_map(|s| Some((s.name.clone(), values(data.index_of(&s.name).ok()?)))).collect()
}

/// Refuses logs in which the states have no value.
pub(crate) fn values(model: &Model, data: &Dataset) -> Result<()> {
    let columns = logged(model, data);
    for (i, run) in data.runs().iter().enumerate() {
        if !columns.is_empty() && columns.iter().all(|(_, values)| values[i].is_empty()) {
            return Err(Error::invalid(format!("run `{}`: no state of the model has a value; leave it out", run.name)));
        }
    }
    match columns.iter().find(|(_, values)| values.iter().all(Vec::is_empty)) {
        Some((name, _)) => Err(Error::invalid(format!("column `{name}` has no value in any run; leave it out"))),
        None => Ok(()),
    }
}

/// Whether any logged state moves at all.
pub(crate) fn moves(model: &Model, data: &Dataset) -> bool {
    let columns = logged(model, data);
    columns.is_empty() || columns.iter().any(|(_, runs)| runs.iter().any(|v| v.windows(2).any(|w| w[0] != w[1])))
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
            return Err(Error::invalid(format!(
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
