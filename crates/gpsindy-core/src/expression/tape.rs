//! Expressions compiled to a straight-line program over registers, evaluated for several lanes at once.
//!
//! Equal parts are computed once (also across equations). A lane is one set of values: a batch of
//! perturbed parameters, of initial states or of samples runs through the same instructions together.

mod fuse;
mod operation;

use super::{Expression, Operator};
use crate::error::{Error, Result};
use operation::Operation;
use pulp::Simd;
use std::collections::HashMap;
use std::ops::Range;

type Register = u32;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Instruction {
    operation: Operation,
    /// Unused operands repeat the first.
    operands: [Register; 3],
}

/// One call of the user's own simulator: its arguments, and where its outputs go.
#[derive(Debug, Clone, PartialEq)]
struct SimulatorCall {
    arguments: Vec<Register>,
    first_output: Register,
    n_outputs: usize,
}

/// A compiled list of expressions.
///
/// Registers hold, in this order: the variables, the time, the constants, the results.
#[derive(Debug, Clone)]
pub struct Tape {
    n_variables: usize,
    constants: Vec<f64>,
    instructions: Vec<Step>,
    n_registers: usize,
    outputs: Vec<Register>,
}

#[derive(Debug, Clone)]
enum Step {
    Compute(Instruction, Register),
    Simulate(SimulatorCall),
}

/// The user's own simulator as a tape sees it: a number of lanes, their arguments and their outputs one after another.
pub(crate) type SimulatorFunction<'a> = &'a dyn Fn(usize, &[f64], &mut [f64]);

struct Compiler<'a> {
    variables: &'a [String],
    constants: Vec<f64>,
    known: HashMap<Instruction, Register>,
    simulators: HashMap<Vec<Register>, Register>,
    n_simulator_outputs: usize,
    steps: Vec<Step>,
    next: Register,
}

impl Tape {
    /// Compiles `expressions` of the variables `variables` (and of time).
    ///
    /// # Errors
    /// [`Error::UnknownName`] for a name that is not among the variables; `delay`, `play` and
    /// `sample_hold`, which need a history, are refused here: a compiled model replaces them by inputs first.
    pub fn new(expressions: &[Expression], variables: &[String]) -> Result<Self> {
        Self::with_simulator(expressions, variables, 0)
    }

    /// As [`Tape::new`], for expressions that call a simulator with `n_simulator_outputs` outputs.
    pub(crate) fn with_simulator(
        expressions: &[Expression],
        variables: &[String],
        n_simulator_outputs: usize,
    ) -> Result<Self> {
        let mut constants = Vec::new();
        for expression in expressions {
            expression.visit(&mut |part| {
                let value = match part {
                    Expression::Number(value) => *value,
                    Expression::Pi => std::f64::consts::PI,
                    _ => return,
                };
                if !constants.iter().any(|c: &f64| c.to_bits() == value.to_bits()) {
                    constants.push(value);
                }
            });
        }
        let next = (variables.len() + 1 + constants.len()) as Register;
        let mut compiler = Compiler {
            variables,
            constants,
            known: HashMap::new(),
            simulators: HashMap::new(),
            n_simulator_outputs,
            steps: Vec::new(),
            next,
        };
        let outputs = expressions.iter().map(|e| compiler.compile(e)).collect::<Result<Vec<_>>>()?;
        Ok(Self {
            n_variables: variables.len(),
            constants: compiler.constants,
            instructions: fuse::fused(compiler.steps, &outputs),
            n_registers: compiler.next as usize,
            outputs,
        })
    }

    /// Which variable an output is, where it is nothing but that; `None` also for constants.
    pub(crate) fn bare_variable(&self, output: usize) -> Option<usize> {
        Some(self.outputs[output] as usize).filter(|&register| register < self.n_variables)
    }

    /// Whether an output is nothing but a constant.
    pub(crate) fn is_constant(&self, output: usize) -> bool {
        let register = self.outputs[output] as usize;
        (self.n_variables + 1..=self.n_variables + self.constants.len()).contains(&register)
    }

    /// Number of variables it reads.
    pub fn n_variables(&self) -> usize {
        self.n_variables
    }

    /// Number of expressions.
    pub fn n_outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Whether any result depends on variable `variable`; the time is the one behind the last.
    pub fn reads(&self, variable: usize) -> bool {
        let register = variable as Register;
        self.outputs.contains(&register)
            || self.instructions.iter().any(|step| match step {
                Step::Compute(instruction, _) => instruction.operands.contains(&register),
                Step::Simulate(call) => call.arguments.contains(&register),
            })
    }

    /// Whether one result depends on any of some `variables`.
    pub(crate) fn output_reads(&self, output: usize, variables: &Range<usize>) -> bool {
        let mut read = vec![self.outputs[output]];
        // Operands come before what is made of them. A simulator's outputs may read all that goes into any.
        for step in self.instructions.iter().rev() {
            match step {
                Step::Compute(instruction, result) if read.contains(result) => read.extend(instruction.operands),
                Step::Simulate(call) => read.extend(&call.arguments),
                Step::Compute(..) => {}
            }
        }
        read.iter().any(|&register| variables.contains(&(register as usize)))
    }

    /// Registers for [`Tape::evaluate`], with the constants in place.
    pub fn registers<const L: usize>(&self) -> Vec<[f64; L]> {
        let mut registers = vec![[0.0; L]; self.n_registers];
        for (i, &value) in self.constants.iter().enumerate() {
            registers[self.n_variables + 1 + i] = [value; L];
        }
        registers
    }

    /// Runs the program. The caller has put the variables into the first registers and the time behind them.
    pub fn evaluate<const L: usize>(&self, registers: &mut [[f64; L]]) {
        self.evaluate_with(pulp::Scalar, registers, &|_, _, outputs| outputs.fill(f64::NAN));
    }

    /// As [`Tape::evaluate`], with the user's own simulator.
    pub(crate) fn evaluate_with<S: Simd, const L: usize>(
        &self,
        simd: S,
        registers: &mut [[f64; L]],
        simulator: SimulatorFunction<'_>,
    ) {
        // One function for all its callers: a copy in each of them took a quarter of the build.
        simd.vectorize(Evaluation { tape: self, simd, registers, simulator });
    }

    /// Result number `output` after [`Tape::evaluate`].
    pub fn output<const L: usize>(&self, registers: &[[f64; L]], output: usize) -> [f64; L] {
        registers[self.outputs[output] as usize]
    }

    /// All results for one set of values: `variables` in the order of compilation, `time` in s.
    pub fn evaluate_once(&self, variables: &[f64], time: f64) -> Vec<f64> {
        let mut registers = self.registers::<1>();
        for (register, &value) in registers.iter_mut().zip(&variables[..self.n_variables]) {
            *register = [value];
        }
        registers[self.n_variables] = [time];
        self.evaluate(&mut registers);
        (0..self.n_outputs()).map(|i| self.output(&registers, i)[0]).collect()
    }
}

/// A run of a tape, compiled once for every kind of vector instructions and number of lanes.
struct Evaluation<'e, S, const L: usize> {
    tape: &'e Tape,
    simd: S,
    registers: &'e mut [[f64; L]],
    simulator: SimulatorFunction<'e>,
}

impl<S: Simd, const L: usize> pulp::WithSimd for Evaluation<'_, S, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _: V) {
        let Self { tape, simd, registers, simulator } = self;
        for step in &tape.instructions {
            match step {
                Step::Compute(instruction, out) => {
                    // Results come after their operands.
                    let (before, after) = registers.split_at_mut(*out as usize);
                    let operand = |i: usize| &before[instruction.operands[i] as usize];
                    instruction.operation.compute(simd, operand, &mut after[0]);
                }
                Step::Simulate(call) => simulate(call, registers, simulator),
            }
        }
    }
}

impl Compiler<'_> {
    fn constant(&self, value: f64) -> Register {
        let place = self.constants.iter().position(|c| c.to_bits() == value.to_bits()).unwrap_or(0);
        (self.variables.len() + 1 + place) as Register
    }

    fn compile(&mut self, expression: &Expression) -> Result<Register> {
        match expression {
            Expression::Number(value) => Ok(self.constant(*value)),
            Expression::Pi => Ok(self.constant(std::f64::consts::PI)),
            Expression::Time => Ok(self.variables.len() as Register),
            Expression::Variable(name) => self
                .variables
                .iter()
                .position(|v| v == name)
                .map(|i| i as Register)
                .ok_or_else(|| Error::unknown("name", name, self.variables)),
            Expression::Negate(a) => {
                let a = self.compile(a)?;
                Ok(self.emit(Operation::Negate, [a, a, a]))
            }
            Expression::Binary(Operator::Power, a, b) => {
                let a = self.compile(a)?;
                match **b {
                    Expression::Number(2.0) => Ok(self.emit(Operation::Square, [a, a, a])),
                    Expression::Number(3.0) => Ok(self.emit(Operation::Cube, [a, a, a])),
                    ref b => {
                        let b = self.compile(b)?;
                        Ok(self.emit(Operation::Power, [a, b, a]))
                    }
                }
            }
            Expression::Binary(operator, a, b) => {
                let (a, b) = (self.compile(a)?, self.compile(b)?);
                Ok(self.emit((*operator).into(), [a, b, a]))
            }
            Expression::Call(function, _) if function.has_memory() => Err(Error::model(format!(
                "`{}` may only be used in a model's equations and measured outputs: `{expression}`",
                function.name()
            ))),
            Expression::Call(function, arguments) => {
                let registers = arguments.iter().map(|a| self.compile(a)).collect::<Result<Vec<_>>>()?;
                let operand = |i: usize| registers.get(i).copied().unwrap_or(registers[0]);
                Ok(self.emit(Operation::Call(*function), [operand(0), operand(1), operand(2)]))
            }
            Expression::Simulator(output, arguments) => self.simulator(*output, arguments),
        }
    }

    fn simulator(&mut self, output: usize, arguments: &[Expression]) -> Result<Register> {
        if output >= self.n_simulator_outputs {
            return Err(Error::range("simulator output", &format!("below {}", self.n_simulator_outputs), output));
        }
        let arguments = arguments.iter().map(|a| self.compile(a)).collect::<Result<Vec<_>>>()?;
        if let Some(first) = self.simulators.get(&arguments) {
            return Ok(first + output as Register);
        }
        let first_output = self.next;
        self.next += self.n_simulator_outputs as Register;
        self.simulators.insert(arguments.clone(), first_output);
        let n_outputs = self.n_simulator_outputs;
        self.steps.push(Step::Simulate(SimulatorCall { arguments, first_output, n_outputs }));
        Ok(first_output + output as Register)
    }

    fn emit(&mut self, operation: Operation, operands: [Register; 3]) -> Register {
        let instruction = Instruction { operation, operands };
        if let Some(&register) = self.known.get(&instruction) {
            return register;
        }
        let register = self.next;
        self.next += 1;
        self.known.insert(instruction, register);
        self.steps.push(Step::Compute(instruction, register));
        register
    }
}

fn simulate<const L: usize>(call: &SimulatorCall, registers: &mut [[f64; L]], simulator: SimulatorFunction<'_>) {
    let mut arguments = Vec::with_capacity(L * call.arguments.len());
    for lane in 0..L {
        arguments.extend(call.arguments.iter().map(|&register| registers[register as usize][lane]));
    }
    let mut outputs = vec![0.0; L * call.n_outputs];
    simulator(L, &arguments, &mut outputs);
    for (lane, values) in outputs.chunks(call.n_outputs.max(1)).enumerate() {
        for (i, &value) in values.iter().enumerate() {
            registers[call.first_output as usize + i][lane] = value;
        }
    }
}

#[cfg(test)]
mod tests;
