//! A path is made: one window rolled out, and its plant differentiated in the middle of every step.

use super::{Along, L, Read};
use crate::expression::Tape;
use crate::model::System;
use crate::model::sticking::Slots;
use crate::refine::experiment::{Experiment, Window};
use crate::refine::history::Stages;
use crate::refine::lanes::Lanes;
use crate::refine::lanes::sticking::{self, Trial};

/// Share of a state's typical size by which it is moved for a derivative: the root of the rounding error.
const DIFFERENCE: f64 = 1e-6;

/// What is made of a contestant's system along its windows.
pub(super) struct Maker<'a> {
    pub(super) system: &'a System,
    pub(super) experiment: &'a Experiment,
    /// What each logged column reads, where all read one state.
    pub(super) read: Option<Vec<Read>>,
}

/// One window's path, compiled for every kind of vector instructions.
pub(super) struct Making<'m, 'a, 'l> {
    pub(super) maker: &'m Maker<'m>,
    pub(super) lanes: &'l mut Lanes<'a, 1>,
    pub(super) window: Window,
    pub(super) start: &'m [f64],
}

impl pulp::WithSimd for Making<'_, '_, '_> {
    type Output = Option<Along>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Option<Along> {
        self.make(simd)
    }
}

impl Making<'_, '_, '_> {
    #[inline(always)]
    fn make<S: pulp::Simd>(self, simd: S) -> Option<Along> {
        let Self { maker, lanes, window, start } = self;
        let Maker { system, experiment, read } = maker;
        let log = &experiment.logs[window.log];
        let (n, m) = (system.n_states(), system.n_controls());
        let (samples, substeps) = (window.last - window.first + 1, experiment.substeps);
        let steps = (samples - 1) * substeps;
        let mut along = Along {
            window,
            before: (0..samples).map(|sample| sample * substeps).collect(),
            middle: vec![Vec::with_capacity(steps); n + m],
            middle_time: Vec::with_capacity(steps),
            sample: vec![Vec::with_capacity(samples); n + m],
            sample_time: log.time[window.first..=window.last].to_vec(),
            carried: Vec::with_capacity(steps * n * n),
            pushed: Vec::with_capacity(steps * n * n),
            slopes: Vec::new(),
            stepped: None,
        };
        let parameters = &lanes.parameters.iter().map(|value| value[0]).collect::<Vec<f64>>()[..];
        let mut differences = Differences::new(system, system.rates(), parameters, &experiment.scale);
        differences.slots = Slots::new(system, &parameters.iter().map(|&v| [v; L]).collect::<Vec<_>>());
        let mut shown = Differences::new(system, system.outputs(), parameters, &experiment.scale);
        let mut x: Vec<[f64; 1]> = start.iter().map(|&v| [v]).collect();
        lanes.follow(window.first, &mut x);
        lanes.histories.rewind(window.first);
        let mut inputs: Vec<Stages<1>> = vec![[[0.0]; 3]; m + lanes.histories.len()];
        let mut rates = vec![vec![[0.0]; n]; 4];
        let mut stage = x.clone();
        let mut slots = lanes.slots.take();
        let mut trial = slots.as_ref().map(|slots| Trial::new(slots, n));
        for sample in window.first..=window.last {
            let step = lanes.step_behind(sample) / substeps as f64;
            let is_last = sample == window.last;
            for part in 0..if is_last { 1 } else { substeps } {
                let a = log.time[sample] + step * part as f64;
                lanes.load_inputs(&mut inputs, sample, a, a + step);
                if part == 0 {
                    for (row, value) in
                        along.sample.iter_mut().zip(x.iter().map(|x| x[0]).chain(inputs[..m].iter().map(|u| u[0][0])))
                    {
                        row.push(value);
                    }
                    if read.is_none() {
                        let first = inputs.iter().map(|stages| stages[0][0]);
                        shown.at(simd, a, &x, first);
                        for &column in &experiment.columns {
                            along.slopes.extend((0..n).map(|j| shown.slope(column, j)));
                        }
                    }
                    if is_last {
                        break;
                    }
                }
                let before = x.clone();
                if let (Some(slots), Some(trial)) = (&mut slots, &mut trial) {
                    sticking::step(simd, slots, (a, step), &mut x, &inputs, trial);
                    for j in 0..n {
                        stage[j][0] = 0.5 * (before[j][0] + x[j][0]);
                    }
                } else {
                    // Classical Runge-Kutta.
                    lanes.derivative(simd, a, &x, &inputs, 0, &mut rates[0]);
                    for (number, ahead, input) in [(1, 0.5, 1), (2, 0.5, 1), (3, 1.0, 2)] {
                        for j in 0..n {
                            stage[j][0] = x[j][0] + ahead * step * rates[number - 1][j][0];
                        }
                        let (_, after) = rates.split_at_mut(number);
                        lanes.derivative(simd, a + ahead * step, &stage, &inputs, input, &mut after[0]);
                    }
                    for j in 0..n {
                        let [first, second, third, last] = std::array::from_fn(|number| rates[number][j][0]);
                        x[j][0] += step / 6.0 * (first + 2.0 * second + 2.0 * third + last);
                        // Hermite's cubic through both ends.
                        stage[j][0] = 0.5 * (before[j][0] + x[j][0]) + step / 8.0 * (first - last);
                    }
                }
                let values = stage.iter().map(|x| x[0]).chain(inputs[..m].iter().map(|u| u[1][0]));
                along.middle.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
                along.middle_time.push(a + 0.5 * step);
                differences.at(simd, a + 0.5 * step, &stage, inputs.iter().map(|stages| stages[1][0]));
                let slope = |i: usize| step * differences.slope(i / n, i % n);
                propagate(n, step, &(0..n * n).map(slope).collect::<Vec<_>>(), &mut along.carried, &mut along.pushed);
                differences.hold(n, &mut along.carried, &mut along.pushed);
                for (j, (before, after)) in before.iter().zip(&x).enumerate() {
                    if before[0] * after[0] < 0.0 {
                        let middle = inputs.iter().map(|stages| stages[1][0]);
                        differences.cross(simd, a + 0.5 * step, (&stage, middle), (j, after[0]), &mut along);
                    }
                }
            }
        }
        lanes.slots = slots;
        let is_finite = |values: &Vec<f64>| values.iter().all(|v| v.is_finite());
        let matrices = [&along.carried, &along.pushed, &along.slopes];
        if matrices.into_iter().chain(&along.sample).all(is_finite) { Some(along) } else { None }
    }
}

/// Appends the exponential of `a` (n x n, rates times the step `h`) and `h` times its mean over the step, each to the order of the
/// Runge-Kutta step.
fn propagate(n: usize, h: f64, a: &[f64], carried: &mut Vec<f64>, pushed: &mut Vec<f64>) {
    let first = carried.len();
    let unit = |i: usize| if i / n == i % n { 1.0 } else { 0.0 };
    carried.extend((0..n * n).map(unit));
    pushed.extend((0..n * n).map(|i| h * unit(i)));
    let mut power: Vec<f64> = (0..n * n).map(unit).collect();
    for order in 1..=4u32 {
        let mut next = vec![0.0; n * n];
        for i in 0..n {
            for k in 0..n {
                let by = power[i * n + k] / f64::from(order);
                for j in 0..n {
                    next[i * n + j] += by * a[k * n + j];
                }
            }
        }
        power = next;
        for (i, value) in power.iter().enumerate() {
            carried[first + i] += value;
            if order < 4 {
                pushed[first + i] += h * value / f64::from(order + 1);
            }
        }
    }
}

/// Derivatives of a tape's results by the states, at one point after another.
pub(super) struct Differences<'a> {
    system: &'a System,
    tape: &'a Tape,
    scale: Vec<f64>,
    registers: Vec<[f64; L]>,
    /// One set of results for every seven states.
    results: Vec<Vec<[f64; L]>>,
    /// What may hold a state at rest, the states that it holds, and how pushes on them are taken up.
    slots: Option<Slots<'a, L>>,
    held: Vec<usize>,
    yielding: Vec<f64>,
}

impl<'a> Differences<'a> {
    pub(super) fn new(system: &'a System, tape: &'a Tape, parameters: &[f64], scale: &[f64]) -> Self {
        let n = system.n_states();
        let first = n + system.n_controls() + system.inputs().len();
        let mut registers = tape.registers::<L>();
        for (register, &value) in registers[first..].iter_mut().zip(parameters) {
            *register = [value; L];
        }
        let scale = (0..n).map(|j| DIFFERENCE * scale.get(j).copied().unwrap_or(1.0)).collect();
        let results = vec![Vec::new(); n.div_ceil(L - 1)];
        Self { system, tape, scale, registers, results, slots: None, held: Vec::new(), yielding: Vec::new() }
    }

    #[inline(always)]
    pub(super) fn at<S: pulp::Simd>(&mut self, simd: S, t: f64, x: &[[f64; 1]], inputs: impl Iterator<Item = f64>) {
        let n = x.len();
        if let Some(slots) = &mut self.slots {
            let inputs: Vec<[f64; L]> = inputs.map(|value| [value; L]).collect();
            let mut states: Vec<[f64; L]> = x.iter().map(|x| [x[0]; L]).collect();
            let mut rates = vec![[0.0; L]; n];
            slots.open();
            slots.rates(simd, [t; L], &states, inputs.iter().copied(), true, &mut rates);
            self.held.clear();
            self.held.extend(slots.held(0));
            self.yielding = if self.held.is_empty() { Vec::new() } else { slots.yielding(0) };
            for (chunk, results) in self.results.iter_mut().enumerate() {
                for (j, (state, x)) in states.iter_mut().zip(x).enumerate() {
                    *state = [x[0]; L];
                    if j / (L - 1) == chunk && !self.held.contains(&j) {
                        state[1 + j % (L - 1)] += self.scale[j];
                    }
                }
                // In the modes of the point itself.
                slots.rates(simd, [t; L], &states, inputs.iter().copied(), false, &mut rates);
                results.clone_from(&rates);
            }
            return;
        }
        for (register, value) in self.registers[n..].iter_mut().zip(inputs) {
            *register = [value; L];
        }
        self.registers[self.tape.n_variables()] = [t; L];
        for (chunk, results) in self.results.iter_mut().enumerate() {
            for (j, x) in x.iter().enumerate() {
                self.registers[j] = [x[0]; L];
                if j / (L - 1) == chunk {
                    self.registers[j][1 + j % (L - 1)] += self.scale[j];
                }
            }
            self.system.evaluate(simd, self.tape, &mut self.registers);
            results.clear();
            results.extend((0..self.tape.n_outputs()).map(|i| self.tape.output(&self.registers, i)));
        }
    }

    /// The matrices of the last step, where state `j` goes through zero to the side of `after` and its dry friction turns around: a
    /// difference that comes to zero earlier or later has the other rate for longer.
    ///
    /// Source: the saltation matrix, Leine and Nijmeijer 2004, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, section 7.
    #[inline(always)]
    fn cross<S: pulp::Simd>(
        &mut self,
        simd: S,
        t: f64,
        (x, inputs): (&[[f64; 1]], impl Iterator<Item = f64>),
        (j, after): (usize, f64),
        along: &mut Along,
    ) {
        let n = x.len();
        let Some(slots) = &mut self.slots else { return };
        if !(0..slots.count()).any(|slot| slots.state(slot) == j) {
            return;
        }
        // Just before it in the first lane, just behind it in all others.
        let mut states: Vec<[f64; L]> = x.iter().map(|x| [x[0]; L]).collect();
        let near = (1e-3 * self.scale[j]).copysign(after);
        states[j] = std::array::from_fn(|lane| if lane == 0 { -near } else { near });
        let mut rates = vec![[0.0; L]; n];
        slots.open();
        slots.rates(simd, [t; L], &states, inputs.map(|value| [value; L]), true, &mut rates);
        if rates[j][0] == 0.0 {
            return;
        }
        for matrices in [&mut along.carried, &mut along.pushed] {
            let from = matrices.len() - n * n;
            let own = &mut matrices[from..];
            let row: Vec<f64> = own[j * n..(j + 1) * n].to_vec();
            for (i, rate) in rates.iter().enumerate() {
                let jump = (rate[1] - rate[0]) / rates[j][0];
                own[i * n..(i + 1) * n].iter_mut().zip(&row).for_each(|(value, row)| *value += jump * row);
            }
        }
    }

    /// The matrices of the last step, appended last, where states are held at rest.
    fn hold(&self, n: usize, carried: &mut [f64], pushed: &mut [f64]) {
        if self.held.is_empty() {
            return;
        }
        let (carried_from, pushed_from) = (carried.len() - n * n, pushed.len() - n * n);
        let (carried, pushed) = (&mut carried[carried_from..], &mut pushed[pushed_from..]);
        let before = pushed.to_vec();
        for i in 0..n * n {
            pushed[i] = (0..n).map(|k| before[i / n * n + k] * self.yielding[k * n + i % n]).sum();
        }
        for &state in &self.held {
            carried[state * n..(state + 1) * n].fill(0.0);
            pushed[state * n..(state + 1) * n].fill(0.0);
        }
    }

    /// Of result `i` by state `j`.
    pub(super) fn slope(&self, i: usize, j: usize) -> f64 {
        let found = &self.results[j / (L - 1)][i];
        (found[1 + j % (L - 1)] - found[0]) / self.scale[j]
    }
}
