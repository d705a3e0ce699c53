//! Rollouts of several lanes at once with a fixed step: what a fit needs, and fast.
//!
//! A lane is one set of parameters and initial states. Classical Runge-Kutta of order 4; a held
//! control enters by its mean over the step, so that outputs are smooth in a delay.

mod buffer;
mod correction;
mod following;
pub(crate) mod guided;
pub(crate) mod lockstep;
pub(crate) mod path;
mod product;
mod sticking;
mod sums;
pub(crate) mod tangent;

use super::experiment::{Log, Past};
use super::history::{Histories, Stages};
use crate::data::Hold;
use crate::model::System;
use crate::model::sticking::Slots;
use following::Followed;

/// What is rolled out, and who receives it: sample, state or column, values.
struct Roll<'r, const L: usize> {
    span: (usize, usize),
    initial: &'r [[f64; L]],
    substeps: usize,
    /// The measured outputs that are wanted; the states themselves where absent.
    columns: Option<&'r [usize]>,
    receive: &'r mut dyn FnMut(usize, usize, [f64; L]),
}

/// A rollout as a task that is compiled once for every kind of vector instructions.
struct Walk<'w, 'r, 'a, const L: usize> {
    lanes: &'w mut Lanes<'a, L>,
    roll: Roll<'r, L>,
}

impl<const L: usize> pulp::WithSimd for Walk<'_, '_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        self.lanes.integrate(simd, self.roll);
    }
}

/// Rolls one log out for `L` sets of parameters; made once for a set of parameters, used for every window.
pub(crate) struct Lanes<'a, const L: usize> {
    system: &'a System,
    log: &'a Log,
    hold: Hold,
    past: Past,
    histories: Histories<'a, L>,
    /// How late each state is read, as [`LateState::amounts`](crate::model::LateState::amounts) has it.
    late: Vec<[[f64; 2]; L]>,
    rates: Vec<[f64; L]>,
    outputs: Vec<[f64; L]>,
    parameters: Vec<[f64; L]>,
    /// States that follow the inputs alone, as far as a rollout has asked for them.
    followed: Option<Followed<L>>,
    /// What may hold a state at rest, where anything does in any lane.
    slots: Option<Box<Slots<'a, L>>>,
}

/// A node of a trajectory, kept where an output is read late.
struct Node<const L: usize> {
    t: f64,
    x: Vec<[f64; L]>,
    /// Rates just after the node, and just before the next one: a held control jumps in between.
    dx: Vec<[f64; L]>,
    dx_end: Vec<[f64; L]>,
}

impl<'a, const L: usize> Lanes<'a, L> {
    /// `parameters`: all of the system's, one value a lane; those of all runs, of which the log may have its own.
    pub(crate) fn new(system: &'a System, log: &'a Log, (hold, past): (Hold, Past), parameters: &[[f64; L]]) -> Self {
        let parameters = &log.parameters(parameters)[..];
        let histories = Histories::new(system.inputs(), log, hold, parameters);
        let first = system.n_states() + system.n_controls() + histories.len();
        let mut rates = system.rates().registers::<L>();
        rates[first..first + parameters.len()].copy_from_slice(parameters);
        let mut outputs = system.outputs().registers::<L>();
        outputs[first..first + parameters.len()].copy_from_slice(parameters);
        let late = log.lateness(system, parameters);
        let slots = Slots::new(system, parameters).map(Box::new);
        let parameters = parameters.to_vec();
        Self { system, log, hold, past, histories, late, rates, outputs, parameters, followed: None, slots }
    }

    /// The states themselves at the samples `first..=last`; `receive(sample, state, values)`.
    pub(crate) fn roll_states(
        &mut self,
        span: (usize, usize),
        initial: &[[f64; L]],
        substeps: usize,
        mut receive: impl FnMut(usize, usize, [f64; L]),
    ) {
        self.walk(Roll { span, initial, substeps, columns: None, receive: &mut receive });
    }

    /// Measured outputs `columns` at the samples `first..=last`, from the states `initial` at `first`.
    ///
    /// `receive(sample, column, values)` is called for every sample and position in `columns`.
    pub(crate) fn roll(
        &mut self,
        span: (usize, usize),
        initial: &[[f64; L]],
        columns: &[usize],
        substeps: usize,
        mut receive: impl FnMut(usize, usize, [f64; L]),
    ) {
        self.walk(Roll { span, initial, substeps, columns: Some(columns), receive: &mut receive });
    }

    fn walk(&mut self, roll: Roll<'_, L>) {
        // The widest vector instructions of this processor; the bits are the same with any.
        pulp::Arch::new().dispatch(Walk { lanes: self, roll });
    }

    /// Integrates, and shows what is asked for at every sample.
    #[inline(always)]
    fn integrate<S: pulp::Simd>(&mut self, simd: S, roll: Roll<'_, L>) {
        let Roll { span: (first, last), initial, substeps, columns, receive } = roll;
        let log = self.log;
        let n = self.system.n_states();
        let mut x = initial.to_vec();
        self.follow(first, &mut x);
        self.histories.rewind(first);
        let mut sum = vec![[0.0; L]; n];
        let mut rate = vec![[0.0; L]; n];
        let mut stage = x.clone();
        let mut inputs: Vec<Stages<L>> = vec![[[0.0; L]; 3]; self.system.n_controls() + self.histories.len()];
        let mut nodes: Vec<Node<L>> = Vec::new();
        let keep = !self.late.is_empty();
        if let Some(mut slots) = self.slots.take() {
            let walk = Roll { span: (first, last), initial: &x, substeps, columns, receive };
            self.integrate_holding(simd, &mut slots, walk, &mut inputs);
            self.slots = Some(slots);
            return;
        }
        for sample in first..=last {
            let t = log.time[sample];
            let is_last = sample == last;
            let step = self.step_behind(sample) / substeps as f64;
            for part in 0..if is_last { 1 } else { substeps } {
                let a = t + step * part as f64;
                self.load_inputs(&mut inputs, sample, a, a + step);
                // Classical Runge-Kutta: how far each stage looks ahead, which input it reads, its weight in the sum.
                for (number, (ahead, input, weight)) in
                    [(0.0, 0, 1.0), (0.5, 1, 2.0), (0.5, 1, 2.0), (1.0, 2, 1.0)].into_iter().enumerate()
                {
                    let length = ahead * step;
                    let from = if number == 0 {
                        &x
                    } else {
                        sums::ahead(simd, &x, (&[length; L], &rate), &mut stage);
                        &stage
                    };
                    self.derivative(simd, a + length, from, &inputs, input, &mut rate);
                    if number == 0 {
                        if keep {
                            nodes.push(Node { t: a, x: x.clone(), dx: rate.clone(), dx_end: Vec::new() });
                        }
                        if part == 0 {
                            self.show(simd, columns, sample, t, &x, &inputs, &nodes, receive);
                        }
                        if is_last {
                            return;
                        }
                        sum.copy_from_slice(&rate);
                    } else {
                        sums::add(simd, &mut sum, &[weight; L], &rate);
                    }
                }
                if let Some(node) = nodes.last_mut() {
                    node.dx_end.clone_from(&rate);
                }
                sums::add(simd, &mut x, &[step / 6.0; L], &sum);
            }
        }
    }

    /// Hands out the states, or the measured outputs `columns`.
    // The innermost call of a rollout: a struct of its arguments would be made anew at every sample.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    fn show<S: pulp::Simd>(
        &mut self,
        simd: S,
        columns: Option<&[usize]>,
        sample: usize,
        t: f64,
        x: &[[f64; L]],
        inputs: &[Stages<L>],
        nodes: &[Node<L>],
        receive: &mut dyn FnMut(usize, usize, [f64; L]),
    ) {
        let Some(columns) = columns else {
            x.iter().enumerate().for_each(|(j, &value)| receive(sample, j, value));
            return;
        };
        self.measure(simd, t, x, inputs, nodes);
        for (place, &column) in columns.iter().enumerate() {
            receive(sample, place, self.system.outputs().output(&self.outputs, column));
        }
    }

    #[inline(always)]
    fn load_inputs(&mut self, inputs: &mut [Stages<L>], sample: usize, a: f64, b: f64) {
        let log = self.log;
        let m = self.system.n_controls();
        for (control, stages) in log.controls.iter().zip(inputs.iter_mut()) {
            let here = control[sample];
            *stages = match (self.hold, control.get(sample + 1)) {
                (Hold::Linear, Some(&next)) => {
                    let (t0, t1) = (log.time[sample], log.time[sample + 1]);
                    [a, 0.5 * (a + b), b].map(|t| [here + (next - here) * (t - t0) / (t1 - t0); L])
                }
                _ => [[here; L]; 3],
            };
        }
        self.histories.step(sample, a, b, &mut inputs[m..]);
    }

    /// Time from a sample of the log to the next, s; behind the last any.
    fn step_behind(&self, sample: usize) -> f64 {
        let time = &self.log.time;
        time.get(sample + 1).map_or(1.0, |next| next - time[sample])
    }

    #[inline(always)]
    fn derivative<S: pulp::Simd>(
        &mut self,
        simd: S,
        t: f64,
        x: &[[f64; L]],
        inputs: &[Stages<L>],
        stage: usize,
        dx: &mut [[f64; L]],
    ) {
        let n = x.len();
        self.rates[..n].copy_from_slice(x);
        for (register, stages) in self.rates[n..].iter_mut().zip(inputs) {
            *register = stages[stage];
        }
        self.rates[self.system.rates().n_variables()] = [t; L];
        self.system.evaluate(simd, self.system.rates(), &mut self.rates);
        for (j, rate) in dx.iter_mut().enumerate() {
            *rate = self.system.rates().output(&self.rates, j);
        }
    }

    #[inline(always)]
    fn measure<S: pulp::Simd>(&mut self, simd: S, t: f64, x: &[[f64; L]], inputs: &[Stages<L>], nodes: &[Node<L>]) {
        let n = x.len();
        self.outputs[..n].copy_from_slice(x);
        for (register, stages) in self.outputs[n..].iter_mut().zip(inputs) {
            *register = stages[0];
        }
        let n_variables = self.system.outputs().n_variables();
        // Before a window in the middle of a log the machine was moving in any case.
        let is_still = self.past == Past::Still && nodes.first().is_some_and(|node| node.t == self.log.time[0]);
        for (i, late) in self.system.late_states().iter().enumerate() {
            let place = n_variables - self.late.len() + i;
            let moment = |lane: usize| late.moment(t, self.late[i][lane]);
            self.outputs[place] = std::array::from_fn(|lane| state_at(nodes, late.state, lane, moment(lane), is_still));
        }
        self.outputs[n_variables] = [t; L];
        self.system.evaluate(simd, self.system.outputs(), &mut self.outputs);
    }
}

/// Cubic Hermite value of a state at time `t`; before the first node its value where it did not move, otherwise its tangent, and behind the last
/// one the tangent that led there.
///
/// A controller that was fed the reading of this moment has put its noise into the control that is held from now on. A reading that followed
/// that control would be predicted from its own noise (Ljung 1999, System Identification, section 13.4).
fn state_at<const L: usize>(nodes: &[Node<L>], state: usize, lane: usize, t: f64, is_still: bool) -> f64 {
    let after = nodes.partition_point(|node| node.t < t).max(1);
    let a = &nodes[after - 1];
    let (true, Some(b)) = (t > a.t, nodes.get(after)) else {
        if is_still && t <= a.t {
            return a.x[state][lane];
        }
        let led = if t > a.t { after.checked_sub(2).map(|before| &nodes[before].dx_end) } else { None };
        return a.x[state][lane] + led.unwrap_or(&a.dx)[state][lane] * (t - a.t);
    };
    let h = b.t - a.t;
    let s = (t - a.t) / h;
    let (x0, x1) = (a.x[state][lane], b.x[state][lane]);
    let (d0, d1) = (h * a.dx[state][lane], h * a.dx_end[state][lane]);
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * x0 + (s3 - 2.0 * s2 + s) * d0 + (3.0 * s2 - 2.0 * s3) * x1 + (s3 - s2) * d1
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
