//! Many samples of a rollout in one call, where what goes to the simulator follows from the log alone.

use super::{Group, L, MOST_STEPS, WHOLE};
use crate::model::{Drive, System};
use crate::refine::Hold;
use crate::refine::lanes::Lanes;
use crate::refine::lanes::buffer::Buffer;

/// What goes to the simulator and is known before its states are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Known {
    /// Not all: states take part, or something acts outside the simulator.
    Nothing,
    /// All, and it changes with the simulator's steps.
    BySteps,
    /// All, and it changes with the log's samples only.
    BySamples,
}

/// The next samples of a rollout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Ahead {
    samples: usize,
    /// Steps of each of them, and how many of these go on with the same commands and forces.
    steps: usize,
    held: usize,
}

impl Ahead {
    /// How many commands and forces there are one after another, and for how many steps each of them is held.
    pub(super) fn pieces(self) -> (usize, usize) {
        (self.samples * self.steps / self.held, self.held)
    }
}

impl Known {
    pub(super) fn of(system: &System, hold: Hold, lanes: &Lanes<'_, L>) -> Self {
        let (Some(Drive { arguments, rows, .. }), Some(engine)) = (system.drive(), system.engine()) else {
            return Self::Nothing;
        };
        let states = system.n_states();
        let past = states + system.n_controls()..states + system.n_controls() + lanes.histories.len();
        // Time is behind the last variable.
        let time = arguments.n_variables();
        let parameters = arguments.n_outputs() - engine.n_parameters()..arguments.n_outputs();
        let changes = |output| [states..past.end, time..time + 1].iter().any(|of| arguments.output_reads(output, of));
        let is_known = rows.is_empty()
            && lanes.late.is_empty()
            && !(0..states).any(|v| arguments.reads(v))
            && !past.clone().any(|v| system.outputs().reads(v))
            && !parameters.into_iter().any(changes);
        match (is_known, hold == Hold::Zero && past.is_empty() && !arguments.reads(time)) {
            (false, _) => Self::Nothing,
            (true, false) => Self::BySteps,
            (true, true) => Self::BySamples,
        }
    }
}

impl Group<'_> {
    /// The samples that can go into one call; none where what goes to the simulator is not known, or a step is shortened. `known` rows
    /// at most go with them.
    pub(super) fn ahead(&self, period: f64, known: usize) -> Option<Ahead> {
        if self.known == Known::Nothing || self.part > 0 {
            return None;
        }
        let time = &self.lanes.log.time;
        let whole = |sample: usize| {
            let steps = (time[sample + 1] - time[sample]) / period;
            ((steps - steps.round()).abs() < WHOLE && steps > 0.5).then(|| steps.round() as usize)
        };
        let steps = whole(self.sample)?;
        let most = (MOST_STEPS / (steps * known).max(1)).max(1);
        let samples = (self.sample..self.last).take(most).take_while(|&sample| whole(sample) == Some(steps)).count();
        // A trail has the states at the beginning of every step.
        let is_by_samples = self.known == Known::BySamples && self.trail.is_none();
        Some(Ahead { samples, steps, held: if is_by_samples { steps } else { 1 } })
    }

    /// Adds its rows, with all commands and forces of the next samples.
    pub(super) fn put_ahead(&mut self, system: &System, ahead: Ahead, rows: &mut Buffer) {
        let (pieces, held) = ahead.pieces();
        let period = system.engine().map_or(0.0, |engine| engine.period());
        let (sample, trail) = (self.sample, self.trail.take());
        let mut by_piece = Buffer::default();
        for piece in 0..pieces {
            self.sample = sample + piece * held / ahead.steps;
            self.part = piece * held % ahead.steps;
            self.put(system, held as f64 * period, None, &mut by_piece);
        }
        (self.sample, self.part, self.trail) = (sample, 0, trail);
        let count = self.count;
        let by_row = |values: &[f64], into: &mut Vec<f64>| {
            let width = values.len() / (pieces * count).max(1);
            for row in 0..count {
                (0..pieces).for_each(|piece| into.extend(&values[(piece * count + row) * width..][..width]));
            }
        };
        by_row(&by_piece.commands, &mut rows.commands);
        by_row(&by_piece.forces, &mut rows.forces);
        rows.states.extend(&by_piece.states[..by_piece.states.len() / pieces]);
        rows.parameters.extend(&by_piece.parameters[..by_piece.parameters.len() / pieces]);
        rows.count += count;
    }

    /// Takes its rows out of what the simulator answered, and shows the samples on the way; returns how many values that were.
    pub(super) fn take_ahead(
        &mut self,
        system: &System,
        ahead: Ahead,
        next: &[f64],
        columns: Option<&[usize]>,
        receive: &mut dyn FnMut(usize, usize, usize, f64),
    ) -> usize {
        let n = system.simulator().map_or(0, |s| s.n_states());
        let (pieces, held) = ahead.pieces();
        for piece in 0..pieces {
            if let Some(trail) = &mut self.trail {
                trail.push(self.x.iter().map(|x| x[0]).collect());
            }
            for (j, x) in self.x.iter_mut().enumerate().take(n) {
                for (lane, value) in x.iter_mut().enumerate() {
                    *value = next[(lane.min(self.count - 1) * pieces + piece) * n + j];
                }
            }
            if (piece + 1) * held % ahead.steps == 0 {
                self.sample += 1;
                if piece + 1 < pieces {
                    self.begin(columns, receive);
                }
            }
        }
        self.count * pieces * n
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::expression::Expression;
    use crate::model::stepping::{Stepping, drawn};
    use crate::model::{Control, Model, Parameter, Rows, State, Steps, System};
    use crate::refine::lanes::lockstep::{paths, roll_together};
    use crate::refine::{Experiment, Hold, Job, Log, Past, Starts, Window};
    use std::sync::Arc;

    const SAMPLES: usize = 60;
    const DELAY: f64 = 0.015;

    fn level(sample: usize) -> f64 {
        0.1 * drawn(sample / 3)
    }

    /// What goes to the servo as its command, and what that is at a step of 5 ms, two a sample, at a state.
    type Command = (&'static str, fn(usize, [f64; 2]) -> f64);

    const COMMANDS: [Command; 4] = [
        ("u", |step, _| level(step / 2)),
        ("delay(u, tau)", |step, _| level(step.saturating_sub(3) / 2)),
        ("u + tau*t", |step, _| level(step / 2) + DELAY * 0.005 * step as f64),
        ("u + tau*v", |step, x| level(step / 2) + DELAY * x[1]),
    ];

    fn system(simulator: &Arc<Stepping>, command: &str) -> System {
        let mut model = Model {
            states: ["q", "v"].map(|name| State::new(name, Expression::Pi)).into(),
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("inertia", 0.03)],
            ..Model::default()
        };
        model.call_simulator(&[(0, 1)]);
        model.parameters.push(Parameter::new("tau", DELAY));
        let command = Expression::parse(command).unwrap();
        model.states[1].equation = model.states[1].equation.map(&|part| match &part {
            Expression::Variable(name) if name == "u" => command.clone(),
            _ => part,
        });
        System::with_simulator(&model, Some(simulator.clone())).unwrap()
    }

    fn by_hand(simulator: &Stepping, command: fn(usize, [f64; 2]) -> f64, first: usize, inertia: f64) -> Vec<[f64; 2]> {
        let mut x = [0.02, 0.1];
        let mut all = vec![x];
        for step in 2 * first..2 * (SAMPLES - 1) {
            let (commands, parameters) = ([command(step, x)], [inertia]);
            let rows = Rows { count: 1, states: &x, commands: &commands, forces: &[], parameters: &parameters };
            let mut next = [0.0; 2];
            simulator.step(&rows, 0.005, &mut next).unwrap();
            x = next;
            all.push(x);
        }
        all
    }

    #[test]
    fn whatever_is_known_before_the_states_is_one_call_and_gives_what_single_steps_give() {
        for (text, command) in COMMANDS {
            let simulator = Arc::new(Stepping::servo());
            let system = system(&simulator, text);
            let log = Log {
                name: "servo".into(),
                time: (0..SAMPLES).map(|i| 0.01 * i as f64).collect(),
                controls: vec![(0..SAMPLES).map(level).collect()],
                measured: Vec::new(),
                ..Log::default()
            };
            let experiment = Experiment {
                logs: vec![log].into(),
                columns: Vec::new(),
                noise: Vec::new(),
                news: Vec::new(),
                windows: [0, 7].map(|first| Window { log: 0, first, last: SAMPLES - 1 }).into(),
                hold: Hold::Zero,
                past: Past::Still,
                starts: Starts::default(),
                substeps: 1,
                scale: vec![1.0; 2],
                tally: Default::default(),
            };
            let inertia = |job: usize| 0.03 + 0.001 * job as f64;
            let jobs: Vec<Job> = (0..12)
                .map(|job| Job { window: job / 6, parameters: vec![inertia(job), DELAY], initial: vec![0.02, 0.1] })
                .collect();
            let expected: Vec<Vec<[f64; 2]>> =
                (0..12).map(|job| by_hand(&simulator, command, 7 * (job / 6), inertia(job))).collect();
            let before = simulator.rollouts();
            let mut count = 0;
            roll_together(&system, &experiment, &jobs, None, &mut |job, sample, j, value| {
                let there = expected[job][2 * (sample - 7 * (job / 6))][j];
                assert!(
                    (value - there).abs() < 1e-9,
                    "{text}: job {job} sample {sample} state {j}: {value} for {there}"
                );
                count += 1;
            });
            assert_eq!(count, 2 * (6 * SAMPLES + 6 * (SAMPLES - 7)), "{text}");
            // One for each length of a window.
            let is_known = !text.contains('v');
            assert_eq!(simulator.rollouts() - before, if is_known { 2 } else { 0 }, "{text}");
            let trails = paths(&system, &experiment, &jobs[..1]).unwrap();
            for (step, (state, there)) in trails[0].iter().zip(&expected[0]).enumerate() {
                assert!((state[0] - there[0]).abs() < 1e-9, "{text}: step {step}");
            }
            assert_eq!(trails[0].len(), 2 * (SAMPLES - 1), "{text}");
            assert_eq!(simulator.rollouts() - before, if is_known { 3 } else { 0 }, "{text}");
        }
    }
}
