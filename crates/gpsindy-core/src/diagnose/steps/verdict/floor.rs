//! The noise floor: the rollout error of a correct model.
//!
//! If held-out runs repeat the same controls from the same initial state, the floor is the difference between them, which
//! no model can predict: sensor noise, disturbances, and the effect of an uncertain initial state. Otherwise it is the
//! sensor noise and its effect on the initial state.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::floor::{COPIES, FIRST_SAMPLES, SAME_COMMAND, SAME_START, SAME_TIME};
use crate::diagnose::steps::verdict::start::{beginnings, starts};
use crate::refine::{Experiment, Jacobian, Log, Point};

/// What a floor is taken from where no runs repeat each other.
pub(crate) const SENSORS: &str = "sensor noise";

/// The floor of every column in its unit, and what it was taken from; `sensors`: columns of which an error with a memory is the sensor's own.
pub(crate) fn of(best: &Contestant, experiment: &Experiment, sensors: &[usize]) -> (Vec<f64>, &'static str) {
    match between_runs(&experiment.logs, &experiment.noise) {
        Some(floor) => (floor, "repeated runs"),
        None => (with_start(best, experiment, sensor_noise(best, &experiment.noise, sensors)), SENSORS),
    }
}

/// The sensor's noise by column in its unit: the winner's residual where a sensor may leave it (it then shows coloured noise, too), else the
/// noise of differences.
fn sensor_noise(best: &Contestant, noise: &[f64], sensors: &[usize]) -> Vec<f64> {
    let one = |(c, (&held_out, &train)): (usize, (&f64, &f64))| {
        let colour = &best.evidence.colours[c];
        let is_of_a_sensor = colour.is_of_a_sensor() || sensors.contains(&c);
        if is_of_a_sensor { train * colour.variance().sqrt() } else { held_out.min(train) }
    };
    noise.iter().zip(&best.experiment.noise).enumerate().map(one).collect()
}

/// The floor with what noise does to the starts: they are fitted to a few noisy samples, and the rollout carries their
/// error on. In an unstable plant that is most of what noise leaves.
fn with_start(best: &Contestant, experiment: &Experiment, floor: Vec<f64>) -> Vec<f64> {
    let own = Experiment { scale: best.experiment.scale.clone(), noise: floor.clone(), ..experiment.clone() };
    let beginning = beginnings(&own);
    let initial = starts(&best.system, &own, &best.refined.parameters, best.nominal_states());
    let point = Point { parameters: best.refined.parameters.clone(), initial };
    let Ok(jacobian) = Jacobian::new(&best.system, &own, &point, &[]) else { return floor };
    let n_columns = own.columns.len();
    let mut sums = vec![(0.0, 0.0); n_columns];
    for ((block, window), start) in jacobian.blocks.iter().zip(&own.windows).zip(&beginning) {
        let fitted = (start.last - start.first + 1) * n_columns;
        let seen = block.derivative.rows(0, fitted.min(block.derivative.nrows()));
        let mut information = seen.tr_mul(&seen);
        let ridge = 1e-9 * information.diagonal().max() + f64::MIN_POSITIVE;
        (0..information.nrows()).for_each(|i| information[(i, i)] += ridge);
        let Some(factor) = information.cholesky() else { return floor };
        let carried = factor.solve(&block.derivative.transpose());
        for row in (0..(window.last - window.first + 1) * n_columns).filter(|&row| block.present[row]) {
            let blur: f64 = block.derivative.row(row).iter().zip(carried.column(row).iter()).map(|(a, b)| a * b).sum();
            let (sum, count) = &mut sums[row % n_columns];
            // What was fitted comes out closer than the noise, the rest further.
            *sum += if row < fitted { 1.0 - blur.min(1.0) } else { 1.0 + blur };
            *count += 1.0;
        }
    }
    let blurred = |(floor, (sum, count)): (f64, (f64, f64))| {
        let factor = if count > 0.0 { sum / count } else { 1.0 };
        if factor.is_finite() { floor * factor.max(1.0).sqrt() } else { floor }
    };
    floor.into_iter().zip(sums).map(blurred).collect()
}

/// Standard deviation of every column between runs that repeat each other, in its unit; `None` without such runs.
///
/// The variance about the mean of each group, sample by sample, with one degree of freedom less than runs.
fn between_runs(logs: &[Log], noise: &[f64]) -> Option<Vec<f64>> {
    let mut groups: Vec<Vec<&Log>> = Vec::new();
    for log in logs {
        match groups.iter_mut().find(|group| repeats(group[0], log, noise)) {
            Some(group) => group.push(log),
            None => groups.push(vec![log]),
        }
    }
    groups.retain(|group| group.len() > 1);
    let one = |c: usize| {
        let (mut sum, mut degrees) = (0.0, 0usize);
        for group in &groups {
            let samples = group.iter().map(|l| l.time.len()).min().unwrap_or(0);
            for i in 0..samples {
                let values: Vec<f64> = group.iter().map(|l| l.measured[c][i]).filter(|v| v.is_finite()).collect();
                if values.len() > 1 {
                    let mean = values.iter().sum::<f64>() / values.len() as f64;
                    sum += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
                    degrees += values.len() - 1;
                }
            }
        }
        (degrees > 0).then(|| (sum / degrees as f64).sqrt())
    };
    let floor: Option<Vec<f64>> = (0..noise.len()).map(one).collect();
    // Copies of one log are no repetition of the experiment.
    let is_new = |floor: &Vec<f64>| floor.iter().zip(noise).all(|(floor, noise)| *floor > COPIES * noise);
    floor.filter(|floor| !groups.is_empty() && is_new(floor))
}

/// Whether two runs have the same times from their start, the same controls and the same start.
fn repeats(one: &Log, other: &Log, noise: &[f64]) -> bool {
    // One may end a little earlier.
    let samples = one.time.len().min(other.time.len());
    if 10 * samples < 9 * one.time.len().max(other.time.len()) || samples < 2 * FIRST_SAMPLES {
        return false;
    }
    let period = (one.time[samples - 1] - one.time[0]) / (samples - 1) as f64;
    let clock = |i: usize| (one.time[i] - one.time[0]) - (other.time[i] - other.time[0]);
    let same_times = (0..samples).all(|i| clock(i).abs() < SAME_TIME * period);
    same_times && same_controls(one, other, samples) && same_start(one, other, noise)
}

fn same_controls(one: &Log, other: &Log, samples: usize) -> bool {
    one.controls.iter().zip(&other.controls).all(|(a, b)| {
        let (a, b) = (&a[..samples], &b[..samples]);
        let size = a.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_COMMAND * size)
    })
}

fn same_start(one: &Log, other: &Log, noise: &[f64]) -> bool {
    one.measured.iter().zip(&other.measured).zip(noise).all(|((a, b), &noise)| {
        let differences: Vec<f64> =
            a.iter().zip(b).map(|(a, b)| a - b).filter(|d| d.is_finite()).take(FIRST_SAMPLES).collect();
        let count = differences.len() as f64;
        // The mean difference of `count` pairs has the deviation noise*sqrt(2/count).
        !differences.is_empty()
            && (differences.iter().sum::<f64>() / count).abs() <= SAME_START * noise * (2.0 / count).sqrt()
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::random::normal;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    const NOISE: f64 = 0.02;

    fn log(seed: u64, start: f64, gain: f64) -> Log {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let time: Vec<f64> = (0..400).map(|i| 7.0 * seed as f64 + 0.05 * f64::from(i)).collect();
        // A disturbance of every run's own doubles the variance in its second half.
        let measured = (0..400)
            .map(|i| {
                let own = if i >= 200 { 3f64.sqrt() } else { 1.0 };
                start * (-0.05 * f64::from(i)).exp() + own * NOISE * normal(&mut random)
            })
            .collect();
        let control = (0..400).map(|i| gain * (0.1 * f64::from(i)).sin()).collect();
        Log { name: format!("{seed}"), time, controls: vec![control], measured: vec![measured], ..Log::default() }
    }

    #[test]
    fn the_spread_between_repeated_runs_is_the_floor() {
        let floor = between_runs(&[log(1, 1.0, 2.0), log(2, 1.0, 2.0), log(3, 1.0, 2.0)], &[NOISE]).unwrap();
        // Half the samples have the noise's variance, half three times as much; 800 degrees of freedom show 2.5 %.
        assert!((floor[0] / (2f64.sqrt() * NOISE) - 1.0).abs() < 0.1, "{floor:?}");
    }

    #[test]
    fn another_command_or_another_start_is_no_repetition() {
        assert_eq!(between_runs(&[log(1, 1.0, 2.0), log(2, 1.0, 2.1)], &[NOISE]), None);
        assert_eq!(between_runs(&[log(1, 1.0, 2.0), log(2, 1.2, 2.0)], &[NOISE]), None);
        assert_eq!(between_runs(&[log(1, 1.0, 2.0)], &[NOISE]), None);
        assert_eq!(between_runs(&[log(1, 1.0, 2.0), log(1, 1.0, 2.0)], &[NOISE]), None);
    }

    #[test]
    fn runs_that_stand_alone_do_not_count() {
        let pair = between_runs(&[log(1, 1.0, 2.0), log(2, 1.0, 2.0)], &[NOISE]);
        let with_another = between_runs(&[log(1, 1.0, 2.0), log(4, 1.0, 5.0), log(2, 1.0, 2.0)], &[NOISE]);
        assert!(pair.is_some() && pair == with_another);
    }
}
