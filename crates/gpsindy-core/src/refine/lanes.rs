//! Rollouts of several lanes at once with a fixed step: what a fit needs, and fast.
//!
//! A lane is one set of parameters and initial states. Classical Runge-Kutta of order 4; a held
//! control enters by its mean over the step, so that outputs are smooth in a delay.

pub(crate) mod lockstep;
mod sticking;
pub(crate) mod tangent;

use super::experiment::{Log, Past};
use super::history::{History, Stages, histories};
use crate::data::Hold;
use crate::model::sticking::Slots;
use crate::model::{Follower, System};

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
    histories: Vec<History<L>>,
    /// How late each state is read: the delay, or the period and phase, s.
    late: Vec<[[f64; 2]; L]>,
    rates: Vec<[f64; L]>,
    outputs: Vec<[f64; L]>,
    parameters: Vec<[f64; L]>,
    /// States that follow the inputs alone, at every sample of the log; computed when first wanted.
    followed: Option<Vec<(usize, Vec<[f64; L]>)>>,
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
    /// `parameters`: all of the system's, one value a lane.
    pub(crate) fn new(system: &'a System, log: &'a Log, (hold, past): (Hold, Past), parameters: &[[f64; L]]) -> Self {
        let histories = histories(system, log, hold, parameters);
        let first = system.n_states() + system.n_controls() + histories.len();
        let mut rates = system.rates().registers::<L>();
        rates[first..first + parameters.len()].copy_from_slice(parameters);
        let mut outputs = system.outputs().registers::<L>();
        outputs[first..first + parameters.len()].copy_from_slice(parameters);
        let late = system
            .late_states()
            .iter()
            .map(|late| {
                let mut registers = late.amounts.registers::<L>();
                registers[..parameters.len()].copy_from_slice(parameters);
                late.amounts.evaluate(&mut registers);
                let last = late.amounts.n_outputs() - 1;
                let (amount, phase) = (late.amounts.output(&registers, 0), late.amounts.output(&registers, last));
                std::array::from_fn(|lane| [amount[lane], phase[lane]])
            })
            .collect();
        let slots = Slots::new(system, parameters).map(Box::new);
        let parameters = parameters.to_vec();
        Self { system, log, hold, past, histories, late, rates, outputs, parameters, followed: None, slots }
    }

    /// States that follow the inputs alone, at every sample: settled at the first or as the model has it, then exact for a constant input
    /// over a step where the rate is a straight line in the state; else in short steps of one such line each, from the
    /// control that leaves it most at rest.
    fn follow(&mut self) -> Vec<(usize, Vec<[f64; L]>)> {
        let (time, n, m) = (&self.log.time, self.system.n_states(), self.system.n_controls());
        let mut all = Vec::new();
        for Follower { state, rate: tape, is_linear } in self.system.followers() {
            let mut registers = tape.registers::<L>();
            let first = n + m + self.histories.len();
            registers[first..first + self.parameters.len()].copy_from_slice(&self.parameters);
            self.histories.iter_mut().for_each(|h| h.rewind(time, time[0], self.hold));
            let model = self.system.model();
            let given = model.initial.get(&model.states[*state].name).copied();
            let mut path: Vec<[f64; L]> = Vec::with_capacity(time.len());
            for k in 0..time.len() - 1 {
                let (a, b) = (time[k], time[k + 1]);
                for (register, control) in registers[n..].iter_mut().zip(&self.log.controls) {
                    let end = if self.hold == Hold::Linear { control[k + 1] } else { control[k] };
                    *register = [0.5 * (control[k] + end); L];
                }
                for (register, history) in registers[n + m..].iter_mut().zip(&mut self.histories) {
                    *register = history.step(time, k, a, b, self.hold)[1];
                }
                registers[tape.n_variables()] = [0.5 * (a + b); L];
                let mut rate = |value: [f64; L]| {
                    registers[*state] = value;
                    tape.evaluate(&mut registers);
                    tape.output(&registers, 0)
                };
                if !is_linear {
                    if path.is_empty() {
                        let starts = self.log.controls.iter().map(|c| c[0]);
                        path.push([most_at_rest(starts, |value| rate([value; L])[0]); L]);
                    }
                    path.push(crept(path[k], b - a, rate));
                    continue;
                }
                let (at_zero, at_one) = (rate([0.0; L]), rate([1.0; L]));
                let settled: [f64; L] = std::array::from_fn(|lane| at_zero[lane] / (at_zero[lane] - at_one[lane]));
                let now = *path.last().unwrap_or(&given.map_or(settled, |value| [value; L]));
                if path.is_empty() {
                    path.push(now);
                }
                path.push(std::array::from_fn(|lane| {
                    let kept = ((at_one[lane] - at_zero[lane]) * (b - a)).exp();
                    settled[lane] + kept * (now[lane] - settled[lane])
                }));
            }
            all.push((*state, path));
        }
        all
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
        if first > 0 && self.followed.is_none() && !self.system.followers().is_empty() {
            self.followed = Some(self.follow());
        }
        for history in &mut self.histories {
            history.rewind(&log.time, log.time[first], self.hold);
        }
        let mut x = initial.to_vec();
        // What follows the inputs has its past in the log, where there is one.
        for (state, path) in self.followed.iter().flatten().filter(|_| first > 0) {
            x[*state] = path[first];
        }
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
            let step = if is_last { 1.0 } else { (log.time[sample + 1] - t) / substeps as f64 };
            for part in 0..if is_last { 1 } else { substeps } {
                let a = t + step * part as f64;
                self.load_inputs(&mut inputs, sample, a, a + step);
                // Classical Runge-Kutta: how far each stage looks ahead, which input it reads, its weight in the sum.
                for (number, (ahead, input, weight)) in
                    [(0.0, 0, 1.0), (0.5, 1, 2.0), (0.5, 1, 2.0), (1.0, 2, 1.0)].into_iter().enumerate()
                {
                    let length = ahead * step;
                    for j in 0..n {
                        for lane in 0..L {
                            stage[j][lane] = x[j][lane] + length * rate[j][lane];
                        }
                    }
                    let from = if number == 0 { &x } else { &stage };
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
                        for j in 0..n {
                            for lane in 0..L {
                                sum[j][lane] += weight * rate[j][lane];
                            }
                        }
                    }
                }
                if let Some(node) = nodes.last_mut() {
                    node.dx_end.clone_from(&rate);
                }
                for j in 0..n {
                    for lane in 0..L {
                        x[j][lane] += step / 6.0 * sum[j][lane];
                    }
                }
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
        for (history, stages) in self.histories.iter_mut().zip(&mut inputs[m..]) {
            *stages = history.step(&log.time, sample, a, b, self.hold);
        }
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

/// Of several values the one with the slowest rate.
fn most_at_rest(values: impl Iterator<Item = f64>, mut rate: impl FnMut(f64) -> f64) -> f64 {
    let rated = values.map(|value| (rate(value).abs(), value));
    rated.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, value)| value)
}

/// A state after `time`, in short steps each of which is exact for the straight line through its rate.
fn crept<const L: usize>(start: [f64; L], time: f64, mut rate: impl FnMut([f64; L]) -> [f64; L]) -> [f64; L] {
    /// Enough for a state that stops where its rate turns from a constant to a decay.
    const STEPS: usize = 8;
    let h = time / STEPS as f64;
    (0..STEPS).fold(start, |now, _| {
        let here = rate(now);
        // As far as an Euler step would go, so that the line sees where the rate ends.
        let ahead = rate(std::array::from_fn(|lane| now[lane] + h * here[lane]));
        std::array::from_fn(|lane| {
            let moved = h * here[lane];
            let slope = if moved == 0.0 { 0.0 } else { (ahead[lane] - here[lane]) / moved };
            let grown = if (slope * h).abs() < 1e-9 { 1.0 } else { (slope * h).exp_m1() / (slope * h) };
            now[lane] + grown * moved
        })
    })
}

/// Cubic Hermite value of a state at time `t`; before the first node its value where it stood still, else its tangent.
fn state_at<const L: usize>(nodes: &[Node<L>], state: usize, lane: usize, t: f64, is_still: bool) -> f64 {
    let after = nodes.partition_point(|node| node.t < t).max(1);
    let a = &nodes[after - 1];
    let (true, Some(b)) = (t > a.t, nodes.get(after)) else {
        if is_still && t <= a.t {
            return a.x[state][lane];
        }
        return a.x[state][lane] + a.dx[state][lane] * (t - a.t);
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
