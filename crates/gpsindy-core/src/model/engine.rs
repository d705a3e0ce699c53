//! Simulators that step: the next state of many rows at once, with forces and the simulator's own parameters.

use super::{Dynamics, Model, System};
use crate::error::{Error, Result};
use crate::expression::{Expression, Tape};

/// Steps of a simulator that the middle sample of a run may last at most. Simulators of machines step at 1 ms or a little less or more, and
/// machines are logged at 1 Hz and more: a thousand steps, and twice that leaves room. Time stamps in ms where s belong make a thousand of
/// every step: four thousand of a log at 50 Hz and steps of 5 ms.
const MOST_STEPS_A_SAMPLE: f64 = 2000.0;

/// A simulator that makes its own steps, for many rows at once: `x' = F(x, u, f, p, dt)`.
///
/// Rows are independent copies of the machine: states `x` (n), commands `u` (m), generalised forces `f` and the
/// simulator's own parameters `p`, each row after row. An effect acts at its command, as a force, on a parameter or
/// at the sensors, never inside.
pub trait Steps: Send + Sync {
    /// The longest step, s: the simulator's own.
    fn period(&self) -> f64;

    /// Number of forces; they are the model's ports.
    fn n_forces(&self) -> usize;

    /// Number of own parameters; they are the model's first parameters.
    fn n_parameters(&self) -> usize;

    /// Whether several threads may call at once, and a call costs little beside its steps. The calls of a simulator that is not are put together:
    /// one in another language costs as much as many steps.
    fn is_concurrent(&self) -> bool {
        false
    }

    /// States `next` (r x n) one step of `dt` s (at most the period) after `x` (r x n), commands and forces held.
    ///
    /// # Errors
    /// [`crate::Error::Callback`] with the simulator's own error.
    fn step(&self, rows: &Rows<'_>, dt: f64, next: &mut [f64]) -> Result<()>;

    /// States `next` (r x s x n) after each of `samples` s, of `count` whole steps each; `rows` has the commands (r x s x m) and forces
    /// (r x s x f) that are held within each sample. A simulator that makes them in one call spares thousands of calls.
    ///
    /// # Errors
    /// As [`Steps::step`].
    fn rollout(&self, rows: &Rows<'_>, (samples, count): (usize, usize), next: &mut [f64]) -> Result<()> {
        self.one_by_one(rows, (samples, count), next)
    }

    /// States `next` one step after `x`, of `dt[i]` s (at most the period) for row i. A simulator whose copies have steps of their own spares
    /// the calls: recordings with jitter end every sample with another one.
    ///
    /// # Errors
    /// As [`Steps::step`].
    fn unequal_steps(&self, rows: &Rows<'_>, dt: &[f64], next: &mut [f64]) -> Result<()> {
        self.by_length(rows, dt, next)
    }

    /// The same by a call of [`Steps::step`] for all rows of one length.
    ///
    /// # Errors
    /// As [`Steps::step`].
    fn by_length(&self, rows: &Rows<'_>, dt: &[f64], next: &mut [f64]) -> Result<()> {
        let mut order: Vec<usize> = (0..rows.count).collect();
        order.sort_by(|&a, &b| dt[a].total_cmp(&dt[b]).then(a.cmp(&b)));
        for same in order.chunk_by(|&a, &b| dt[a] == dt[b]) {
            let picked = |part: &[f64]| -> Vec<f64> {
                let width = part.len() / rows.count.max(1);
                same.iter().flat_map(|&i| part[i * width..(i + 1) * width].iter().copied()).collect()
            };
            let (states, commands) = (picked(rows.states), picked(rows.commands));
            let (forces, parameters) = (picked(rows.forces), picked(rows.parameters));
            let some = Rows {
                count: same.len(),
                states: &states,
                commands: &commands,
                forces: &forces,
                parameters: &parameters,
            };
            let mut found = vec![f64::NAN; states.len()];
            self.step(&some, dt[same[0]], &mut found)?;
            let width = states.len() / same.len();
            for (&i, row) in same.iter().zip(found.chunks(width.max(1))) {
                next[i * width..(i + 1) * width].copy_from_slice(row);
            }
        }
        Ok(())
    }

    /// [`Steps::rollout`] by as many calls of [`Steps::step`].
    ///
    /// # Errors
    /// As [`Steps::step`].
    fn one_by_one(&self, rows: &Rows<'_>, (samples, count): (usize, usize), next: &mut [f64]) -> Result<()> {
        let mut states = rows.states.to_vec();
        let width = states.len() / rows.count.max(1);
        let mut found = vec![f64::NAN; states.len()];
        for sample in 0..samples {
            let of_sample = |all: &[f64]| -> Vec<f64> {
                let width = all.len() / (rows.count * samples).max(1);
                let at = |row: usize| (row * samples + sample) * width;
                (0..rows.count).flat_map(|row| all[at(row)..at(row) + width].iter().copied()).collect()
            };
            let (commands, forces) = (of_sample(rows.commands), of_sample(rows.forces));
            for _ in 0..count {
                let held = Rows { states: &states, commands: &commands, forces: &forces, ..*rows };
                self.step(&held, self.period(), &mut found)?;
                states.copy_from_slice(&found);
            }
            for (row, state) in states.chunks(width.max(1)).enumerate() {
                next[(row * samples + sample) * width..][..width].copy_from_slice(state);
            }
        }
        Ok(())
    }
}

/// Copies of a machine, row after row.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// Number of rows r.
    pub count: usize,
    /// States (r x n).
    pub states: &'a [f64],
    /// Commands (r x m).
    pub commands: &'a [f64],
    /// Generalised forces, one a port.
    pub forces: &'a [f64],
    /// The simulator's own parameters.
    pub parameters: &'a [f64],
}

/// What a compiled model hands to a simulator that steps, and what it adds outside of it.
///
/// All tapes read states, controls, inputs with a history and parameters, as the rates do.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    /// Commands, forces, parameters of the simulator.
    pub(crate) arguments: Tape,
    /// Rates outside the simulator: terms added to its rows, and whole rows of added states.
    pub(crate) beside: Tape,
    /// Which rows have such a rate; most have none.
    pub(crate) rows: Vec<usize>,
}

impl Model {
    /// Equations of a simulator with `n` states: positions of `kinematic` (position, rate) say so, the others call it.
    ///
    /// Call it once states, controls, ports and parameters are in place.
    pub fn call_simulator(&mut self, kinematic: &[(usize, usize)]) {
        let names = self.states.iter().map(|s| &s.name).chain(self.controls.iter().map(|c| &c.name));
        let names = names.chain(self.ports.iter().map(|p| &p.name)).chain(self.parameters.iter().map(|p| &p.name));
        let arguments: Vec<Expression> = names.map(Expression::variable).collect();
        for j in 0..self.states.len() {
            self.states[j].equation = match kinematic.iter().find(|(position, _)| *position == j) {
                Some((_, rate)) => Expression::variable(self.states[*rate].name.clone()),
                None => Expression::Simulator(j, arguments.clone()),
            };
        }
    }

    /// What goes into a simulator of `n` states that steps, besides the states: name and expression of every command, force and
    /// parameter of its own, ports at zero and values in the place of the parameters that are not its own.
    pub fn simulator_inputs(&self, n: usize) -> Vec<(String, Expression)> {
        let closed = self.closed();
        let Some(arguments) = closed.states.iter().find_map(|s| call(&s.equation)) else { return Vec::new() };
        let arguments = arguments.get(n..).unwrap_or_default();
        let own = arguments.len().saturating_sub(self.controls.len() + self.ports.len());
        let names = self.controls.iter().map(|c| &c.name).chain(self.ports.iter().map(|p| &p.name));
        let names = names.chain(self.parameters.iter().take(own).map(|p| &p.name));
        let valued = |e: &Expression| {
            e.map(&|part| match &part {
                Expression::Variable(name) => match self.parameters.iter().find(|p| p.name == *name) {
                    Some(parameter) => Expression::Number(parameter.value),
                    None => part,
                },
                _ => part,
            })
        };
        names.cloned().zip(arguments.iter().map(valued)).collect()
    }

    /// Whether an equation calls the user's own simulator.
    pub fn calls_simulator(&self) -> bool {
        (0..self.states.len()).any(|state| self.is_simulated(state))
    }

    /// Whether a simulator gives the rate of a state.
    pub(crate) fn is_simulated(&self, state: usize) -> bool {
        call(&self.states[state].equation).is_some()
    }
}

/// Arguments of the call of a simulator within an expression.
pub(super) fn call(expression: &Expression) -> Option<Vec<Expression>> {
    let mut found = None;
    expression.visit(&mut |part| {
        if let Expression::Simulator(_, arguments) = part {
            found.get_or_insert_with(|| arguments.clone());
        }
    });
    found
}

/// What is added to the call of a simulator: the expression with the call at zero.
pub(super) fn beside(expression: &Expression) -> Expression {
    use crate::expression::Operator::{Add, Subtract};
    match expression {
        Expression::Simulator(..) => Expression::Number(0.0),
        Expression::Binary(Add, a, b) => beside(a).plus(beside(b)),
        Expression::Binary(Subtract, a, b) => beside(a).minus(beside(b)),
        other => other.clone(),
    }
}

impl Drive {
    /// Of the equations `rates`, in which histories are variables already.
    pub(super) fn new(rates: &[Expression], n_states: usize, variables: &[String]) -> Result<Self> {
        let arguments = rates.iter().find_map(call).unwrap_or_default();
        let arguments = arguments.get(n_states..).unwrap_or_default();
        let is_own = |j: usize, rate: &Expression| j >= n_states || !matches!(rate, Expression::Variable(_));
        let rest = rates.iter().enumerate().filter(|(j, rate)| is_own(*j, rate)).map(|(j, rate)| (j, beside(rate)));
        let (rows, rest): (Vec<usize>, Vec<Expression>) =
            rest.filter(|(_, rate)| *rate != Expression::Number(0.0)).unzip();
        Ok(Self { arguments: Tape::new(arguments, variables)?, beside: Tape::new(&rest, variables)?, rows })
    }
}

impl System {
    /// The user's own simulator where it steps on its own.
    pub(crate) fn engine(&self) -> Option<&dyn Steps> {
        self.simulator().and_then(|s| s.steps())
    }

    /// Refuses a run, `name`, whose time stamps can't be seconds for a simulator that steps.
    ///
    /// # Errors
    /// [`Error::Data`] where its middle sample lasts more than [`MOST_STEPS_A_SAMPLE`] steps.
    pub(crate) fn check_stamps(&self, name: &str, time: &[f64]) -> Result<()> {
        let Some(engine) = self.engine() else { return Ok(()) };
        let mut apart: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        apart.sort_by(f64::total_cmp);
        let Some(middle) = apart.get(apart.len() / 2) else { return Ok(()) };
        let (period, steps) = (engine.period(), middle / engine.period());
        if steps <= MOST_STEPS_A_SAMPLE {
            return Ok(());
        }
        let message = format!(
            "{name}: samples are {middle} s apart, which is {steps:.3e} steps of the simulator ({period} s each); time stamps are \
             seconds: divide milliseconds by 1e3 and nanoseconds by 1e9"
        );
        Err(Error::Data { message })
    }

    /// How all rates of the nominal equations change when the input or parameter `name` is raised by `change`, at each of
    /// the `points` (all states, then all controls); parameters as `parameters`. `None` where that fails.
    pub(crate) fn response(
        &self,
        name: &str,
        change: f64,
        points: &[Vec<f64>],
        parameters: &[f64],
    ) -> Option<Vec<Vec<f64>>> {
        let model = self.model();
        let n = model.states.len();
        if let Some(engine) = self.engine() {
            return engine_response(self, engine, name, change, points, parameters);
        }
        let names: Vec<String> = model.names().map(str::to_string).collect();
        let equations: Vec<Expression> = model.states.iter().map(|s| without_past(&s.equation)).collect();
        let tape = Tape::new(&equations, &names).ok()?;
        let at = |point: &[f64], raised: f64| {
            let parameter = |other: &str| model.parameter_index(other).map_or(0.0, |i| parameters[i]);
            let value = |(i, other): (usize, &String)| {
                point.get(i).copied().unwrap_or_else(|| parameter(other)) + if other == name { raised } else { 0.0 }
            };
            tape.evaluate_once(&names.iter().enumerate().map(value).collect::<Vec<f64>>(), 0.0)
        };
        let one = |point: &Vec<f64>| {
            let (from, to) = (at(point, 0.0), at(point, change));
            (0..n).map(|j| to[j] - from[j]).collect()
        };
        Some(points.iter().map(one).collect())
    }
}

/// An expression in which `delay`, `play` and `sample_hold` read their signal as it is.
fn without_past(expression: &Expression) -> Expression {
    expression.map(&|part| match part {
        Expression::Call(function, mut arguments) if function.has_memory() => arguments.swap_remove(0),
        other => other,
    })
}

fn engine_response(
    system: &System,
    engine: &dyn Steps,
    name: &str,
    change: f64,
    points: &[Vec<f64>],
    parameters: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let model = system.model();
    let (n, m, count) = (model.states.len(), model.controls.len(), points.len());
    let raised = |values: &mut [f64], index: Option<usize>, width: usize| {
        if let Some(index) = index {
            values.iter_mut().skip(index).step_by(width.max(1)).for_each(|v| *v += change);
        }
    };
    let states: Vec<f64> = points.iter().flat_map(|p| p[..n].iter().copied()).collect();
    let run = |is_raised: bool| {
        let mut commands: Vec<f64> = points.iter().flat_map(|p| p[n..n + m].iter().copied()).collect();
        let mut forces = vec![0.0; engine.n_forces() * count];
        let own = engine.n_parameters().min(parameters.len());
        let mut values: Vec<f64> = (0..count).flat_map(|_| parameters[..own].iter().copied()).collect();
        if is_raised {
            raised(&mut commands, model.control_index(name), m);
            raised(&mut forces, model.port_index(name), engine.n_forces());
            raised(&mut values, model.parameter_index(name).filter(|&i| i < own), own);
        }
        let rows = Rows { count, states: &states, commands: &commands, forces: &forces, parameters: &values };
        let mut next = vec![0.0; n * count];
        engine.step(&rows, engine.period(), &mut next).ok().map(|()| next)
    };
    let (from, to) = (run(false)?, run(true)?);
    let rates: Vec<f64> = from.iter().zip(&to).map(|(a, b)| (b - a) / engine.period()).collect();
    Some(rates.chunks(n.max(1)).map(<[f64]>::to_vec).collect())
}

/// A rate out of one step, for callers that want one: `(x' - x)/dt`.
///
/// # Errors
/// As [`Steps::step`].
pub(crate) fn rates_of_step(engine: &dyn Steps, rows: &Rows<'_>, dx: &mut [f64]) -> Result<()> {
    let period = engine.period();
    engine.step(rows, period, dx)?;
    dx.iter_mut().zip(rows.states).for_each(|(next, x)| *next = (*next - x) / period);
    Ok(())
}

/// Splits the arguments of a call, lane after lane, into rows; returns how many each row has of each.
pub(super) fn rows_of(simulator: &dyn Dynamics, engine: &dyn Steps, lanes: usize, arguments: &[f64]) -> [Vec<f64>; 4] {
    let widths = [simulator.n_states(), simulator.n_controls(), engine.n_forces(), engine.n_parameters()];
    let mut parts: [Vec<f64>; 4] = Default::default();
    for lane in arguments.chunks((arguments.len() / lanes.max(1)).max(1)) {
        let mut first = 0;
        for (part, width) in parts.iter_mut().zip(widths) {
            part.extend_from_slice(&lane[first..first + width]);
            first += width;
        }
    }
    parts
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::{Rows, Steps};
    use crate::model::stepping::Stepping;

    #[test]
    fn several_steps_and_steps_of_each_row_are_those_of_single_calls() {
        let servo = Stepping::rough_servo();
        let (states, commands, parameters) = ([0.1, -0.3, 0.4, 2.0, -0.2, 0.5], [0.3, -0.6, 0.9], [0.03, 0.02, 0.05]);
        let rows = Rows { count: 3, states: &states, commands: &commands, forces: &[], parameters: &parameters };
        let step = |rows: &Rows<'_>, dt: f64| {
            let mut next = vec![0.0; rows.states.len()];
            servo.step(rows, dt, &mut next).unwrap();
            next
        };
        let twice = step(&Rows { states: &step(&rows, servo.period()), ..rows }, servo.period());
        let mut found = [0.0; 6];
        servo.rollout(&rows, (1, 2), &mut found).unwrap();
        assert_eq!(found[..], twice);
        let lengths = [1.0, 0.3, 1.0].map(|part| part * servo.period());
        servo.unequal_steps(&rows, &lengths, &mut found).unwrap();
        for (i, dt) in lengths.into_iter().enumerate() {
            let (x, own) = (2 * i..2 * i + 2, i..i + 1);
            let row = Rows {
                count: 1,
                states: &states[x.clone()],
                commands: &commands[own.clone()],
                forces: &[],
                parameters: &parameters[own],
            };
            assert_eq!(found[x], step(&row, dt));
        }
    }
}
