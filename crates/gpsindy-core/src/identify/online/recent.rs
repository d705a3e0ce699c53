//! The newest samples, as many as the method still needs.

use crate::gp::Points;
use std::collections::VecDeque;

/// One sample as it was checked.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    /// s.
    pub(super) time: f64,
    /// Number of its run, from 0.
    pub(super) run: usize,
    /// One a state; NaN is missing.
    pub(super) states: Vec<f64>,
    /// One a control; a missing value holds the last known one.
    pub(super) controls: Vec<f64>,
}

/// Samples in order, counted over the whole log.
#[derive(Debug, Clone, Default)]
pub(super) struct Recent {
    samples: VecDeque<Sample>,
    /// Number of the oldest that is still here.
    first: usize,
}

impl Recent {
    pub(super) fn push(&mut self, sample: Sample) {
        self.samples.push_back(sample);
    }

    /// Number of the oldest sample here.
    pub(super) fn first(&self) -> usize {
        self.first
    }

    /// Number that the next sample will have.
    pub(super) fn end(&self) -> usize {
        self.first + self.samples.len()
    }

    pub(super) fn len(&self) -> usize {
        self.samples.len()
    }

    /// Sample number `i`, which must be here.
    pub(super) fn get(&self, i: usize) -> &Sample {
        &self.samples[i - self.first]
    }

    /// First number of the run that sample `i` belongs to, and the first behind it.
    pub(super) fn run_of(&self, i: usize) -> (usize, usize) {
        let run = self.get(i).run;
        let start = self.samples.partition_point(|s| s.run < run);
        let end = self.samples.partition_point(|s| s.run <= run);
        (self.first + start, self.first + end)
    }

    /// The last sample at or before `time` in the run that begins with number `start`, or `start`.
    pub(super) fn at_or_before(&self, time: f64, start: usize) -> usize {
        let run = self.get(start).run;
        let after = self.samples.partition_point(|s| s.run < run || (s.run == run && s.time <= time));
        (self.first + after).saturating_sub(1).max(start)
    }

    /// Drops samples before number `from`.
    pub(super) fn drop_before(&mut self, from: usize) {
        while self.first < from && self.samples.pop_front().is_some() {
            self.first += 1;
        }
    }

    /// Values of state `s` that are not missing, run by run.
    pub(super) fn points(&self, s: usize) -> Vec<Points> {
        let mut runs = Vec::new();
        let mut from = self.first;
        while from < self.end() {
            let (_, to) = self.run_of(from);
            runs.push(self.points_between(s, from, to));
            from = to;
        }
        runs
    }

    /// Values of state `s` that are not missing, of the samples `from..to`.
    pub(super) fn points_between(&self, s: usize, from: usize, to: usize) -> Points {
        let (time, values): (Vec<f64>, Vec<f64>) =
            (from..to).map(|i| self.get(i)).map(|sample| (sample.time, sample.states[s])).unzip();
        Points::in_time(&time, &values)
    }

    /// Median of the steps within runs, s; infinite for fewer than two samples.
    pub(super) fn period(&self) -> f64 {
        let pairs = self.samples.iter().zip(self.samples.iter().skip(1));
        let mut steps: Vec<f64> = pairs.filter(|(a, b)| a.run == b.run).map(|(a, b)| b.time - a.time).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_keep_their_number_when_older_ones_go() {
        let mut recent = Recent::default();
        for i in 0..10u8 {
            let run = usize::from(i >= 6);
            recent.push(Sample { time: f64::from(i), run, states: vec![f64::from(i)], controls: vec![] });
        }
        recent.drop_before(3);
        assert_eq!((recent.first(), recent.end(), recent.len()), (3, 10, 7));
        assert_eq!(recent.get(5).time, 5.0);
        assert_eq!((recent.run_of(4), recent.run_of(9)), ((3, 6), (6, 10)));
        assert_eq!(recent.points(0).iter().map(Points::len).collect::<Vec<_>>(), [3, 4]);
        assert_eq!(recent.period(), 1.0);
        assert_eq!(recent.at_or_before(4.5, 3), 4);
        assert_eq!(recent.at_or_before(1.0, 3), 3);
    }
}
