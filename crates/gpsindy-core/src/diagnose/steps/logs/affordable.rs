//! As much of the logs as a simulator that steps can pass through before the time limit.
//!
//! Equations are integrated in microseconds, and a search of them ends where it is. A simulator of the user's own may take a second for one
//! pass through the logs, and then even the nominal model's fit is late.

use crate::data::Dataset;
use crate::diagnose::limits::{AFFORDED, FEWEST_AFFORDED, FEWEST_PASSES, PASSES, PROBE, STEPPED_STRETCHES};
use crate::diagnose::notes::Note;
use crate::diagnose::run::Run;
use crate::error::Result;
use crate::excerpt::{Excerpt, excerpt};
use crate::model::System;
use crate::refine::{Experiment, Job, Window, guess_initial, roll_together};

/// Logs to learn from and to verify on, shortened alike, and what to say of it; none where the time may suffice for all of them, where
/// nobody set a limit, and for equations.
pub(crate) fn affordable(
    run: &Run<'_>,
    system: &System,
    [train, holdout]: [&Dataset; 2],
) -> Result<Option<(Dataset, Dataset, Note)>> {
    let Some(left) = run.left().filter(|_| system.engine().is_some()) else { return Ok(None) };
    let passes = (PASSES * system.n_states() as f64).max(FEWEST_PASSES);
    let most = (left / (passes * seconds_a_sample(run, system, train)?)) as usize;
    let total = train.n_samples();
    if most as f64 >= AFFORDED * total as f64 || total <= FEWEST_AFFORDED {
        return Ok(None);
    }
    let most = most.max(FEWEST_AFFORDED);
    let of = |data: &Dataset, most: usize| -> Result<Excerpt> {
        let ends: Vec<usize> = data.runs().iter().map(crate::data::Run::n_samples).collect();
        let columns: Vec<usize> = (0..data.channels().len()).collect();
        let window = (most as f64 / STEPPED_STRETCHES) as usize;
        excerpt(data, &columns, &ends, (window.max(FEWEST_AFFORDED / 4), most))
    };
    let share = most as f64 / total as f64;
    let used = of(train, most)?;
    let most = (share * holdout.n_samples() as f64) as usize;
    let holdout = of(holdout, most.max(FEWEST_AFFORDED / 4))?.data;
    let note = Note::Afforded { samples: total, used: used.data.n_samples(), windows: used.windows };
    Ok(Some((used.data, holdout, note)))
}

/// Seconds in which the simulator passes one sample, where it steps through many rollouts at once as all fits let it.
fn seconds_a_sample(run: &Run<'_>, system: &System, data: &Dataset) -> Result<f64> {
    let mut experiment = Experiment::new(system, data, None)?;
    let (rows, samples) = PROBE;
    let window = |k: usize| {
        let log = k % experiment.logs.len();
        let last = experiment.logs[log].time.len() - 1;
        let first = last.saturating_sub(samples) * k / rows;
        Window { log, first, last: last.min(first + samples) }
    };
    experiment.windows = (0..rows).map(window).collect();
    let starts = guess_initial(system, &experiment);
    let parameters = system.parameter_values();
    let job = |(window, initial): (usize, Vec<f64>)| Job { window, parameters: parameters.clone(), initial };
    let jobs: Vec<Job> = starts.into_iter().enumerate().map(job).collect();
    let pass = |jobs: &[Job]| {
        let start = run.now();
        roll_together(system, &experiment, jobs, None, &mut |_, _, _, _| {});
        run.now().zip(start).map_or(0.0, |(end, start)| end - start)
    };
    // The first call of a simulator may load and compile it, and the first of many at once makes the copies that they are stepped in.
    pass(&jobs[..1]);
    let first = pass(&jobs);
    let passed: usize = experiment.windows.iter().map(|w| w.last - w.first).sum();
    Ok(first.min(pass(&jobs)) / passed.max(1) as f64)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::limits::SEARCHED;
    use crate::model::stepping::Stepping;
    use crate::progress::{Progress, Silent};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A clock that goes on by a second whenever it is read: the probe's 1024 samples take one.
    struct Ticking(AtomicU32);

    impl Progress for Ticking {
        fn report(&self, _: &str, _: usize, _: usize) -> bool {
            true
        }

        fn seconds(&self) -> Option<f64> {
            Some(f64::from(self.0.fetch_add(1, Ordering::Relaxed)))
        }
    }

    #[test]
    fn logs_are_shortened_only_where_a_simulator_that_steps_would_be_late() {
        let spring = Arc::new(Stepping::spring());
        let system = spring.system("x", ("k", 4.0));
        let command = |i: usize| (0.02 * i as f64).sin();
        let data = spring.log(("x", 5.0), ([0.5, 0.0], 4000), command, command, |_, x| x);
        let shortened = |limit: Option<f64>, progress: &dyn Progress| {
            affordable(&Run::new(progress, limit), &system, [&data, &data]).unwrap()
        };
        let clock = Ticking(AtomicU32::new(0));
        assert!(shortened(None, &clock).is_none() && shortened(Some(1e9), &clock).is_none());
        assert!(shortened(Some(1e-9), &Silent).is_none());
        let (train, holdout, note) = shortened(Some(1e-9), &clock).unwrap();
        assert!((FEWEST_AFFORDED..FEWEST_AFFORDED + 100).contains(&train.n_samples()), "{}", train.n_samples());
        assert!(holdout.n_samples() < 500 && train.runs().len() > 1);
        assert!(note.to_string().contains("of 4000 samples"), "{note}");
    }

    #[test]
    fn logs_that_may_be_passed_in_time_stay_whole() {
        let spring = Arc::new(Stepping::spring());
        let system = spring.system("x", ("k", 4.0));
        let data = spring.log(("x", 5.0), ([0.5, 0.0], 4000), |_| 0.0, |_| 0.0, |_, x| x);
        let used = |share: f64| {
            let limit = share * 4000.0 / 1024.0 * FEWEST_PASSES / SEARCHED;
            let clock = Ticking(AtomicU32::new(0));
            let shortened = affordable(&Run::new(&clock, Some(limit)), &system, [&data, &data]).unwrap();
            shortened.map(|(train, ..)| train.n_samples())
        };
        assert_eq!([used(1.1), used(0.9), used(0.6)], [None; 3]);
        let fewer = used(0.4).unwrap();
        assert!((1400..2000).contains(&fewer), "{fewer}");
    }
}
