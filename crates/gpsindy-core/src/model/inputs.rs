//! Inputs with a history and states that are read late: functions with a memory, as a compiled model has them.

use super::Model;
use crate::error::Result;
use crate::expression::{Expression, Function, Tape};

/// How an input with a history is made from a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum InputKind {
    /// The signal, `amount` seconds earlier.
    Delay,
    /// The signal through a play of total width `amount`, starting centred.
    Play,
    /// The signal, followed no faster than `amount` per second; it starts where the signal does.
    Slew,
    /// The signal as it was when last sampled, every `amount` seconds.
    SampleHold,
}

impl InputKind {
    /// The kind that a function of the language makes.
    pub(super) fn of(function: Function) -> Self {
        match function {
            Function::Play => Self::Play,
            Function::Slew => Self::Slew,
            Function::SampleHold => Self::SampleHold,
            _ => Self::Delay,
        }
    }
}

/// Share of the period of a sample-and-hold that rounding may make of time stamps and of the period.
pub(crate) const ROUNDING: f64 = 1e-6;

/// Shortest period of a sample-and-hold, in sampling steps of a log: what is shorter holds nothing that the log could show.
pub(crate) const SHORTEST_HOLD: f64 = 0.01;

/// The moment at or before `t` at which a signal was last sampled, where it is sampled at `phase` and every `period` from there.
///
/// A moment that rounding puts just after `t` counts as `t`.
pub(crate) fn sampled_at(t: f64, phase: f64, period: f64) -> f64 {
    if period > 0.0 { phase + period * ((t - phase) / period + ROUNDING).floor() } else { t }
}

/// Where a signal that is followed no faster than `rate` has come after `dt` s: it was at `from` as the signal, which changes by `slope`
/// per second, was at `signal`.
pub(crate) fn slewed(from: f64, signal: f64, slope: f64, rate: f64, dt: f64) -> f64 {
    let caught = caught_after(from, signal, slope, rate);
    if dt < caught {
        from + (signal - from).signum() * rate * dt
    } else {
        signal + slope * caught + slope.max(-rate).min(rate) * (dt - caught)
    }
}

/// After how many seconds it has caught up with the signal; infinite where it never does.
pub(crate) fn caught_after(from: f64, signal: f64, slope: f64, rate: f64) -> f64 {
    let gap = signal - from;
    let closing = rate - gap.signum() * slope;
    match gap == 0.0 {
        true => 0.0,
        false if closing > 0.0 => gap.abs() / closing,
        false => f64::INFINITY,
    }
}

/// An input with a history, such as `delay(u, tau)`.
#[derive(Debug, Clone)]
pub struct Input {
    /// What is done with the signal.
    pub kind: InputKind,
    /// Outputs: the signal, the amount and, of a [`InputKind::SampleHold`], its phase; of the variables controls, earlier
    /// inputs, parameters.
    pub tape: Tape,
}

/// A measured state that is read late: `delay(state, tau)` or `sample_hold(state, period, phase)` in `measured`.
#[derive(Debug, Clone)]
pub(crate) struct LateState {
    /// Which state.
    pub(crate) state: usize,
    /// [`InputKind::Delay`] or [`InputKind::SampleHold`].
    pub(super) kind: InputKind,
    /// The delay, or period and phase, in s, of the parameters and, of a delay, the time.
    pub(crate) amounts: Tape,
}

impl LateState {
    /// The delay at time 0, s, and by how much it grows in a second, or period and phase, s; in every lane of parameters.
    pub(crate) fn amounts<const L: usize>(&self, parameters: &[[f64; L]]) -> [[f64; 2]; L] {
        let mut registers = self.amounts.registers::<L>();
        registers[..parameters.len()].copy_from_slice(parameters);
        let mut at = |time: f64| {
            registers[self.amounts.n_variables()] = [time; L];
            self.amounts.evaluate(&mut registers);
            let last = self.amounts.n_outputs() - 1;
            [self.amounts.output(&registers, 0), self.amounts.output(&registers, last)]
        };
        let ([now, phase], [later, _]) = (at(0.0), at(1.0));
        let is_held = self.kind == InputKind::SampleHold;
        std::array::from_fn(|lane| [now[lane], if is_held { phase[lane] } else { later[lane] - now[lane] }])
    }

    /// Whether a sensor holds what it read at its last sample.
    pub(crate) fn is_held(&self) -> bool {
        self.kind == InputKind::SampleHold
    }

    /// How late a reading is at most between two times, s.
    pub(crate) fn lateness(&self, amounts: [f64; 2], (first, last): (f64, f64)) -> f64 {
        match self.kind {
            InputKind::SampleHold => amounts[0],
            _ => (first - self.moment(first, amounts)).max(last - self.moment(last, amounts)),
        }
    }

    /// The moment that a reading at `t` is of, s.
    pub(crate) fn moment(&self, t: f64, amounts: [f64; 2]) -> f64 {
        match self.kind {
            InputKind::SampleHold => sampled_at(t, amounts[1], amounts[0]),
            _ => t - (amounts[0] + amounts[1] * t),
        }
    }
}

/// Replaces functions with a memory by new variables, and remembers what they replace.
pub(super) struct Extraction<'a> {
    pub(super) model: &'a Model,
    /// The kind, the signal and then its amounts.
    pub(super) inputs: Vec<(InputKind, Vec<Expression>)>,
    pub(super) late: Vec<(InputKind, usize, Vec<Expression>)>,
}

pub(super) fn input_name(index: usize) -> String {
    format!("input with a history {index}")
}

pub(super) fn late_name(index: usize) -> String {
    format!("late state {index}")
}

impl Extraction<'_> {
    /// The inputs, compiled, each a function of the controls, the inputs before it and the parameters; and the variables of tapes that
    /// read them: states, controls, inputs, parameters.
    pub(super) fn compiled(&self, parameters: &[String]) -> Result<(Vec<Input>, Vec<String>)> {
        let controls: Vec<String> = self.model.controls.iter().map(|c| c.name.clone()).collect();
        let mut inputs = Vec::with_capacity(self.inputs.len());
        for (index, (kind, parts)) in self.inputs.iter().enumerate() {
            let earlier = (0..index).map(input_name);
            let variables: Vec<String> =
                controls.iter().cloned().chain(earlier).chain(parameters.iter().cloned()).collect();
            inputs.push(Input { kind: *kind, tape: Tape::new(parts, &variables)? });
        }
        let names = self.model.states.iter().map(|s| s.name.clone());
        let known = names.chain(controls).chain((0..inputs.len()).map(input_name));
        Ok((inputs, known.chain(parameters.iter().cloned()).collect()))
    }

    /// The states that are read late, compiled: their amounts are functions of the parameters.
    pub(super) fn late_states(&self, parameters: &[String]) -> Result<Vec<LateState>> {
        let one = |(kind, state, amounts): &(InputKind, usize, Vec<Expression>)| {
            Ok(LateState { state: *state, kind: *kind, amounts: Tape::new(amounts, parameters)? })
        };
        self.late.iter().map(one).collect()
    }

    pub(super) fn extract(&mut self, expression: &Expression) -> Expression {
        match expression {
            Expression::Call(function, arguments) if function.has_memory() => {
                let kind = InputKind::of(*function);
                if let Some(state) = self.late_state(&arguments[0]) {
                    let entry = (kind, state, arguments[1..].to_vec());
                    return Expression::Variable(late_name(place_of(&mut self.late, entry)));
                }
                if let (Function::Slew, Some(delayed)) = (*function, delayed_last(*function, arguments)) {
                    return self.extract(&delayed);
                }
                let mut parts = arguments.clone();
                parts[0] = self.extract(&parts[0]);
                Expression::Variable(input_name(place_of(&mut self.inputs, (kind, parts))))
            }
            Expression::Number(_) | Expression::Pi | Expression::Time | Expression::Variable(_) => expression.clone(),
            Expression::Negate(a) => Expression::Negate(self.extract(a).into()),
            Expression::Binary(operator, a, b) => {
                Expression::Binary(*operator, self.extract(a).into(), self.extract(b).into())
            }
            Expression::Call(function, arguments) => {
                Expression::Call(*function, arguments.iter().map(|a| self.extract(a)).collect())
            }
            Expression::Simulator(output, arguments) => {
                Expression::Simulator(*output, arguments.iter().map(|a| self.extract(a)).collect())
            }
        }
    }

    fn late_state(&self, argument: &Expression) -> Option<usize> {
        match argument {
            Expression::Variable(name) => self.model.state_index(name),
            _ => None,
        }
    }
}

/// The play or the rate limit of a delayed control as the delayed one of the control, which is the same: only that needs no samples in
/// between.
pub(super) fn delayed_last(function: Function, arguments: &[Expression]) -> Option<Expression> {
    match (function, &arguments[0]) {
        (Function::Play | Function::Slew, Expression::Call(Function::Delay, inner)) => {
            let first = Expression::Call(function, vec![inner[0].clone(), arguments[1].clone()]);
            Some(Expression::Call(Function::Delay, vec![first, inner[1].clone()]))
        }
        _ => None,
    }
}

fn place_of<T: PartialEq>(list: &mut Vec<T>, entry: T) -> usize {
    list.iter().position(|e| *e == entry).unwrap_or_else(|| {
        list.push(entry);
        list.len() - 1
    })
}
