//! Held-out rollouts whose recordings have a size of their own, as those that were learned from have: whether a cause has the right form.
//!
//! The size of a recording that was not seen is a draw from the sizes of those that were; a mean over them misses it by that much however
//! right the cause is. It is found where the errors and the spread of the sizes have it together, and no further from the mean than such a
//! draw goes (Laird and Ware 1982, Biometrics 38(4)). Nothing that is reported as predicted makes use of it.

use crate::diagnose::fit::by_run::{differing, parts_of_recordings};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::own_sizes::of_their_own;
use crate::diagnose::limits::OWN_ROUNDS;
use crate::diagnose::limits::verify::{BAND_95, OF_BAND_95};
use crate::refine::{Experiment, Log};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Outputs of the corrected model on the held-out logs with such sizes, by the `rollouts` that give the `pooled` ones; none where no size
/// differs.
pub(crate) fn with_sizes_of_their_own(
    best: &Contestant,
    experiment: &Experiment,
    pooled: &[Vec<f64>],
    rollouts: &dyn Fn(&Experiment) -> Vec<Vec<f64>>,
) -> Option<Vec<Vec<f64>>> {
    let parts = parts_of_recordings(&experiment.logs);
    let mut now = pooled.to_vec();
    let mut held_out = experiment.clone();
    for parameter in differing(&best.experiment) {
        let variance = variance(best, parameter)?;
        let (mut more, mut step) = (vec![0.0; parts.len()], vec![variance.sqrt(); parts.len()]);
        for _ in 0..OWN_ROUNDS {
            let tried: Vec<f64> = more.iter().zip(&step).map(|(more, step)| more + step).collect();
            let ahead = rollouts(&of_their_own(&held_out, parameter, &tried));
            let next: Vec<f64> = (0..parts.len())
                .map(|log| nearest(&held_out, (&parts, log), (&now, &ahead), (&more, &step), variance))
                .collect();
            step = next.iter().zip(&tried).map(|(next, tried)| tried - next).collect();
            now = rollouts(&of_their_own(&held_out, parameter, &next));
            more = next;
            // A further step from there would say nothing that the noise does not.
            if step.iter().all(|step| step.powi(2) < f64::EPSILON * variance) {
                break;
            }
        }
        held_out = of_their_own(&held_out, parameter, &more);
    }
    (!differing(&best.experiment).is_empty()).then_some(now)
}

/// Variance of the size of a recording that was not seen about the mean of those that were, where so few of them say little of it: Student's
/// interval as a normal one.
fn variance(best: &Contestant, parameter: usize) -> Option<f64> {
    let logs = &best.experiment.logs;
    let of = |log: &Log| log.own.iter().find(|(index, _)| *index == parameter).map(|(_, more)| *more);
    let parts = parts_of_recordings(logs);
    let count = parts.iter().max()? + 1;
    let first = |part: usize| parts.iter().position(|&own| own == part);
    let values: Vec<f64> = (0..count).filter_map(|part| of(&logs[first(part)?])).collect();
    let (count, freedom) = (values.len() as f64, values.len().checked_sub(1)? as f64);
    let mean = values.iter().sum::<f64>() / count;
    let spread = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / freedom;
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(OF_BAND_95) / BAND_95;
    let variance = spread * (1.0 + 1.0 / count) * student * student;
    (variance > 0.0 && variance.is_finite()).then_some(variance)
}

/// The size of the recording of log number `log` by a straight line through the outputs `now` and those `ahead`, at sizes that are `more` and a
/// `step` beyond that.
fn nearest(
    experiment: &Experiment,
    (parts, log): (&[usize], usize),
    (now, ahead): (&[Vec<f64>], &[Vec<f64>]),
    (more, step): (&[f64], &[f64]),
    variance: f64,
) -> f64 {
    let columns = experiment.columns.len();
    let (mut along, mut square) = (-more[log] / variance, 1.0 / variance);
    for (w, window) in experiment.windows.iter().enumerate().filter(|(_, w)| parts[w.log] == parts[log]) {
        let measured = &experiment.logs[window.log].measured;
        for (row, (&now, &ahead)) in now[w].iter().zip(&ahead[w]).enumerate() {
            let (sample, c) = (window.first + row / columns, row % columns);
            let missed = (measured[c][sample] - now) / experiment.noise[c];
            let slope = (ahead - now) / (step[log] * experiment.noise[c]);
            if missed.is_finite() && slope.is_finite() {
                (along, square) = (along + slope * missed, square + slope * slope);
            }
        }
    }
    more[log] + along / square
}
