//! What a random process does within a step, and what it moves.

use super::driven::{GAUSS, TERMS};
use crate::diagnose::limits::forcing::SOON;

/// What one process does within a step, for steps of one length.
pub(super) struct Decay {
    /// Its own value after the step, and what it moves.
    pub(super) left: f64,
    pub(super) moved: [f64; TERMS],
    /// The same at the points of the integral over the step, with their weights.
    pub(super) points: [(f64, f64, [f64; TERMS]); 3],
}

impl Decay {
    /// Of a process with the correlation time `time` over `step`.
    pub(super) fn over(step: f64, time: f64) -> Self {
        let point = |(place, weight): (f64, f64)| {
            let s = 0.5 * step * (1.0 + place);
            (weight * step, (-s / time).exp(), weights(s, time))
        };
        Self { left: (-step / time).exp(), moved: weights(step, time), points: GAUSS.map(point) }
    }
}

/// Weights of `A^j e` in the integral of `e^(A r) e exp(-(s - r)/time)` over r from 0 to s: what a process that is one at the start moves
/// in the time s.
pub(super) fn weights(s: f64, time: f64) -> [f64; TERMS] {
    let mut all = [0.0; TERMS];
    // s^j / j!
    let mut powers = [1.0; TERMS];
    (1..TERMS).for_each(|j| powers[j] = powers[j - 1] * s / j as f64);
    if s < SOON * time {
        // The last by the series of the incomplete gamma function, and by parts back to the first, which loses no digits.
        let last = TERMS - 1;
        let (mut term, mut m) = (powers[last] * s / TERMS as f64, TERMS as f64);
        let least = 1e-12 * term;
        while term.abs() > least {
            all[last] += term;
            m += 1.0;
            term *= -s / time / m;
        }
        (0..last).rev().for_each(|j| all[j] = powers[j + 1] - all[j + 1] / time);
    } else {
        // By parts, each from the one before.
        all[0] = time * -(-s / time).exp_m1();
        (1..TERMS).for_each(|j| all[j] = time * (powers[j] - all[j - 1]));
    }
    all
}

/// Adds `factor` times the sum of `powers` (n entries each) with their weights.
#[inline(always)]
pub(super) fn add_series(to: &mut [f64], powers: &[f64], weights: &[f64; TERMS], factor: f64) {
    for (power, weight) in powers.chunks_exact(to.len()).zip(weights) {
        add(to, factor * weight, power);
    }
}

/// Adds `factor` times a vector.
#[inline(always)]
pub(super) fn add(to: &mut [f64], factor: f64, vector: &[f64]) {
    to.iter_mut().zip(vector).for_each(|(to, v)| *to += factor * v);
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
            for (j, weight) in weights(s, time).into_iter().enumerate() {
                let expected = integral(s, time, j);
                // The rule itself is coarse where the time is far below the step.
                assert!((weight / expected - 1.0).abs() < 1e-5, "{s} {time} {j}: {weight} {expected}");
            }
        }
    }
}
