//! The path of a fitted model, and how far small pushes along it move the readings.
//!
//! A suspect adds a signal to the rates. The signal is taken exactly, at the states of the path; the plant answers to it in a straight
//! line, `d' = A d + signal`, which is one recursion of small matrices for every suspect. So a plant is rolled out once for all of
//! them, and differentiated once.
//!
//! Where dry friction holds a state at rest, pushes on it are taken up by the friction.
//!
//! A signal enters an integration step by its value in the middle, where `A` is taken, too: both are right to the second order in the
//! step. Source: the variational equation, Hairer, Norsett and Wanner 1993, Solving Ordinary Differential Equations I, section I.14.

use super::Lanes;
use super::sticking::{self, Trial};
use crate::expression::Tape;
use crate::model::change::Change;
use crate::model::sticking::Slots;
use crate::model::{LateState, System};
use crate::refine::experiment::{Experiment, Past, Window};
use crate::refine::history::{Histories, Stages};
use std::sync::Arc;

/// Steps, or samples, or columns that are computed side by side.
const L: usize = 8;

/// Share of a state's typical size by which it is moved for a derivative: the root of the rounding error.
const DIFFERENCE: f64 = 1e-6;

/// Most numbers that the matrices of a path may take: 256 MB. Beyond that rollouts cost less than the memory.
const MOST: usize = 1 << 25;

/// The paths of all windows.
#[derive(Debug, Clone)]
pub(crate) struct Path {
    n: usize,
    windows: Vec<Arc<Along>>,
    /// How late each late state is read: the delay, or the period and phase, s.
    late: Vec<[f64; 2]>,
}

/// The path of one window: its integration steps and its samples.
#[derive(Debug, Clone)]
struct Along {
    window: Window,
    /// In the middle of every step: states and then controls, one row of values each; times, s.
    middle: Vec<Vec<f64>>,
    middle_time: Vec<f64>,
    /// The same at every sample.
    sample: Vec<Vec<f64>>,
    sample_time: Vec<f64>,
    /// Step by step: by how much a difference at its beginning, and a rate in its middle, move its end (n x n, row after row).
    carried: Vec<f64>,
    pushed: Vec<f64>,
    /// Sample by sample: derivatives of the logged readings (c x n); empty where all of them are states as they are.
    slopes: Vec<f64>,
}

/// What is made of a contestant's system along its windows.
struct Maker<'a> {
    system: &'a System,
    experiment: &'a Experiment,
    parameters: &'a [f64],
    /// What each logged column reads, where all read one state.
    read: Option<Vec<Read>>,
}

/// What a column reads.
#[derive(Debug, Clone, Copy)]
enum Read {
    /// A state as it is.
    Now(usize),
    /// A state that the system reads late: its number among these.
    Late(usize),
}

impl Path {
    /// The path of `system` from the `initial` states of every window; `None` where it has no such straight line: a simulator that
    /// steps, a function of a late reading, a rollout that diverges.
    pub(crate) fn new(
        system: &System,
        experiment: &Experiment,
        parameters: &[f64],
        initial: &[Vec<f64>],
    ) -> Option<Self> {
        let n = system.n_states();
        let read = read(system, experiment);
        if system.engine().is_some() || (read.is_none() && !system.late_states().is_empty()) {
            return None;
        }
        if 2 * n * n * experiment.n_samples() * experiment.substeps > MOST {
            return None;
        }
        let maker = Maker { system, experiment, parameters, read };
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let mut lanes: Option<(usize, Lanes<'_, 1>)> = None;
        let mut windows = Vec::with_capacity(experiment.windows.len());
        for (window, start) in experiment.windows.iter().zip(initial) {
            if lanes.as_ref().is_none_or(|(log, _)| *log != window.log) {
                let log = &experiment.logs[window.log];
                lanes = Some((window.log, Lanes::new(system, log, (experiment.hold, experiment.past), &lane)));
            }
            let (_, lanes) = lanes.as_mut()?;
            let made = pulp::Arch::new().dispatch(Making { maker: &maker, lanes, window: *window, start })?;
            windows.push(Arc::new(made));
        }
        let late = system.late_states().iter().map(|late| late.amounts(&lane)[0]).collect();
        Some(Self { n, windows, late })
    }

    /// The paths of some of the windows.
    pub(crate) fn of(&self, windows: impl Iterator<Item = usize>) -> Self {
        Self { windows: windows.map(|w| self.windows[w].clone()).collect(), ..self.clone() }
    }

    /// The responses of the logged readings, in their units, to a change of the model with each of several sets of `parameters` (those
    /// of the change's tapes): by set and window, sample by sample, columns beside each other.
    pub(crate) fn responses(
        &self,
        system: &System,
        experiment: &Experiment,
        change: &Change,
        parameters: &[Vec<f64>],
    ) -> Vec<Vec<Vec<f64>>> {
        let n_columns = experiment.columns.len();
        let read = read(system, experiment);
        let mut all: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(self.windows.len()); parameters.len()];
        for (number, sets) in parameters.chunks(L).enumerate() {
            let mut histories: Option<(usize, Vec<Histories<'_, 1>>)> = None;
            for along in &self.windows {
                let log = &experiment.logs[along.window.log];
                let of = |set: &Vec<f64>| {
                    let lane: Vec<[f64; 1]> = set.iter().map(|&v| [v]).collect();
                    Histories::<1>::new(&change.inputs, log, experiment.hold, &lane)
                };
                if histories.as_ref().is_none_or(|(index, _)| *index != along.window.log) {
                    histories = Some((along.window.log, sets.iter().map(of).collect()));
                }
                let Some((_, histories)) = histories.as_mut() else { continue };
                let mut signals = Vec::with_capacity(sets.len());
                let mut shown = Vec::with_capacity(sets.len());
                for (set, history) in sets.iter().zip(histories) {
                    let [middle, sample] = along.inputs(experiment, history, change.inputs.len());
                    signals.push(along.signals(system, &change.rates, set, (&middle, &[]), Moment::Middle));
                    let late = along.late(experiment, change, set);
                    shown.push(along.signals(system, &change.readings, set, (&sample, &late), Moment::Sample));
                }
                let place = |column: usize| change.shown.iter().position(|&j| j == experiment.columns[column]);
                let places: Vec<Option<usize>> = (0..n_columns).map(place).collect();
                let moved = along.moved(self.n, &change.rows, &signals, experiment.substeps);
                for (lane, shown) in shown.iter().enumerate() {
                    let mut values = self.read_out(system, along, read.as_deref(), &moved, lane);
                    for (row, value) in values.iter_mut().enumerate() {
                        if let Some(place) = places[row % n_columns] {
                            *value += shown[place][row / n_columns];
                        }
                    }
                    all[number * L + lane].push(values);
                }
            }
        }
        all
    }
}

impl Path {
    /// The responses of the logged readings, in their units, to pushes on the rates of some `rows`: by window, sample by sample.
    /// `push` gives the values of each row in the middles of a window's steps, of which it is told the times, s.
    pub(crate) fn pushed(
        &self,
        system: &System,
        experiment: &Experiment,
        rows: &[usize],
        push: &mut dyn FnMut(&[f64]) -> Vec<Vec<f64>>,
    ) -> Vec<Vec<f64>> {
        let read = read(system, experiment);
        let one = |along: &Arc<Along>| {
            let moved = along.moved(self.n, rows, &[push(&along.middle_time)], experiment.substeps);
            self.read_out(system, along, read.as_deref(), &moved, 0)
        };
        self.windows.iter().map(one).collect()
    }

    /// What one lane of differences from the path does to the readings.
    fn read_out(
        &self,
        system: &System,
        along: &Along,
        read: Option<&[Read]>,
        moved: &[[f64; L]],
        lane: usize,
    ) -> Vec<f64> {
        let samples = along.sample_time.len();
        let n_columns = read.map_or(along.slopes.len() / (samples * self.n).max(1), <[Read]>::len);
        let value = |row: usize| {
            let (i, c) = (row / n_columns, row % n_columns);
            match read.map(|read| read[c]) {
                Some(Read::Now(state)) => moved[i * self.n + state][lane],
                Some(Read::Late(number)) => {
                    let late = &system.late_states()[number];
                    along.moved_at(
                        self.n,
                        moved,
                        late.state,
                        lane,
                        late.moment(along.sample_time[i], self.late[number]),
                    )
                }
                None => {
                    let slopes = &along.slopes[row * self.n..][..self.n];
                    (0..self.n).map(|j| slopes[j] * moved[i * self.n + j][lane]).sum()
                }
            }
        };
        (0..samples * n_columns).map(value).collect()
    }
}

/// What each logged column reads, where all read one state.
fn read(system: &System, experiment: &Experiment) -> Option<Vec<Read>> {
    let n = system.n_states();
    let first = system.outputs().n_variables() - system.late_states().len();
    let of = |&c: &usize| match system.outputs().bare_variable(c)? {
        state if state < n => Some(Read::Now(state)),
        late if late >= first => Some(Read::Late(late - first)),
        _ => None,
    };
    experiment.columns.iter().map(of).collect()
}

/// Where along a path a tape is evaluated.
#[derive(Clone, Copy)]
enum Moment {
    Middle,
    Sample,
}

impl Along {
    /// The inputs with a history of a change: one row each, in the middle of the steps and at the samples.
    fn inputs(&self, experiment: &Experiment, history: &mut Histories<'_, 1>, count: usize) -> [Vec<Vec<f64>>; 2] {
        let mut rows = [vec![Vec::with_capacity(self.middle_time.len()); count], vec![Vec::new(); count]];
        if count == 0 {
            return rows;
        }
        let time = &experiment.logs[self.window.log].time;
        let mut stages: Vec<Stages<1>> = vec![[[0.0]; 3]; count];
        history.rewind(self.window.first);
        for sample in self.window.first..=self.window.last {
            let is_last = sample == self.window.last;
            let whole = time.get(sample + 1).map_or(1.0, |next| next - time[sample]);
            let step = whole / experiment.substeps as f64;
            for part in 0..if is_last { 1 } else { experiment.substeps } {
                let a = time[sample] + step * part as f64;
                history.step(sample, a, a + step, &mut stages);
                for (k, stage) in stages.iter().enumerate() {
                    if part == 0 {
                        rows[1][k].push(stage[0][0]);
                    }
                    if !is_last {
                        rows[0][k].push(stage[1][0]);
                    }
                }
            }
        }
        rows
    }

    /// The states that a change reads late, at every sample, one row each.
    fn late(&self, experiment: &Experiment, change: &Change, parameters: &[f64]) -> Vec<Vec<f64>> {
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let is_still = experiment.past == Past::Still && self.window.first == 0;
        let row = |late: &LateState| {
            let amounts = late.amounts(&lane)[0];
            let then = |t: &f64| self.state_at(late.state, late.moment(*t, amounts), experiment.substeps, is_still);
            self.sample_time.iter().map(then).collect()
        };
        change.late.iter().map(row).collect()
    }

    /// A state at a time within the window, on straight lines between samples and middles of steps; before the window its value where
    /// the machine stood still, else its tangent.
    fn state_at(&self, state: usize, t: f64, substeps: usize, is_still: bool) -> f64 {
        let (samples, middles) = (&self.sample[state], &self.middle[state]);
        let last = self.sample_time.len() - 1;
        let sample =
            self.sample_time.partition_point(|&other| other <= t).saturating_sub(1).min(last.saturating_sub(1));
        if middles.is_empty() || (is_still && t <= self.sample_time[0]) {
            return samples[0];
        }
        let steps = sample * substeps..(sample + 1) * substeps;
        let mut before = (self.sample_time[sample], samples[sample]);
        let nodes = steps.map(|step| (self.middle_time[step], middles[step]));
        for after in nodes.chain([(self.sample_time[sample + 1], samples[sample + 1])]) {
            if t <= after.0 || after.0 == self.sample_time[sample + 1] {
                return before.1 + (t - before.0) / (after.0 - before.0) * (after.1 - before.1);
            }
            before = after;
        }
        before.1
    }

    /// A difference from the path at a time within the window, on straight lines between samples; none before it.
    fn moved_at(&self, n: usize, moved: &[[f64; L]], state: usize, lane: usize, t: f64) -> f64 {
        let after = self.sample_time.partition_point(|&other| other <= t);
        let at = |sample: usize| moved[sample * n + state][lane];
        match after {
            0 => 0.0,
            after if after < self.sample_time.len() => {
                let (from, to) = (self.sample_time[after - 1], self.sample_time[after]);
                at(after - 1) + (t - from) / (to - from) * (at(after) - at(after - 1))
            }
            after => at(after - 1),
        }
    }

    /// The results of a tape along the path, one row each; `inputs` have a history, then come the states that are read late.
    fn signals(
        &self,
        system: &System,
        tape: &Tape,
        parameters: &[f64],
        (inputs, late): (&[Vec<f64>], &[Vec<f64>]),
        moment: Moment,
    ) -> Vec<Vec<f64>> {
        if tape.n_outputs() == 0 {
            return Vec::new();
        }
        pulp::Arch::new().dispatch(Signals { along: self, system, tape, parameters, inputs, late, moment })
    }

    /// Differences from the path at every sample, state by state, that signals in `rows` make; one lane for each set of signals.
    fn moved(&self, n: usize, rows: &[usize], signals: &[Vec<Vec<f64>>], substeps: usize) -> Vec<[f64; L]> {
        let samples = self.sample_time.len();
        let mut moved = vec![[0.0; L]; samples * n];
        if rows.is_empty() {
            return moved;
        }
        let mut now = vec![[0.0; L]; n];
        let mut next = vec![[0.0; L]; n];
        let mut pushes = vec![[0.0; L]; rows.len()];
        for step in 0..self.middle_time.len() {
            for (place, push) in pushes.iter_mut().enumerate() {
                for (lane, signals) in signals.iter().enumerate() {
                    push[lane] = signals[place][step];
                }
            }
            let (carried, pushed) = (&self.carried[step * n * n..][..n * n], &self.pushed[step * n * n..][..n * n]);
            for j in 0..n {
                let mut sum = [0.0; L];
                for (i, now) in now.iter().enumerate() {
                    let by = carried[j * n + i];
                    for lane in 0..L {
                        sum[lane] += by * now[lane];
                    }
                }
                for (push, &row) in pushes.iter().zip(rows) {
                    let by = pushed[j * n + row];
                    for lane in 0..L {
                        sum[lane] += by * push[lane];
                    }
                }
                next[j] = sum;
            }
            std::mem::swap(&mut now, &mut next);
            if (step + 1).is_multiple_of(substeps) {
                let sample = (step + 1) / substeps;
                moved[sample * n..(sample + 1) * n].copy_from_slice(&now);
            }
        }
        moved
    }
}

/// One window's path, compiled for every kind of vector instructions.
struct Making<'m, 'a, 'l> {
    maker: &'m Maker<'m>,
    lanes: &'l mut Lanes<'a, 1>,
    window: Window,
    start: &'m [f64],
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
        let Maker { system, experiment, parameters, read } = maker;
        let log = &experiment.logs[window.log];
        let (n, m) = (system.n_states(), system.n_controls());
        let (samples, substeps) = (window.last - window.first + 1, experiment.substeps);
        let steps = (samples - 1) * substeps;
        let mut along = Along {
            window,
            middle: vec![Vec::with_capacity(steps); n + m],
            middle_time: Vec::with_capacity(steps),
            sample: vec![Vec::with_capacity(samples); n + m],
            sample_time: log.time[window.first..=window.last].to_vec(),
            carried: Vec::with_capacity(steps * n * n),
            pushed: Vec::with_capacity(steps * n * n),
            slopes: Vec::new(),
        };
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
struct Differences<'a> {
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
    fn new(system: &'a System, tape: &'a Tape, parameters: &[f64], scale: &[f64]) -> Self {
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
    fn at<S: pulp::Simd>(&mut self, simd: S, t: f64, x: &[[f64; 1]], inputs: impl Iterator<Item = f64>) {
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
    fn slope(&self, i: usize, j: usize) -> f64 {
        let found = &self.results[j / (L - 1)][i];
        (found[1 + j % (L - 1)] - found[0]) / self.scale[j]
    }
}

/// The results of a tape along a path, compiled for every kind of vector instructions.
struct Signals<'s> {
    along: &'s Along,
    system: &'s System,
    tape: &'s Tape,
    parameters: &'s [f64],
    inputs: &'s [Vec<f64>],
    late: &'s [Vec<f64>],
    moment: Moment,
}

impl pulp::WithSimd for Signals<'_> {
    type Output = Vec<Vec<f64>>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> Self::Output {
        let Self { along, system, tape, parameters, inputs, late, moment } = self;
        let (rows, time) = match moment {
            Moment::Middle => (&along.middle, &along.middle_time),
            Moment::Sample => (&along.sample, &along.sample_time),
        };
        let mut registers = tape.registers::<L>();
        let first = rows.len() + inputs.len();
        for (register, &value) in registers[first..].iter_mut().zip(parameters) {
            *register = [value; L];
        }
        // Only what the tape reads is loaded.
        let clock = tape.n_variables();
        let behind = late.iter().enumerate().map(|(i, values)| (clock - late.len() + i, values));
        let all = rows.iter().chain(inputs).enumerate().chain(behind);
        let read: Vec<(usize, &Vec<f64>)> = all.filter(|(variable, _)| tape.reads(*variable)).collect();
        let count = time.len();
        let mut results = vec![Vec::with_capacity(count + L); tape.n_outputs()];
        for from in (0..count).step_by(L) {
            // The last block is filled up with its last moment.
            let lane = |values: &[f64]| -> [f64; L] {
                match values[from..].first_chunk::<L>() {
                    Some(whole) => *whole,
                    None => std::array::from_fn(|lane| values[(from + lane).min(count - 1)]),
                }
            };
            for (variable, values) in &read {
                registers[*variable] = lane(values);
            }
            registers[clock] = lane(time);
            system.evaluate(simd, tape, &mut registers);
            for (i, result) in results.iter_mut().enumerate() {
                result.extend_from_slice(&tape.output(&registers, i));
            }
        }
        results.iter_mut().for_each(|result| result.truncate(count));
        results
    }
}
