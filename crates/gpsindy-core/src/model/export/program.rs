//! The parts of a model that every program needs: rates, outputs, and inputs with a history.

use super::super::inputs::delayed_last;
use super::super::{InputKind, Model};
use super::dialect::no_equations;
use super::names::identifiers;
use crate::error::{Error, Result};
use crate::expression::{Expression, Function};
use std::collections::BTreeMap;

/// An input with a history: entry `i` of the list is the variable [`history_name`]`(i)`.
pub(super) struct History {
    pub(super) kind: InputKind,
    /// A function of controls, parameters and earlier entries.
    pub(super) signal: Expression,
    /// The delay in s, the width of the play, the largest rate or the period in s.
    pub(super) amount: Expression,
    /// A moment at which a sample-and-hold samples, s.
    pub(super) phase: Expression,
    /// The whole as the model writes it.
    pub(super) text: String,
}

/// What the programs of all languages are written from.
pub(super) struct Program<'a> {
    pub(super) model: &'a Model,
    pub(super) rates: Vec<Expression>,
    /// What the columns of a log read, where that is not the states themselves.
    pub(super) outputs: Option<Vec<Expression>>,
    pub(super) history: Vec<History>,
    /// States that outputs read late, and when.
    pub(super) late: Vec<(usize, String)>,
    identifiers: BTreeMap<String, String>,
}

fn history_name(index: usize) -> String {
    format!("history {index}")
}

fn late_name(index: usize) -> String {
    format!("late {index}")
}

/// Index of a variable that [`history_name`] or [`late_name`] made.
fn index_after(name: &str, prefix: &str) -> Option<usize> {
    name.strip_prefix(prefix)?.strip_prefix(' ')?.parse().ok()
}

impl<'a> Program<'a> {
    pub(super) fn new(model: &'a Model) -> Result<Self> {
        let mut program = Self {
            model,
            rates: Vec::new(),
            outputs: None,
            history: Vec::new(),
            late: Vec::new(),
            identifiers: identifiers(model),
        };
        for state in &model.states {
            let rate = program.extract(&state.equation)?;
            program.rates.push(rate);
        }
        if model.states.iter().any(|s| s.measured.is_some()) {
            let mut outputs = Vec::new();
            for state in &model.states {
                let own = Expression::variable(&state.name);
                outputs.push(program.extract(state.measured.as_ref().unwrap_or(&own))?);
            }
            program.outputs = Some(outputs);
        }
        Ok(program)
    }

    fn extract(&mut self, expression: &Expression) -> Result<Expression> {
        Ok(match expression {
            Expression::Number(_) | Expression::Pi | Expression::Time | Expression::Variable(_) => expression.clone(),
            Expression::Negate(a) => Expression::Negate(self.extract(a)?.into()),
            Expression::Binary(operator, a, b) => {
                Expression::Binary(*operator, self.extract(a)?.into(), self.extract(b)?.into())
            }
            Expression::Call(function, arguments) if function.has_memory() && self.state(&arguments[0]).is_some() => {
                let when = match function {
                    Function::SampleHold => {
                        let (period, phase) = (&arguments[1], &arguments[2]);
                        format!("as it was when last sampled, at {phase} s and every {period} s from there")
                    }
                    _ => format!("as it was {} s earlier", arguments[1]),
                };
                let entry = (self.state(&arguments[0]).unwrap_or(0), when);
                let index = self.late.iter().position(|e| *e == entry).unwrap_or(self.late.len());
                if index == self.late.len() {
                    self.late.push(entry);
                }
                Expression::Variable(late_name(index))
            }
            Expression::Call(function, arguments) if function.has_memory() => {
                self.extract_history(*function, arguments)?
            }
            Expression::Call(function, arguments) => {
                Expression::Call(*function, arguments.iter().map(|a| self.extract(a)).collect::<Result<_>>()?)
            }
            Expression::Simulator(..) => return Err(no_equations()),
        })
    }

    fn extract_history(&mut self, function: Function, arguments: &[Expression]) -> Result<Expression> {
        let (signal, amount) = (&arguments[0], &arguments[1]);
        if let Some(delayed) = delayed_last(function, arguments) {
            return self.extract(&delayed);
        }
        if matches!(function, Function::Play | Function::Slew) {
            let mut delayed = false;
            let is_late =
                |part: &Expression| matches!(part, Expression::Call(Function::Delay | Function::SampleHold, _));
            signal.visit(&mut |part| delayed |= is_late(part));
            if delayed {
                return Err(Error::NotExportable {
                    what: format!("`{}({signal}, {amount})`", function.name()),
                    why: format!(
                        "its signal is delayed or held in part; delay or hold the {} instead",
                        function.name()
                    ),
                });
            }
        }
        let text = Expression::Call(function, arguments.to_vec()).to_string();
        if let Some(index) = self.history.iter().position(|h| h.text == text) {
            return Ok(Expression::Variable(history_name(index)));
        }
        let signal = self.extract(signal)?;
        let kind = InputKind::of(function);
        let phase = arguments.get(2).cloned().unwrap_or(Expression::Number(0.0));
        self.history.push(History { kind, signal, amount: amount.clone(), phase, text });
        Ok(Expression::Variable(history_name(self.history.len() - 1)))
    }

    fn state(&self, expression: &Expression) -> Option<usize> {
        match expression {
            Expression::Variable(name) => self.model.state_index(name),
            _ => None,
        }
    }

    /// The identifier of a name, or what `history` and `late` make of such a variable.
    pub(super) fn name(&self, name: &str, history: &dyn Fn(usize) -> String, late: &dyn Fn(usize) -> String) -> String {
        if let Some(index) = index_after(name, "history") {
            return history(index);
        }
        index_after(name, "late").map_or_else(|| self.identifier(name), late)
    }

    /// The identifier of a name of the model.
    pub(super) fn identifier(&self, name: &str) -> String {
        self.identifiers.get(name).cloned().unwrap_or_default()
    }

    /// Indices of the states, controls and parameters that occur in `expressions`.
    pub(super) fn used(&self, expressions: &[&Expression]) -> [Vec<usize>; 3] {
        let used = |name: &str| expressions.iter().any(|e| e.contains(name));
        let model = self.model;
        [
            (0..model.states.len()).filter(|&j| used(&model.states[j].name)).collect(),
            (0..model.controls.len()).filter(|&j| used(&model.controls[j].name)).collect(),
            (0..model.parameters.len()).filter(|&j| used(&model.parameters[j].name)).collect(),
        ]
    }

    /// Lines that bind the names in `expressions`: `bind(list, place, identifier)` with list "state", "control" or "parameters".
    pub(super) fn bindings(&self, expressions: &[&Expression], bind: &dyn Fn(&str, usize, &str) -> String) -> String {
        let [states, controls, parameters] = self.used(expressions);
        let model = self.model;
        let mut lines = String::new();
        for j in states {
            lines += &bind("state", j, &self.identifier(&model.states[j].name));
        }
        for j in controls {
            lines += &bind("control", j, &self.identifier(&model.controls[j].name));
        }
        for j in parameters {
            lines += &bind("parameters", j, &self.identifier(&model.parameters[j].name));
        }
        lines
    }

    /// Whether `function` appears in any expression.
    pub(super) fn calls(&self, function: Function) -> bool {
        let mut found = false;
        let all = self.rates.iter().chain(self.outputs.iter().flatten()).chain(self.history.iter().map(|h| &h.signal));
        for expression in all.chain(self.history.iter().flat_map(|h| [&h.amount, &h.phase])) {
            expression.visit(&mut |part| found |= matches!(part, Expression::Call(f, _) if *f == function));
        }
        found
    }

    /// Whether there is an input of this kind.
    pub(super) fn has(&self, kind: InputKind) -> bool {
        self.history.iter().any(|h| h.kind == kind)
    }

    /// The initial state, zero where the model says nothing.
    pub(super) fn initial(&self) -> Vec<f64> {
        self.model.states.iter().map(|s| self.model.initial.get(&s.name).copied().unwrap_or(0.0)).collect()
    }

    /// The model as a comment calls it. Text of the user never begins a line: some tools run what begins with a prompt.
    pub(super) fn called(&self) -> String {
        if self.model.name.is_empty() { "A model".into() } else { format!("Model {}", self.model.name) }
    }

    /// `name [unit]`
    pub(super) fn labelled(name: &str, unit: &str) -> String {
        if unit.is_empty() { name.into() } else { format!("{name} [{unit}]") }
    }

    /// Comment lines, without comment marks, that say what the lists hold.
    pub(super) fn legend(&self, first: usize) -> Vec<String> {
        let model = self.model;
        let mut lines = vec![format!("{}: rates of its states, written by gpsindy.", self.called())];
        let place = |i: usize| i + first;
        for (i, s) in model.states.iter().enumerate() {
            lines.push(format!("state[{}]: {}", place(i), Self::labelled(&s.name, &s.unit)));
        }
        for (i, c) in model.controls.iter().enumerate() {
            lines.push(format!("control[{}]: {}", place(i), Self::labelled(&c.name, &c.unit)));
        }
        for (i, h) in self.history.iter().enumerate() {
            let meaning = match h.kind {
                InputKind::Delay => "as it was that many seconds earlier; before the record its first sample",
                InputKind::Play => "through a play of that total width, centred at the first sample",
                InputKind::Slew => "followed no faster than that rate per second, from the first sample on",
                InputKind::SampleHold => {
                    "as it was when last sampled; the numbers are the period and a time at which it is sampled, in s"
                }
            };
            lines.push(format!("history[{}]: {}, {meaning}", place(i), h.text));
        }
        for (i, (state, when)) in self.late.iter().enumerate() {
            let state = &model.states[*state].name;
            lines.push(format!("late[{}]: state {state} {when}; the caller keeps it", place(i)));
        }
        if !self.history.is_empty() {
            lines.push("What has a history is made from a record of samples between which controls are held.".into());
        }
        lines
    }
}
