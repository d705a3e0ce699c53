//! Climb: where random processes beside a machine are at their best.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::filter::{Acts, Linear, Process};
use crate::diagnose::limits::forcing::{CLIMB_STEPS, CURVED, DURATIONS, LAST_STEP, LEVELS, LONGEST, SLOPED, UNSEEN};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::optimise::Optimiser;

/// Where a process acts, and between what its standard deviation and its correlation time lie.
pub(super) struct Range {
    acts: Acts,
    /// Those that are tried first.
    tried: [(f64, f64); 2],
    /// Those that may be found.
    bounds: [(f64, f64); 2],
}

impl Range {
    pub(super) fn starts(&self) -> impl Iterator<Item = Process> {
        let between =
            |(low, high): (f64, f64), k: usize, of: usize| low * (high / low).powf(k as f64 / (of - 1) as f64);
        (0..DURATIONS * LEVELS).map(move |k| Process {
            acts: self.acts,
            deviation: between(self.tried[0], k % LEVELS, LEVELS),
            time: between(self.tried[1], k / LEVELS, DURATIONS),
        })
    }

    /// Whether the correlation time is at its longest, closer than a step of a curvature.
    pub(super) fn ends_at(&self, process: &Process) -> bool {
        process.time.ln() > self.bounds[1].1.ln() - CURVED
    }

    fn holds(&self, process: &Process) -> bool {
        let is_inside = |value: f64, (low, high): (f64, f64)| (low..=high).contains(&value);
        is_inside(process.deviation, self.bounds[0]) && is_inside(process.time, self.bounds[1])
    }
}

/// What a process may be that acts on `fit`.
pub(super) fn range(contest: &Contest<'_>, fit: &Contestant, acts: Acts) -> Range {
    let experiment = &fit.experiment;
    let together: f64 = experiment.logs.iter().map(|log| log.time[log.time.len() - 1] - log.time[0]).sum();
    let (period, longest) = (contest.scene.period, LONGEST * together);
    let (tried, widest) = match acts {
        Acts::Row(row) => {
            let rate = contest.scene.rates[row];
            ((rate * UNSEEN, rate), rate / UNSEEN)
        }
        Acts::Column(column) => {
            let motion = experiment.scale[experiment.columns[column]];
            ((experiment.noise[column].min(motion), motion), motion / UNSEEN)
        }
    };
    Range {
        acts,
        tried: [tried, (period, 0.5 * longest)],
        bounds: [(tried.0 * UNSEEN, widest), (0.5 * period, longest)],
    }
}

/// The logarithms of every process's standard deviation and correlation time.
fn logarithms(processes: &[Process]) -> Vec<f64> {
    processes.iter().flat_map(|process| [process.deviation.ln(), process.time.ln()]).collect()
}

/// What random processes cost beside a machine, about a path of it.
pub(super) struct Climb {
    pub(super) ranges: Vec<Range>,
    pub(super) linear: Linear,
}

impl Climb {
    /// Where the processes cost least on the first `most` samples, from `start` on.
    pub(super) fn top(&self, start: &[Process], most: usize) -> Option<Vec<Process>> {
        let climb = Optimiser {
            tolerance_cost: LAST_STEP,
            tolerance_gradient: LAST_STEP,
            max_iterations: CLIMB_STEPS,
            longest_move: 1.0,
            ..Optimiser::default()
        };
        let found = climb.minimise(&logarithms(start), |place, slope| {
            let aside = |k: usize, step: f64| {
                let mut aside = place.to_vec();
                aside[k] += step;
                self.processes(&aside)
            };
            let mut all = vec![self.processes(place)];
            all.extend((0..place.len()).map(|k| aside(k, SLOPED)));
            let costs = self.costs_of(&all, most);
            let cost = costs[0];
            for (k, slope) in slope.iter_mut().enumerate() {
                let ahead = (costs[k + 1] - cost) / SLOPED;
                // Where the range ends, backwards.
                let back = || (cost - self.cost_of(&aside(k, -SLOPED), most)) / SLOPED;
                *slope = if ahead.is_finite() { ahead } else { back() };
            }
            cost.is_finite().then_some(cost)
        })?;
        Some(self.processes(&found.point))
    }

    /// On the first `most` samples.
    pub(super) fn cost_of(&self, processes: &[Process], most: usize) -> f64 {
        self.costs_of(&[processes], most)[0]
    }

    /// Of several sets of processes on the first `most` samples; infinite beyond their ranges and where the filter diverges.
    pub(super) fn costs_of<S: AsRef<[Process]>>(&self, all: &[S], most: usize) -> Vec<f64> {
        let is_inside = |set: &[Process]| self.ranges.iter().zip(set).all(|(range, process)| range.holds(process));
        let inside = all.iter().map(AsRef::as_ref).enumerate().filter(|(_, set)| is_inside(set));
        let (places, sets): (Vec<usize>, Vec<&[Process]>) = inside.unzip();
        let mut costs = vec![f64::INFINITY; all.len()];
        for (place, likelihood) in places.into_iter().zip(self.linear.likelihoods(&sets, most)) {
            if likelihood.is_finite() {
                costs[place] = -likelihood;
            }
        }
        costs
    }

    /// The processes that have these logarithms.
    fn processes(&self, logarithms: &[f64]) -> Vec<Process> {
        let one = |(range, pair): (&Range, &[f64])| Process {
            acts: range.acts,
            deviation: pair[0].exp(),
            time: pair[1].exp(),
        };
        self.ranges.iter().zip(logarithms.chunks_exact(2)).map(one).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{drive, fitted};
    use crate::diagnose::run::Run;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::progress::Silent;

    #[test]
    fn a_force_that_changed_five_times_in_all_logs_is_at_the_end_of_what_is_looked_for() {
        let (model, data) = drive(None, |x| 1.3 * x, 0.002, (2, 200));
        let (fitter, nominal) = fitted(&model, &data, 0.002);
        let together: f64 = data.runs().iter().map(|run| run.time[run.n_samples() - 1] - run.time[0]).sum();
        let run = Run::new(&Silent, None);
        let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
        let range = range(&contest, &nominal, Acts::Row(0));
        let lasting = |time: f64| Process { acts: Acts::Row(0), deviation: 1.0, time };
        assert!(range.ends_at(&lasting(together / 5.0)));
        assert!(!range.ends_at(&lasting(together / 6.0)));
    }
}
