//! The path of a simulator that steps, from its derivatives along rollouts or along the logs.

use super::making::{Differences, Maker};
use super::stepped::Stepped;
use super::{Along, MOST, Path, Read, read};
use crate::model::System;
use crate::refine::experiment::{Experiment, Log};
use crate::refine::lanes::lockstep::{Group, Job};
use crate::refine::lanes::tangent::Tangent;
use std::sync::Arc;

impl Path {
    /// The path of a simulator that steps, along a `tangent` at these values, of whose windows the experiment's are `places`; `None` where
    /// something else than the simulator has states, or a reading is late.
    pub(crate) fn of_steps(
        system: &System,
        experiment: &Experiment,
        (parameters, initial): (&[f64], &[Vec<f64>]),
        (tangent, places): (&Arc<Tangent>, &[usize]),
    ) -> Option<Self> {
        let n = system.simulator()?.n_states();
        if system.n_states() != n || !system.late_states().is_empty() {
            return None;
        }
        let arguments = system.drive()?.arguments.n_outputs();
        let steps: usize = places.iter().map(|&place| tangent.steps[place].len()).sum();
        if (n + arguments) * n * steps > MOST {
            return None;
        }
        let job = |window: usize| Job { window, parameters: parameters.to_vec(), initial: initial[window].clone() };
        let jobs: Vec<Job> = (0..experiment.windows.len()).map(job).collect();
        let maker = Maker { system, experiment, read: read(system, experiment) };
        let of = |(number, &place): (usize, &usize)| {
            let group = Group::new(system, experiment, &jobs, number, 1);
            maker.along(group, (number, parameters), (tangent, place)).map(Into::into)
        };
        let windows = places.iter().enumerate().map(of).collect::<Option<Vec<_>>>()?;
        Some(Self { n, windows, late: Vec::new() })
    }
}

impl Maker<'_> {
    /// Window `number`, which is another one of the tangent; what goes to the simulator is taken at the beginning of a step.
    fn along(
        &self,
        mut group: Group<'_>,
        (number, parameters): (usize, &[f64]),
        (tangent, place): (&Arc<Tangent>, usize),
    ) -> Option<Along> {
        let Self { system, experiment, .. } = self;
        let window = experiment.windows[number];
        let (n, m, period) = (system.n_states(), system.n_controls(), system.engine()?.period());
        let (log, steps) = (&experiment.logs[window.log], &tangent.steps[place]);
        let samples = window.last - window.first;
        let mut along = Along {
            window,
            before: Vec::with_capacity(samples + 1),
            middle: vec![Vec::with_capacity(steps.len()); n + m],
            middle_time: Vec::with_capacity(steps.len()),
            sample: vec![Vec::with_capacity(samples + 1); n + m],
            sample_time: log.time[window.first..=window.last].to_vec(),
            carried: Vec::new(),
            pushed: Vec::new(),
            slopes: Vec::new(),
            stepped: None,
        };
        let predicted = |sample: usize, state: &[f64]| match &tangent.corrections {
            Some(all) => all[place].get(sample).map_or(state.to_vec(), |at| at.predicted.clone()),
            None => state.to_vec(),
        };
        for (k, step) in steps.iter().enumerate() {
            group.begin(Some(&[]), &mut |_, _, _, _| {});
            if let Some(sample) = group.new_sample() {
                along.before.push(k);
                along.show(log, &predicted(sample, &step.x));
            }
            let dt = group.next_step(period);
            let (time, controls) = group.inputs_of(system, dt, &step.x);
            along.middle_time.push(time);
            along
                .middle
                .iter_mut()
                .zip(step.x.iter().copied().chain(controls))
                .for_each(|(row, value)| row.push(value));
            group.advance(system, period, dt, |j, _| step.next[j]);
        }
        along.before.push(steps.len());
        along.show(log, &steps.last()?.next);
        let slopes = self.slopes(&along, parameters);
        if self.read.is_none() {
            along.slopes.clone_from(&slopes);
        }
        along.stepped = Some(Stepped::new((tangent.clone(), place), n, &along.before, &slopes));
        Some(along)
    }

    /// Derivatives of the readings by the states, sample by sample (c x n).
    fn slopes(&self, along: &Along, parameters: &[f64]) -> Vec<f64> {
        let Self { system, experiment, read } = self;
        let n = system.n_states();
        if let Some(read) = read {
            let of = |read: &Read, j: usize| f64::from(u8::from(matches!(read, Read::Now(state) if *state == j)));
            let one: Vec<f64> = read.iter().flat_map(|read| (0..n).map(move |j| of(read, j))).collect();
            return one.repeat(along.sample_time.len());
        }
        let log = &experiment.logs[along.window.log];
        let parameters = log.parameters(&parameters.iter().map(|&v| [v]).collect::<Vec<[f64; 1]>>());
        let parameters: Vec<f64> = parameters.iter().map(|value| value[0]).collect();
        let mut shown = Differences::new(system, system.outputs(), &parameters, &experiment.scale);
        let mut all = Vec::with_capacity(along.sample_time.len() * experiment.columns.len() * n);
        for (sample, &time) in along.sample_time.iter().enumerate() {
            let value = |row: &Vec<f64>| row[sample];
            let x: Vec<[f64; 1]> = along.sample[..n].iter().map(|row| [value(row)]).collect();
            shown.at(pulp::Scalar, time, &x, along.sample[n..].iter().map(value));
            for &column in &experiment.columns {
                all.extend((0..n).map(|j| shown.slope(column, j)));
            }
        }
        all
    }
}

impl Along {
    /// Appends a sample of the log with these states.
    fn show(&mut self, log: &Log, state: &[f64]) {
        let sample = self.window.first + self.sample[0].len();
        let controls = log.controls.iter().map(|control| control[sample]);
        self.sample.iter_mut().zip(state.iter().copied().chain(controls)).for_each(|(row, value)| row.push(value));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::change::Change;
    use crate::model::stepping::Stepping;
    use crate::refine::{Hold, roll_together, tangent};
    use std::sync::Arc;

    /// A servo of two or three steps a sample and its logs in windows of half a second.
    fn servo(reading: &str) -> (System, Experiment) {
        let servo = Arc::new(Stepping::servo());
        let system = servo.system("q", ("inertia", 0.03));
        let mut model = system.model().clone();
        model.states[0].measured = Some(Expression::parse(reading).unwrap());
        let system = System::with_simulator(&model, system.simulator().cloned()).unwrap();
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
        ["q", "sin(q) + 0.1*v"].into_iter().for_each(terms_move);
    }

    fn terms_move(reading: &str) {
        let (system, experiment) = servo(reading);
        let terms = ["sin(3*q)", "u*v", "t*delay(u, 0.03)"].map(|term| Expression::parse(term).unwrap());
        let start: Vec<Vec<f64>> = experiment.windows.iter().map(|w| vec![0.01 * w.first as f64, 0.2]).collect();
        let size = 1e-6;
        let (tangent, places) = tangent(&system, &experiment, &[0.03], &start).unwrap();
        let path = Path::of_steps(&system, &experiment, (&[0.03], &start), (&tangent, &places)).unwrap();
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
