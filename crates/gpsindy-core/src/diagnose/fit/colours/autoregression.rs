//! An autoregression: noise of which each value remembers those before it.
//!
//! Source: Levinson's recursion, Brockwell and Davis 1991, Time Series, section 5.2; the order by BIC.

use crate::diagnose::limits::{FAR, NOISE, REPEATED, ROUGH, SHORT, SPECTRUM_FLOOR};

/// The noise of one column: `e_i = sum_k a_k e_(i-k) + innovation`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Colour {
    pub(crate) coefficients: Vec<f64>,
    /// Variance of the innovations, in squared noise units.
    pub(crate) innovation: f64,
    /// Variance of the errors of the predictions, each as the values before it that are there allow: the geometric mean, as
    /// the likelihood counts them. That of the innovations where nothing is missing.
    pub(crate) error: f64,
    /// Variance of the residual itself, and its covariances up to one lag less than there are coefficients.
    pub(crate) covariance: Vec<f64>,
    /// Values that are there.
    pub(crate) count: usize,
}

/// The autoregressive model of the order with the lowest BIC.
pub(crate) fn levinson(covariance: &[f64], count: usize) -> Colour {
    let tiny = f64::MIN_POSITIVE;
    let mut coefficients: Vec<f64> = Vec::new();
    let mut innovation = covariance[0].max(tiny);
    let score = |v: f64, order: usize| count as f64 * v.ln() + (order as f64) * (count.max(2) as f64).ln();
    let mut best = (score(innovation, 0), coefficients.clone(), innovation);
    for order in 1..covariance.len().min(count / 10 + 1) {
        let predicted: f64 = coefficients.iter().enumerate().map(|(k, a)| a * covariance[order - 1 - k]).sum();
        let reflection = (covariance[order] - predicted) / innovation;
        if !(reflection.abs() < 1.0) {
            break;
        }
        let reversed: Vec<f64> = coefficients.iter().rev().map(|a| reflection * a).collect();
        coefficients.iter_mut().zip(reversed).for_each(|(a, b)| *a -= b);
        coefficients.push(reflection);
        innovation = (innovation * (1.0 - reflection * reflection)).max(tiny);
        if score(innovation, order) < best.0 {
            best = (score(innovation, order), coefficients.clone(), innovation);
        }
    }
    let covariance = covariance[..best.1.len().max(1)].to_vec();
    Colour { coefficients: best.1, innovation: best.2, error: best.2, covariance, count }
}

impl Colour {
    /// Variance of the residual, in squared noise units.
    pub(crate) fn variance(&self) -> f64 {
        self.covariance[0]
    }

    /// How many values repeat each other: the sum of the squared correlations of one with all of a stretch of so many.
    ///
    /// That many fewer waves fill the band of the process than values were drawn (Bayley and Hammersley 1946, Supplement to the Journal
    /// of the Royal Statistical Society 8(2), the effective number of independent observations of a variance).
    pub(crate) fn repetition(&self, longest: usize) -> f64 {
        let order = self.coefficients.len();
        let mut last: Vec<f64> = self.covariance.iter().take(order).map(|c| c / self.variance()).collect();
        let mut sum = 1.0 + 2.0 * last.iter().skip(1).map(|r| r * r).sum::<f64>();
        for _ in order.max(1)..longest {
            let next: f64 = self.coefficients.iter().zip(last.iter().rev()).map(|(a, r)| a * r).sum();
            sum += 2.0 * next * next;
            if last.is_empty() || !(sum.is_finite()) {
                break;
            }
            last.remove(0);
            last.push(next);
        }
        if sum.is_finite() { sum.max(1.0) } else { longest.max(1) as f64 }
    }

    /// Whether a sensor may leave it: about as much as differences of the samples show, or with so short a memory that these see only the
    /// rough part of it.
    pub(crate) fn is_of_a_sensor(&self) -> bool {
        self.variance() < NOISE || (self.innovation < ROUGH && self.repetition(SHORT) <= REPEATED)
    }

    /// Spectrum at zero frequency, in squared noise units: what an average over many values sees of the noise.
    pub(crate) fn spectrum(&self) -> f64 {
        self.innovation / (1.0 - self.coefficients.iter().sum::<f64>()).powi(2).max(SPECTRUM_FLOOR)
    }

    /// Variance of the innovations, as far as the residual can be noise.
    ///
    /// Differences of samples see a sensor's innovations, whatever its colour (a random walk's as 3.6). Innovations far
    /// above that belong to structure, and say how smooth it is, not how large: an effect that leaves a large smooth rest
    /// would win over one that leaves a small rough one. Such a rest counts by its size, less what the slowest noise
    /// (a coefficient of 0.975) would keep of it.
    pub(crate) fn noise_like(&self) -> f64 {
        self.error.max((self.variance() / FAR).min(self.error * self.error / ROUGH))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colour(coefficients: &[f64], covariance: &[f64]) -> Colour {
        let (coefficients, covariance) = (coefficients.to_vec(), covariance.to_vec());
        Colour { coefficients, innovation: 1.0, error: 1.0, covariance, count: 1000 }
    }

    #[test]
    fn values_repeat_each_other_as_the_squares_of_their_correlations_say() {
        assert!((colour(&[], &[7.0]).repetition(500) - 1.0).abs() < 1e-12);
        // Correlations of 0.9^k: (1 + 0.81)/(1 - 0.81), whatever the variance.
        assert!((colour(&[0.9], &[3.0]).repetition(500) - 1.81 / 0.19).abs() < 1e-9);
        // A swing of 20 samples a period that hardly decays repeats itself though it has a mean of nothing: half of its values do.
        let (decay, turn) = (0.999_f64, std::f64::consts::TAU / 20.0);
        let coefficients = [2.0 * decay * turn.cos(), -decay * decay];
        let first = coefficients[0] / (1.0 - coefficients[1]);
        let found = colour(&coefficients, &[1.0, first]).repetition(100);
        assert!(found > 70.0 && found < 110.0, "{found}");
        // Correlations reach no further than the stretch.
        assert!(colour(&[0.999], &[1.0]).repetition(10) < 19.0);
    }

    #[test]
    fn a_short_memory_is_a_sensors_and_a_long_one_is_not() {
        let of = |coefficient: f64, variance: f64| {
            let innovation = variance * (1.0 - coefficient * coefficient);
            Colour { innovation, ..colour(&[coefficient], &[variance]) }
        };
        // Differences of the samples see less of its variance than there is.
        assert!(of(0.35, 1.8).is_of_a_sensor());
        // As little of anything is noise; as much with a long memory, or far more with a short one, is not.
        assert!(of(0.95, 1.4).is_of_a_sensor());
        assert!(!of(0.8, 1.8).is_of_a_sensor());
        assert!(!of(0.35, 9.0).is_of_a_sensor());
    }
}
