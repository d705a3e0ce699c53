//! Many samples of a rollout in one call, where what goes to the simulator follows from the log alone.

use super::{Group, MOST_STEPS, WHOLE};
use crate::model::System;
use crate::refine::lanes::buffer::Buffer;

impl Group<'_> {
    /// How many samples can go into one call, and of how many steps each of them is; no samples where states or the time within a
    /// sample matter, or a step is shortened. `held` rows at most go with them.
    pub(super) fn ahead(&self, period: f64, held: usize) -> (usize, usize) {
        if !self.is_held || self.part > 0 || self.trail.is_some() {
            return (0, 0);
        }
        let time = &self.lanes.log.time;
        let steps = |sample: usize| {
            let steps = (time[sample + 1] - time[sample]) / period;
            ((steps - steps.round()).abs() < WHOLE && steps > 0.5).then(|| steps.round() as usize)
        };
        let Some(count) = steps(self.sample) else { return (0, 0) };
        let most = (MOST_STEPS / (count * held).max(1)).max(1);
        let alike = (self.sample..self.last).take(most).take_while(|&sample| steps(sample) == Some(count));
        (alike.count(), count)
    }

    /// Adds its rows, with what goes to the simulator in each of the next samples.
    pub(super) fn put_ahead(&mut self, system: &System, (samples, _): (usize, usize), rows: &mut Buffer) {
        let mut by_sample = Buffer::default();
        let sample = self.sample;
        for ahead in 0..samples {
            self.sample = sample + ahead;
            let dt = self.lanes.log.time[self.sample + 1] - self.lanes.log.time[self.sample];
            self.put(system, dt, None, &mut by_sample);
        }
        self.sample = sample;
        let count = self.count;
        let by_row = |values: &[f64], into: &mut Vec<f64>| {
            let width = values.len() / (samples * count).max(1);
            for row in 0..count {
                (0..samples).for_each(|s| into.extend(&values[(s * count + row) * width..][..width]));
            }
        };
        by_row(&by_sample.commands, &mut rows.commands);
        by_row(&by_sample.forces, &mut rows.forces);
        let first = |values: &[f64]| values[..values.len() / samples.max(1)].to_vec();
        rows.states.extend(first(&by_sample.states));
        rows.parameters.extend(first(&by_sample.parameters));
        rows.count += count;
    }

    /// Takes its rows out of what the simulator answered, and shows the samples on the way; returns how many values that were.
    pub(super) fn take_ahead(
        &mut self,
        system: &System,
        (samples, _): (usize, usize),
        next: &[f64],
        columns: Option<&[usize]>,
        receive: &mut dyn FnMut(usize, usize, usize, f64),
    ) -> usize {
        let n = system.simulator().map_or(0, |s| s.n_states());
        for ahead in 0..samples {
            for (j, x) in self.x.iter_mut().enumerate().take(n) {
                for (lane, value) in x.iter_mut().enumerate() {
                    *value = next[(lane.min(self.count - 1) * samples + ahead) * n + j];
                }
            }
            self.sample += 1;
            if ahead + 1 < samples {
                self.begin(columns, receive);
            }
        }
        self.count * samples * n
    }
}
