//! Where a control that follows at a limited rate stands as a log begins.
//!
//! An actuator that is on its way when a recording starts is a state that no sensor reads. Each log has a place of its own, found by trial on its
//! first rollouts: the later ones have starts of their own.

use super::Fitter;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{BEGINNINGS, BEGUN_PLACES, BEGUN_ROUNDS, BEGUN_SAMPLES, BEGUN_SHOWS, Budget, CONVINCING};
use crate::error::{Result, unless_refused};
use crate::model::{Input, InputKind, System};
use crate::refine::{Experiment, Log, Point, Refined, Window};
use std::sync::Arc;

impl Fitter {
    /// The fit with its limited controls arrived as the logs begin, or where they stood then, if that is better by what these places cost. They
    /// are looked for where the other fit came to rest: at a wrong rate a wrong place suits the logs.
    pub(crate) fn with_begun(self, fit: Contestant, budget: Budget) -> Result<Contestant> {
        if limited(&fit.system).is_empty() {
            return Ok(fit);
        }
        let arrived = match is_moving(&fit.experiment) {
            true => self.stepped_on(Contestant { experiment: arrived(&fit.experiment), ..fit.clone() }, budget)?,
            false => fit.clone(),
        };
        let Refined { parameters, initial, .. } = &arrived.refined;
        let point = Point { parameters: parameters.clone(), initial: initial.clone() };
        let experiment = settle(&arrived.system, arrived.experiment.clone(), &point)?;
        let mut best = if arrived.evidence.score() > fit.evidence.score() { arrived.clone() } else { fit };
        if is_moving(&experiment) {
            let moving = self.stepped_on(Contestant { experiment, ..arrived }, budget)?;
            if moving.evidence.score() > best.evidence.score() {
                best = moving;
            }
        }
        Ok(best)
    }
}

/// Whether a control is on its way as a log begins.
fn is_moving(experiment: &Experiment) -> bool {
    experiment.logs.iter().any(|log| !log.begun.is_empty())
}

/// The experiment in which every control has arrived as the logs begin.
fn arrived(experiment: &Experiment) -> Experiment {
    let logs: Vec<Log> = experiment.logs.iter().map(|log| Log { begun: Vec::new(), ..log.clone() }).collect();
    Experiment { logs: Arc::new(logs), ..experiment.clone() }
}

/// The experiment with the places of another one of the same logs.
pub(super) fn as_in(experiment: &Experiment, other: &Experiment) -> Experiment {
    if !is_moving(experiment) && !is_moving(other) {
        return experiment.clone();
    }
    let with = |(log, other): (&Log, &Log)| Log { begun: other.begun.clone(), ..log.clone() };
    let logs: Vec<Log> = experiment.logs.iter().zip(other.logs.iter()).map(with).collect();
    Experiment { logs: Arc::new(logs), ..experiment.clone() }
}

/// How many places were fitted; to a model without a limited control they are nothing.
pub(super) fn places(contestant: &Contestant) -> usize {
    let limited = limited(&contestant.system);
    let is_limited = |(control, _): &&(usize, f64)| limited.contains(control);
    contestant.experiment.logs.iter().flat_map(|log| log.begun.iter().filter(is_limited)).count()
}

/// Controls that a system of equations follows at a limited rate.
pub(crate) fn limited(system: &System) -> Vec<usize> {
    let is_limited =
        |c: &usize| system.inputs().iter().any(|input| input.kind == InputKind::Slew && input.tape.reads(*c));
    if system.engine().is_some() { Vec::new() } else { (0..system.n_controls()).filter(is_limited).collect() }
}

/// The experiment with the places of its limited controls at which the logs begin.
pub(crate) fn settle(system: &System, experiment: Experiment, point: &Point) -> Result<Experiment> {
    let mut experiment = experiment;
    for control in limited(system) {
        let values = || experiment.logs.iter().flat_map(|log| log.controls[control].iter().copied());
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if !(low < high) {
            continue;
        }
        for log in 0..experiment.logs.len() {
            experiment = of_log(system, experiment, point, (control, log), (low, high))?;
        }
    }
    Ok(experiment)
}

/// How long a control with a limited rate may be on its way over this range, s.
fn longest_way(system: &System, parameters: &[f64], (control, range): (usize, f64)) -> f64 {
    let rate = |(number, input): (usize, &Input)| {
        let mut registers = input.tape.registers::<1>();
        let place = system.n_controls() + number;
        registers[place..place + parameters.len()].iter_mut().zip(parameters).for_each(|(own, &value)| *own = [value]);
        input.tape.evaluate(&mut registers);
        input.tape.output(&registers, 1)[0].abs()
    };
    let limits = system.inputs().iter().enumerate().filter(|(_, i)| i.kind == InputKind::Slew && i.tape.reads(control));
    range / limits.map(rate).fold(f64::INFINITY, f64::min)
}

/// The same for one control and one log, of the places from `low` to `high`.
fn of_log(
    system: &System,
    experiment: Experiment,
    point: &Point,
    (control, log): (usize, usize),
    (low, high): (f64, f64),
) -> Result<Experiment> {
    let is_early = |w: &usize| experiment.windows[*w].log == log;
    let early: Vec<usize> = (0..experiment.windows.len()).filter(is_early).take(BEGINNINGS).collect();
    // Where the log's beginning is left out nothing shows.
    if early.first().is_none_or(|&w| experiment.windows[w].first > 0) {
        return Ok(experiment);
    }
    let time = &experiment.logs[log].time;
    let shows = time[0] + BEGUN_SHOWS * longest_way(system, &point.parameters, (control, high - low));
    let until = time.partition_point(|&t| t <= shows).max(BEGUN_SAMPLES) - 1;
    let cut = |&w: &usize| {
        let Window { first, last, .. } = experiment.windows[w];
        (first < until).then_some((w, Window { last: last.min(until), ..experiment.windows[w] }))
    };
    let (early, windows): (Vec<usize>, Vec<Window>) = early.iter().filter_map(cut).unzip();
    let part = Experiment { windows, ..experiment.clone() };
    let initial: Vec<Vec<f64>> = early.iter().map(|&w| point.initial[w].clone()).collect();
    let first = experiment.logs[log].controls[control][0];
    let cost = |place: f64| -> Result<f64> {
        let there = begun(&part, (control, log), place - first);
        let fit = Budget::Rough.refine().fit_on(system, &there, (&point.parameters, &[]), &initial, None);
        Ok(unless_refused(fit)?.map_or(f64::INFINITY, |fit| fit.cost))
    };
    let at_rest = cost(first)?;
    let (mut best, mut least) = (first, at_rest);
    let (mut center, mut reach) = (0.5 * (low + high), 0.5 * (high - low));
    for _ in 0..BEGUN_ROUNDS {
        let apart = 2.0 * reach / BEGUN_PLACES as f64;
        for k in 0..=BEGUN_PLACES {
            let place = center - reach + apart * k as f64;
            let cost = cost(place)?;
            if cost < least {
                (best, least) = (place, cost);
            }
        }
        (center, reach) = (best, apart);
    }
    let more = if at_rest - least > 2.0 * CONVINCING { best - first } else { 0.0 };
    Ok(begun(&experiment, (control, log), more))
}

/// The experiment with a control that is by so much `more` than its first value as a log begins.
fn begun(experiment: &Experiment, (control, log): (usize, usize), more: f64) -> Experiment {
    let mut logs: Vec<Log> = experiment.logs.to_vec();
    logs[log].begun.retain(|(known, _)| *known != control);
    if more != 0.0 {
        logs[log].begun.push((control, more));
    }
    Experiment { logs: Arc::new(logs), ..experiment.clone() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::Diagnose;
    use crate::expression::Expression;
    use crate::model::{Control, Model, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A ship whose rudder stands midships as the log begins, while it is asked for something else from the first sample on; 0.09 rad/s.
    fn ship(seed: u64) -> Run {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (step, fine) = (0.1, 20);
        let time: Vec<f64> = (0..400).map(|i| step * f64::from(i)).collect();
        let asked = |i: usize| if (i / (60 + 10 * seed as usize)).is_multiple_of(2) { 0.35 } else { -0.3 };
        let (mut rudder, mut turn, mut values) = (0.0_f64, 0.0, Mat::zeros(time.len(), 2));
        for i in 0..time.len() {
            values[(i, 0)] = turn + 0.0005 * normal(&mut random);
            values[(i, 1)] = asked(i);
            for _ in 0..fine {
                let h = step / f64::from(fine);
                let before = rudder;
                rudder += (asked(i) - rudder).clamp(-0.09 * h, 0.09 * h);
                let middle = 0.5 * (before + rudder);
                let rate = |turn: f64| (0.12 * middle - turn) / 4.0;
                turn += h * rate(turn + 0.5 * h * rate(turn));
            }
        }
        Run { name: format!("{seed}"), time, values }
    }

    #[test]
    fn a_rudder_on_its_way_as_the_log_begins_has_its_rate() {
        let equation = Expression::parse("(0.12*u - r)/4").unwrap();
        let model =
            Model { states: vec![State::new("r", equation)], controls: vec![Control::new("u")], ..Model::default() };
        let logs = |runs: std::ops::Range<u64>| {
            Dataset::new(["r", "u"].map(Channel::new).into(), runs.map(ship).collect()).unwrap()
        };
        let (train, holdout) = (logs(0..3), logs(3..4));
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["input_rate_limit"], "{:?}", found.causes);
        let rate = &found.causes[0].parameters[0];
        assert!((rate.value - 0.09).abs() < 0.001, "{rate:?}");
    }
}
