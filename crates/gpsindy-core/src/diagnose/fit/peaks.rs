//! Spectral lines of a residual: where a periodic effect should look.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{CARRIED, FREQUENCIES, LINES, OF_LINE, OF_PERIOD};
use crate::expression::elementary::{cos, sin};
use crate::parallel;
use std::f64::consts::{PI, TAU};

/// Samples whose sines are computed side by side. Exact.
const LANES: usize = 8;

/// Angular frequencies at which the residual has lines, with neighbours as close as all logs together can part.
pub(crate) fn peaks(fitted: &Contestant) -> Vec<f64> {
    let experiment = &fitted.experiment;
    let n_columns = experiment.columns.len();
    let longest = experiment.longest_window();
    let total = experiment
        .logs
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), l| (a.min(l.time[0]), b.max(l.time[l.time.len() - 1])));
    if longest <= 0.0 {
        return Vec::new();
    }
    let spacing = PI / longest;
    let highest = CARRIED * PI / experiment.sampling_step();
    let count = FREQUENCIES.min((highest / spacing) as usize);
    let mut found: Vec<f64> = Vec::new();
    let powers: Vec<[f64; 2]> = parallel::map(1..=count, |k| powers_at(fitted, spacing * k as f64, n_columns));
    for kind in 0..2 {
        let powers: Vec<f64> = powers.iter().map(|powers| powers[kind]).collect();
        found.extend(lines(&powers).take(LINES).map(|k| spacing * (k + 1) as f64));
    }
    found.sort_by(f64::total_cmp);
    found.dedup();
    // Logs on one clock resolve finer than one log alone: offer what lies between, too, where the windows agree on the phase.
    let fine = PI / (total.1 - total.0).max(longest);
    let around = ((0.5 * spacing / fine).ceil() as i32).clamp(1, 6);
    let between = |&w: &f64| {
        let all = (-around..=around).map(|k| w + fine * f64::from(k)).filter(|&w| w > 0.0 && w.is_finite());
        let mut all: Vec<(f64, f64)> =
            all.map(|w| (w, coherent_power_at(fitted, w, n_columns, Seen::Values))).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all.into_iter().take(OF_LINE).map(|(w, _)| w).collect::<Vec<_>>()
    };
    let mut offered: Vec<f64> = parallel::map(&found, between).concat();
    // What is slower than a rollout shows in how their residuals rise from one to the next.
    let slow: Vec<f64> = (1..).map(|k| fine * f64::from(k)).take_while(|&w| w < spacing).take(FREQUENCIES).collect();
    let powers = parallel::map(&slow, |&w| coherent_power_at(fitted, w, n_columns, Seen::Rises));
    offered.extend(lines(&powers).take(OF_LINE).map(|k| slow[k]));
    offered.sort_by(f64::total_cmp);
    offered.dedup();
    offered
}

/// Places at which a spectrum is no lower than at its neighbours, the highest first.
fn lines(powers: &[f64]) -> impl Iterator<Item = usize> + use<> {
    let power = |k: usize| powers.get(k).copied().unwrap_or(0.0);
    let is_line = |&k: &usize| power(k) >= power(k + 1) && (k == 0 || power(k) >= power(k - 1));
    let mut lines: Vec<usize> = (0..powers.len()).filter(is_line).collect();
    lines.sort_by(|&a, &b| power(b).total_cmp(&power(a)));
    lines.into_iter()
}

/// What of a residual is looked at: its values, or by how much it rises from one sample to the next of a window.
#[derive(Clone, Copy, PartialEq)]
enum Seen {
    Values,
    Rises,
}

/// Power of the residual at one angular frequency on the clock of the logs, all windows in phase, each column in units of its own.
fn coherent_power_at(fitted: &Contestant, omega: f64, n_columns: usize, seen: Seen) -> f64 {
    let mut sums = vec![(0.0, 0.0, 0.0); n_columns];
    let mut waves = Waves::default();
    for (window, residual) in fitted.experiment.windows.iter().zip(&fitted.refined.residuals) {
        let time = &fitted.experiment.logs[window.log].time[window.first..=window.last];
        let stride = waves.fill(time, omega);
        let mut before = vec![if seen == Seen::Rises { f64::NAN } else { 0.0 }; n_columns];
        for ((sine, cosine), row) in waves.values().zip(residual.chunks_exact(n_columns).step_by(stride)) {
            for ((sum, value), before) in sums.iter_mut().zip(row).zip(&mut before).filter(|((_, v), _)| v.is_finite())
            {
                let used = value - *before;
                if seen == Seen::Rises {
                    *before = *value;
                }
                if used.is_finite() {
                    *sum = (sum.0 + used * cosine, sum.1 + used * sine, sum.2 + used * used);
                }
            }
        }
    }
    let of_column = |(real, imaginary, squares): &(f64, f64, f64)| match *squares > 0.0 {
        true => (real * real + imaginary * imaginary) / squares,
        false => 0.0,
    };
    sums.iter().map(of_column).sum()
}

/// Power of the residual at one angular frequency, summed over windows and columns: as it is, and of its differences.
fn powers_at(fitted: &Contestant, omega: f64, n_columns: usize) -> [f64; 2] {
    let mut powers = [0.0; 2];
    let mut waves = Waves::default();
    for (window, residual) in fitted.experiment.windows.iter().zip(&fitted.refined.residuals) {
        let time = &fitted.experiment.logs[window.log].time[window.first..=window.last];
        let stride = waves.fill(time, omega);
        for c in 0..n_columns {
            let mut sums = [(0.0, 0.0); 2];
            let mut last = 0.0;
            for ((sine, cosine), row) in waves.values().zip(residual.chunks_exact(n_columns).step_by(stride)) {
                let value = row[c];
                if value.is_finite() {
                    for (sum, used) in sums.iter_mut().zip([value, value - last]) {
                        *sum = (sum.0 + used * cosine, sum.1 + used * sine);
                    }
                    last = value;
                }
            }
            for (power, (real, imaginary)) in powers.iter_mut().zip(sums) {
                *power += (real * real + imaginary * imaginary) * (stride * stride) as f64 / time.len() as f64;
            }
        }
    }
    powers
}

/// Sine and cosine of a frequency at the samples of a window, which all columns share.
#[derive(Default)]
struct Waves {
    sines: Vec<f64>,
    cosines: Vec<f64>,
}

impl Waves {
    /// By how many samples it goes: long windows are thinned to what the frequency needs.
    fn fill(&mut self, time: &[f64], omega: f64) -> usize {
        let period = (time[time.len() - 1] - time[0]) / (time.len().max(2) - 1) as f64;
        // A window that is shorter than a period has several of its samples, too.
        let most = (time.len() as f64 / OF_PERIOD) as usize;
        let stride = ((TAU / omega / OF_PERIOD / period) as usize).min(most).max(1);
        self.sines.clear();
        self.cosines.clear();
        for first in (0..time.len()).step_by(stride * LANES) {
            // The last block is filled up with its last moment.
            let angles = std::array::from_fn(|lane| omega * time[(first + lane * stride).min(time.len() - 1)]);
            let mut values = [0.0; LANES];
            sin(&angles, &mut values);
            self.sines.extend_from_slice(&values);
            cos(&angles, &mut values);
            self.cosines.extend_from_slice(&values);
        }
        stride
    }

    fn values(&self) -> impl Iterator<Item = (&f64, &f64)> {
        self.sines.iter().zip(&self.cosines)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fit::fitter::Fitter;
    use crate::diagnose::limits::Budget;
    use crate::expression::Expression;
    use crate::model::{Model, State, System};
    use crate::random::normal;
    use crate::refine::Experiment;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    #[test]
    fn a_line_that_is_slower_than_a_rollout_is_offered() {
        let model = Model { states: vec![State::new("v", Expression::parse("-v").unwrap())], ..Model::default() };
        let (step, fine, omega) = (0.02, 20, 0.61);
        let time: Vec<f64> = (0..1000).map(|i| step * f64::from(i)).collect();
        let (mut random, mut v) = (ChaCha8Rng::seed_from_u64(1), 0.0);
        let values = Mat::from_fn(1000, 1, |i, _| {
            let read = v + 0.002 * normal(&mut random);
            for k in 0..fine {
                let h = step / f64::from(fine);
                v += h * (0.3 * (omega * (time[i] + h * f64::from(k)) + 0.4).sin() - v);
            }
            read
        });
        let data = Dataset::new(vec![Channel::new("v")], vec![Run { name: "swing".into(), time, values }]).unwrap();
        let system = System::new(&model).unwrap();
        let experiment = Experiment::new(&system, &data, Some(&[0.002])).unwrap().with_windows_of(1.0);
        let fitted = Fitter::default().nominal(system, experiment, Vec::new(), Budget::Thorough).unwrap();
        // As close as twenty seconds show it.
        let offered = peaks(&fitted);
        assert!(offered.iter().any(|found| (found - omega).abs() < 0.5 * PI / 20.0), "{offered:?}");
    }
}
