//! Linearised responses of a simulator that steps: the effect of small changes of its inputs and parameters on a rollout.
//!
//! Along one rollout the simulator is differentiated once, at every step, in calls of many rows: by its states, and by each of its arguments
//! when the first suspect changes that one. Any number of suspects is then screened without another call: `d' = A d + B (a - a0)`, where `d`
//! is how far the states have moved and `a` what a suspect hands to the simulator.

mod differences;

use super::correction::Correction;
use super::lockstep::{Group, Job, L};
use super::product::Product;
use crate::model::System;
use crate::refine::{Experiment, Window};
pub(super) use differences::answers;
use differences::{Differences, along, by_argument};
use std::sync::{Arc, OnceLock};

/// Share of a typical size by which a value is moved for a difference.
pub(super) const DIFFERENCE: f64 = 1e-5;

/// A step of the rollout, `dt` s long: states, arguments, and the next states with their derivatives by the states (n x n, row after row).
pub(super) struct Step {
    pub(super) x: Vec<f64>,
    pub(super) arguments: Vec<f64>,
    pub(super) dt: f64,
    pub(super) next: Vec<f64>,
    pub(super) by_states: Vec<f64>,
}

/// The derivatives along the paths of all windows.
pub(crate) struct Tangent {
    pub(super) parameters: Vec<f64>,
    /// What each run has of its own of them.
    pub(super) own: Vec<Vec<(usize, f64)>>,
    pub(super) initial: Vec<Vec<f64>>,
    pub(super) windows: Vec<Window>,
    pub(super) steps: Vec<Vec<Step>>,
    /// Derivatives by argument, window by window (n a step): a suspect changes few of them.
    by_arguments: Vec<Vec<OnceLock<Vec<f64>>>>,
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
    let made = Arc::new(Tangent::new(system, experiment, (parameters, initial))?);
    *kept = Some(made.clone());
    Some((made, (0..experiment.windows.len()).collect()))
}

impl Tangent {
    /// Rolls every window out and differentiates at every step; `None` where the simulator fails.
    pub(super) fn new(
        system: &System,
        experiment: &Experiment,
        (parameters, initial): (&[f64], &[Vec<f64>]),
    ) -> Option<Self> {
        let jobs: Vec<Job> = initial
            .iter()
            .enumerate()
            .map(|(window, start)| Job { window, parameters: parameters.to_vec(), initial: start.clone() })
            .collect();
        let paths = super::lockstep::paths(system, experiment, &jobs)?;
        let mut differences = Differences::new(system, experiment)?;
        let mut all = Vec::with_capacity(paths.iter().map(Vec::len).sum());
        for (i, path) in paths.iter().enumerate() {
            along(system, experiment, &jobs[i..=i], path, (&mut differences, &mut all))?;
        }
        differences.finish(system, &mut all)?;
        let mut all = all.into_iter();
        let steps = paths.iter().map(|path| all.by_ref().take(path.len()).collect()).collect();
        Some(Self::of((parameters, experiment), initial.to_vec(), steps, None))
    }

    /// Of these steps, by window.
    pub(super) fn of(
        (parameters, experiment): (&[f64], &Experiment),
        initial: Vec<Vec<f64>>,
        steps: Vec<Vec<Step>>,
        corrections: Option<Vec<Vec<Correction>>>,
    ) -> Self {
        let open = |steps: &Vec<Step>| {
            let arguments = steps.first().map_or(0, |step| step.arguments.len());
            (0..arguments).map(|_| OnceLock::new()).collect()
        };
        let (own, windows) = (experiment.own_parameters(), experiment.windows.clone());
        let by_arguments = steps.iter().map(open).collect();
        Self { parameters: parameters.to_vec(), own, initial, windows, steps, by_arguments, corrections }
    }

    /// The derivatives of the next states by argument `i` along a window (n a step), by the simulator of `system`.
    pub(super) fn by_argument(&self, system: &System, window: usize, i: usize) -> &[f64] {
        self.by_arguments[window][i].get_or_init(|| by_argument(system, &self.steps[window], i))
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
        if self.parameters != parameters || self.own != experiment.own_parameters() {
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
        let slopes: Vec<&[f64]> = arguments.iter().map(|&i| self.by_argument(system, window, i)).collect();
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
                correction[sample].apply(&mut group, &step.x, &shown, (&mut moved, &mut next));
            }
            let dt = group.next_step(period);
            group.arguments_at(system, dt, &step.x, &arguments, &mut changed);
            for (now, &i) in changed.iter_mut().zip(&arguments) {
                *now = now.map(|now| now - step.arguments[i]);
            }
            moved.clear();
            moved.extend(step.x.iter().enumerate().map(|(j, x)| group.state(j).map(|now| now - x)));
            commands.ask(number, &arguments[..own], &mut changed[..own], group.count());
            step.next(&moved, &mut next);
            let n = next.len();
            for (slopes, lanes) in slopes.iter().zip(&changed) {
                for (next, by) in next.iter_mut().zip(&slopes[number * n..(number + 1) * n]) {
                    next.iter_mut().zip(lanes).for_each(|(next, lane)| *next += by * lane);
                }
            }
            commands.answer(number, &step.next, &mut next);
            group.advance(system, period, dt, |j, lane| next[j][lane]);
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
    lane: usize,
    changed: Vec<(usize, f64)>,
}

impl Commands {
    /// Notes the commands that changed at a step; the derivatives have no part in them.
    fn ask(&mut self, step: usize, commands: &[usize], changed: &mut [[f64; L]], count: usize) {
        if matches!(self, Self::Lines) {
            return;
        }
        if let Self::Asked(all) = self {
            for lane in 0..count {
                let by = || commands.iter().zip(changed.iter()).map(|(&i, by)| (i, by[lane]));
                // Nearer than that it is the same command, but for rounding.
                if by().any(|(_, by)| by.abs() > DIFFERENCE) {
                    all.push(Asked { step, lane, changed: by().collect() });
                }
            }
        }
        changed.fill([0.0; L]);
    }

    /// The next states to all that was asked along a window.
    fn answered(self, system: &System, tangent: &Tangent, window: usize) -> Self {
        let Self::Asked(all) = self else { return Self::Lines };
        let step = |asked: &Asked| &tangent.steps[window][asked.step];
        let answers = answers(system, all.iter().map(|asked| (step(asked), &asked.changed)));
        Self::Answered(all, answers)
    }

    /// Adds what the simulator answered for a step to the lanes' next states.
    fn answer(&self, step: usize, base: &[f64], next: &mut [[f64; L]]) {
        let (Self::Answered(all, answers), n) = (self, base.len()) else { return };
        let first = all.partition_point(|asked| asked.step < step);
        for (place, asked) in all.iter().enumerate().skip(first).take_while(|(_, asked)| asked.step == step) {
            let answer = &answers[place * n..(place + 1) * n];
            next.iter_mut().zip(answer.iter().zip(base)).for_each(|(next, (a, base))| next[asked.lane] += a - base);
        }
    }
}

impl Step {
    /// The next states of lanes whose states are that far off, and whose arguments are the same.
    fn next(&self, moved: &[[f64; L]], next: &mut Vec<[f64; L]>) {
        next.clear();
        next.extend(self.next.iter().map(|&next| [next; L]));
        Product { matrix: &self.by_states, vectors: moved, sums: next }.add();
    }
}
