//! Rollouts of a simulator that steps: all of them together, one call a step for every row.
//!
//! A job is a window of a log with parameters and a start of its own. Jobs of many windows and perturbations go side
//! by side, each with its own clock. A sample's period is walked in the simulator's own steps; where it is no whole
//! number of them, the last one is shortened. Commands and forces are held over a step, as the simulator holds them; where they follow
//! from the log alone, many samples are one call.

mod ahead;
mod beside;

use super::buffer::Buffer;
use super::{Lanes, Node};
use crate::model::{Steps, System};
use crate::refine::Experiment;
use crate::refine::history::Stages;
use ahead::{Ahead, Known};

/// Lanes that run through a tape together.
pub(super) const L: usize = 4;

/// Rows of one call at most, so that a call's memory stays within the processor's own.
pub(super) const MOST_ROWS: usize = 2048;

/// Steps of one call at most, over all rows: a second or two of a costly simulator, after which somebody may want to stop.
const MOST_STEPS: usize = 1 << 15;

/// Share of a step by which the last one of a sample may differ and still count as whole.
const WHOLE: f64 = 1e-6;

/// A rollout that is wanted.
pub(crate) struct Job {
    /// Which of the experiment's windows.
    pub(crate) window: usize,
    /// All of the system's parameters.
    pub(crate) parameters: Vec<f64>,
    /// All states at the window's first sample.
    pub(crate) initial: Vec<f64>,
}

/// Up to `L` jobs of the same window.
pub(super) struct Group<'a> {
    lanes: Lanes<'a, L>,
    /// Number of its first job, and how many there are.
    first: usize,
    count: usize,
    /// First, present and last sample, and how many steps of the present sample are made.
    start: usize,
    sample: usize,
    last: usize,
    part: usize,
    known: Known,
    x: Vec<[f64; L]>,
    inputs: Vec<Stages<L>>,
    arguments: Vec<[f64; L]>,
    beside: Vec<[f64; L]>,
    nodes: Vec<Node<L>>,
    /// States of the first lane at the beginning of every step, where they are wanted.
    trail: Option<Vec<Vec<f64>>>,
}

/// Rolls all `jobs` out; `receive(job, sample, place, value)` for every sample of its window and every one of `columns`,
/// or every state where absent. Values are NaN from where a rollout or the simulator fails.
pub(crate) fn roll_together(
    system: &System,
    experiment: &Experiment,
    jobs: &[Job],
    columns: Option<&[usize]>,
    receive: &mut dyn FnMut(usize, usize, usize, f64),
) {
    let Some(engine) = system.engine() else { return };
    let mut groups: Vec<(usize, usize)> = Vec::new();
    for (i, job) in jobs.iter().enumerate() {
        match groups.last_mut() {
            Some((first, count)) if jobs[*first].window == job.window && *count < L => *count += 1,
            _ => groups.push((i, 1)),
        }
    }
    for together in groups.chunks((MOST_ROWS / L).max(1)) {
        let made = together.iter().map(|&(first, count)| Group::new(system, experiment, jobs, first, count));
        walk(system, engine, made.collect(), columns, receive);
    }
}

/// All states at the beginning of every step, of every job; `None` where one fails.
pub(super) fn paths(system: &System, experiment: &Experiment, jobs: &[Job]) -> Option<Vec<Vec<Vec<f64>>>> {
    let engine = system.engine()?;
    let groups: Vec<Group<'_>> = (0..jobs.len())
        .map(|i| Group { trail: Some(Vec::new()), ..Group::new(system, experiment, jobs, i, 1) })
        .collect();
    let walked = walk(system, engine, groups, Some(&[]), &mut |_, _, _, _| {});
    let paths: Vec<Vec<Vec<f64>>> = walked.into_iter().filter_map(|g| g.trail).collect();
    paths.iter().flatten().flatten().all(|v| v.is_finite()).then_some(paths)
}

/// Steps all groups to their last samples.
fn walk<'a>(
    system: &System,
    engine: &dyn Steps,
    mut groups: Vec<Group<'a>>,
    columns: Option<&[usize]>,
    receive: &mut dyn FnMut(usize, usize, usize, f64),
) -> Vec<Group<'a>> {
    let (mut rows, mut lengths) = (Buffer::default(), Vec::new());
    let mut under_way: Vec<usize> = (0..groups.len()).collect();
    loop {
        let known: usize = groups.iter().filter(|g| g.known != Known::Nothing).map(|g| g.count).sum();
        let mut due: Vec<(usize, Option<Ahead>)> = Vec::with_capacity(groups.len());
        under_way.retain(|&g| {
            let group = &mut groups[g];
            group.begin(columns, receive);
            let goes_on = !group.is_over();
            if goes_on {
                due.push((g, group.ahead(engine.period(), known)));
            }
            goes_on
        });
        if due.is_empty() {
            return groups;
        }
        due.sort_by_key(|&(g, ahead)| (ahead, g));
        for same in due.chunk_by(|a, b| a.1 == b.1) {
            rows.clear();
            let mut taken = 0;
            if let Some(ahead) = same[0].1 {
                same.iter().for_each(|&(g, _)| groups[g].put_ahead(system, ahead, &mut rows));
                rows.rollout(engine, system, ahead.pieces());
                for &(g, _) in same {
                    taken += groups[g].take_ahead(system, ahead, &rows.next[taken..], columns, receive);
                }
                continue;
            }
            lengths.clear();
            for &(g, _) in same {
                let dt = groups[g].next_step(engine.period());
                groups[g].put(system, dt, None, &mut rows);
                lengths.resize(rows.count, dt);
            }
            rows.step_each(engine, system, &lengths);
            for &(g, _) in same {
                let dt = groups[g].next_step(engine.period());
                taken += groups[g].take(system, engine.period(), dt, &rows.next[taken..]);
            }
        }
    }
}

impl<'a> Group<'a> {
    pub(super) fn new(
        system: &'a System,
        experiment: &'a Experiment,
        jobs: &[Job],
        first: usize,
        count: usize,
    ) -> Self {
        let job = |lane: usize| &jobs[first + lane.min(count - 1)];
        let window = experiment.windows[job(0).window];
        let log = &experiment.logs[window.log];
        let across = |of: &dyn Fn(&Job) -> f64| std::array::from_fn(|lane| of(job(lane)));
        let parameters: Vec<[f64; L]> = (0..system.n_parameters()).map(|p| across(&|j| j.parameters[p])).collect();
        let mut x: Vec<[f64; L]> = (0..system.n_states()).map(|s| across(&|j| j.initial[s])).collect();
        let mut lanes = Lanes::<L>::new(system, log, (experiment.hold, experiment.past), &parameters);
        lanes.follow(window.first, &mut x);
        lanes.histories.rewind(window.first);
        let inputs = vec![[[0.0; L]; 3]; system.n_controls() + lanes.histories.len()];
        let behind = system.n_states() + inputs.len();
        let filled = |mut registers: Vec<[f64; L]>| {
            registers[behind..behind + parameters.len()].copy_from_slice(&lanes.parameters);
            registers
        };
        let drive = system.drive();
        let known = Known::of(system, experiment.hold, &lanes);
        Self {
            known,
            first,
            count,
            start: window.first,
            sample: window.first,
            last: window.last,
            part: 0,
            x,
            inputs,
            arguments: drive.map(|d| filled(d.arguments.registers())).unwrap_or_default(),
            beside: drive.map(|d| filled(d.beside.registers())).unwrap_or_default(),
            nodes: Vec::new(),
            trail: None,
            lanes,
        }
    }

    /// Shows the sample, where one begins.
    pub(super) fn begin(&mut self, columns: Option<&[usize]>, receive: &mut dyn FnMut(usize, usize, usize, f64)) {
        if self.part == 0 {
            self.enter();
            self.show(columns, receive);
        }
    }

    /// Number of the sample that begins, counted from the window's first; none within a sample.
    pub(super) fn new_sample(&self) -> Option<usize> {
        (self.part == 0).then(|| self.sample - self.start)
    }

    /// Whether its last sample has been reached.
    pub(super) fn is_over(&self) -> bool {
        self.sample >= self.last
    }

    /// Puts a state of every lane elsewhere.
    pub(super) fn set_state(&mut self, j: usize, values: [f64; L]) {
        self.x[j] = values;
    }

    /// A state of every lane.
    pub(super) fn state(&self, j: usize) -> [f64; L] {
        self.x[j]
    }

    /// Number of its jobs.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Looks at the inputs of the sample that begins.
    fn enter(&mut self) {
        let t = self.lanes.log.time[self.sample];
        let Self { lanes, inputs, .. } = self;
        // For the outputs only: histories move on with the steps.
        for (control, stages) in lanes.log.controls.iter().zip(inputs.iter_mut()) {
            *stages = [[control[self.sample]; L]; 3];
        }
        if !lanes.late.is_empty() {
            let still = self.x.iter().map(|x| x.map(|_| 0.0)).collect::<Vec<_>>();
            let node = Node { t, x: self.x.clone(), dx: still.clone(), dx_end: still };
            match self.nodes.last_mut() {
                Some(last) if last.t == t => *last = node,
                _ => self.nodes.push(node),
            }
        }
    }

    fn show(&mut self, columns: Option<&[usize]>, receive: &mut dyn FnMut(usize, usize, usize, f64)) {
        let t = self.lanes.log.time[self.sample];
        let (first, count) = (self.first, self.count);
        let mut pass = |sample: usize, place: usize, values: [f64; L]| {
            (0..count).for_each(|lane| receive(first + lane, sample, place, values[lane]));
        };
        self.lanes.show(pulp::Scalar, columns, self.sample, t, &self.x, &self.inputs, &self.nodes, &mut pass);
    }

    /// Length of the next step, s.
    pub(super) fn next_step(&self, period: f64) -> f64 {
        let time = &self.lanes.log.time;
        let whole = time[self.sample + 1] - time[self.sample];
        let rest = whole - self.part as f64 * period;
        if self.part + 1 < self.steps(period) || (rest - period).abs() < WHOLE * period { period } else { rest }
    }

    /// Steps of the present sample.
    fn steps(&self, period: f64) -> usize {
        let time = &self.lanes.log.time;
        (((time[self.sample + 1] - time[self.sample]) / period - WHOLE).ceil() as usize).max(1)
    }

    /// Time at which the next step begins, s.
    fn now(&self, period: f64) -> f64 {
        self.lanes.log.time[self.sample] + self.part as f64 * period
    }

    /// Adds its rows to a call; arguments are those of the states `at`, where they are given.
    pub(super) fn put(&mut self, system: &System, dt: f64, at: Option<&[f64]>, rows: &mut Buffer) {
        self.load(system, dt, at);
        self.fill(system, rows);
    }

    /// Arguments that may differ from those of the same rollout with other `parameters` and without what this system adds:
    /// all but states, controls, constants and equal parameters.
    pub(super) fn changed_arguments(&self, system: &System, parameters: &[f64]) -> Vec<usize> {
        let Some(drive) = system.drive() else { return Vec::new() };
        let inputs = system.n_states() + system.n_controls();
        let first = inputs + self.lanes.histories.len();
        let is_equal = |i: &usize| match drive.arguments.bare_variable(*i) {
            Some(v) if v < inputs => true,
            Some(v) if v >= first => parameters.get(v - first).is_some_and(|p| self.arguments[v] == [*p; L]),
            _ => drive.arguments.is_constant(*i),
        };
        (0..drive.arguments.n_outputs()).filter(|i| !is_equal(i)).collect()
    }

    /// The `wanted` arguments of a step at the states `at`.
    pub(super) fn arguments_at(
        &mut self,
        system: &System,
        dt: f64,
        at: &[f64],
        wanted: &[usize],
        into: &mut Vec<[f64; L]>,
    ) {
        into.clear();
        self.load(system, dt, Some(at));
        if let Some(drive) = system.drive() {
            drive.arguments.evaluate(&mut self.arguments);
            into.extend(wanted.iter().map(|&i| drive.arguments.output(&self.arguments, i)));
        }
    }

    /// When a step begins at the states `at`, s, and the controls in its middle.
    pub(super) fn inputs_of(&mut self, system: &System, dt: f64, at: &[f64]) -> (f64, Vec<f64>) {
        self.load(system, dt, Some(at));
        let time = system.engine().map_or(0.0, |engine| self.now(engine.period()));
        (time, self.inputs.iter().take(system.n_controls()).map(|stages| stages[1][0]).collect())
    }

    /// Looks at the inputs of the next step, and at the states `at` where they are given.
    fn load(&mut self, system: &System, dt: f64, at: Option<&[f64]>) {
        let Some(engine) = system.engine() else { return };
        if let Some(trail) = &mut self.trail {
            trail.push(self.x.iter().map(|x| x[0]).collect());
        }
        let t = self.now(engine.period());
        self.lanes.load_inputs(&mut self.inputs, self.sample, t, t + dt);
        let n = self.x.len();
        for registers in [&mut self.arguments, &mut self.beside] {
            registers[..n].copy_from_slice(&self.x);
            for (register, &value) in registers.iter_mut().zip(at.unwrap_or_default()) {
                *register = [value; L];
            }
            for (register, stages) in registers[n..].iter_mut().zip(&self.inputs) {
                *register = stages[1];
            }
        }
        if let Some(drive) = system.drive() {
            self.arguments[drive.arguments.n_variables()] = [t; L];
            self.beside[drive.beside.n_variables()] = [t; L];
        }
    }

    /// The same rows once more, with the arguments of other states, all inputs being as they were.
    pub(super) fn put_again(&mut self, system: &System, at: &[f64], rows: &mut Buffer) {
        for (register, &value) in self.arguments.iter_mut().zip(at) {
            *register = [value; L];
        }
        self.fill(system, rows);
    }

    fn fill(&mut self, system: &System, rows: &mut Buffer) {
        let (Some(drive), Some(engine), Some(simulator)) = (system.drive(), system.engine(), system.simulator()) else {
            return;
        };
        drive.arguments.evaluate(&mut self.arguments);
        let (n, m, f) = (simulator.n_states(), simulator.n_controls(), engine.n_forces());
        let argument = |i: usize, lane: usize| drive.arguments.output(&self.arguments, i)[lane];
        for lane in 0..self.count {
            rows.states.extend(self.x[..n].iter().map(|x| x[lane]));
            rows.commands.extend((0..m).map(|i| argument(i, lane)));
            rows.forces.extend((m..m + f).map(|i| argument(i, lane)));
            rows.parameters.extend((m + f..m + f + engine.n_parameters()).map(|i| argument(i, lane)));
        }
        rows.count += self.count;
    }

    /// Takes its rows out of what the simulator answered; returns how many values that were.
    pub(super) fn take(&mut self, system: &System, period: f64, dt: f64, next: &[f64]) -> usize {
        let (n, count) = (system.simulator().map_or(0, |s| s.n_states()), self.count);
        self.advance(system, period, dt, |j, lane| next[lane.min(count - 1) * n + j]);
        count * n
    }

    /// A step of `dt` s after which the simulator has `next` states, by state and lane.
    pub(super) fn advance(&mut self, system: &System, period: f64, dt: f64, next: impl Fn(usize, usize) -> f64) {
        let n = system.simulator().map_or(0, |s| s.n_states());
        let before = (!self.lanes.late.is_empty()).then(|| self.x.clone());
        let beside = self.rates_beside(system, dt);
        for (j, x) in self.x.iter_mut().enumerate().take(n) {
            *x = std::array::from_fn(|lane| next(j, lane));
        }
        for (j, moved) in beside {
            for lane in 0..L {
                self.x[j][lane] += moved[lane];
            }
        }
        let t = self.now(period);
        if let Some(before) = before {
            // A straight line between the steps.
            let slope: Vec<[f64; L]> =
                before.iter().zip(&self.x).map(|(a, b)| std::array::from_fn(|lane| (b[lane] - a[lane]) / dt)).collect();
            let node = Node { t, x: before, dx: slope.clone(), dx_end: slope };
            match self.nodes.last_mut() {
                Some(last) if last.t == t => *last = node,
                _ => self.nodes.push(node),
            }
        }
        self.part += 1;
        if self.part == self.steps(period) {
            self.part = 0;
            self.sample += 1;
        }
    }
}
