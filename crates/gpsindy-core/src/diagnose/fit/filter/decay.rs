//! What a random process does within a step, and what it moves: one process in each of `L` lanes.

use super::driven::{GAUSS, TERMS};
use crate::diagnose::limits::forcing::SOON;

/// What one process does within a step, for steps of one length.
pub(super) struct Decay<const L: usize> {
    /// Its own value after the step, and what it moves.
    pub(super) left: [f64; L],
    pub(super) moved: [[f64; L]; TERMS],
    /// The same at the points of the integral over the step, with their weights.
    pub(super) points: [(f64, [f64; L], [[f64; L]; TERMS]); 3],
}

impl<const L: usize> Decay<L> {
    /// Of a process with the correlation times `time` over `step`.
    #[inline(always)]
    pub(super) fn over(step: f64, time: &[f64; L]) -> Self {
        let left = |s: f64| time.map(|time| (-s / time).exp());
        let point = |(place, weight): (f64, f64)| {
            let s = 0.5 * step * (1.0 + place);
            (weight * step, left(s), weights(s, time))
        };
        Self { left: left(step), moved: weights(step, time), points: GAUSS.map(point) }
    }
}

/// Weights of `A^j e` in the integral of `e^(A r) e exp(-(s - r)/time)` over r from 0 to s: what a process that is one at the start moves
/// in the time s.
#[inline(always)]
pub(super) fn weights<const L: usize>(s: f64, time: &[f64; L]) -> [[f64; L]; TERMS] {
    let mut all = [[0.0; L]; TERMS];
    // s^j / j!
    let mut powers = [1.0; TERMS];
    (1..TERMS).for_each(|j| powers[j] = powers[j - 1] * s / j as f64);
    // The last by the series of the incomplete gamma function, and by parts back to the first, which loses no digits.
    let last = TERMS - 1;
    let ratio = time.map(|time| (-s / time).max(-SOON));
    let first = powers[last] * s / TERMS as f64;
    let (mut term, mut m) = ([first; L], TERMS as f64);
    while term.iter().any(|term| term.abs() > 1e-12 * first) {
        m += 1.0;
        for lane in 0..L {
            all[last][lane] += term[lane];
            term[lane] *= ratio[lane] / m;
        }
    }
    for j in (0..last).rev() {
        for lane in 0..L {
            all[j][lane] = powers[j + 1] - all[j + 1][lane] / time[lane];
        }
    }
    // Long steps: by parts, each from the one before.
    for lane in (0..L).filter(|&lane| s >= SOON * time[lane]) {
        let time = time[lane];
        all[0][lane] = time * -(-s / time).exp_m1();
        (1..TERMS).for_each(|j| all[j][lane] = time * (powers[j] - all[j - 1][lane]));
    }
    all
}

/// Adds the sum of `powers` (n entries each) with their weights.
#[inline(always)]
pub(super) fn add_series<const L: usize>(to: &mut [[f64; L]], powers: &[f64], weights: &[[f64; L]; TERMS]) {
    for (power, weight) in powers.chunks_exact(to.len()).zip(weights) {
        for (to, power) in to.iter_mut().zip(power) {
            add(to, *power, weight);
        }
    }
}

/// Adds `factor` times the lanes of a number.
#[inline(always)]
pub(super) fn add<const L: usize>(to: &mut [f64; L], factor: f64, lanes: &[f64; L]) {
    (0..L).for_each(|lane| to[lane] += factor * lanes[lane]);
}

/// Adds a product, lane by lane.
#[inline(always)]
pub(super) fn add_product<const L: usize>(to: &mut [f64; L], a: &[f64; L], b: &[f64; L]) {
    (0..L).for_each(|lane| to[lane] += a[lane] * b[lane]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The integral by the trapezoidal rule.
    fn integral(s: f64, time: f64, j: usize) -> f64 {
        let (count, factorial) = (400_000, (1..=j).product::<usize>() as f64);
        let h = s / f64::from(count);
        let value = |i: i32| {
            let r = h * f64::from(i);
            let end = if i == 0 || i == count { 0.5 } else { 1.0 };
            end * r.powi(j as i32) / factorial * (-(s - r) / time).exp()
        };
        h * (0..=count).map(value).sum::<f64>()
    }

    #[test]
    fn the_weights_are_integrals_over_steps_short_and_long() {
        for (s, time) in [(0.01, 3.0), (0.4, 0.2), (0.4, 0.0501), (0.4, 0.0499), (2.0, 0.05), (50.0, 0.05)] {
            for (j, [weight]) in weights(s, &[time]).into_iter().enumerate() {
                let expected = integral(s, time, j);
                // The rule itself is coarse where the time is far below the step.
                assert!((weight / expected - 1.0).abs() < 1e-5, "{s} {time} {j}: {weight} {expected}");
            }
        }
    }

    #[test]
    fn each_lane_has_its_own_weights() {
        // Series and parts side by side.
        let times = [3.0, 0.2, 0.0501, 0.0499, 0.01, 7.0, 0.05, 0.4];
        let together = weights(0.4, &times);
        for (lane, &time) in times.iter().enumerate() {
            for (all, [alone]) in together.iter().zip(weights(0.4, &[time])) {
                assert!((all[lane] / alone - 1.0).abs() < 1e-9, "{time}: {} {alone}", all[lane]);
            }
        }
    }
}
