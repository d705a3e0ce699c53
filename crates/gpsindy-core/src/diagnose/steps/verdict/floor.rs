//! The noise floor: the rollout error of a correct model.
//!
//! If held-out runs repeat the same controls from the same initial state, the floor is the difference between them, which
//! no model can predict: sensor noise, disturbances, and the effect of an uncertain initial state. Otherwise it is the
//! sensor noise and its effect on the initial state.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::outputs;
use crate::diagnose::limits::floor::{COPIES, FIRST_SAMPLES, SAME_COMMAND, SAME_START, SAME_TIME, STARTS_DRAWN};
use crate::diagnose::limits::start::UNTOLD;
use crate::diagnose::steps::verdict::start::{beginnings, starts};
use crate::refine::{Block, Experiment, Jacobian, Log, Point, Window, drawn_around};
use nalgebra::{Cholesky, Dyn};
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

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
    let Some(fitted) = Fitted::new(best, &own) else { return floor };
    let blurs = if best.system.engine().is_some() { fitted.drawn(best, &own) } else { fitted.carried() };
    let n_columns = own.columns.len();
    let mut sums = vec![(0.0, 0.0); n_columns];
    for ((blurs, block), &seen) in blurs.iter().zip(&fitted.jacobian.blocks).zip(&fitted.seen) {
        for (row, blur) in blurs.iter().enumerate().filter(|(row, _)| block.present[*row]) {
            let (sum, count) = &mut sums[row % n_columns];
            // What was fitted comes out closer than the noise, the rest further.
            *sum += if row < seen { 1.0 - blur.min(1.0) } else { 1.0 + blur };
            *count += 1.0;
        }
    }
    let blurred = |(floor, (sum, count)): (f64, (f64, f64))| {
        let factor = if count > 0.0 { sum / count } else { 1.0 };
        if factor.is_finite() { floor * factor.max(1.0).sqrt() } else { floor }
    };
    floor.into_iter().zip(sums).map(blurred).collect()
}

/// Starts of held-out rollouts with what is known of their errors.
struct Fitted {
    point: Point,
    jacobian: Jacobian,
    /// By window: the values that its start was fitted to.
    seen: Vec<usize>,
    /// By window: the Cholesky factor of what they say of the start, in squares of the noise.
    known: Vec<Cholesky<f64, Dyn>>,
}

impl Fitted {
    fn new(best: &Contestant, own: &Experiment) -> Option<Self> {
        let initial = starts(&best.system, own, &best.refined.parameters, best.nominal_states());
        let point = Point { parameters: best.refined.parameters.clone(), initial };
        let jacobian = Jacobian::new(&best.system, own, &point, &[]).ok()?;
        let count = |start: &Window| (start.last - start.first + 1) * own.columns.len();
        let seen: Vec<usize> = beginnings(own).iter().map(count).collect();
        let far: Vec<f64> = own.scale.iter().map(|scale| UNTOLD * scale).collect();
        let all: Vec<usize> = (0..far.len()).collect();
        let known = |(block, &seen): (&Block, &usize)| block.known_start(seen, &all, &far);
        let known = jacobian.blocks.iter().zip(&seen).map(known).collect::<Option<_>>()?;
        Some(Self { point, jacobian, seen, known })
    }

    /// Variance that the error of a start has in every value of its window, in squares of the noise, along a straight line.
    fn carried(&self) -> Vec<Vec<f64>> {
        let one = |(block, known): (&Block, &Cholesky<f64, Dyn>)| {
            let carried = known.solve(&block.derivative.transpose());
            let value =
                |row: usize| block.derivative.row(row).iter().zip(&carried.column(row)).map(|(a, b)| a * b).sum();
            (0..block.derivative.nrows()).map(value).collect()
        };
        self.jacobian.blocks.iter().zip(&self.known).map(one).collect()
    }

    /// The same from rollouts of starts that are drawn: what steps meets limits and stops, beyond which no straight line leads. Each counts by
    /// what the values that it was fitted to say against it (importance sampling).
    fn drawn(&self, best: &Contestant, own: &Experiment) -> Vec<Vec<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let at = |initial: &[Vec<f64>]| outputs(&best.system, own, &best.refined.parameters, initial);
        let fitted = at(&self.point.initial);
        let mut sums: Vec<(Vec<f64>, f64)> = fitted.iter().map(|values| (vec![0.0; values.len()], 1.0)).collect();
        for _ in 0..STARTS_DRAWN {
            let mut initial = self.point.initial.clone();
            let mut expected = Vec::new();
            for (start, known) in initial.iter_mut().zip(&self.known) {
                let (drawn, distance) = drawn_around(start, known, &mut random);
                *start = drawn;
                expected.push(distance);
            }
            for (w, drawn) in at(&initial).into_iter().enumerate() {
                let block = &self.jacobian.blocks[w];
                let change: Vec<f64> = drawn.iter().zip(&fitted[w]).map(|(a, b)| a - b).collect();
                let seen = (0..self.seen[w].min(change.len())).filter(|&row| block.present[row]);
                let more: f64 = seen.map(|row| change[row] * (change[row] - 2.0 * block.residual[row])).sum();
                let weight = (0.5 * (expected[w] - more)).min(0.0).exp();
                let (sum, weights) = &mut sums[w];
                if weight > 0.0 && change.iter().all(|change| change.is_finite()) {
                    sum.iter_mut().zip(&change).for_each(|(sum, change)| *sum += weight * change * change);
                    *weights += weight;
                }
            }
        }
        sums.into_iter().map(|(sum, weights)| sum.into_iter().map(|sum| sum / weights).collect()).collect()
    }
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
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::limits::Budget;
    use crate::model::stepping::{Stepping, drawn};
    use crate::random::normal;
    use std::sync::Arc;

    const NOISE: f64 = 0.02;

    #[test]
    fn drawn_starts_blur_as_much_as_straight_lines_say_where_nothing_bends() {
        let noise = [1e-3, 1e-2];
        let spring = Arc::new(Stepping::spring());
        let system = spring.system("x", ("k", 5.0));
        let command = |i: usize| (0.02 * i as f64).sin() + f64::from((i / 70).is_multiple_of(2));
        let read = |i: usize, x: [f64; 2]| [0, 1].map(|j| x[j] + 3f64.sqrt() * noise[j] * drawn(2 * i + j));
        let data = spring.log(("x", 5.0), ([0.5, 0.0], 1000), command, command, read);
        let experiment = Experiment::new(&system, &data, Some(&noise)).unwrap().with_windows_of(0.4);
        let best = Fitter::default().nominal(system, experiment.clone(), Vec::new(), Budget::Usual).unwrap();
        let fitted = Fitted::new(&best, &experiment).unwrap();
        let mean = |blurs: Vec<Vec<f64>>| {
            let all: Vec<f64> = blurs.into_iter().flatten().collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let (straight, drawn) = (mean(fitted.carried()), mean(fitted.drawn(&best, &experiment)));
        // The start itself is one of the draws; 25 windows of 16 draws show a variance to a fifteenth.
        let expected = straight * STARTS_DRAWN as f64 / (STARTS_DRAWN + 1) as f64;
        assert!(straight > 0.02 && (drawn / expected - 1.0).abs() < 0.25, "{straight} and {drawn}");
    }

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
