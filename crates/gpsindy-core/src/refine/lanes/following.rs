//! States that follow the inputs alone, such as a lagging input, where a rollout begins within a log.

use super::Lanes;
use crate::data::Hold;
use crate::model::Follower;

/// The states that follow the inputs alone, in every lane, at one sample of a log.
pub(super) struct Followed<const L: usize> {
    sample: usize,
    values: Vec<[f64; L]>,
}

impl<const L: usize> Lanes<'_, L> {
    /// Puts the states that follow the inputs alone into `x`, as they are at the sample `first` after all that came before it.
    ///
    /// They are settled at the log's first sample, or as the model has it; then exact for a constant input over a step where the
    /// rate is a straight line in the state; else in short steps of one such line each, from the control that leaves the
    /// state most at rest.
    pub(super) fn follow(&mut self, first: usize, x: &mut [[f64; L]]) {
        let followers = self.system.followers();
        if first == 0 || followers.is_empty() {
            return;
        }
        let mut followed = match self.followed.take() {
            Some(followed) if followed.sample <= first => followed,
            _ => Followed { sample: 0, values: Vec::new() },
        };
        if followed.sample < first {
            self.histories.rewind(followed.sample);
            let mut registers: Vec<_> = followers.iter().map(|follower| self.registers_of(follower)).collect();
            let mut inputs = vec![[[0.0; L]; 3]; self.histories.len()];
            for sample in followed.sample..first {
                self.histories.step(sample, self.log.time[sample], self.log.time[sample + 1], &mut inputs);
                for (number, (follower, registers)) in followers.iter().zip(&mut registers).enumerate() {
                    let middle = inputs.iter().map(|stages| stages[1]);
                    let next = self.followed_by(follower, registers, sample, middle, followed.values.get(number));
                    if followed.values.len() > number {
                        followed.values[number] = next;
                    } else {
                        followed.values.push(next);
                    }
                }
            }
            followed.sample = first;
        }
        for (follower, value) in followers.iter().zip(&followed.values) {
            x[follower.state] = *value;
        }
        self.followed = Some(followed);
    }

    fn registers_of(&self, follower: &Follower) -> Vec<[f64; L]> {
        let mut registers = follower.rate.registers::<L>();
        let first = self.system.n_states() + self.system.n_controls() + self.histories.len();
        registers[first..first + self.parameters.len()].copy_from_slice(&self.parameters);
        registers
    }

    /// The state at the sample behind `sample`; `now`: at `sample`, where it is not the log's first.
    fn followed_by(
        &self,
        Follower { state, rate: tape, is_linear }: &Follower,
        registers: &mut [[f64; L]],
        sample: usize,
        inputs: impl Iterator<Item = [f64; L]>,
        now: Option<&[f64; L]>,
    ) -> [f64; L] {
        let (n, m) = (self.system.n_states(), self.system.n_controls());
        let (a, b) = (self.log.time[sample], self.log.time[sample + 1]);
        for (register, control) in registers[n..].iter_mut().zip(&self.log.controls) {
            let end = if self.hold == Hold::Linear { control[sample + 1] } else { control[sample] };
            *register = [0.5 * (control[sample] + end); L];
        }
        for (register, input) in registers[n + m..].iter_mut().zip(inputs) {
            *register = input;
        }
        registers[tape.n_variables()] = [0.5 * (a + b); L];
        let mut rate = |value: [f64; L]| {
            registers[*state] = value;
            tape.evaluate(registers);
            tape.output(registers, 0)
        };
        if !is_linear {
            let starts = self.log.controls.iter().map(|control| control[0]);
            let now = now.copied().unwrap_or_else(|| [most_at_rest(starts, |value| rate([value; L])[0]); L]);
            return crept(now, b - a, rate);
        }
        let (at_zero, at_one) = (rate([0.0; L]), rate([1.0; L]));
        let settled: [f64; L] = std::array::from_fn(|lane| at_zero[lane] / (at_zero[lane] - at_one[lane]));
        let model = self.system.model();
        let given = || model.initial.get(&model.states[*state].name).map(|&value| [value; L]);
        let now = now.copied().or_else(given).unwrap_or(settled);
        std::array::from_fn(|lane| {
            let kept = ((at_one[lane] - at_zero[lane]) * (b - a)).exp();
            settled[lane] + kept * (now[lane] - settled[lane])
        })
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
