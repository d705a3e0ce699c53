//! Signals along a path, and what they make of its states.

use super::{Along, L};
use crate::expression::Tape;
use crate::model::change::{Change, Entry};
use crate::model::{LateState, System};
use crate::refine::experiment::{Experiment, Past};
use crate::refine::history::{Histories, Stages};
use std::ops::Range;

/// Where along a path a tape is evaluated.
#[derive(Clone, Copy)]
pub(super) enum Moment {
    Middle,
    Sample,
}

impl Along {
    /// The inputs with a history of a change: one row each, in the middle of the steps and at the samples.
    pub(super) fn inputs(
        &self,
        experiment: &Experiment,
        history: &mut Histories<'_, 1>,
        count: usize,
    ) -> [Vec<Vec<f64>>; 2] {
        let mut rows = [vec![Vec::with_capacity(self.middle_time.len()); count], vec![Vec::new(); count]];
        if count == 0 {
            return rows;
        }
        let time = &experiment.logs[self.window.log].time;
        let mut stages: Vec<Stages<1>> = vec![[[0.0]; 3]; count];
        history.rewind(self.window.first);
        for (number, sample) in (self.window.first..=self.window.last).enumerate() {
            let is_last = sample == self.window.last;
            let whole = time.get(sample + 1).map_or(1.0, |next| next - time[sample]);
            let steps = self.steps_behind(number);
            let step = whole / steps.len().max(1) as f64;
            for part in 0..steps.len().max(1) {
                let (a, length) = match &self.stepped {
                    Some(stepped) if !is_last => {
                        (self.middle_time[steps.start + part], stepped.length(steps.start + part))
                    }
                    _ => (time[sample] + step * part as f64, step),
                };
                history.step(sample, a, a + length, &mut stages);
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

    /// The steps from a sample to the next; none behind the last.
    fn steps_behind(&self, sample: usize) -> Range<usize> {
        let first = self.before[sample];
        first..self.before.get(sample + 1).copied().unwrap_or(first)
    }

    /// The states that a change reads late, at every sample, one row each.
    pub(super) fn late(&self, experiment: &Experiment, change: &Change, parameters: &[f64]) -> Vec<Vec<f64>> {
        let lane: Vec<[f64; 1]> = parameters.iter().map(|&v| [v]).collect();
        let is_still = experiment.past == Past::Still && self.window.first == 0;
        let row = |late: &LateState| {
            let amounts = late.amounts(&lane)[0];
            let then = |(sample, &t): (usize, &f64)| {
                let moment = late.moment(t, amounts);
                let seen = self.state_at(late.state, moment.min(t), is_still);
                if moment > t { seen + (moment - t) * self.slope_before(late.state, sample) } else { seen }
            };
            self.sample_time.iter().enumerate().map(then).collect()
        };
        change.late.iter().map(row).collect()
    }

    /// Slope of a state just before a sample, which no control since has changed; behind the first one of a window the slope after it.
    fn slope_before(&self, state: usize, sample: usize) -> f64 {
        let (time, samples) = (&self.sample_time, &self.sample[state]);
        let to = sample.max(1);
        let Some(end) = samples.get(to) else { return 0.0 };
        let last = self.steps_behind(to - 1).last().filter(|_| to == sample);
        let step = |step: usize| (self.middle_time[step], self.middle[state][step]);
        let (t, begin) = last.map_or((time[to - 1], samples[to - 1]), step);
        if time[to] > t { (end - begin) / (time[to] - t) } else { 0.0 }
    }

    /// A state at a time within the window, on straight lines between samples and middles of steps; before the window its value where
    /// the machine did not move, otherwise its tangent.
    fn state_at(&self, state: usize, t: f64, is_still: bool) -> f64 {
        let (samples, middles) = (&self.sample[state], &self.middle[state]);
        let last = self.sample_time.len() - 1;
        let sample =
            self.sample_time.partition_point(|&other| other <= t).saturating_sub(1).min(last.saturating_sub(1));
        if middles.is_empty() || (is_still && t <= self.sample_time[0]) {
            return samples[0];
        }
        let steps = self.steps_behind(sample);
        let mut before = (self.sample_time[sample], samples[sample]);
        if t == before.0 {
            return before.1;
        }
        let nodes = steps.map(|step| (self.middle_time[step], middles[step]));
        for after in nodes.chain([(self.sample_time[sample + 1], samples[sample + 1])]) {
            // A simulator's first step begins with the sample, and where a log guides it at another state.
            let is_long = after.0 > before.0;
            if is_long && (t <= after.0 || after.0 == self.sample_time[sample + 1]) {
                return before.1 + (t - before.0) / (after.0 - before.0) * (after.1 - before.1);
            }
            before = after;
        }
        before.1
    }

    /// A difference from the path at a time within the window, on straight lines between samples; none before it.
    pub(super) fn moved_at(&self, n: usize, moved: &[[f64; L]], state: usize, lane: usize, t: f64) -> f64 {
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
    pub(super) fn signals(
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

    /// Differences from the path at every sample, state by state, that signals in `entries` make, and where a log guides the path also
    /// readings that are others by `shown` (column, and its values by sample); one lane for each set of both.
    pub(super) fn moved(
        &self,
        (system, n): (&System, usize),
        (entries, signals): (&[Entry], &mut [Vec<Vec<f64>>]),
        shown: (&[usize], &[Vec<Vec<f64>>]),
    ) -> Vec<[f64; L]> {
        if let Some(stepped) = &self.stepped {
            return stepped.moved(system, &self.before, (entries, signals), shown);
        }
        let row = |entry: &Entry| if let Entry::Rate(row) = entry { Some(*row) } else { None };
        let rows: Vec<usize> = entries.iter().filter_map(row).collect();
        pulp::Arch::new().dispatch(Moved { along: self, n, rows: &rows, signals })
    }
}

/// The recursion of differences from a path, compiled for every kind of vector instructions.
struct Moved<'s> {
    along: &'s Along,
    n: usize,
    rows: &'s [usize],
    signals: &'s [Vec<Vec<f64>>],
}

impl pulp::WithSimd for Moved<'_> {
    type Output = Vec<[f64; L]>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
        let Self { along, n, rows, signals } = self;
        let samples = along.sample_time.len();
        let mut moved = vec![[0.0; L]; samples * n];
        if rows.is_empty() {
            return moved;
        }
        let mut now = vec![[0.0; L]; n];
        let mut next = vec![[0.0; L]; n];
        let mut pushes = vec![[0.0; L]; rows.len()];
        let mut sample = 1;
        for step in 0..along.middle_time.len() {
            for (place, push) in pushes.iter_mut().enumerate() {
                for (lane, signals) in signals.iter().enumerate() {
                    push[lane] = signals[place][step];
                }
            }
            let (carried, pushed) = (&along.carried[step * n * n..][..n * n], &along.pushed[step * n * n..][..n * n]);
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
            if step + 1 == along.before[sample] {
                moved[sample * n..(sample + 1) * n].copy_from_slice(&now);
                sample += 1;
            }
        }
        moved
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
