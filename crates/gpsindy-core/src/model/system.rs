//! A model compiled for evaluation: rates, measured outputs and the inputs with a history.

use super::Model;
use super::engine::{self, Drive, Rows, Steps};
use super::inputs::{Extraction, Input, LateState, input_name, late_name};
use crate::error::{Error, Result};
use crate::expression::{Expression, Tape};
use crate::model::sticking::Sticks;

use std::sync::{Arc, Mutex};

/// Anybody's simulator: rates of the states as a function of time, states and controls.
///
/// A compiled model is one, and so is a wrapped Python callable.
pub trait Dynamics: Send + Sync {
    /// Number of states n.
    fn n_states(&self) -> usize;

    /// Number of controls m.
    fn n_controls(&self) -> usize;

    /// The rates `dx` (n) at time `t` (s), states `x` (n) and controls `u` (m).
    ///
    /// # Errors
    /// [`Error::Callback`] with the user's own error.
    fn derivative(&self, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()>;

    /// The simulator as one that steps on its own, where it does; rollouts then use its own steps.
    fn steps(&self) -> Option<&dyn Steps> {
        None
    }

    /// Rates of several samples at once: times `t` (r), states `x` (r x n), controls `u` (r x m) and rates `dx`
    /// (r x n), all row after row. One after another unless the simulator does better.
    ///
    /// # Errors
    /// As [`Dynamics::derivative`].
    fn derivatives(&self, t: &[f64], x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        let (n, m) = (self.n_states(), self.n_controls());
        for (i, &t) in t.iter().enumerate() {
            self.derivative(t, &x[i * n..(i + 1) * n], &u[i * m..(i + 1) * m], &mut dx[i * n..(i + 1) * n])?;
        }
        Ok(())
    }
}

/// A state that follows the inputs alone, such as a lagging input; its rate is a straight line in the state.
#[derive(Debug, Clone)]
pub(crate) struct Follower {
    /// Which state.
    pub(crate) state: usize,
    /// Its rate, as a tape of the variables of [`System::rates`].
    pub(crate) rate: Tape,
}

/// Something computed of a system, shared among its copies.
type Kept = Arc<Mutex<Option<Arc<dyn std::any::Any + Send + Sync>>>>;

/// A model compiled for evaluation.
///
/// The rates are functions of the variables states (n), controls (m), inputs with a history (h)
/// and parameters (p), in this order; the measured outputs also of late states behind them.
#[derive(Clone)]
pub struct System {
    model: Model,
    inputs: Vec<Input>,
    late_states: Vec<LateState>,
    rates: Tape,
    outputs: Tape,
    followers: Vec<Follower>,
    /// What may hold a state at rest.
    sticks: Option<Sticks>,
    simulator: Option<Arc<dyn Dynamics>>,
    /// What goes to a simulator that steps on its own.
    drive: Option<Drive>,
    kept: Kept,
}

impl std::fmt::Debug for System {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("System").field("model", &self.model.name).field("inputs", &self.inputs.len()).finish()
    }
}

impl System {
    /// Checks and compiles a model.
    ///
    /// # Errors
    /// As [`Model::check`].
    pub fn new(model: &Model) -> Result<Self> {
        Self::with_simulator(model, None)
    }

    /// Compiles a model whose equations call `simulator` through [`Expression::Simulator`].
    ///
    /// # Errors
    /// As [`Model::check`].
    pub fn with_simulator(model: &Model, simulator: Option<Arc<dyn Dynamics>>) -> Result<Self> {
        model.check()?;
        let n_outputs = simulator.as_ref().map_or(0, |s| s.n_states());
        let mut extraction = Extraction { model, inputs: Vec::new(), late: Vec::new() };
        // A port is zero until an effect replaces it.
        let closed = model.closed();
        let rates: Vec<Expression> = closed.states.iter().map(|s| extraction.extract(&s.equation)).collect();
        let outputs: Vec<Expression> = closed
            .states
            .iter()
            .map(|s| match &s.measured {
                Some(measured) => extraction.extract(measured),
                None => Expression::Variable(s.name.clone()),
            })
            .collect();

        let parameters: Vec<String> = model.parameters.iter().map(|p| p.name.clone()).collect();
        let (inputs, variables) = extraction.compiled(&parameters)?;
        let late_states = extraction.late_states(&parameters)?;
        let steps = simulator.as_ref().filter(|s| s.steps().is_some());
        let drive = steps.map(|s| Drive::new(&rates, s.n_states(), &variables)).transpose()?;
        let with_late: Vec<String> = variables.iter().cloned().chain((0..late_states.len()).map(late_name)).collect();
        // A simulator that steps has its forces held over a step, so that nothing can change within.
        let sticks = if drive.is_none() { Sticks::new(model, &rates, &variables, n_outputs)? } else { None };
        Ok(Self {
            rates: Tape::with_simulator(&rates, &variables, n_outputs)?,
            outputs: Tape::with_simulator(&outputs, &with_late, n_outputs)?,
            model: model.clone(),
            inputs,
            late_states,
            followers: Vec::new(),
            sticks,
            simulator,
            drive,
            kept: Kept::default(),
        })
    }

    /// Of the states from number `first` on, those that follow the inputs alone (lagging inputs): a rollout that starts
    /// within a log takes them from the log's past, and has no start of theirs to choose.
    pub(crate) fn with_followers(mut self, first: usize) -> Result<Self> {
        let model = &self.model;
        if first >= model.states.len() {
            return Ok(self);
        }
        let mut extraction = Extraction { model, inputs: Vec::new(), late: Vec::new() };
        let closed = model.closed();
        let rates: Vec<Expression> = closed.states.iter().map(|s| extraction.extract(&s.equation)).collect();
        let names = model.states.iter().map(|s| s.name.clone()).chain(model.controls.iter().map(|c| c.name.clone()));
        let parameters = model.parameters.iter().map(|p| p.name.clone());
        let variables: Vec<String> = names.chain((0..self.inputs.len()).map(input_name)).chain(parameters).collect();
        let is_alone = |j: &usize| {
            let reads = |k: usize| k != *j && model.states[*j].equation.contains(&model.states[k].name);
            let own = &model.states[*j].name;
            let is_linear = || rates[*j].derivative(own).is_ok_and(|slope| !slope.contains(own));
            !(0..model.states.len()).any(reads) && is_linear()
        };
        let follower =
            |state: usize| Ok(Follower { state, rate: Tape::new(std::slice::from_ref(&rates[state]), &variables)? });
        self.followers = (first..model.states.len()).filter(is_alone).map(follower).collect::<Result<_>>()?;
        Ok(self)
    }

    /// The states that follow the inputs alone, and their rates.
    pub(crate) fn followers(&self) -> &[Follower] {
        &self.followers
    }

    /// The functions of the rates that may hold a state at rest, where there are any.
    pub(crate) fn sticks(&self) -> Option<&Sticks> {
        self.sticks.as_ref()
    }

    /// The model that was compiled.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Number of states n.
    pub fn n_states(&self) -> usize {
        self.model.states.len()
    }

    /// Number of controls m.
    pub fn n_controls(&self) -> usize {
        self.model.controls.len()
    }

    /// Number of parameters p.
    pub fn n_parameters(&self) -> usize {
        self.model.parameters.len()
    }

    /// The inputs with a history, in the order in which they must be computed.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// The nominal values of the parameters, p of them.
    pub fn parameter_values(&self) -> Vec<f64> {
        self.model.parameters.iter().map(|p| p.value).collect()
    }

    /// The rates as a tape of the variables states, controls, inputs with a history, parameters.
    pub fn rates(&self) -> &Tape {
        &self.rates
    }

    /// The measured outputs, one a state, as a tape of the same variables and then the late states.
    pub fn outputs(&self) -> &Tape {
        &self.outputs
    }

    /// The states that `measured` reads late.
    pub(crate) fn late_states(&self) -> &[LateState] {
        &self.late_states
    }

    /// Runs a tape of this system; a failing simulator of the user's own yields NaN.
    #[inline(always)]
    pub(crate) fn evaluate<S: pulp::Simd, const L: usize>(&self, simd: S, tape: &Tape, registers: &mut [[f64; L]]) {
        tape.evaluate_with(simd, registers, &|lanes, arguments, outputs| {
            let Some(simulator) = &self.simulator else { return outputs.fill(f64::NAN) };
            if let Some(engine) = simulator.steps() {
                // Arguments of a lane are its states, commands, forces and parameters.
                let [states, commands, forces, parameters] =
                    engine::rows_of(simulator.as_ref(), engine, lanes, arguments);
                let rows = Rows {
                    count: lanes,
                    states: &states,
                    commands: &commands,
                    forces: &forces,
                    parameters: &parameters,
                };
                if engine::rates_of_step(engine, &rows, outputs).is_err() {
                    outputs.fill(f64::NAN);
                }
                return;
            }
            // Arguments of a lane are the time, the states, then the controls.
            let n = simulator.n_states().min(self.n_states());
            let (mut t, mut x, mut u) = (Vec::with_capacity(lanes), Vec::new(), Vec::new());
            for lane in arguments.chunks(arguments.len() / lanes.max(1)) {
                t.push(lane[0]);
                x.extend_from_slice(&lane[1..=n]);
                u.extend_from_slice(&lane[n + 1..]);
            }
            if simulator.derivatives(&t, &x, &u, outputs).is_err() {
                outputs.fill(f64::NAN);
            }
        });
    }

    /// What goes to a simulator that steps on its own, where there is one.
    pub(crate) fn drive(&self) -> Option<&Drive> {
        self.drive.as_ref()
    }

    /// A place for what was computed of this system last and may be wanted again.
    pub(crate) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// The user's own simulator, where there is one.
    pub(crate) fn simulator(&self) -> Option<&Arc<dyn Dynamics>> {
        self.simulator.as_ref()
    }
}

impl Dynamics for System {
    fn n_states(&self) -> usize {
        self.model.states.len()
    }

    fn n_controls(&self) -> usize {
        self.model.controls.len()
    }

    /// Inputs with a history are taken without it here: `delay(u, tau)`, `play(u, width)` and
    /// `sample_hold(u, period, phase)` read `u`.
    fn derivative(&self, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        let (n, m, p) = (self.n_states(), self.n_controls(), self.n_parameters());
        if x.len() != n || u.len() != m || dx.len() != n {
            return Err(Error::shape(
                "derivative",
                format!("{n} states, {m} controls"),
                format!("{}, {}", x.len(), u.len()),
            ));
        }
        let values = self.parameter_values();
        let mut signals: Vec<f64> = u.to_vec();
        for input in &self.inputs {
            let variables: Vec<f64> = signals.iter().chain(&values).copied().collect();
            let signal = input.tape.evaluate_once(&variables, t)[0];
            signals.push(signal);
        }
        let mut registers = self.rates.registers::<1>();
        for (register, &value) in registers.iter_mut().zip(x.iter().chain(&signals).chain(&values)) {
            *register = [value];
        }
        registers[n + signals.len() + p] = [t];
        self.evaluate(pulp::Scalar, &self.rates, &mut registers);
        for (j, rate) in dx.iter_mut().enumerate() {
            *rate = self.rates.output(&registers, j)[0];
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
