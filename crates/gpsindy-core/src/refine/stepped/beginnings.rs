//! Starts of a simulator that steps, found along ever longer beginnings of their windows.
//!
//! Servos saturate, friction sticks and contacts close, so that a start within the noise of its reading may still be several
//! of those events away from the true one, and a fit over the whole window stops at the first of them. Over three samples
//! there is nothing to stop at; each beginning that is a little longer starts where the last one ended.

use crate::error::{Error, Result};
use crate::model::System;
use crate::refine::stepped::slopes::Scene;
use crate::refine::tally::Purpose;
use crate::refine::{Experiment, Job, Point, Refine, Window, guess_initial, roll_together};

/// Samples of the first beginning: three determine a place, a rate and what drives it.
const FIRST: usize = 3;

/// By how much each beginning is longer than the last. A six-joint arm with saturating servos, windows of 24 and of 96 samples:
/// 1.4 left none of 62 windows above 1.4 times the noise's variance, 2 left 6, and the whole window at once 27.
const LONGER: f64 = 1.4;

/// Samples beyond which no beginning is followed: what comes later depends on the machine, and little on the start.
pub(super) const LONGEST: usize = 128;

/// Samples of the longest beginning that determines a start whatever the model lacks: what is missing has hardly moved a state by then.
/// Argument.
const SHORT: usize = 8;

/// Steps on each: the next one goes on, so that a thousandth of the cost is not worth another.
const STEPS: Refine = Refine { max_iterations: 5, tolerance: 1e-3, hopeless: f64::INFINITY };

/// Initial states of all windows at these parameters (all of the system's): what the first samples determine, and where the system
/// steps on its own also what its rollouts do.
///
/// # Errors
/// A computation that was asked to stop.
pub(crate) fn guess_starts(system: &System, experiment: &Experiment, parameters: &[f64]) -> Result<Vec<Vec<f64>>> {
    let starts = as_read(system, experiment);
    if system.engine().is_none() { Ok(starts) } else { followed(system, experiment, parameters, (starts, LONGEST)) }
}

/// Initial states of all windows that their first samples alone determine. A fit over whole windows pulls its starts off where a model lacks
/// something that acts in them.
///
/// # Errors
/// A computation that was asked to stop.
pub(crate) fn first_starts(system: &System, experiment: &Experiment, parameters: &[f64]) -> Result<Vec<Vec<f64>>> {
    followed(system, experiment, parameters, (as_read(system, experiment), SHORT))
}

/// Of every window the one of two initial states from which a rollout misses less.
pub(crate) fn nearer_starts(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    [one, other]: [&[Vec<f64>]; 2],
) -> Vec<Vec<f64>> {
    let [of_one, of_other] = [one, other].map(|starts| squares(system, experiment, parameters, starts));
    let nearer = |w: usize| if of_other[w] < of_one[w] { other[w].clone() } else { one[w].clone() };
    (0..one.len()).map(nearer).collect()
}

/// Of every window the nearer of its start and of where the window before it in its log arrives from its own: windows that follow each other are
/// one motion, and what a whole window determines is nearer to the truth than a reading is. Events that a start would have to be moved over
/// lie behind one that comes along the motion. The windows of `experiment` may be the beginnings of `windows`.
pub(crate) fn chained_starts(
    system: &System,
    (experiment, windows): (&Experiment, &[Window]),
    parameters: &[f64],
    starts: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let before = |w: usize| {
        let of = |p: &usize| {
            let (before, window) = (windows[*p], windows[w]);
            before.log == window.log && before.first < window.first && before.last + 1 >= window.first
        };
        (0..windows.len()).filter(of).max_by_key(|&p| windows[p].first)
    };
    let links: Vec<(usize, usize)> = (0..windows.len()).filter_map(|w| Some((before(w)?, w))).collect();
    let until = |&(p, w): &(usize, usize)| Window { last: windows[w].first, ..windows[p] };
    let leading = Experiment { windows: links.iter().map(until).collect(), ..experiment.clone() };
    let job = |(window, &(p, _)): (usize, &(usize, usize))| Job {
        window,
        parameters: parameters.to_vec(),
        initial: starts[p].clone(),
    };
    let jobs: Vec<Job> = links.iter().enumerate().map(job).collect();
    experiment.tally.pass(Purpose::Trials, leading.windows.iter().map(|w| w.last - w.first + 1).sum());
    let mut chained = starts.to_vec();
    roll_together(system, &leading, &jobs, None, &mut |job, sample, state, value| {
        let (_, w) = links[job];
        if sample == windows[w].first {
            chained[w][state] = value;
        }
    });
    for (own, start) in starts.iter().zip(&mut chained) {
        if !start.iter().all(|value| value.is_finite()) {
            start.clone_from(own);
        }
    }
    nearer_starts(system, experiment, parameters, [starts, &chained])
}

/// Sums of squared residuals, in units of the noise, of rollouts of all windows; infinite where one fails.
pub(super) fn squares(system: &System, experiment: &Experiment, parameters: &[f64], starts: &[Vec<f64>]) -> Vec<f64> {
    let point = Point { parameters: parameters.to_vec(), initial: starts.to_vec() };
    let jobs: Vec<Job> = (0..starts.len()).map(|window| Scene::job(&point, window)).collect();
    let residuals = Scene { system, experiment, free: &[] }.residuals(Purpose::Trials, &jobs);
    let sums = residuals.iter().map(|residual| residual.norm_squared());
    sums.map(|sum| if sum.is_finite() { sum } else { f64::INFINITY }).collect()
}

/// What the first samples of every window determine; of a system that steps on its own, the first readings as they are.
pub(super) fn as_read(system: &System, experiment: &Experiment) -> Vec<Vec<f64>> {
    let mut starts = guess_initial(system, experiment);
    if system.engine().is_none() {
        return starts;
    }
    for (window, start) in experiment.windows.iter().zip(&mut starts) {
        for (c, &state) in experiment.columns.iter().enumerate() {
            let first = experiment.logs[window.log].measured[c][window.first];
            if first.is_finite() {
                start[state] = first;
            }
        }
    }
    starts
}

/// The starts fitted along ever longer beginnings.
fn followed(
    system: &System,
    experiment: &Experiment,
    parameters: &[f64],
    (mut starts, most): (Vec<Vec<f64>>, usize),
) -> Result<Vec<Vec<f64>>> {
    let longest = experiment.windows.iter().map(|w| w.last - w.first + 1).max().unwrap_or(0);
    let mut count = FIRST;
    while count < longest.min(most) {
        let beginning = |w: &Window| Window { last: w.last.min(w.first + count - 1), ..*w };
        let cut = Experiment { windows: experiment.windows.iter().map(beginning).collect(), ..experiment.clone() };
        match STEPS.fit(system, &cut, parameters, &[], Some(&starts)) {
            Ok(fit) => starts = fit.initial,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // Longer ones would leave all bounds, too.
            Err(_) => break,
        }
        count = (LONGER * count as f64).ceil() as usize;
    }
    Ok(starts)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::stepping::Stepping;
    use crate::refine::{drawn_starts, draws_of_readings};
    use std::sync::Arc;

    #[test]
    fn a_start_is_found_over_many_saturations() {
        let inertia = 0.03;
        let (system, data) = Stepping::shaken_servo();
        let experiment = Experiment::new(&system, &data, Some(&[1e-3, 1e-2])).unwrap().with_windows_of(0.95);
        let per_value = |starts: &[Vec<f64>]| {
            let fit = Refine::default().fit(&system, &experiment, &[inertia], &[], Some(starts)).unwrap();
            fit.cost / experiment.n_values() as f64
        };
        let followed = per_value(&guess_starts(&system, &experiment, &[inertia]).unwrap());
        let at_once = per_value(&guess_initial(&system, &experiment));
        assert!(followed < 1.4, "{followed}");
        assert!(at_once > 2.0 * followed, "{at_once}, {followed}");
        // Along the motion, too: each fit hands its starts on to the next window.
        let mut starts = guess_initial(&system, &experiment);
        for _ in 0..4 {
            starts = chained_starts(&system, (&experiment, &experiment.windows), &[inertia], &starts);
            let fit = Refine::default().fit(&system, &experiment, &[inertia], &[], Some(&starts));
            starts = fit.unwrap().initial;
        }
        let chained = per_value(&starts);
        assert!(chained < 0.75 * at_once, "{at_once}, {chained}");
        let all: Vec<usize> = (0..experiment.windows.len()).collect();
        let mut draw = draws_of_readings(&system, &experiment);
        let drawn = per_value(&drawn_starts(&system, &experiment, &[inertia], &all, &mut draw).unwrap());
        assert!(drawn < 1.4, "{drawn}");
    }

    #[test]
    fn the_first_samples_have_starts_that_a_poor_fit_pulls_off() {
        // Logs of a spring of stiffness 5 without noise, and a model of 2: over a whole window other starts make up for it.
        let spring = Arc::new(Stepping::spring());
        let system = spring.system("x", ("k", 2.0));
        let command = |i: usize| (0.02 * i as f64).sin() + f64::from((i / 70).is_multiple_of(2));
        let data = spring.log(("x", 5.0), ([0.5, 0.0], 1000), command, command, |_, x| x);
        let experiment = Experiment::new(&system, &data, Some(&[1e-3, 1e-2])).unwrap().with_windows_of(0.5);
        let pulled = Refine::default().fit(&system, &experiment, &[2.0], &[], None).unwrap().initial;
        let first = first_starts(&system, &experiment, &[2.0]).unwrap();
        let off = |starts: &[Vec<f64>]| {
            let of = |(window, start): (&Window, &Vec<f64>)| {
                let log = &experiment.logs[window.log].measured;
                ((log[0][window.first] - start[0]) / 1e-3).hypot((log[1][window.first] - start[1]) / 1e-2)
            };
            experiment.windows.iter().zip(starts).map(of).sum::<f64>() / starts.len() as f64
        };
        assert!(off(&pulled) > 3.0 * off(&first), "{} and {}", off(&pulled), off(&first));
        let nearer = nearer_starts(&system, &experiment, &[5.0], [&pulled, &first]);
        let taken = nearer.iter().zip(&first).filter(|(nearer, first)| nearer == first).count();
        assert!(10 * taken > 9 * first.len(), "{taken} of {}", first.len());
    }
}
