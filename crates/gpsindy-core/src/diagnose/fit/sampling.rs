//! Period and phase of a sample-and-hold, by trial.
//!
//! Which moments are sampled changes in jumps when the period moves, and in a log of a thousand periods a change of a
//! thousandth turns the last one by a whole period: a fit that follows derivatives gets nowhere. So a lattice of periods
//! and phases is tried on the beginning of every log, where few periods make it coarse; the best go on to twice the length
//! on a lattice twice as fine, to the end of the logs. Whole numbers of samples that begin with the log are tried throughout:
//! that is what a log has that its own controller wrote.

use crate::diagnose::catalogue::hypothesis::{Added, Applied, Role};
use crate::diagnose::limits::sampling::{CELLS, FEWEST, KEPT, LATTICE, PHASES, REACH};
use crate::error::Result;
use crate::model::System;
use crate::refine::{Experiment, Free, Point, Profile, Window};

/// Share of a sample by which the last moment of a log may move from one trial to the next.
const FINE: f64 = 0.25;

/// A period and a phase, s, and by how much their neighbours on the lattice differ.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sampling {
    period: f64,
    phase: f64,
    /// Distance of the neighbours: of the period and of the phase; zero where the neighbours are not tried.
    apart: (f64, f64),
}

impl Sampling {
    /// Whether the lattice around one of the two holds the other.
    fn is_beside(&self, other: &Self) -> bool {
        let turn = (self.phase - other.phase).rem_euclid(self.period);
        let of_phase = turn.min(self.period - turn);
        (self.period - other.period).abs() < 0.75 * self.apart.0 && of_phase < 0.75 * self.apart.1
    }
}

/// Puts the periods and phases of the sample-and-holds of `applied` in `point` where the logs fit best.
pub(crate) fn settle(
    system: &System,
    experiment: &Experiment,
    applied: &Applied,
    free: &[Free],
    point: &mut Point,
) -> Result<()> {
    for pair in applied.fitted.windows(2) {
        let [(period, of_period), (phase, of_phase)] = pair else { continue };
        if (of_period.role, of_phase.role) != (Role::Period, Role::Phase) {
            continue;
        }
        let bounds = (of_period.lower, of_period.upper);
        let found = search(experiment, point.parameters[*period], bounds, |samples, trials| {
            let (part, windows) = beginning(experiment, samples);
            let initial: Vec<Vec<f64>> = windows.iter().map(|&w| point.initial[w].clone()).collect();
            let at = |trial: &Sampling| {
                let mut parameters = point.parameters.clone();
                (parameters[*period], parameters[*phase]) = (trial.period, trial.phase);
                Point { parameters, initial: initial.clone() }
            };
            let here = Point { parameters: point.parameters.clone(), initial: initial.clone() };
            // What else is free moves with them: it has settled for the model that lacks the hold.
            let profile = Profile::new(system, &part, &here, free)?;
            Ok(profile.costs(&trials.iter().map(at).collect::<Vec<_>>()))
        })?;
        (point.parameters[*period], point.parameters[*phase]) = (found.period, found.phase);
    }
    Ok(())
}

/// By how much a period or a phase may differ before a log samples another value at its end, s; nothing for other parameters.
pub(crate) fn told_apart(experiment: &Experiment, added: &Added, value: f64) -> Option<f64> {
    let (step, count) = grid(experiment);
    match added.role {
        Role::Period => Some(value / count as f64),
        Role::Phase => Some(step),
        Role::Plain | Role::Angle | Role::Corner => None,
    }
}

/// Sampling step (s) and number of samples of the longest log.
fn grid(experiment: &Experiment) -> (f64, usize) {
    let Some(log) = experiment.logs.iter().max_by_key(|log| log.time.len()) else { return (1.0, 1) };
    let count = log.time.len();
    ((log.time[count - 1] - log.time[0]) / (count - 1).max(1) as f64, count)
}

/// The sampling with the least cost near the period `start`; `costs(samples, trials)`: on so many first samples.
fn search(
    experiment: &Experiment,
    start: f64,
    (lower, upper): (f64, f64),
    costs: impl Fn(usize, &[Sampling]) -> Result<Vec<f64>>,
) -> Result<Sampling> {
    let (step, longest) = grid(experiment);
    let begin = experiment.logs.first().map_or(0.0, |log| log.time[0]);
    let (low, high) = ((start / REACH).max(lower), (start * REACH).min(upper));
    let whole = (1..).map(|k| f64::from(k) * step).skip_while(|&p| p < 0.999 * low).take_while(|&p| p <= 1.001 * high);
    let whole: Vec<Sampling> = whole.map(|period| Sampling { period, phase: begin, apart: (0.0, 0.0) }).collect();
    // After so many periods the neighbours' moments are a share of a period apart.
    let ratio = 1.0 + 1.0 / (CELLS * LATTICE);
    let periods = std::iter::successors(Some(low), |p| Some(p * ratio)).take_while(|&p| p <= high);
    let mut trials: Vec<Sampling> = periods
        .flat_map(|period| {
            let apart = ((ratio - 1.0) * period, period / PHASES);
            let phases = (0..PHASES as usize).map(move |k| begin + k as f64 * apart.1);
            phases.map(move |phase| Sampling { period, phase, apart })
        })
        .collect();
    let mut most = KEPT;
    let mut samples = ((CELLS * start / step) as usize).clamp(1, longest);
    loop {
        trials.extend(&whole);
        let found = costs(samples, &trials)?;
        let mut order: Vec<usize> = (0..trials.len()).collect();
        order.sort_by(|&a, &b| found[a].total_cmp(&found[b]));
        let is_fine = |t: &Sampling| t.apart.0 * (longest as f64 * step / t.period) < FINE * step;
        if samples >= longest && trials.iter().all(is_fine) {
            let best = order.first().map(|&i| trials[i]);
            let Sampling { period, phase, apart } =
                best.unwrap_or(Sampling { period: start, phase: begin, apart: (0.0, 0.0) });
            // Shortly before a period is over is shortly before the first sample.
            let phase = if phase - begin > 0.5 * period { phase - period } else { phase };
            return Ok(Sampling { period, phase, apart });
        }
        // Whole logs have no more to tell: from here on the best of them can be parted.
        most = if samples >= longest { (most / 2).max(FEWEST) } else { most };
        samples = (2 * samples).min(longest);
        let mut kept: Vec<Sampling> = Vec::new();
        for trial in order.iter().map(|&i| trials[i]).filter(|t| t.apart.0 > 0.0) {
            if kept.len() < most && !kept.iter().any(|other| other.is_beside(&trial)) {
                kept.push(trial);
            }
        }
        trials = kept.into_iter().flat_map(|t| finer(t, (low, high), begin)).collect();
    }
}

/// The trial and its neighbours on a lattice twice as fine, and those periods that begin with the log: a controller often
/// starts it.
fn finer(trial: Sampling, (low, high): (f64, f64), begin: f64) -> Vec<Sampling> {
    let apart = (0.5 * trial.apart.0, 0.5 * trial.apart.1);
    let steps = [-1.0, 0.0, 1.0];
    let all = steps.iter().flat_map(|&i| steps.iter().map(move |&j| (i, j)));
    let moved = |(i, j): (f64, f64)| {
        let period = (trial.period + i * apart.0).clamp(low, high);
        Sampling { period, phase: begin + (trial.phase - begin + j * apart.1).rem_euclid(period), apart }
    };
    let mut all: Vec<Sampling> = all.map(moved).collect();
    for i in steps {
        let in_step = moved((i, 0.0));
        all.push(Sampling { phase: begin, ..in_step });
    }
    all
}

/// The first samples of every log, and which windows they are of.
fn beginning(experiment: &Experiment, samples: usize) -> (Experiment, Vec<usize>) {
    let inside = |w: &Window| w.first + 1 < samples;
    let numbers = (0..experiment.windows.len()).filter(|&w| inside(&experiment.windows[w])).collect();
    let cut = |w: &Window| Window { last: w.last.min(samples - 1), ..*w };
    let windows = experiment.windows.iter().filter(|w| inside(w)).map(cut).collect();
    (Experiment { windows, ..experiment.clone() }, numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State, sampled_at};

    /// A model whose column is sampled and held, and a log of it.
    fn held(period: f64, phase: f64) -> (System, Experiment) {
        let state = State {
            measured: Some(Expression::parse("sample_hold(x, T, phase)").unwrap()),
            ..State::new("x", Expression::parse("u").unwrap())
        };
        let model = Model {
            states: vec![state],
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("T", 0.02), Parameter::new("phase", 0.0)],
            ..Model::default()
        };
        let system = System::new(&model).unwrap();
        let time: Vec<f64> = (0..800).map(|i| 0.01 * f64::from(i)).collect();
        let x = |t: f64| (3.0 * t).sin() + 0.3 * (7.0 * t).cos();
        let rate = |t: f64| 3.0 * (3.0 * t).cos() - 2.1 * (7.0 * t).sin();
        let values = faer::Mat::from_fn(time.len(), 2, |i, j| match j {
            0 => x(sampled_at(time[i], phase, period).max(0.0)),
            _ => rate(time[i] + 0.005),
        });
        let run = Run { name: "held".into(), time, values };
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], vec![run]).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.01])).unwrap();
        (system, experiment)
    }

    #[test]
    fn period_and_phase_are_found_from_a_quarter_off() {
        for (period, phase) in [(0.05, 0.0), (0.0732, 0.0), (0.1234, 0.051)] {
            let (system, experiment) = held(period, phase);
            let start = 1.2 * period;
            let profile = |samples: usize, trials: &[Sampling]| {
                let (part, _) = beginning(&experiment, samples);
                let at = |t: &Sampling| Point { parameters: vec![t.period, t.phase], initial: vec![vec![0.3]] };
                Profile::new(&system, &part, &at(&trials[0]), &[])
                    .map(|p| p.costs(&trials.iter().map(at).collect::<Vec<_>>()))
            };
            let found = search(&experiment, start, (0.015, 0.8), profile).unwrap();
            // The log's last period begins within a sample of where it should.
            assert!((found.period - period).abs() * 8.0 / period < 0.01, "{period} {found:?}");
            assert!((found.phase - phase).abs() < 0.01, "{phase} {found:?}");
        }
    }
}
