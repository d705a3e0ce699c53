//! Instants at which something happens, found by trial.
//!
//! Only the rollout in which an instant lies says which way to move it, so that a fit on short rollouts ends at the best moment of whichever of
//! them it began in. Moments around it are tried, on the rollouts that these lie in.

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::limits::{AROUND_INSTANT, FINER_INSTANTS, INSTANTS};
use crate::error::{Result, unless_refused};
use crate::model::System;
use crate::refine::{Experiment, Free, Point, Profile, Window};

/// Puts the instants among `fitted` in `point` where the logs fit best.
pub(crate) fn settle(
    system: &System,
    experiment: &Experiment,
    (fitted, free): (&[(usize, Added)], &[Free]),
    point: &mut Point,
) -> Result<()> {
    if system.engine().is_some() {
        return Ok(());
    }
    for (index, added) in fitted.iter().filter(|(_, added)| added.role == Role::Instant) {
        let mut reach = AROUND_INSTANT * added.scale;
        for count in [INSTANTS, FINER_INSTANTS] {
            let at = point.parameters[*index];
            let (low, high) = ((at - reach).max(added.lower), (at + reach).min(added.upper));
            if !(low < high) {
                break;
            }
            let apart = (high - low) / count as f64;
            let moments = (0..=count).map(|k| low + k as f64 * apart);
            let Some(best) = best(system, experiment, (*index, free), point, &moments.collect::<Vec<f64>>())? else {
                break;
            };
            point.parameters[*index] = best;
            reach = apart;
        }
    }
    Ok(())
}

/// The moment of some at which the logs fit better than at the present one, and best; the present one where none does, and nothing where no rollout
/// can be followed.
fn best(
    system: &System,
    experiment: &Experiment,
    (index, free): (usize, &[Free]),
    point: &Point,
    moments: &[f64],
) -> Result<Option<f64>> {
    let (first, last) = (moments[0], moments[moments.len() - 1]);
    let is_near = |w: &Window| {
        let time = &experiment.logs[w.log].time;
        time[w.first] <= last && time[w.last] >= first
    };
    let near: Vec<usize> = (0..experiment.windows.len()).filter(|&w| is_near(&experiment.windows[w])).collect();
    let part = Experiment { windows: near.iter().map(|&w| experiment.windows[w]).collect(), ..experiment.clone() };
    let initial: Vec<Vec<f64>> = near.iter().map(|&w| point.initial[w].clone()).collect();
    let others: Vec<Free> = free.iter().filter(|f| f.parameter != index).cloned().collect();
    let at = |moment: f64| {
        let mut parameters = point.parameters.clone();
        parameters[index] = moment;
        Point { parameters, initial: initial.clone() }
    };
    let present = point.parameters[index];
    let here = at(present);
    let Some(profile) = unless_refused(Profile::new(system, &part, (&here, &others), None, None))? else {
        return Ok(None);
    };
    let trials: Vec<Point> = std::iter::once(present).chain(moments.iter().copied()).map(at).collect();
    let costs = profile.costs(&trials);
    let least = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    Ok(least.map(|k| trials[k].parameters[index]))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Model, Parameter, State};
    use faer::Mat;

    #[test]
    fn an_instant_is_found_beyond_the_rollout_that_it_was_looked_for_in() {
        let rate = Expression::parse("-2*v + c*clamp((t - t0)/0.04, 0, 1)").unwrap();
        let model = Model {
            states: vec![State::new("v", rate)],
            parameters: vec![Parameter::new("c", 1.0), Parameter::new("t0", 7.0)],
            ..Model::default()
        };
        // A step at 6 s.
        let value = |t: f64| (-2.0 * t).exp() + if t > 6.0 { 0.5 - 0.5 * (-2.0 * (t - 6.0)).exp() } else { 0.0 };
        let time: Vec<f64> = (0..1000).map(|i| 0.02 * f64::from(i)).collect();
        let values = Mat::from_fn(time.len(), 1, |i, _| value(time[i]));
        let data = Dataset::new(vec![Channel::new("v")], vec![Run { name: "one".into(), time, values }]).unwrap();
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap().with_windows_of(0.3);
        let starts = experiment.windows.iter().map(|w| vec![value(experiment.logs[0].time[w.first])]).collect();
        let added = Added {
            symbol: "t0".into(),
            name: "t0".into(),
            unit: "s".into(),
            scale: 0.4,
            lower: 2.0,
            upper: 18.0,
            role: Role::Instant,
        };
        let free = [Free { lower: 2.0, upper: 18.0, ..Free::new(1, 0.4) }, Free::new(0, 1.0)];
        let mut point = Point { parameters: vec![1.0, 7.0], initial: starts };
        settle(&system, &experiment, (&[(1, added)], &free), &mut point).unwrap();
        assert!((point.parameters[1] - 6.0).abs() < 0.05, "{}", point.parameters[1]);
    }
}
