//! The length of rollouts: as long as the model follows the logs and longer rollouts carry more information.

use crate::diagnose::limits::{Budget, EXPLOSION, FOLLOWS, LOUD, OFF_COURSE, OFF_COURSE_NOISE, SHORTEST};
use crate::error::{Error, Result};
use crate::model::System;
use crate::refine::{Experiment, Free, Jacobian, Log, Window};

/// What the windows are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To distinguish effects: no longer than the noise asks for.
    Search,
    /// To predict: as long as the model stays near the logs.
    Rollout,
}

/// Windows short enough that the model stays near the logs and initial errors do not explode.
///
/// Starts from whole runs, or from the time of one motion where a simulator steps on its own, and halves; `watch` is called with how
/// often. Returns the experiment and, where they had to be cut, their length in s.
pub(crate) fn choose_windows(
    system: &System,
    experiment: Experiment,
    (parameters, free): (&[f64], &[Free]),
    purpose: Purpose,
    watch: &dyn Fn(usize) -> Result<()>,
) -> Result<(Experiment, Option<f64>)> {
    let longest = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).fold(0.0, f64::max);
    let samples = experiment.logs.iter().map(|l| l.time.len()).max().unwrap_or(1);
    let shortest = SHORTEST * experiment.rows_a_value();
    let mut parts = 1usize;
    if purpose == Purpose::Search && system.engine().is_some() && system.n_controls() > 0 {
        // A longer rollout costs more calls, and has more saturations and stops at which the fit of a wrong model ends.
        // Where the model follows the logs in these, they grow again.
        let motion = motion_time(&experiment);
        while longest / parts as f64 > motion && samples / (2 * parts) >= shortest {
            parts *= 2;
        }
    }
    let of_motion = parts;
    loop {
        watch(parts.ilog2() as usize)?;
        let length = longest / parts as f64;
        let cut = if parts == 1 { whole_runs(experiment.clone()) } else { experiment.clone().with_windows_of(length) };
        let smallest = samples / (2 * parts) < shortest;
        let at = (parameters, free);
        match Budget::Rough.refine().fit_watched(system, &cut, at, None, &|_| watch(parts.ilog2() as usize)) {
            Ok((fit, jacobian)) => {
                let loud = purpose == Purpose::Search && is_loud(system, &cut, &fit.residuals);
                let fits = stays_near(&cut, &fit.residuals, &jacobian) && !loud;
                if fits && parts == of_motion && parts > 1 && follows(&cut, &fit.residuals) {
                    return grown(system, (experiment, cut), at, parts, watch);
                }
                // Where time is up no further length is tried.
                if fits || smallest || experiment.tally.is_over() {
                    return Ok((cut, (parts > 1).then_some(length)));
                }
            }
            Err(error) if smallest => return Err(error),
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(_) => {}
        }
        parts *= 2;
    }
}

/// Windows of a simulator that steps, from `parts` of the longest run to longer ones, as far as the model follows the logs within their
/// noise: nothing piles up in them, and what is small shows in the longest ones first. The answer is that of [`choose_windows`].
fn grown(
    system: &System,
    (experiment, mut cut): (Experiment, Experiment),
    at: (&[f64], &[Free]),
    mut parts: usize,
    watch: &dyn Fn(usize) -> Result<()>,
) -> Result<(Experiment, Option<f64>)> {
    let longest = experiment.logs.iter().map(|l| l.time[l.time.len() - 1] - l.time[0]).fold(0.0, f64::max);
    while parts > 1 && !experiment.tally.is_over() {
        let half = parts / 2;
        let longer = match half {
            1 => whole_runs(experiment.clone()),
            _ => experiment.clone().with_windows_of(longest / half as f64),
        };
        let fit = Budget::Rough.refine().fit_watched(system, &longer, at, None, &|_| watch(half.ilog2() as usize));
        let (fit, jacobian) = match fit {
            Ok(found) => found,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // What can't be fitted there is one more reason for shorter ones.
            Err(_) => break,
        };
        if !follows(&longer, &fit.residuals) || !stays_near(&longer, &fit.residuals, &jacobian) {
            break;
        }
        (cut, parts) = (longer, half);
    }
    Ok((cut, (parts > 1).then_some(longest / parts as f64)))
}

/// Whether rollouts leave no more than the noise of every column, and a little.
fn follows(experiment: &Experiment, residuals: &[Vec<f64>]) -> bool {
    within(experiment, residuals, |c| FOLLOWS * experiment.noise[c])
}

/// How often windows can be halved before they are too short.
pub(crate) fn halvings(experiment: &Experiment) -> usize {
    let samples = experiment.logs.iter().map(|l| l.time.len()).max().unwrap_or(1);
    (samples / (SHORTEST * experiment.rows_a_value())).max(1).ilog2() as usize + 1
}

/// Whether rollouts stay near the logs, and errors of their starts do not explode.
pub(crate) fn stays_near(experiment: &Experiment, residuals: &[Vec<f64>], jacobian: &Jacobian) -> bool {
    near(experiment, residuals) && growth(experiment, jacobian) < EXPLOSION
}

/// Whether rollouts are so far above the noise that shorter ones would distinguish effects better.
///
/// A free motion has only its start: cut into pieces, each with a start of its own, it no longer shows what it loses.
pub(crate) fn is_loud(system: &System, experiment: &Experiment, residuals: &[Vec<f64>]) -> bool {
    let may_shrink = system.n_controls() > 0 && 0.5 * experiment.longest_window() >= motion_time(experiment);
    may_shrink && !within(experiment, residuals, |c| LOUD * experiment.noise[c])
}

/// The experiment with windows twice as long; none where every run is whole already.
pub(crate) fn doubled(experiment: &Experiment) -> Option<Experiment> {
    let length = 2.0 * experiment.longest_window();
    let longer = experiment.clone().with_windows_of(length);
    (longer.windows.len() < experiment.windows.len()).then_some(longer)
}

/// The experiment with windows half as long; none where they would be too short.
pub(crate) fn halved(experiment: &Experiment) -> Option<Experiment> {
    let samples = experiment.windows.iter().map(|w| w.last - w.first + 1).max().unwrap_or(0);
    let is_long = samples / 2 >= SHORTEST * experiment.rows_a_value();
    is_long.then(|| experiment.clone().with_windows_of(0.5 * experiment.longest_window()))
}

pub(crate) fn whole_runs(mut experiment: Experiment) -> Experiment {
    experiment.windows =
        experiment.logs.iter().enumerate().map(|(i, l)| Window { log: i, first: 0, last: l.time.len() - 1 }).collect();
    experiment
}

fn near(experiment: &Experiment, residuals: &[Vec<f64>]) -> bool {
    within(experiment, residuals, |c| {
        (OFF_COURSE * experiment.scale[experiment.columns[c]]).max(OFF_COURSE_NOISE * experiment.noise[c])
    })
}

/// Time in which the logged motion renews itself, s: where the autocorrelation of a column falls below 1/e, the longest.
fn motion_time(experiment: &Experiment) -> f64 {
    let of = |column: usize, log: &Log| {
        let values: Vec<f64> = log.measured[column].iter().copied().filter(|v| v.is_finite()).collect();
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count.max(1) as f64;
        let stride = (count / 2000).max(1);
        let product = |lag: usize| {
            let pairs = (0..count.saturating_sub(lag)).step_by(stride);
            let (sum, terms) =
                pairs.fold((0.0, 0.0), |(s, n), i| (s + (values[i] - mean) * (values[i + lag] - mean), n + 1.0));
            sum / f64::max(terms, 1.0)
        };
        let least = product(0) / std::f64::consts::E;
        let mut lag = 1;
        while lag < count / 2 && product(lag) > least {
            lag += (lag / 30).max(1);
        }
        lag as f64 * (log.time[log.time.len() - 1] - log.time[0]) / (log.time.len().max(2) - 1) as f64
    };
    let columns = 0..experiment.columns.len();
    columns.flat_map(|c| experiment.logs.iter().map(move |log| of(c, log))).fold(0.0, f64::max)
}

/// Whether the root mean square residual of every column stays within a limit, in the column's unit.
fn within(experiment: &Experiment, residuals: &[Vec<f64>], limit: impl Fn(usize) -> f64) -> bool {
    let n_columns = experiment.columns.len();
    (0..n_columns).all(|c| {
        let values = || residuals.iter().flat_map(|w| w.iter().skip(c).step_by(n_columns)).filter(|e| e.is_finite());
        let count = values().count().max(1) as f64;
        let rms = (values().map(|e| e * e).sum::<f64>() / count).sqrt() * experiment.noise[c];
        rms <= limit(c)
    })
}

/// How much larger an initial error is in the last tenth of a window than the state itself is.
fn growth(experiment: &Experiment, jacobian: &Jacobian) -> f64 {
    let n_columns = experiment.columns.len();
    let mut largest: f64 = 0.0;
    for block in &jacobian.blocks {
        let rows = block.derivative.nrows();
        for j in 0..jacobian.n_states {
            for row in (rows - (rows / 10).max(n_columns.min(rows)))..rows {
                let c = row % n_columns;
                let moved = block.derivative[(row, j)] * experiment.noise[c] * experiment.scale[j];
                largest = largest.max((moved / experiment.scale[experiment.columns[c]]).abs());
            }
        }
    }
    largest
}
