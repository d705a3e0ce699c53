//! Derivatives along a path by differences, in calls of as many rows as the simulator takes at once.

use super::{DIFFERENCE, Step};
use crate::model::{Steps, System};
use crate::refine::Experiment;
use crate::refine::lanes::buffer::Buffer;
use crate::refine::lanes::lockstep::{Group, Job, MOST_ROWS};

/// Rows whose differences are derivatives: those of the steps that wait for the simulator.
pub(super) struct Differences<'a> {
    engine: &'a dyn Steps,
    /// Number of the simulator's states, and of its commands and forces.
    n: usize,
    widths: (usize, usize),
    scale: &'a [f64],
    pending: Buffer,
    /// Lengths of the rows' steps, s, and how many steps wait.
    lengths: Vec<f64>,
    waiting: usize,
}

impl<'a> Differences<'a> {
    pub(super) fn new(system: &'a System, experiment: &'a Experiment) -> Option<Self> {
        let (engine, simulator) = (system.engine()?, system.simulator()?);
        Some(Self {
            engine,
            n: simulator.n_states(),
            widths: (simulator.n_controls(), engine.n_forces()),
            scale: &experiment.scale,
            pending: Buffer::default(),
            lengths: Vec::new(),
            waiting: 0,
        })
    }

    /// Rows of a step.
    fn rows(&self) -> usize {
        1 + self.n
    }

    /// Adds the rows of a step of `dt` s at `x`; `group` knows the arguments of other states.
    fn put(&mut self, system: &System, group: &mut Group<'_>, dt: f64, (x, arguments): (&[f64], &[f64])) {
        self.pending.push(x, arguments, self.widths);
        for j in 0..self.n {
            let mut moved = x.to_vec();
            moved[j] += DIFFERENCE * self.scale[j];
            let mut there = Buffer::default();
            group.put_again(system, &moved, &mut there);
            let arguments: Vec<f64> = there.arguments(0).collect();
            self.pending.push(&moved, &arguments, self.widths);
        }
        self.lengths.resize(self.pending.count, dt);
        self.waiting += 1;
    }

    /// Whether the rows of one more step would be too many for a call.
    fn is_full(&self) -> bool {
        self.pending.count + self.rows() > MOST_ROWS
    }

    /// Calls the simulator for the rows that wait, and keeps what it says as derivatives of the last `steps`; `None` where it fails.
    pub(super) fn finish(&mut self, system: &System, steps: &mut [Step]) -> Option<()> {
        self.pending.step_each(self.engine, system, &self.lengths);
        let (n, rows) = (self.n, self.rows());
        let first = steps.len() - self.waiting;
        for (k, step) in steps[first..].iter_mut().enumerate() {
            let of = |row: usize, j: usize| self.pending.next[(k * rows + row) * n + j];
            step.next = (0..n).map(|j| of(0, j)).collect();
            step.by_states = vec![0.0; n * n];
            for j in 0..n {
                for i in 0..n {
                    step.by_states[j * n + i] = (of(1 + i, j) - of(0, j)) / (DIFFERENCE * self.scale[i]);
                }
            }
            let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
            if !(finite(&step.next) && finite(&step.by_states)) {
                return None;
            }
        }
        self.pending.clear();
        self.lengths.clear();
        self.waiting = 0;
        Some(())
    }
}

/// The steps along one window's path of states; those of which the simulator is not asked yet wait in `differences`.
pub(super) fn along(
    system: &System,
    experiment: &Experiment,
    job: &[Job],
    path: &[Vec<f64>],
    (differences, steps): (&mut Differences<'_>, &mut Vec<Step>),
) -> Option<()> {
    let (n, period) = (differences.n, differences.engine.period());
    let mut group = Group::new(system, experiment, job, 0, 1);
    for (k, x) in path.iter().enumerate() {
        group.begin(None, &mut |_, _, _, _| {});
        let dt = group.next_step(period);
        if differences.is_full() {
            differences.finish(system, steps)?;
        }
        let mut own = Buffer::default();
        group.put(system, dt, Some(&x[..n]), &mut own);
        let arguments: Vec<f64> = own.arguments(0).collect();
        differences.put(system, &mut group, dt, (&x[..n], &arguments));
        steps.push(Step { x: x[..n].to_vec(), arguments, dt, next: Vec::new(), by_states: Vec::new() });
        // The added states go on as they did.
        let next = path.get(k + 1).map_or_else(|| x[..n].to_vec(), |next| next[..n].to_vec());
        group.take(system, period, dt, &next);
    }
    Some(())
}

/// The derivatives of the next states by argument `i`, of one step after the other (n a step); no numbers where the simulator fails.
pub(super) fn by_argument(system: &System, steps: &[Step], i: usize) -> Vec<f64> {
    let by = DIFFERENCE * argument_size(system, i);
    let moved = answers(system, steps.iter().map(|step| (step, [(i, by)])));
    let next = steps.iter().flat_map(|step| &step.next);
    moved.iter().zip(next).map(|(moved, next)| (moved - next) / by).collect()
}

/// The next states (n a row) of steps of which some arguments, by number, are changed by so much; no numbers where the simulator fails.
pub(in crate::refine::lanes) fn answers<'s, A: AsRef<[(usize, f64)]>>(
    system: &System,
    asked: impl Iterator<Item = (&'s Step, A)>,
) -> Vec<f64> {
    let (Some(engine), Some(simulator)) = (system.engine(), system.simulator()) else { return Vec::new() };
    let widths = (simulator.n_controls(), engine.n_forces());
    let (mut rows, mut lengths, mut all) = (Buffer::default(), Vec::new(), Vec::new());
    let mut asked = asked.peekable();
    while asked.peek().is_some() {
        rows.clear();
        lengths.clear();
        for (step, changed) in asked.by_ref().take(MOST_ROWS) {
            let mut arguments = step.arguments.clone();
            changed.as_ref().iter().for_each(|(i, by)| arguments[*i] += by);
            rows.push(&step.x, &arguments, widths);
            lengths.push(step.dt);
        }
        rows.step_each(engine, system, &lengths);
        all.extend_from_slice(&rows.next);
    }
    all
}

/// Typical size of a command, force or parameter of the simulator.
fn argument_size(system: &System, i: usize) -> f64 {
    let model = system.model();
    let parameter = i.checked_sub(model.controls.len() + model.ports.len());
    parameter.and_then(|place| model.parameters.get(place)).map_or(1.0, |parameter| parameter.typical())
}
