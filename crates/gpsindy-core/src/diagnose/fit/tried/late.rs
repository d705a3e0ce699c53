//! Delay of a command that a simulator holds over its own steps, by trial.
//!
//! A servo that saturates where its command jumps does not see when within a step of the simulator that happens: such a delay acts in whole
//! steps, next to nothing changes in between, and a fit that follows derivatives stays in the step that it began in. So whole steps are
//! tried around where it is, and then parts of one.

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{AROUND_DELAY, Budget, DELAYS, FINER_DELAYS, PART_OF_STEP};
use crate::error::{Result, unless_refused};
use crate::model::{Steps, System};
use crate::refine::{Experiment, Free, Point, Profile};

/// Puts the delays among `fitted` in `point` where the logs fit best; a fit that only ranks looks for them widely, any other one about where they
/// are. The derivatives of `from` serve as far as they go.
pub(crate) fn settle(
    from: &Contestant,
    (system, experiment): (&System, &Experiment),
    (fitted, free): (&[(usize, Added)], &[Free]),
    (point, budget): (&mut Point, Budget),
) -> Result<()> {
    let Some(engine) = system.engine() else { return Ok(()) };
    let step = held_for(engine, experiment);
    for (index, added) in fitted.iter().filter(|(_, added)| added.role == Role::Late) {
        let Some(profile) = unless_refused(profile(from, (system, experiment), free, point))? else { return Ok(()) };
        let mut reach = if budget.only_ranks() { AROUND_DELAY * point.parameters[*index].max(step) } else { step };
        let mut apart = step * (2.0 * reach / (step * DELAYS)).ceil();
        while apart > 0.5 * step / PART_OF_STEP {
            let at = point.parameters[*index];
            let (first, last) = (((at - reach) / apart).floor() as i64, ((at + reach) / apart).ceil() as i64);
            let around = (first..=last).map(|k| (k as f64 * apart).clamp(added.lower, added.upper));
            let mut delays: Vec<f64> = std::iter::once(at).chain(around).collect();
            // At an end of the range many are one.
            delays.dedup();
            let costs = profile.costs(&moved(point, *index, &delays));
            // The simulator acts in whole steps: a part of one must be worth a number of its own.
            let is_part = apart < step;
            let price = if is_part {
                per_value(costs[0], experiment) * (experiment.n_values().max(2) as f64).ln()
            } else {
                0.0
            };
            // Of equals the one that is there, or the shortest.
            let best = (1..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
            if let Some(k) = best.filter(|&k| costs[k] + price < costs[0]) {
                point.parameters[*index] = delays[k];
            }
            (reach, apart) = (apart, apart / FINER_DELAYS);
        }
    }
    Ok(())
}

/// How far a delay that is the parameter `index` may be off before the squares of the logs (noise units) are greater by `least`, s.
pub(crate) fn least_distinguished(fit: &Contestant, (index, added): &(usize, Added), least: f64) -> Option<f64> {
    let engine = fit.system.engine().filter(|_| added.role == Role::Late)?;
    let point = Point { parameters: fit.refined.parameters.clone(), initial: fit.refined.initial.clone() };
    let profile = profile(fit, (&fit.system, &fit.experiment), &fit.free, &point).ok()?;
    let part = held_for(engine, &fit.experiment) / PART_OF_STEP;
    let at = point.parameters[*index];
    let distances: Vec<f64> = (0..=DELAYS as i32).map(|k| part * 2f64.powf(0.5 * f64::from(k))).collect();
    let is_off_by = |sign: f64| {
        let delays: Vec<f64> = std::iter::once(at).chain(distances.iter().map(|d| at + sign * d)).collect();
        let costs = profile.costs(&moved(&point, *index, &delays));
        distances.iter().zip(&costs[1..]).find(|(_, cost)| **cost > costs[0] + least).map(|(distance, _)| *distance)
    };
    is_off_by(1.0).zip(is_off_by(-1.0)).map(|(above, below)| above.max(below))
}

/// For how long a command is held, s: a step of the simulator, or a sample's period where that is shorter.
fn held_for(engine: &dyn Steps, experiment: &Experiment) -> f64 {
    engine.period().min(experiment.sampling_step())
}

/// The cost of a value, in units of the noise, and at least that of noise.
fn per_value(cost: f64, experiment: &Experiment) -> f64 {
    (cost / experiment.n_values().max(1) as f64).max(1.0)
}

fn profile<'a>(
    from: &Contestant,
    (system, experiment): (&'a System, &'a Experiment),
    free: &'a [Free],
    point: &Point,
) -> Result<Profile<'a>> {
    Profile::new(system, experiment, (point, free), None, from.refined.kept.as_ref().map(AsRef::as_ref))
}

/// The point with each of some values of a parameter.
fn moved(point: &Point, index: usize, values: &[f64]) -> Vec<Point> {
    let at = |&value: &f64| {
        let mut trial = point.clone();
        trial.parameters[index] = value;
        trial
    };
    values.iter().map(at).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::Dataset;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::stepping::{Stepping, drawn};
    use crate::progress::Silent;
    use std::sync::Arc;

    /// A servo that saturates at every jump of its command, which comes so many samples late: what is named, and the size with its interval.
    fn named(late: usize) -> (String, [f64; 3]) {
        let (noise, inertia) = ([1e-3, 1e-2], 0.03);
        let servo = Arc::new(Stepping::servo());
        let run = |seed: usize| {
            let command = move |i: usize| 0.02 * drawn(9000 + 100 * seed + i / 40);
            let sensor = |i: usize, j: usize, x: f64| x + 3f64.sqrt() * noise[j] * drawn(5000 * seed + 2 * i + j);
            let read = |i: usize, x: [f64; 2]| [sensor(i, 0, x[0]), sensor(i, 1, x[1])];
            servo.log(("q", inertia), ([0.0; 2], 400), command, |i| command(i.saturating_sub(late)), read)
        };
        let logs: Vec<Dataset> = (0..3).map(run).collect();
        let runs = logs.iter().enumerate().flat_map(|(number, log)| {
            log.runs().iter().map(move |run| crate::data::Run { name: format!("{number}"), ..run.clone() })
        });
        let data = Dataset::new(logs[0].channels().to_vec(), runs.collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let system = servo.system("q", ("inertia", inertia));
        let diagnose = Diagnose {
            effects: ["input_delay", "input_lag", "input_gain"].map(String::from).into(),
            hold: Some(crate::data::Hold::Zero),
            ..Diagnose::default()
        };
        let found = diagnose.run_simulator(system.model(), servo, &train, &holdout, &Silent).unwrap().diagnosis;
        let cause = found.included().next().unwrap_or_else(|| panic!("{found:?}"));
        let tau = &cause.parameters[0];
        (cause.effect.clone(), [tau.value, tau.low.unwrap(), tau.high.unwrap()])
    }

    #[test]
    fn a_late_command_is_found_where_no_derivative_shows_it() {
        for late in [1, 4] {
            let (effect, [tau, low, high]) = named(late);
            let truth = 0.01 * late as f64;
            assert_eq!(effect, "input_delay");
            // Steps are of 5 ms.
            assert!((tau - truth).abs() < 0.0013 && low <= truth + 1e-4 && high >= truth, "{tau} ({low} to {high})");
            assert!(high - low < 0.011, "{tau} ({low} to {high})");
        }
    }
}
