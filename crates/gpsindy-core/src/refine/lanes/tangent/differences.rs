//! Derivatives along a path by differences, in calls of as many rows as the simulator takes at once.

use super::{DIFFERENCE, Step};
use crate::model::{Steps, System};
use crate::refine::Experiment;
use crate::refine::lanes::buffer::Buffer;
use crate::refine::lanes::lockstep::{Group, Job, MOST_ROWS};

/// By what the next states are differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum By {
    /// The states alone: what a filter needs.
    States,
    /// The states and all that goes to the simulator.
    All,
}

/// Rows whose differences are derivatives: those of the steps that wait for the simulator.
pub(super) struct Differences<'a> {
    engine: &'a dyn Steps,
    /// Number of the simulator's states, and of its commands and forces.
    n: usize,
    widths: (usize, usize),
    scale: &'a [f64],
    /// Typical sizes of the arguments that are moved.
    sizes: Vec<f64>,
    pending: Buffer,
    /// Lengths of the rows' steps, s, and how many steps wait.
    lengths: Vec<f64>,
    waiting: usize,
}

impl<'a> Differences<'a> {
    pub(super) fn new(system: &'a System, experiment: &'a Experiment, by: By) -> Option<Self> {
        let (engine, simulator) = (system.engine()?, system.simulator()?);
        Some(Self {
            engine,
            n: simulator.n_states(),
            widths: (simulator.n_controls(), engine.n_forces()),
            scale: &experiment.scale,
            sizes: if by == By::All { argument_sizes(system) } else { Vec::new() },
            pending: Buffer::default(),
            lengths: Vec::new(),
            waiting: 0,
        })
    }

    /// Rows of a step.
    fn rows(&self) -> usize {
        1 + self.n + self.sizes.len()
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
        for (i, size) in self.sizes.iter().enumerate() {
            let mut arguments = arguments.to_vec();
            arguments[i] += DIFFERENCE * size;
            self.pending.push(x, &arguments, self.widths);
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
        let (n, a, rows) = (self.n, self.sizes.len(), self.rows());
        let first = steps.len() - self.waiting;
        for (k, step) in steps[first..].iter_mut().enumerate() {
            let of = |row: usize, j: usize| self.pending.next[(k * rows + row) * n + j];
            step.next = (0..n).map(|j| of(0, j)).collect();
            step.by_states = vec![0.0; n * n];
            step.by_arguments = vec![0.0; n * a];
            for j in 0..n {
                for i in 0..n {
                    step.by_states[j * n + i] = (of(1 + i, j) - of(0, j)) / (DIFFERENCE * self.scale[i]);
                }
                for i in 0..a {
                    step.by_arguments[i * n + j] = (of(1 + n + i, j) - of(0, j)) / (DIFFERENCE * self.sizes[i]);
                }
            }
            let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
            if !(finite(&step.next) && finite(&step.by_states) && finite(&step.by_arguments)) {
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
    Some(())
}

/// Typical sizes of commands, forces and parameters of the simulator.
fn argument_sizes(system: &System) -> Vec<f64> {
    let model = system.model();
    let ones = model.controls.len() + model.ports.len();
    let own = system.engine().map_or(0, |e| e.n_parameters());
    std::iter::repeat_n(1.0, ones).chain(model.parameters.iter().take(own).map(|p| p.typical())).collect()
}
