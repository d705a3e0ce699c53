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
    /// They are settled at the log's first sample, or as the model has it; then exact for a constant input over a step.
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
        Follower { state, rate: tape }: &Follower,
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
