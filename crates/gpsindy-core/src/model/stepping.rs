//! Simulators that step, for tests: a joint under a servo, and a spring.

use crate::data::{Channel, Dataset, Run};
use crate::error::{Error, Result};
use crate::expression::Expression;
use crate::model::{Control, Dynamics, Model, Parameter, Rows, State, Steps, System};
use faer::Mat;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The next place and speed, from place and speed, the command, the parameter and the length of the step.
type Rule = fn([f64; 2], f64, f64, f64) -> [f64; 2];

/// A simulator of a place and a speed with one command and one parameter, which counts its calls and the rows that it steps.
pub(crate) struct Stepping {
    period: f64,
    rule: Rule,
    rows: AtomicUsize,
    calls: AtomicUsize,
    rollouts: AtomicUsize,
}

impl Stepping {
    /// A joint under a stiff servo, which saturates 3 mrad from where it should be; its parameter is the inertia.
    pub(crate) fn servo() -> Self {
        Self::new(0.005, |x, u, inertia, dt| {
            let v = x[1] + dt * servo_force(x, u) / inertia;
            [x[0] + dt * v, v]
        })
    }

    /// The same with dry friction in the joint.
    pub(crate) fn rough_servo() -> Self {
        Self::new(0.005, |x, u, inertia, dt| {
            let pushed = x[1] + dt * servo_force(x, u) / inertia;
            let v = pushed.signum() * (pushed.abs() - dt * 0.05 / inertia).max(0.0);
            [x[0] + dt * v, v]
        })
    }

    /// Such a joint with an inertia of 0.03 and its log of 9.6 s under steps that take the servo to its limits, with noise of 1 mrad and 10 mrad/s.
    pub(crate) fn shaken_servo() -> (System, Dataset) {
        let servo = Arc::new(Self::rough_servo());
        let system = servo.system("q", ("inertia", 0.03));
        let command = |i: usize| drawn(9000 + i / 40);
        let sensor = |i: usize, j: usize, x: f64| x + 3f64.sqrt() * [1e-3, 1e-2][j] * drawn(2 * i + j);
        let read = |i: usize, x: [f64; 2]| [sensor(i, 0, x[0]), sensor(i, 1, x[1])];
        let data = servo.log(("q", 0.03), ([0.0; 2], 960), command, command, read);
        (system, data)
    }

    /// A mass on a spring with drag; its parameter is the stiffness.
    pub(crate) fn spring() -> Self {
        Self::new(0.01, |x, u, k, dt| {
            let v = x[1] + dt * (u - k * x[0] - 0.3 * x[1] * x[1].abs());
            [x[0] + dt * v, v]
        })
    }

    fn new(period: f64, rule: Rule) -> Self {
        let [rows, calls, rollouts] = Default::default();
        Self { period, rule, rows, calls, rollouts }
    }

    /// Rows that it has stepped.
    pub(crate) fn rows(&self) -> usize {
        self.rows.load(Ordering::Relaxed)
    }

    /// Calls by which it stepped them.
    pub(crate) fn calls(&self) -> usize {
        self.calls.load(Ordering::Relaxed)
    }

    /// Calls for many samples at once.
    pub(crate) fn rollouts(&self) -> usize {
        self.rollouts.load(Ordering::Relaxed)
    }

    /// A system of `place`, its speed `v`, the command `u`, and the parameter with its value.
    pub(crate) fn system(self: &Arc<Self>, place: &str, (parameter, value): (&str, f64)) -> System {
        let mut model = Model {
            states: [place, "v"].map(|name| State::new(name, Expression::Pi)).into(),
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new(parameter, value)],
            ..Model::default()
        };
        model.call_simulator(&[(0, 1)]);
        System::with_simulator(&model, Some(self.clone())).unwrap()
    }

    /// A run of `count` samples at 100 Hz from `start` under `command` (by sample); `read` makes of a sample's number and state what
    /// its two sensors say.
    pub(crate) fn log(
        &self,
        (place, parameter): (&str, f64),
        (start, count): ([f64; 2], usize),
        command: impl Fn(usize) -> f64,
        acting: impl Fn(usize) -> f64,
        read: impl Fn(usize, [f64; 2]) -> [f64; 2],
    ) -> Dataset {
        let mut values = Mat::zeros(count, 3);
        let mut x = start;
        for i in 0..count {
            let [q, v] = read(i, x);
            (values[(i, 0)], values[(i, 1)], values[(i, 2)]) = (q, v, command(i));
            for _ in 0..(0.01 / self.period).round() as usize {
                x = (self.rule)(x, acting(i), parameter, self.period);
            }
        }
        let run = Run { name: "steps".into(), time: (0..count).map(|i| 0.01 * i as f64).collect(), values };
        Dataset::new([place, "v", "u"].map(Channel::new).into(), vec![run]).unwrap()
    }
}

/// Numbers in -1 to 1 without a pattern.
pub(crate) fn drawn(i: usize) -> f64 {
    (((i as f64 + 1.0) * 12.9898).sin() * 43758.5453).fract()
}

fn servo_force([q, v]: [f64; 2], u: f64) -> f64 {
    (1000.0 * (u - q) - 3.0 * v).clamp(-3.0, 3.0)
}

impl Steps for Stepping {
    fn period(&self) -> f64 {
        self.period
    }

    fn n_forces(&self) -> usize {
        0
    }

    fn n_parameters(&self) -> usize {
        1
    }

    fn step(&self, rows: &Rows<'_>, dt: f64, next: &mut [f64]) -> Result<()> {
        self.rows.fetch_add(rows.count, Ordering::Relaxed);
        self.calls.fetch_add(1, Ordering::Relaxed);
        let inputs = rows.commands.iter().zip(rows.parameters);
        for ((x, (u, parameter)), next) in rows.states.chunks(2).zip(inputs).zip(next.chunks_mut(2)) {
            next.copy_from_slice(&(self.rule)([x[0], x[1]], *u, *parameter, dt));
        }
        Ok(())
    }

    fn rollout(&self, rows: &Rows<'_>, span: (usize, usize), next: &mut [f64]) -> Result<()> {
        self.rollouts.fetch_add(1, Ordering::Relaxed);
        self.one_by_one(rows, span, next)
    }
}

impl Dynamics for Stepping {
    fn n_states(&self) -> usize {
        2
    }

    fn n_controls(&self) -> usize {
        1
    }

    fn derivative(&self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) -> Result<()> {
        Err(Error::settings("it steps"))
    }

    fn steps(&self) -> Option<&dyn Steps> {
        Some(self)
    }
}
