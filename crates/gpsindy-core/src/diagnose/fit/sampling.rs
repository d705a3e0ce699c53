//! Period and phase of a sample-and-hold, by trial.
//!
//! Which moments are sampled changes in jumps when the period moves, and in a log of a thousand periods a change of a
//! thousandth turns the last one by a whole period: a fit that follows derivatives gets nowhere. So a lattice of periods
//! and phases is tried on the beginning of what is rolled out, where few periods make it coarse; the best go on to twice the
//! length on a lattice twice as fine, to the end. Whole numbers of samples that begin with the first log are tried throughout:
//! that is what a log has that its own controller wrote.

pub(crate) mod jitter;

use crate::diagnose::catalogue::hypothesis::{Added, Role};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::sampling::{
    BESIDE, CELLS, FEWEST_TRIALS, FINE, KEPT, LATTICE, PAST_END, PHASES, REACH, TURN_OF,
};
use crate::error::Result;
use crate::model::System;
use crate::refine::{Experiment, Free, Point, Profile, Refined, Window, tangent};

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
        (self.period - other.period).abs() < BESIDE * self.apart.0 && of_phase < BESIDE * self.apart.1
    }
}

/// Puts the periods and phases of the sample-and-holds among `fitted` in `point` where the logs fit best; hundreds of them are tried, those of
/// a simulator that steps along straight lines from the contestant `from`, whose windows are the experiment's.
pub(crate) fn settle(
    from: &Contestant,
    system: &System,
    experiment: &Experiment,
    (fitted, free): (&[(usize, Added)], &[Free]),
    point: &mut Point,
) -> Result<()> {
    let is_sampled = |pair: &[(usize, Added)]| matches!(pair, [(_, a), (_, b)] if is_sampling(a, b));
    if !fitted.windows(2).any(is_sampled) {
        return Ok(());
    }
    let Refined { parameters, initial, kept, .. } = &from.refined;
    let lines = tangent(&from.system, &from.experiment, parameters, initial);
    for pair in fitted.windows(2) {
        let [(period, of_period), (phase, of_phase)] = pair else { continue };
        if !is_sampling(of_period, of_phase) {
            continue;
        }
        let bounds = (of_period.lower, of_period.upper);
        let start = (point.parameters[*period], point.parameters[*phase]);
        let found = search(experiment, start, bounds, |until, trials| {
            let (part, windows) = beginning(experiment, until);
            let initial: Vec<Vec<f64>> = windows.iter().map(|&w| point.initial[w].clone()).collect();
            let at = |trial: &Sampling| {
                let mut parameters = point.parameters.clone();
                (parameters[*period], parameters[*phase]) = (trial.period, trial.phase);
                Point { parameters, initial: initial.clone() }
            };
            let here = Point { parameters: point.parameters.clone(), initial: initial.clone() };
            // What else is free moves with them: it has settled for the model that lacks the hold.
            let own = |all: &[usize]| windows.iter().map(|&w| all[w]).collect::<Vec<usize>>();
            let own = lines.as_ref().map(|(tangent, all)| (tangent, own(all)));
            let along = own.as_ref().map(|(tangent, windows)| (&***tangent, &windows[..]));
            let profile = Profile::new(system, &part, (&here, free), along, kept.as_ref().map(AsRef::as_ref))?;
            Ok(profile.costs(&trials.iter().map(at).collect::<Vec<_>>()))
        })?;
        (point.parameters[*period], point.parameters[*phase]) = (found.period, found.phase);
    }
    Ok(())
}

fn is_sampling(period: &Added, phase: &Added) -> bool {
    (period.role, phase.role) == (Role::Period, Role::Phase)
}

/// By how much a period or a phase may differ before a log samples another value at its end, s; nothing for other parameters.
pub(crate) fn least_distinguished(experiment: &Experiment, added: &Added, value: f64) -> Option<f64> {
    let grid = Grid::new(experiment);
    match added.role {
        Role::Period => Some(value * grid.step / (grid.end - grid.begin).max(grid.step)),
        Role::Phase => Some(grid.step),
        Role::Plain
        | Role::Angle
        | Role::Corner
        | Role::AtRest
        | Role::Instant
        | Role::Late
        | Role::Scale
        | Role::Above
        | Role::Below => None,
    }
}

/// The stamps of what is rolled out, s.
struct Grid {
    /// Sampling step of the longest log.
    step: f64,
    /// First and last stamp that are rolled out, of all logs: they have one clock.
    begin: f64,
    end: f64,
    /// First stamp of the first log.
    first: f64,
}

impl Grid {
    fn new(experiment: &Experiment) -> Self {
        let stamps = |of: &dyn Fn(&Window) -> usize| -> Vec<f64> {
            experiment.windows.iter().map(|w| experiment.logs[w.log].time[of(w)]).collect()
        };
        Self {
            step: experiment.sampling_step(),
            begin: stamps(&|w| w.first).into_iter().reduce(f64::min).unwrap_or(0.0),
            end: stamps(&|w| w.last).into_iter().reduce(f64::max).unwrap_or(0.0),
            first: experiment.logs.first().map_or(0.0, |log| log.time[0]),
        }
    }

    /// The phase, with the first of its moments at or behind the stamp `from`.
    fn since(from: f64, phase: f64, period: f64) -> f64 {
        from + (phase - from).rem_euclid(period)
    }
}

/// The sampling with the least cost near the period and phase `start`, or that one; `costs(until, trials)`: on what is rolled out before that stamp.
fn search(
    experiment: &Experiment,
    (start, at): (f64, f64),
    (lower, upper): (f64, f64),
    costs: impl Fn(f64, &[Sampling]) -> Result<Vec<f64>>,
) -> Result<Sampling> {
    let grid = Grid::new(experiment);
    let (step, begin) = (grid.step, grid.begin);
    let whole = (grid.end - begin).max(step);
    let (low, high) = ((start / REACH).max(lower), (start * REACH).min(upper));
    let in_step = (1..)
        .map(|k| f64::from(k) * step)
        .skip_while(|&p| p < (1.0 - PAST_END) * low)
        .take_while(|&p| p <= (1.0 + PAST_END) * high);
    let alone = |period: f64, phase: f64| Sampling { period, phase, apart: (0.0, 0.0) };
    let in_step: Vec<Sampling> = in_step.map(|period| alone(period, grid.first)).chain([alone(start, at)]).collect();
    // After so many periods the neighbours' moments are a share of a period apart.
    let ratio = 1.0 + 1.0 / (CELLS * LATTICE);
    let periods = std::iter::successors(Some(low), |p| Some(p * ratio)).take_while(|&p| p <= high);
    let trials = periods.flat_map(|period| {
        let apart = ((ratio - 1.0) * period, period / PHASES);
        let phases = (0..PHASES as usize).map(move |k| begin + k as f64 * apart.1);
        phases.map(move |phase| Sampling { period, phase, apart })
    });
    let descent = Descent { grid: &grid, range: (low, high), costs: &costs };
    let length = (CELLS * start).clamp(step, whole);
    let mut found = descent.of(trials.collect(), (length, KEPT), &in_step)?;
    if at != grid.first {
        // What was pointed to or found before may be right nearly to the end of the logs: an eighth of a period off there.
        let apart = (start * start / (TURN_OF * 2.0 * whole), start / (2.0 * PHASES));
        let near = Sampling { period: start, phase: at, apart };
        let near = descent.of(vec![near], (whole, FEWEST_TRIALS), &[])?;
        let is_better = |near: &(Sampling, f64)| found.is_none_or(|found| near.1 < found.1);
        found = near.filter(is_better).or(found);
    }
    let found = found.map(|(sampling, _)| sampling);
    let Sampling { period, phase, apart } = found.unwrap_or(alone(start, grid.first));
    let phase = Grid::since(grid.first, phase, period);
    // Shortly before a period is over is shortly before the first sample.
    let phase = if phase - grid.first > 0.5 * period { phase - period } else { phase };
    Ok(Sampling { period, phase, apart })
}

/// From coarse lattices on beginnings of the logs to fine ones on all of them.
struct Descent<'a, F> {
    grid: &'a Grid,
    range: (f64, f64),
    costs: &'a F,
}

impl<F: Fn(f64, &[Sampling]) -> Result<Vec<f64>>> Descent<'_, F> {
    /// The best of `trials` and of their neighbours, and its cost on all logs; from a beginning of this length on, on which so many are kept.
    /// `always`: what is tried throughout.
    fn of(
        &self,
        mut trials: Vec<Sampling>,
        (mut length, mut most): (f64, usize),
        always: &[Sampling],
    ) -> Result<Option<(Sampling, f64)>> {
        let Self { grid, range, costs } = self;
        let whole = (grid.end - grid.begin).max(grid.step);
        loop {
            trials.extend(always);
            // The last sample is a part of the whole.
            let found = costs(grid.begin + length + 0.5 * grid.step, &trials)?;
            let mut order: Vec<usize> = (0..trials.len()).collect();
            order.sort_by(|&a, &b| found[a].total_cmp(&found[b]));
            let is_fine = |t: &Sampling| t.apart.0 * (whole / t.period) < FINE * grid.step;
            if length >= whole && trials.iter().all(is_fine) {
                let best = order.first();
                return Ok(best.map(|&i| (trials[i], found[i])));
            }
            // The whole has no more to show: from here on the best of it can be distinguished.
            most = if length >= whole { (most / 2).max(FEWEST_TRIALS) } else { most };
            length = (2.0 * length).min(whole);
            let mut kept: Vec<Sampling> = Vec::new();
            for trial in order.iter().map(|&i| trials[i]).filter(|t| t.apart.0 > 0.0) {
                if kept.len() < most && !kept.iter().any(|other| other.is_beside(&trial)) {
                    kept.push(trial);
                }
            }
            trials = kept.into_iter().flat_map(|t| finer(t, *range, grid)).collect();
        }
    }
}

/// The trial and its neighbours on a lattice twice as fine, and those periods that begin with the first log: a controller often
/// starts it.
fn finer(trial: Sampling, (low, high): (f64, f64), grid: &Grid) -> Vec<Sampling> {
    let apart = (0.5 * trial.apart.0, 0.5 * trial.apart.1);
    let steps = [-1.0, 0.0, 1.0];
    let all = steps.iter().flat_map(|&i| steps.iter().map(move |&j| (i, j)));
    let moved = |(i, j): (f64, f64)| {
        let period = (trial.period + i * apart.0).clamp(low, high);
        Sampling { period, phase: Grid::since(grid.begin, trial.phase + j * apart.1, period), apart }
    };
    let mut all: Vec<Sampling> = all.map(moved).collect();
    for i in steps {
        let in_step = moved((i, 0.0));
        all.push(Sampling { phase: Grid::since(grid.begin, grid.first, in_step.period), ..in_step });
    }
    all
}

/// What is rolled out before the stamp `until`, s, and which windows that are.
fn beginning(experiment: &Experiment, until: f64) -> (Experiment, Vec<usize>) {
    let cut = |(number, w): (usize, &Window)| {
        let last = experiment.logs[w.log].time.partition_point(|&t| t < until).saturating_sub(1).min(w.last);
        (w.first < last).then_some((number, Window { last, ..*w }))
    };
    let (numbers, windows) = experiment.windows.iter().enumerate().filter_map(cut).unzip();
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
            let start = (1.2 * period, 0.0);
            let profile = |until: f64, trials: &[Sampling]| {
                let (part, _) = beginning(&experiment, until);
                let at = |t: &Sampling| Point { parameters: vec![t.period, t.phase], initial: vec![vec![0.3]] };
                Profile::new(&system, &part, (&at(&trials[0]), &[]), None, None)
                    .map(|p| p.costs(&trials.iter().map(at).collect::<Vec<_>>()))
            };
            let found = search(&experiment, start, (0.015, 0.8), profile).unwrap();
            // The log's last period begins within a sample of where it should.
            assert!((found.period - period).abs() * 8.0 / period < 0.01, "{period} {found:?}");
            assert!((found.phase - phase).abs() < 0.01, "{phase} {found:?}");
        }
    }
}
