//! The rates of a system driven by an excitation, as the integrators call them.

use super::excitation::{Excitation, Moment};
use crate::error::Error;
use crate::model::System;
use crate::model::sticking::{Kept, Mode, Slots};

/// Evaluates rates and outputs; holds the registers between calls.
pub(super) struct Rates<'a> {
    pub(super) system: &'a System,
    pub(super) excitation: &'a Excitation,
    rates: Vec<[f64; 1]>,
    outputs: Vec<[f64; 1]>,
    signals: Vec<f64>,
    /// What may hold a state at rest, and room for states and rates as it takes them.
    slots: Option<Slots<'a, 1>>,
    held: [Vec<[f64; 1]>; 2],
    segment: (f64, f64),
    n_behind: usize,
    /// Time and states at which the user's own simulator last gave no number.
    failing: Option<(f64, Vec<f64>)>,
}

impl<'a> Rates<'a> {
    pub(super) fn new(system: &'a System, excitation: &'a Excitation) -> Self {
        let first = system.n_states() + system.n_controls() + system.inputs().len();
        let mut rates = system.rates().registers::<1>();
        let mut outputs = system.outputs().registers::<1>();
        for (i, value) in system.parameter_values().into_iter().enumerate() {
            rates[first + i] = [value];
            outputs[first + i] = [value];
        }
        let n_behind = first + system.n_parameters();
        let parameters: Vec<[f64; 1]> = system.parameter_values().into_iter().map(|value| [value]).collect();
        let slots = Slots::new(system, &parameters);
        let held = std::array::from_fn(|_| vec![[0.0]; if slots.is_some() { system.n_states() } else { 0 }]);
        let (signals, segment) = (Vec::new(), (0.0, 0.0));
        Self { system, excitation, rates, outputs, signals, slots, held, segment, n_behind, failing: None }
    }

    /// Goes to the segment from `a` to `b`, s, which no break point divides.
    pub(super) fn enter(&mut self, a: f64, b: f64) {
        self.segment = (a, b);
        self.load(self.excitation.moment(a, a, b));
    }

    fn load(&mut self, moment: Moment) {
        self.excitation.signals(self.system, moment, &mut self.signals);
        let n = self.system.n_states();
        for (register, &value) in self.rates[n..].iter_mut().zip(&self.signals) {
            *register = [value];
        }
    }

    /// The rates `dx` (n) at time `t` (s) and states `x` (n), in the modes that hold from there on.
    pub(super) fn begin(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.rate_in(t, x, true, dx);
    }

    /// The rates `dx` (n) at time `t` (s) and states `x` (n), in the present modes.
    pub(super) fn rate(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.rate_in(t, x, false, dx);
    }

    fn rate_in(&mut self, t: f64, x: &[f64], decides: bool, dx: &mut [f64]) {
        if self.excitation.varies() {
            self.load(self.excitation.moment(t, self.segment.0, self.segment.1));
        }
        if let Some(slots) = &mut self.slots {
            let [states, rates] = &mut self.held;
            states.iter_mut().zip(x).for_each(|(state, &value)| *state = [value]);
            let signals = self.signals.iter().map(|&value| [value]);
            slots.rates(pulp::Scalar, [t], states, signals, decides, rates);
            dx.iter_mut().zip(rates).for_each(|(rate, value)| *rate = value[0]);
            return;
        }
        for (register, &value) in self.rates.iter_mut().zip(x) {
            *register = [value];
        }
        self.rates[self.n_behind] = [t];
        self.system.evaluate(pulp::Scalar, self.system.rates(), &mut self.rates);
        for (j, rate) in dx.iter_mut().enumerate() {
            *rate = self.system.rates().output(&self.rates, j)[0];
        }
        if self.system.simulator().is_some() && dx.iter().any(|f| f.is_nan()) {
            self.failing = Some((t, x.to_vec()));
        }
    }

    /// Whether anything may hold a state at rest.
    pub(super) fn may_hold(&self) -> bool {
        self.slots.is_some()
    }

    /// Whether a state is held now.
    pub(super) fn holds(&self) -> bool {
        (0..self.n_slots()).any(|slot| self.mode(slot) == Mode::Held)
    }

    pub(super) fn n_slots(&self) -> usize {
        self.slots.as_ref().map_or(0, Slots::count)
    }

    pub(super) fn mode(&self, slot: usize) -> Mode {
        self.slots.as_ref().map_or(Mode::Smooth, |slots| slots.mode(slot, 0))
    }

    /// The state that a slot holds.
    pub(super) fn held_state(&self, slot: usize) -> usize {
        self.slots.as_ref().map_or(0, |slots| slots.state(slot))
    }

    /// Value of a held slot at the last evaluation, and the largest that it can have.
    pub(super) fn force(&self, slot: usize) -> (f64, f64) {
        self.slots.as_ref().map_or((0.0, 0.0), |slots| slots.force(slot, 0))
    }

    /// What is decided beforehand of a slot.
    pub(super) fn kept(&self, slot: usize) -> Kept {
        self.slots.as_ref().map_or(Kept::Open, |slots| slots.kept(slot, 0))
    }

    /// Decides beforehand what a slot does once its state is at zero.
    pub(super) fn keep(&mut self, slot: usize, kept: Kept) {
        if let Some(slots) = &mut self.slots {
            slots.keep(slot, 0, kept);
        }
    }

    /// Forgets what was decided beforehand.
    pub(super) fn open(&mut self) {
        if let Some(slots) = &mut self.slots {
            slots.open();
        }
    }

    /// What `measured` says at sample time `t`, states `x` and late states `late`.
    pub(super) fn output(&mut self, t: f64, x: &[f64], late: &[f64], y: &mut [f64]) {
        let moment = self.excitation.sample_moment(t);
        self.excitation.signals(self.system, moment, &mut self.signals);
        for (register, &value) in self.outputs.iter_mut().zip(x.iter().chain(&self.signals)) {
            *register = [value];
        }
        for (register, &value) in self.outputs[self.n_behind..].iter_mut().zip(late) {
            *register = [value];
        }
        self.outputs[self.n_behind + late.len()] = [t];
        self.system.evaluate(pulp::Scalar, self.system.outputs(), &mut self.outputs);
        for (j, value) in y.iter_mut().enumerate() {
            *value = self.system.outputs().output(&self.outputs, j)[0];
        }
    }

    /// Whether the rates depend on time explicitly.
    pub(super) fn read_time(&self) -> bool {
        self.system.rates().reads(self.n_behind)
    }

    /// The error of the user's own simulator where it last gave no number.
    pub(super) fn failure(&self) -> Option<Error> {
        let (simulator, (t, x)) = (self.system.simulator()?, self.failing.as_ref()?);
        let (n, m) = (simulator.n_states().min(x.len()), simulator.n_controls().min(self.signals.len()));
        let mut dx = vec![0.0; simulator.n_states()];
        simulator.derivative(*t, &x[..n], &self.signals[..m], &mut dx).err()
    }
}
