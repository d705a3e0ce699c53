//! The path of a simulator that steps, from its derivatives along the rollouts.

use super::{Along, MOST, Path, Read, read};
use crate::model::System;
use crate::refine::experiment::Experiment;
use crate::refine::lanes::lockstep::{Group, Job};
use crate::refine::lanes::tangent::{Step, tangent};

impl Path {
    /// The path of a simulator that steps, for [`responses_to_terms`](Self::responses_to_terms); `None` where it fails, or where
    /// the readings are more than states of the simulator.
    pub(crate) fn of_steps(
        system: &System,
        experiment: &Experiment,
        parameters: &[f64],
        initial: &[Vec<f64>],
    ) -> Option<Self> {
        let n = system.simulator()?.n_states();
        let is_plain = read(system, experiment)?.iter().all(|read| matches!(read, Read::Now(_)));
        if !is_plain || system.n_states() != n || !system.late_states().is_empty() {
            return None;
        }
        let (tangent, places) = tangent(system, experiment, parameters, initial)?;
        let steps = || places.iter().map(|&place| &tangent.steps[place]);
        if 2 * n * n * steps().map(Vec::len).sum::<usize>() > MOST {
            return None;
        }
        let job = |window: usize| Job { window, parameters: parameters.to_vec(), initial: initial[window].clone() };
        let jobs: Vec<Job> = (0..experiment.windows.len()).map(job).collect();
        let of = |(number, steps): (usize, &Vec<Step>)| {
            let group = Group::new(system, experiment, &jobs, number, 1);
            along(system, experiment, group, (number, steps)).map(Into::into)
        };
        let windows = steps().enumerate().map(of).collect::<Option<Vec<_>>>()?;
        Some(Self { n, windows, late: Vec::new() })
    }
}

/// One window; terms outside a simulator are taken at the beginning of a step, and act over all of it.
fn along(
    system: &System,
    experiment: &Experiment,
    mut group: Group<'_>,
    (number, steps): (usize, &[Step]),
) -> Option<Along> {
    let window = experiment.windows[number];
    let (n, m, period) = (system.n_states(), system.n_controls(), system.engine()?.period());
    let log = &experiment.logs[window.log];
    let samples = window.last - window.first;
    let mut along = Along {
        window,
        before: Vec::with_capacity(samples + 1),
        middle: vec![Vec::with_capacity(steps.len()); n + m],
        middle_time: Vec::with_capacity(steps.len()),
        // Terms act within the steps alone.
        sample: Vec::new(),
        sample_time: log.time[window.first..=window.last].to_vec(),
        carried: Vec::with_capacity(steps.len() * n * n),
        pushed: vec![0.0; steps.len() * n * n],
        slopes: Vec::new(),
    };
    for (k, step) in steps.iter().enumerate() {
        group.begin(Some(&[]), &mut |_, _, _, _| {});
        if group.new_sample().is_some() {
            along.before.push(k);
        }
        let dt = group.next_step(period);
        let (time, controls) = group.inputs_of(system, dt, &step.x);
        along.middle_time.push(time);
        along.middle.iter_mut().zip(step.x.iter().copied().chain(controls)).for_each(|(row, value)| row.push(value));
        along.carried.extend_from_slice(&step.by_states);
        (0..n).for_each(|j| along.pushed[(k * n + j) * n + j] = dt);
        group.advance(system, period, dt, |j, _| step.next[j]);
    }
    along.before.push(steps.len());
    Some(along)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::change::Change;
    use crate::model::stepping::Stepping;
    use crate::refine::{Hold, roll_together};
    use std::sync::Arc;

    /// A servo of two or three steps a sample and its logs in windows of half a second.
    fn servo() -> (System, Experiment) {
        let servo = Arc::new(Stepping::servo());
        let system = servo.system("q", ("inertia", 0.03));
        let command = |i: usize| (0.05 * i as f64).sin();
        let data = servo.log(("q", 0.03), ([0.0; 2], 300), command, command, |_, x| x);
        let mut experiment = Experiment::new(&system, &data, Some(&[1e-3, 1e-2])).unwrap();
        let mut logs = experiment.logs.to_vec();
        logs[0].time.iter_mut().enumerate().for_each(|(i, t)| *t += 0.005 * (i / 7) as f64);
        experiment.logs = logs.into();
        (system, Experiment { hold: Hold::Linear, ..experiment }.with_windows_of(0.5))
    }

    #[test]
    fn terms_along_a_path_of_steps_move_the_readings_as_in_rollouts() {
        let (system, experiment) = servo();
        let terms = ["sin(3*q)", "u*v", "t*delay(u, 0.03)"].map(|term| Expression::parse(term).unwrap());
        let start: Vec<Vec<f64>> = experiment.windows.iter().map(|w| vec![0.01 * w.first as f64, 0.2]).collect();
        let size = 1e-6;
        let path = Path::of_steps(&system, &experiment, &[0.03], &start).unwrap();
        let change = Change::terms(&system, 1, &terms).unwrap().unwrap();
        let found = path.responses_to_terms(&system, &experiment, &change, (&[0.03], size));
        let rolled = |system: &System| {
            let jobs: Vec<Job> = start
                .iter()
                .enumerate()
                .map(|(window, initial)| Job { window, parameters: vec![0.03], initial: initial.clone() })
                .collect();
            let mut values = vec![Vec::new(); jobs.len()];
            let mut receive = |job: usize, _: usize, _: usize, value: f64| values[job].push(value);
            roll_together(system, &experiment, &jobs, Some(&[0, 1]), &mut receive);
            values
        };
        let base = rolled(&system);
        for (term, found) in terms.iter().zip(&found) {
            let mut model = system.model().clone();
            let own = &mut model.states[1].equation;
            *own = own.clone().plus(Expression::Number(size).times(term.clone()));
            let changed = rolled(&System::with_simulator(&model, system.simulator().cloned()).unwrap());
            let rows = changed.iter().flatten().zip(base.iter().flatten()).map(|(a, b)| a - b);
            let (mut off, mut all) = (0.0, 0.0);
            for (expected, found) in rows.zip(found.iter().flatten()) {
                off += (expected - found) * (expected - found);
                all += expected * expected;
            }
            assert!(all > 0.0 && off < 1e-6 * all, "{term:?}: {off} of {all}");
        }
    }
}
