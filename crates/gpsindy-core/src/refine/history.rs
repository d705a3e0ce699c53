//! Inputs with a history: delays, play, sample-and-hold.
//!
//! They depend on the controls alone, so they are sampled over a whole log once. A late input that is held enters a step
//! by its mean, which is smooth in the delay, and so does one that switches within a step.

use super::experiment::Log;
use crate::data::Hold;
use crate::model::{InputKind, ROUNDING, SHORTEST_HOLD, System, sampled_at};

/// An input with a history, sampled, for every lane.
pub(super) struct History<const L: usize> {
    /// Value at each sample, and how much later than its time stamp it acts, s.
    values: Vec<[f64; L]>,
    shift: [f64; L],
    shifted: bool,
    /// Integral of the held signal up to each sample.
    integral: Vec<[f64; L]>,
    /// Last sample at or before the current time, one a lane.
    cursor: [usize; L],
    /// Integral up to the start of the current step.
    started: [f64; L],
    /// What a sample-and-hold has sampled, one a lane; empty for other inputs.
    held: Vec<Held>,
}

/// A signal that is sampled and held.
struct Held {
    /// The last moment before the log at which it is sampled, and the time from one to the next, s.
    first: f64,
    period: f64,
    /// The value that is held from each moment on.
    values: Vec<f64>,
    /// Its integral from the first moment up to each.
    integral: Vec<f64>,
}

impl Held {
    /// `at(t)`: the signal; before the log's begin it is what it is there.
    fn new(time: &[f64], phase: f64, period: f64, at: impl Fn(f64) -> f64) -> Self {
        let (begin, last) = (time[0], time[time.len() - 1]);
        // What would be shorter holds nothing that the log could show.
        let shortest = (last - begin) / time.len() as f64 * SHORTEST_HOLD;
        let period = if shortest > 0.0 { period.max(shortest) } else { 1.0 };
        let first = sampled_at(begin, phase, period);
        let mut held = Self { first, period, values: Vec::new(), integral: vec![0.0] };
        let (mut moment, mut integral) = (first, 0.0);
        while held.values.is_empty() || moment <= last {
            let value = at((moment + ROUNDING * period).max(begin));
            integral += period * value;
            held.values.push(value);
            held.integral.push(integral);
            moment = first + period * held.values.len() as f64;
        }
        held
    }

    /// Number of the value that holds at `t`, and how long it has held.
    fn locate(&self, t: f64) -> (usize, f64) {
        let place = ((t - self.first) / self.period).floor().clamp(0.0, (self.values.len() - 1) as f64);
        (place as usize, t - self.first - self.period * place)
    }

    fn integral_at(&self, t: f64) -> f64 {
        let (place, since) = self.locate(t);
        self.integral[place] + self.values[place] * since
    }
}

/// Values of an input at the start, middle and end of a step.
pub(super) type Stages<const L: usize> = [[f64; L]; 3];

impl<const L: usize> History<L> {
    fn locate(&mut self, time: &[f64], lane: usize, t: f64) -> usize {
        let mut k = self.cursor[lane];
        while k + 1 < time.len() && time[k + 1] <= t {
            k += 1;
        }
        self.cursor[lane] = k;
        k
    }

    fn integral_at(&mut self, time: &[f64], lane: usize, t: f64) -> f64 {
        let k = self.locate(time, lane, t);
        self.integral[k][lane] + self.values[k][lane] * (t - time[k])
    }

    /// The value at `t` of one lane.
    fn value_at(&mut self, time: &[f64], lane: usize, t: f64) -> f64 {
        match self.held.get(lane) {
            Some(held) => held.values[held.locate(t + ROUNDING * held.period).0],
            None => self.linear_at(time, lane, t - self.shift[lane]),
        }
    }

    fn linear_at(&mut self, time: &[f64], lane: usize, t: f64) -> f64 {
        let k = self.locate(time, lane, t);
        if k + 1 >= time.len() || t <= time[0] {
            return self.values[k][lane];
        }
        let part = (t - time[k]) / (time[k + 1] - time[k]);
        self.values[k][lane] + part * (self.values[k + 1][lane] - self.values[k][lane])
    }

    /// The signal of one lane, sampled and held.
    fn held(&self, log: &Log, hold: Hold, lane: usize, (phase, period): (f64, f64)) -> Held {
        let time = &log.time;
        Held::new(time, phase, period, |t| {
            let k = time.partition_point(|&other| other <= t).max(1) - 1;
            let here = self.values[k][lane];
            match self.values.get(k + 1) {
                Some(next) if hold == Hold::Linear => {
                    here + (next[lane] - here) * ((t - time[k]) / (time[k + 1] - time[k])).max(0.0)
                }
                _ => here,
            }
        })
    }

    /// Goes back to the time `t`.
    pub(super) fn rewind(&mut self, time: &[f64], t: f64, hold: Hold) {
        let before = |shift: f64| time.partition_point(|&other| other <= t - shift).saturating_sub(1);
        self.cursor = self.shift.map(before);
        if !self.held.is_empty() {
            self.started = std::array::from_fn(|lane| self.held[lane].integral_at(t));
        } else if hold == Hold::Zero && self.shifted {
            self.started = std::array::from_fn(|lane| self.integral_at(time, lane, t - self.shift[lane]));
        }
    }

    #[inline(always)]
    pub(super) fn step(&mut self, time: &[f64], sample: usize, a: f64, b: f64, hold: Hold) -> Stages<L> {
        if !self.held.is_empty() {
            let ended: [f64; L] = std::array::from_fn(|lane| self.held[lane].integral_at(b));
            let mean = std::array::from_fn(|lane| (ended[lane] - self.started[lane]) / (b - a));
            self.started = ended;
            return [mean; 3];
        }
        match hold {
            Hold::Zero if !self.shifted => [self.values[sample]; 3],
            Hold::Zero => {
                let ended: [f64; L] = std::array::from_fn(|lane| self.integral_at(time, lane, b - self.shift[lane]));
                let mean = std::array::from_fn(|lane| (ended[lane] - self.started[lane]) / (b - a));
                self.started = ended;
                [mean; 3]
            }
            Hold::Linear => {
                let mut at = |t: f64| std::array::from_fn(|lane| self.linear_at(time, lane, t - self.shift[lane]));
                [at(a), at(0.5 * (a + b)), at(b)]
            }
        }
    }
}

/// Every input with a history, sampled over the log.
pub(super) fn histories<const L: usize>(
    system: &System,
    log: &Log,
    hold: Hold,
    parameters: &[[f64; L]],
) -> Vec<History<L>> {
    let m = system.n_controls();
    let mut all: Vec<History<L>> = Vec::new();
    for input in system.inputs() {
        let mut registers = input.tape.registers::<L>();
        let first = m + all.len();
        registers[first..first + parameters.len()].copy_from_slice(parameters);
        for history in &mut all {
            history.cursor = [0; L];
        }
        let (mut amount, mut phase) = ([0.0; L], [0.0; L]);
        let mut values = Vec::with_capacity(log.time.len());
        for (sample, &t) in log.time.iter().enumerate() {
            for (register, control) in registers.iter_mut().zip(&log.controls) {
                *register = [control[sample]; L];
            }
            for (register, earlier) in registers[m..].iter_mut().zip(&mut all) {
                *register = std::array::from_fn(|lane| earlier.value_at(&log.time, lane, t));
            }
            let n_variables = input.tape.n_variables();
            registers[n_variables] = [t; L];
            input.tape.evaluate(&mut registers);
            let signal = input.tape.output(&registers, 0);
            amount = input.tape.output(&registers, 1);
            values.push(match (input.kind, values.last()) {
                (InputKind::Delay, _) => signal,
                (InputKind::Play, last) => played(last, &signal, &amount),
                (InputKind::SampleHold, _) => {
                    phase = input.tape.output(&registers, 2);
                    signal
                }
            });
        }
        let shift = if input.kind == InputKind::Delay { amount } else { [0.0; L] };
        let mut integral = vec![[0.0; L]; values.len()];
        for k in 1..values.len() {
            let step = log.time[k] - log.time[k - 1];
            integral[k] = std::array::from_fn(|lane| integral[k - 1][lane] + step * values[k - 1][lane]);
        }
        let shifted = input.kind == InputKind::Delay;
        let mut history =
            History { values, shift, shifted, integral, cursor: [0; L], started: [0.0; L], held: Vec::new() };
        if input.kind == InputKind::SampleHold {
            history.held = (0..L).map(|lane| history.held(log, hold, lane, (phase[lane], amount[lane]))).collect();
        }
        all.push(history);
    }
    all
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
mod tests {
    use super::*;

    #[test]
    fn a_play_drags_its_output_along_once_the_gap_is_used_up() {
        let signal = [0.0, 0.4, 1.0, 0.8, 0.1, 0.5];
        let mut path: Vec<[f64; 1]> = Vec::new();
        for value in signal {
            path.push(played(path.last(), &[value], &[1.0]));
        }
        // Half a unit behind, on either side.
        assert_eq!(path.concat(), [0.0, 0.0, 0.5, 0.5, 0.5, 0.5]);
        assert_eq!(played(Some(&[0.5]), &[-0.2], &[1.0]), [0.3]);
    }

    #[test]
    fn a_late_held_input_enters_a_step_by_its_mean() {
        let time = [0.0, 1.0, 2.0, 3.0];
        let values: Vec<[f64; 1]> = vec![[0.0], [4.0], [4.0], [4.0]];
        let integral = vec![[0.0], [0.0], [4.0], [8.0]];
        let mut late =
            History { values, shift: [0.25], shifted: true, integral, cursor: [0], started: [0.0], held: Vec::new() };
        late.rewind(&time, 1.0, Hold::Zero);
        // From 0.75 to 1.75 the input is at 4 for three quarters.
        assert_eq!(late.step(&time, 1, 1.0, 2.0, Hold::Zero), [[3.0]; 3]);
        assert_eq!(late.step(&time, 2, 2.0, 3.0, Hold::Zero), [[4.0]; 3]);
    }
}
