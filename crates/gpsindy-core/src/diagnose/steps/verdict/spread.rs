//! Spread: whether random forces, as strong and as lasting as the training logs have them, predict the errors of held-out rollouts.
//!
//! No rollout follows a random force, but along its path the machine answers in a straight line, so that the distribution of the errors
//! is known: draws of the forces and of the sensors' noise give the band that holds 95 % of them, and how often it should hold those
//! that were seen.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::verify::{BAND_95, COVERED, SPREADS};
use crate::diagnose::steps::findings::{Forcing, StatedProcess};
use crate::diagnose::steps::verdict::start::starts;
use crate::random::normal;
use crate::refine::{Experiment, Path};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// How well a band holds the held-out errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    /// Share of the errors within the band that should hold 95 %.
    pub(crate) within: f64,
    /// Chance that no more lie within it where the forces are as they are stated.
    pub(crate) p_value: f64,
}

impl Spread {
    /// Whether the band covers the errors at its level.
    pub(crate) fn covers(self) -> bool {
        self.p_value > COVERED
    }
}

/// One held-out value: its error, and half the width of the band there, in the column's unit.
struct Value {
    window: usize,
    row: usize,
    half_width: f64,
    error: f64,
}

/// The errors of the rollouts `after` (one list a window, columns beside each other) in the band that `forcing` predicts.
pub(crate) fn of(
    best: &Contestant,
    experiment: &Experiment,
    moving: &[usize],
    after: &[Vec<f64>],
    forcing: &Forcing,
) -> Option<Spread> {
    let own = Experiment { scale: best.experiment.scale.clone(), ..experiment.clone() };
    let parameters = &best.refined.parameters;
    let initial = starts(&best.system, &own, parameters, best.nominal_states());
    let path = Path::new(&best.system, &own, parameters, &initial)?;
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut draw = || drawn(&path, best, &own, forcing, &mut random);
    let draws: Vec<Vec<Vec<f64>>> = (0..SPREADS).map(|_| draw()).collect();
    let count = draws.len() as f64;
    // Deviations of every value over the draws.
    let deviation = |w: usize, row: usize| {
        (draws.iter().map(|draw| draw[w][row] * draw[w][row]).sum::<f64>() / count).sqrt().max(f64::MIN_POSITIVE)
    };
    let n_columns = own.columns.len();
    let mut band: Vec<Value> = Vec::new();
    for (w, window) in own.windows.iter().enumerate() {
        for row in 0..after[w].len() {
            let (sample, c) = (row / n_columns, row % n_columns);
            let measured = own.logs[window.log].measured[c][window.first + sample];
            if moving.contains(&c) && measured.is_finite() {
                let error = measured - after[w][row];
                band.push(Value { window: w, row, half_width: BAND_95 * deviation(w, row), error });
            }
        }
    }
    let share = |error: &dyn Fn(&Value) -> f64| {
        band.iter().filter(|value| error(value).abs() <= value.half_width).count() as f64 / band.len().max(1) as f64
    };
    let within = share(&|value| value.error);
    let below = draws.iter().filter(|draw| share(&|value| draw[value.window][value.row]) <= within).count() as f64;
    Some(Spread { within, p_value: (1.0 + below) / (1.0 + count) })
}

/// Errors of all rollouts as forces and noise would make them, in the columns' units.
fn drawn(
    path: &Path,
    best: &Contestant,
    experiment: &Experiment,
    forcing: &Forcing,
    random: &mut ChaCha8Rng,
) -> Vec<Vec<f64>> {
    let rows: Vec<usize> = forcing.forces.iter().map(|process| process.state).collect();
    let mut force = |times: &[f64]| forcing.forces.iter().map(|stated| process(stated, times, random)).collect();
    let mut errors = path.pushed(&best.system, experiment, &rows, &mut force);
    let n_columns = experiment.columns.len();
    for (errors, window) in errors.iter_mut().zip(&experiment.windows) {
        let times = &experiment.logs[window.log].time[window.first..=window.last];
        for (c, &column) in experiment.columns.iter().enumerate() {
            let slow = forcing.errors.iter().filter(|process| process.state == column);
            let slow: Vec<Vec<f64>> = slow.map(|stated| process(stated, times, random)).collect();
            for (i, error) in errors.iter_mut().skip(c).step_by(n_columns).enumerate() {
                *error += experiment.noise[c] * normal(random) + slow.iter().map(|values| values[i]).sum::<f64>();
            }
        }
    }
    errors
}

/// An Ornstein-Uhlenbeck process at so many times, s.
fn process(process: &StatedProcess, times: &[f64], random: &mut ChaCha8Rng) -> Vec<f64> {
    let mut value = process.deviation * normal(random);
    let mut before = times.first().copied().unwrap_or(0.0);
    let next = |&t: &f64| {
        let kept = (-(t - before) / process.time).exp();
        value = kept * value + (1.0 - kept * kept).max(0.0).sqrt() * process.deviation * normal(random);
        before = t;
        value
    };
    times.iter().map(next).collect()
}
