//! Inputs with a history: delays, play, rate limits, sample-and-hold.
//!
//! They depend on the controls alone. Of a log no more is sampled at a time than a block and what that looks back on. A late
//! input that is held enters a step by its mean, which is smooth in the delay, and so does one that switches within a step.

mod held;

use super::experiment::Log;
use crate::data::Hold;
use crate::model::{Input, InputKind, caught_after, slewed};
use held::Held;
use std::ops::Range;

/// Samples that are taken at first, and at most at a time: twice as many each time, so that a short rollout samples little more
/// than it reads, and along a long one what is looked back on costs little.
const BLOCKS: (usize, usize) = (64, 4096);

/// Values of an input at the start, middle and end of a step.
pub(super) type Stages<const L: usize> = [[f64; L]; 3];

/// Every input with a history of a system, for every lane, over the part of a log that is being rolled out.
pub(super) struct Histories<'a, const L: usize> {
    log: &'a Log,
    all: Vec<History<'a, L>>,
    /// The samples of the log that are kept, and those among them behind which a step finds all that it reads.
    kept: Range<usize>,
    ready: Range<usize>,
    /// How many samples are taken next.
    block: usize,
    /// How far all of them together look back, s, and whether one looks ahead.
    back: f64,
    is_ahead: bool,
}

/// An input with a history, for every lane; its samples are counted from the first that is kept.
struct History<'a, const L: usize> {
    input: &'a Input,
    /// Controls, earlier inputs and parameters, for the input's tape.
    registers: Vec<[f64; L]>,
    /// Value at each sample, and how much later than its time stamp it acts, s.
    values: Vec<[f64; L]>,
    shift: [f64; L],
    /// Integral of the held signal up to each sample.
    integral: Vec<[f64; L]>,
    /// Last sample at or before the current time, one a lane.
    cursor: [usize; L],
    /// Integral up to the start of the current step.
    started: [f64; L],
    /// What a sample-and-hold has sampled, one a lane; empty for other inputs.
    held: Vec<Held>,
    /// What a rate-limited signal follows at each sample, and how fast it may, one a lane; empty for other inputs.
    followed: Vec<[f64; L]>,
    rate: [f64; L],
    /// By how much it is more than that as the log begins.
    begun: f64,
    /// What the signal does between samples: what follows a held signal at a limited rate does not hold.
    hold: Hold,
}

impl<'a, const L: usize> Histories<'a, L> {
    /// Nothing is sampled yet. `parameters`: all of the inputs', one value a lane.
    pub(super) fn new(inputs: &'a [Input], log: &'a Log, hold: Hold, parameters: &[[f64; L]]) -> Self {
        let first = log.controls.len();
        let mut all: Vec<History<L>> = Vec::with_capacity(inputs.len());
        for (i, input) in inputs.iter().enumerate() {
            let bends = |(j, other): (usize, &History<L>)| input.tape.reads(first + j) && other.gives() == Hold::Linear;
            let hold = if all.iter().enumerate().any(bends) { Hold::Linear } else { hold };
            all.push(History::new(input, first + i, log, hold, parameters));
        }
        let back = |history: &History<L>| {
            let of = |lane: usize| history.held.get(lane).map_or(history.shift[lane], Held::period);
            (0..L).map(of).fold(0.0, f64::max)
        };
        let is_ahead = all.iter().any(|history| history.shift.iter().any(|&shift| shift < 0.0));
        let back = all.iter().map(back).sum();
        Self { log, all, kept: 0..0, ready: 0..0, block: BLOCKS.0, back, is_ahead }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// Goes to the sample `first`, behind which the next step lies.
    pub(super) fn rewind(&mut self, first: usize) {
        if self.all.is_empty() {
            return;
        }
        self.cover(first);
        let time = &self.log.time[self.kept.clone()];
        self.all.iter_mut().for_each(|history| history.rewind(time, self.log.time[first]));
    }

    /// Their values over a step from `a` to `b`, s, behind the sample `sample`.
    #[inline(always)]
    pub(super) fn step(&mut self, sample: usize, a: f64, b: f64, into: &mut [Stages<L>]) {
        if self.all.is_empty() {
            return;
        }
        self.cover(sample);
        let time = &self.log.time[self.kept.clone()];
        for (history, stages) in self.all.iter_mut().zip(into) {
            *stages = history.step(time, sample - self.kept.start, a, b);
        }
    }

    /// Samples what a step behind `sample` reads, where it is not there.
    #[inline(always)]
    fn cover(&mut self, sample: usize) {
        if !self.ready.contains(&sample) {
            self.sample(sample);
        }
    }

    #[cold]
    fn sample(&mut self, sample: usize) {
        let time = &self.log.time;
        let look_back = |sample: usize| time.partition_point(|&t| t <= time[sample] - self.back).saturating_sub(1);
        // One that looks ahead is sampled as a whole.
        let whole = self.is_ahead.then_some(time.len());
        let end = if self.is_ahead { time.len() } else { (sample + 2).min(time.len()) };
        let first = look_back(sample);
        let is_play = self.all.iter().any(|history| matches!(history.input.kind, InputKind::Play | InputKind::Slew));
        if first < self.kept.start || self.kept.is_empty() || (first > self.kept.end && !is_play) {
            // A play and a rate limit depend on all that came before.
            let start = if is_play { 0 } else { first };
            self.kept = start..start;
            self.all.iter_mut().for_each(|history| history.restart(time[start]));
        }
        while self.kept.end < end {
            let begin = self.kept.end;
            // What is sampled now looks back, too; a play continues from its last sample.
            let start = look_back(sample.min(begin)).min(begin.saturating_sub(1)).max(self.kept.start);
            let gone = start - self.kept.start;
            self.kept = start..(begin + whole.unwrap_or(self.block)).min(time.len());
            self.block = (2 * self.block).min(BLOCKS.1);
            for number in 0..self.all.len() {
                let (earlier, rest) = self.all.split_at_mut(number);
                rest[0].forget(gone, time[start]);
                rest[0].extend(self.log, &self.kept, begin, earlier);
            }
        }
        let is_whole = self.kept.end == time.len();
        self.ready = sample..if is_whole { time.len() } else { self.kept.end - 1 };
    }
}

impl<'a, const L: usize> History<'a, L> {
    /// `place`: the number of registers before those of the parameters.
    fn new(input: &'a Input, place: usize, log: &Log, hold: Hold, parameters: &[[f64; L]]) -> Self {
        let mut registers = input.tape.registers::<L>();
        registers[place..place + parameters.len()].copy_from_slice(parameters);
        // Amounts are of parameters alone.
        input.tape.evaluate(&mut registers);
        let amount = input.tape.output(&registers, 1);
        let shift = if input.kind == InputKind::Delay { amount } else { [0.0; L] };
        let held = match input.kind {
            InputKind::SampleHold => {
                let phase = input.tape.output(&registers, 2);
                (0..L).map(|lane| Held::new(&log.time, phase[lane], amount[lane])).collect()
            }
            _ => Vec::new(),
        };
        let (values, integral, followed) = (Vec::new(), Vec::new(), Vec::new());
        let rate = amount.map(f64::abs);
        let of_log = log.begun.iter().find(|(control, _)| input.tape.reads(*control));
        let begun = of_log.filter(|_| input.kind == InputKind::Slew).map_or(0.0, |(_, more)| *more);
        Self {
            input,
            registers,
            values,
            shift,
            integral,
            cursor: [0; L],
            started: [0.0; L],
            held,
            followed,
            rate,
            begun,
            hold,
        }
    }

    fn restart(&mut self, begin: f64) {
        self.values.clear();
        self.integral.clear();
        self.followed.clear();
        self.cursor = [0; L];
        self.held.iter_mut().for_each(|held| held.restart(begin));
    }

    /// Forgets the first `gone` samples; the log goes on from `begin`, s.
    fn forget(&mut self, gone: usize, begin: f64) {
        self.values.drain(..gone);
        self.integral.drain(..gone);
        self.followed.drain(..gone.min(self.followed.len()));
        self.cursor = self.cursor.map(|k| k.saturating_sub(gone));
        self.held.iter_mut().for_each(|held| held.forget(begin));
    }

    /// Samples the rest of `kept` from the sample `begin` on.
    fn extend(&mut self, log: &Log, kept: &Range<usize>, begin: usize, earlier: &[Self]) {
        let hold = self.hold;
        let (tape, m) = (&self.input.tape, log.controls.len());
        let time = &log.time[kept.clone()];
        for k in begin - kept.start..time.len() {
            for (register, control) in self.registers.iter_mut().zip(&log.controls) {
                *register = [control[kept.start + k]; L];
            }
            for (register, earlier) in self.registers[m..].iter_mut().zip(earlier) {
                *register = std::array::from_fn(|lane| earlier.value_at(time, lane, time[k]));
            }
            let n_variables = tape.n_variables();
            self.registers[n_variables] = [time[k]; L];
            tape.evaluate(&mut self.registers);
            let signal = tape.output(&self.registers, 0);
            let value = match self.input.kind {
                InputKind::Delay | InputKind::SampleHold => signal,
                InputKind::Play => played(self.values.last(), &signal, &tape.output(&self.registers, 1)),
                InputKind::Slew => {
                    self.followed.push(signal);
                    match k {
                        0 => signal.map(|value| value + self.begun),
                        _ => std::array::from_fn(|lane| self.slewed_at(time, k - 1, lane, time[k])),
                    }
                }
            };
            let integral = match (self.values.last(), self.integral.last()) {
                (Some(value), Some(before)) => {
                    let step = time[k] - time[k - 1];
                    std::array::from_fn(|lane| before[lane] + step * value[lane])
                }
                _ => [0.0; L],
            };
            self.values.push(value);
            self.integral.push(integral);
        }
        for (lane, held) in self.held.iter_mut().enumerate() {
            held.extend(time[time.len() - 1], |moment, later| match hold {
                Hold::Zero => self.values[before(time, later)][lane],
                Hold::Linear => linear_at(time, &self.values, lane, before(time, moment), moment),
            });
        }
    }

    /// The value at `t` of one lane, for an input behind this one.
    fn value_at(&self, time: &[f64], lane: usize, t: f64) -> f64 {
        let at = t - self.shift[lane];
        match self.held.get(lane) {
            Some(held) => held.value_at(t),
            None => linear_at(time, &self.values, lane, before(time, at), at),
        }
    }

    /// What it does between samples, for an input behind this one.
    fn gives(&self) -> Hold {
        if self.input.kind == InputKind::Slew { Hold::Linear } else { self.hold }
    }

    /// The rate-limited signal of one lane at `t`, behind the sample `k`.
    fn slewed_at(&self, time: &[f64], k: usize, lane: usize, t: f64) -> f64 {
        let (signal, slope) = self.followed_by(time, k, lane);
        slewed(self.values[k][lane], signal, slope, self.rate[lane], t - time[k])
    }

    /// The same at the start, middle and end of a step, moved so that Simpson's rule gives its mean where it bends on the way.
    fn slewed_over(&self, time: &[f64], k: usize, lane: usize, (a, b): (f64, f64)) -> [f64; 3] {
        let stages = [a, 0.5 * (a + b), b].map(|t| self.slewed_at(time, k, lane, t));
        let (signal, slope) = self.followed_by(time, k, lane);
        let corner = time[k] + caught_after(self.values[k][lane], signal, slope, self.rate[lane]);
        if !(a < corner && corner < b) {
            return stages;
        }
        let [begin, middle, end] = stages;
        let at_corner = self.slewed_at(time, k, lane, corner);
        let area = 0.5 * ((corner - a) * (begin + at_corner) + (b - corner) * (at_corner + end));
        let shift = area / (b - a) - (begin + 4.0 * middle + end) / 6.0;
        stages.map(|stage| stage + shift)
    }

    /// What a rate limit of one lane follows behind the sample `k`, and by how much that changes in a second.
    fn followed_by(&self, time: &[f64], k: usize, lane: usize) -> (f64, f64) {
        let signal = self.followed[k][lane];
        let slope = match self.followed.get(k + 1) {
            Some(next) if self.hold == Hold::Linear => (next[lane] - signal) / (time[k + 1] - time[k]),
            _ => 0.0,
        };
        (signal, slope)
    }

    fn rewind(&mut self, time: &[f64], t: f64) {
        self.cursor = self.shift.map(|shift| before(time, t - shift));
        if self.hold == Hold::Zero || !self.held.is_empty() {
            self.started = std::array::from_fn(|lane| self.integral_at(time, lane, t));
        }
    }

    #[inline(always)]
    fn step(&mut self, time: &[f64], sample: usize, a: f64, b: f64) -> Stages<L> {
        let hold = self.hold;
        if self.input.kind == InputKind::Slew {
            let lanes: [[f64; 3]; L] = std::array::from_fn(|lane| self.slewed_over(time, sample, lane, (a, b)));
            return std::array::from_fn(|stage| lanes.map(|lane| lane[stage]));
        }
        if hold == Hold::Zero && self.input.kind == InputKind::Play {
            return [self.values[sample]; 3];
        }
        if hold == Hold::Zero || !self.held.is_empty() {
            let ended: [f64; L] = std::array::from_fn(|lane| self.integral_at(time, lane, b));
            let mean = std::array::from_fn(|lane| (ended[lane] - self.started[lane]) / (b - a));
            self.started = ended;
            return [mean; 3];
        }
        let mut at = |t: f64| {
            std::array::from_fn(|lane| {
                let k = self.locate(time, lane, t - self.shift[lane]);
                linear_at(time, &self.values, lane, k, t - self.shift[lane])
            })
        };
        [at(a), at(0.5 * (a + b)), at(b)]
    }

    /// Integral of the held signal up to the time `t` of one lane.
    fn integral_at(&mut self, time: &[f64], lane: usize, t: f64) -> f64 {
        if let Some(held) = self.held.get(lane) {
            return held.integral_at(t);
        }
        let k = self.locate(time, lane, t - self.shift[lane]);
        self.integral[k][lane] + self.values[k][lane] * (t - self.shift[lane] - time[k])
    }

    fn locate(&mut self, time: &[f64], lane: usize, t: f64) -> usize {
        let mut k = self.cursor[lane];
        while k + 1 < time.len() && time[k + 1] <= t {
            k += 1;
        }
        self.cursor[lane] = k;
        k
    }
}

/// The last sample at or before `t`, else the first.
fn before(time: &[f64], t: f64) -> usize {
    time.partition_point(|&other| other <= t).saturating_sub(1)
}

/// The straight line through the samples about `t`, of which `k` is the last before it; at the ends their values.
fn linear_at<const L: usize>(time: &[f64], values: &[[f64; L]], lane: usize, k: usize, t: f64) -> f64 {
    let here = values[k][lane];
    match values.get(k + 1) {
        Some(next) if t > time[k] => here + (t - time[k]) / (time[k + 1] - time[k]) * (next[lane] - here),
        _ => here,
    }
}

/// One step of a play of total width `width`: the output is dragged along once the gap is used up.
fn played<const L: usize>(last: Option<&[f64; L]>, signal: &[f64; L], width: &[f64; L]) -> [f64; L] {
    std::array::from_fn(|lane| {
        let half = 0.5 * width[lane].abs();
        let previous = last.map_or(signal[lane], |l| l[lane]);
        previous.max(signal[lane] - half).min(signal[lane] + half)
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
