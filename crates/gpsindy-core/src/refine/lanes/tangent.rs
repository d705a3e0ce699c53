//! Linearised responses of a simulator that steps: the effect of small changes of its inputs and parameters on a rollout.
//!
//! Along one rollout the simulator is differentiated once, at every step and by all its arguments, in calls of many
//! rows. Any number of suspects is then screened without another call: `d' = A d + B (a - a0)`, where `d` is how far
//! the states have moved and `a` what a suspect hands to the simulator.

use super::buffer::Buffer;
use super::correction::Correction;
use super::lockstep::{Group, Job, L, MOST_ROWS};
use crate::model::System;
use crate::refine::{Experiment, Window};
use std::sync::Arc;

/// Share of a typical size by which a value is moved for a difference.
const DIFFERENCE: f64 = 1e-5;

/// Steps whose rows go to the simulator together.
const TOGETHER: usize = 64;

/// A step of the rollout: states, arguments, terms outside, and the derivatives of the next states.
pub(super) struct Step {
    pub(super) x: Vec<f64>,
    arguments: Vec<f64>,
    pub(super) next: Vec<f64>,
    /// Row after row: by the states (n x n), then by the arguments (n x a).
    pub(super) by_states: Vec<f64>,
    by_arguments: Vec<f64>,
}

/// The derivatives along the paths of all windows.
pub(crate) struct Tangent {
    pub(super) parameters: Vec<f64>,
    pub(super) initial: Vec<Vec<f64>>,
    pub(super) windows: Vec<Window>,
    pub(super) steps: Vec<Vec<Step>>,
    /// By what the readings move the states, sample by sample; none where the paths are rollouts.
    pub(super) corrections: Option<Vec<Vec<Correction>>>,
}

/// The tangent of a system at a point, and which of its windows those of `experiment` are; made where the one that the system
/// keeps belongs to another point or lacks a window.
pub(crate) fn tangent(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    initial: &[Vec<f64>],
) -> Option<(Arc<Tangent>, Vec<usize>)> {
    let mut kept = system.kept().lock().ok()?;
    let known = kept.as_ref().and_then(|any| any.clone().downcast::<Tangent>().ok());
    if let Some(found) = known
        && let Some(windows) = found.windows_of(experiment, parameters, initial)
    {
        return Some((found, windows));
    }
    let made = Arc::new(Tangent::new(system, experiment, parameters, initial)?);
    *kept = Some(made.clone());
    Some((made, (0..experiment.windows.len()).collect()))
}

impl Tangent {
    /// Rolls every window out and differentiates at every step; `None` where the simulator fails.
    pub(super) fn new(
        system: &System,
        experiment: &Experiment,
        parameters: &[f64],
        initial: &[Vec<f64>],
    ) -> Option<Self> {
        let mut steps = Vec::with_capacity(experiment.windows.len());
        let jobs: Vec<Job> = initial
            .iter()
            .enumerate()
            .map(|(window, start)| Job { window, parameters: parameters.to_vec(), initial: start.clone() })
            .collect();
        let paths = super::lockstep::paths(system, experiment, &jobs)?;
        for (i, path) in paths.iter().enumerate() {
            steps.push(along(system, experiment, &jobs[i..=i], path)?);
        }
        Some(Self {
            parameters: parameters.to_vec(),
            initial: initial.to_vec(),
            windows: experiment.windows.clone(),
            steps,
            corrections: None,
        })
    }

    /// Where the windows of `experiment` with these starts are among its own, if all are.
    pub(crate) fn windows_of(
        &self,
        experiment: &Experiment,
        parameters: &[f64],
        initial: &[Vec<f64>],
    ) -> Option<Vec<usize>> {
        let mut own = self.windows.iter().zip(&self.initial).enumerate();
        let mut place = |wanted: (&Window, &Vec<f64>)| Some(own.find(|(_, known)| *known == wanted)?.0);
        if self.parameters != parameters {
            return None;
        }
        experiment.windows.iter().zip(initial).map(&mut place).collect()
    }

    /// As [`super::lockstep::roll_together`], for systems that change a little of what this one was made of; `windows` says which
    /// of its own those of the experiment are, or begin as. Other commands may be much other ones if the simulator `answers` to them.
    pub(crate) fn roll(
        &self,
        system: &System,
        (experiment, windows): (&Experiment, &[usize]),
        jobs: &[Job],
        (columns, answers): (&[usize], bool),
        receive: &mut dyn FnMut(usize, usize, usize, f64),
    ) {
        let mut first = 0;
        while first < jobs.len() {
            let same = jobs[first..].iter().take_while(|j| j.window == jobs[first].window).count().min(L);
            let walk = |commands: &mut Commands, receive: &mut dyn FnMut(usize, usize, usize, f64)| {
                let group = Group::new(system, experiment, jobs, first, same);
                self.walk(system, group, (windows[jobs[first].window], first), columns, commands, receive)
            };
            let mut commands = Commands::Lines;
            if answers {
                commands = Commands::Asked(Vec::new());
                walk(&mut commands, &mut |_, _, _, _| {});
                commands = commands.answered(system, self, windows[jobs[first].window]);
            }
            walk(&mut commands, receive);
            first += same;
        }
    }

    /// Walks one group along its window; `first` is the number of its first job.
    fn walk(
        &self,
        system: &System,
        mut group: Group<'_>,
        (window, first): (usize, usize),
        columns: &[usize],
        commands: &mut Commands,
        receive: &mut dyn FnMut(usize, usize, usize, f64),
    ) {
        let (Some(engine), Some(simulator)) = (system.engine(), system.simulator()) else { return };
        let (period, n_commands) = (engine.period(), simulator.n_controls());
        let (mut moved, mut changed, mut next) = (Vec::new(), Vec::new(), Vec::new());
        let arguments = group.changed_arguments(system, &self.parameters);
        let own = arguments.iter().take_while(|i| **i < n_commands).count();
        if own == 0 && matches!(commands, Commands::Asked(_)) {
            return;
        }
        let corrections = self.corrections.as_ref().map(|all| &all[window]);
        let mut shown = vec![[0.0; L]; columns.len()];
        for (number, step) in self.steps[window].iter().enumerate() {
            if group.is_over() {
                break;
            }
            let sample = group.new_sample();
            group.begin(Some(columns), &mut |job, sample, column, value| {
                shown[column][job - first] = value;
                receive(job, sample, column, value);
            });
            if let Some((correction, sample)) = corrections.zip(sample) {
                correction[sample].apply(&mut group, &step.x, &shown);
            }
            let dt = group.next_step(period);
            group.arguments_at(system, dt, &step.x, &arguments, &mut changed);
            for (now, &i) in changed.iter_mut().zip(&arguments) {
                *now = now.map(|now| now - step.arguments[i]);
            }
            moved.clear();
            moved.extend(step.x.iter().enumerate().map(|(j, x)| group.state(j).map(|now| now - x)));
            commands.ask((number, dt), &arguments[..own], &mut changed[..own], group.count());
            step.next(&moved, (&arguments, &changed), &mut next, group.count());
            commands.answer(number, &step.next, &mut next);
            group.take(system, period, dt, &next);
        }
        group.begin(Some(columns), receive);
    }
}

/// How commands that a suspect changes act: as far as the derivatives say, or as the simulator answers to them.
///
/// A servo that is driven to its limits does not feel a little more of its command, and is moved by a command that comes late.
enum Commands {
    Lines,
    /// The commands that are other ones.
    Asked(Vec<Asked>),
    /// The same, and the next states for each.
    Answered(Vec<Asked>, Vec<f64>),
}

/// Commands of one lane at one step: which of them are by how much other ones.
struct Asked {
    step: usize,
    dt: f64,
    lane: usize,
    changed: Vec<(usize, f64)>,
}

impl Commands {
    /// Notes the commands that changed at a step; the derivatives have no part in them.
    fn ask(&mut self, (step, dt): (usize, f64), commands: &[usize], changed: &mut [[f64; L]], count: usize) {
        if matches!(self, Self::Lines) {
            return;
        }
        if let Self::Asked(all) = self {
            for lane in 0..count {
                let by = || commands.iter().zip(changed.iter()).map(|(&i, by)| (i, by[lane]));
                // Nearer than that it is the same command, but for rounding.
                if by().any(|(_, by)| by.abs() > DIFFERENCE) {
                    all.push(Asked { step, dt, lane, changed: by().collect() });
                }
            }
        }
        changed.fill([0.0; L]);
    }

    /// The next states to all that was asked along a window.
    fn answered(self, system: &System, tangent: &Tangent, window: usize) -> Self {
        let (Self::Asked(all), Some(engine), Some(simulator)) = (self, system.engine(), system.simulator()) else {
            return Self::Lines;
        };
        let widths = (simulator.n_controls(), engine.n_forces());
        let (mut rows, mut answers) = (Buffer::default(), Vec::new());
        for some in all.chunks(MOST_ROWS) {
            rows.clear();
            for Asked { step, changed, .. } in some {
                let step = &tangent.steps[window][*step];
                let mut arguments = step.arguments.clone();
                changed.iter().for_each(|(i, by)| arguments[*i] += by);
                rows.push(&step.x, &arguments, widths);
            }
            rows.step_each(engine, system, &some.iter().map(|asked| asked.dt).collect::<Vec<_>>());
            answers.extend_from_slice(&rows.next);
        }
        Self::Answered(all, answers)
    }

    /// Adds what the simulator answered for a step to the lanes' next states.
    fn answer(&self, step: usize, base: &[f64], next: &mut [f64]) {
        let (Self::Answered(all, answers), n) = (self, base.len()) else { return };
        let first = all.partition_point(|asked| asked.step < step);
        for (place, asked) in all.iter().enumerate().skip(first).take_while(|(_, asked)| asked.step == step) {
            let lane = &mut next[asked.lane * n..(asked.lane + 1) * n];
            let answer = &answers[place * n..(place + 1) * n];
            lane.iter_mut().zip(answer.iter().zip(base)).for_each(|(next, (answer, base))| *next += answer - base);
        }
    }
}

impl Step {
    /// The next states of `count` lanes, one after the other, whose states are that far off and whose arguments differ by so much.
    fn next(
        &self,
        moved: &[[f64; L]],
        (arguments, changed): (&[usize], &[[f64; L]]),
        next: &mut Vec<f64>,
        count: usize,
    ) {
        let (n, a) = (self.x.len(), self.arguments.len());
        next.clear();
        next.resize(n * count, 0.0);
        for j in 0..n {
            let mut value = [self.next[j]; L];
            let mut add = |by: f64, lanes: &[f64; L]| {
                for lane in 0..L {
                    value[lane] += by * lanes[lane];
                }
            };
            moved.iter().zip(&self.by_states[j * n..(j + 1) * n]).for_each(|(lanes, &by)| add(by, lanes));
            arguments.iter().zip(changed).for_each(|(&i, lanes)| add(self.by_arguments[j * a + i], lanes));
            for lane in 0..count {
                next[lane * n + j] = value[lane];
            }
        }
    }
}

/// The derivatives along one window's path of states.
fn along(system: &System, experiment: &Experiment, job: &[Job], path: &[Vec<f64>]) -> Option<Vec<Step>> {
    let (engine, simulator) = (system.engine()?, system.simulator()?);
    let (n, period) = (simulator.n_states(), engine.period());
    let (scale, widths) = (&experiment.scale, (simulator.n_controls(), engine.n_forces()));
    let mut group = Group::new(system, experiment, job, 0, 1);
    let mut steps: Vec<Step> = Vec::with_capacity(path.len());
    let sizes = argument_sizes(system);
    let mut pending = Buffer::default();
    let mut since = 0;
    // Of every row.
    let mut lengths: Vec<f64> = Vec::new();
    for (k, x) in path.iter().enumerate() {
        group.begin(None, &mut |_, _, _, _| {});
        let dt = group.next_step(period);
        if k - since >= TOGETHER {
            finish(&mut steps[since..], engine, system, &mut lengths, &mut pending, (n, scale, &sizes))?;
            since = k;
        }
        let mut own = Buffer::default();
        group.put(system, dt, Some(&x[..n]), &mut own);
        let arguments: Vec<f64> = own.arguments(0).collect();
        pending.push(&x[..n], &arguments, widths);
        for j in 0..n {
            let mut moved = x[..n].to_vec();
            moved[j] += DIFFERENCE * scale[j];
            let mut there = Buffer::default();
            group.put_again(system, &moved, &mut there);
            let arguments: Vec<f64> = there.arguments(0).collect();
            pending.push(&moved, &arguments, widths);
        }
        for (i, size) in sizes.iter().enumerate() {
            let mut arguments = arguments.clone();
            arguments[i] += DIFFERENCE * size;
            pending.push(&x[..n], &arguments, widths);
        }
        lengths.resize(pending.count, dt);
        steps.push(Step {
            x: x[..n].to_vec(),
            arguments,
            next: Vec::new(),
            by_states: Vec::new(),
            by_arguments: Vec::new(),
        });
        // The added states go on as they did.
        let next = path.get(k + 1).map_or_else(|| x[..n].to_vec(), |next| next[..n].to_vec());
        group.take(system, period, dt, &next);
    }
    if since < steps.len() {
        finish(&mut steps[since..], engine, system, &mut lengths, &mut pending, (n, scale, &sizes))?;
    }
    Some(steps)
}

/// Calls the simulator for the rows of some steps, and keeps what it says as derivatives.
fn finish(
    steps: &mut [Step],
    engine: &dyn crate::model::Steps,
    system: &System,
    lengths: &mut Vec<f64>,
    pending: &mut Buffer,
    (n, scale, sizes): (usize, &[f64], &[f64]),
) -> Option<()> {
    pending.step_each(engine, system, lengths);
    lengths.clear();
    let (rows, a) = (1 + n + sizes.len(), sizes.len());
    for (k, step) in steps.iter_mut().enumerate() {
        let of = |row: usize, j: usize| pending.next[(k * rows + row) * n + j];
        step.next = (0..n).map(|j| of(0, j)).collect();
        step.by_states = vec![0.0; n * n];
        step.by_arguments = vec![0.0; n * a];
        for j in 0..n {
            for i in 0..n {
                step.by_states[j * n + i] = (of(1 + i, j) - of(0, j)) / (DIFFERENCE * scale[i]);
            }
            for i in 0..a {
                step.by_arguments[j * a + i] = (of(1 + n + i, j) - of(0, j)) / (DIFFERENCE * sizes[i]);
            }
        }
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if !(finite(&step.next) && finite(&step.by_states) && finite(&step.by_arguments)) {
            return None;
        }
    }
    pending.clear();
    Some(())
}

/// Typical sizes of commands, forces and parameters of the simulator.
fn argument_sizes(system: &System) -> Vec<f64> {
    let model = system.model();
    let ones = model.controls.len() + model.ports.len();
    let own = system.engine().map_or(0, |e| e.n_parameters());
    std::iter::repeat_n(1.0, ones).chain(model.parameters.iter().take(own).map(|p| p.typical())).collect()
}
