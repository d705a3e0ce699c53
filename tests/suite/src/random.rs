//! Random numbers: one portable generator, own samplers, so that a seed keeps its case.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// A stream of random draws.
pub struct Draw {
    generator: ChaCha8Rng,
}

impl Draw {
    /// The stream number `stream` of a seed; streams of one seed do not overlap.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator }
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Log-uniform in [low, high).
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Log-uniform, rounded to three digits: a number that a data sheet could state.
    pub fn sheet(&mut self, low: f64, high: f64) -> f64 {
        digits(self.log(low, high), 3)
    }

    /// Standard normal, by Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// -1 or 1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// An index below `n`.
    pub fn index(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// An integer in [low, high].
    pub fn integer(&mut self, low: usize, high: usize) -> usize {
        low + self.index(high - low + 1)
    }
}

/// Rounds to `n` significant digits.
pub fn digits(value: f64, n: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let exponent = n - 1 - value.abs().log10().floor() as i32;
    // Through text, so that the number is the closest one to its decimal form.
    if exponent >= 0 {
        format!("{value:.*}", exponent as usize).parse().unwrap_or(value)
    } else {
        let scale = 10f64.powi(-exponent);
        (value / scale).round() * scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_repeat_and_streams_differ() {
        let list = |seed, stream| {
            let mut draw = Draw::new(seed, stream);
            (0..5).map(|_| draw.unit()).collect::<Vec<_>>()
        };
        assert_eq!(list(3, 1), list(3, 1));
        assert_ne!(list(3, 1), list(3, 2));
        assert_ne!(list(3, 1), list(4, 1));
    }

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let mut draw = Draw::new(1, 0);
        let values: Vec<f64> = (0..40_000).map(|_| draw.normal()).collect();
        let mean = values.iter().sum::<f64>() / 4e4;
        let variance = values.iter().map(|v| v * v).sum::<f64>() / 4e4;
        // Four standard errors: 1/200 of the mean, sqrt(2)/200 of the variance.
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03);
    }

    #[test]
    fn rounding_keeps_significant_digits() {
        assert_eq!(digits(0.012_345, 3), 0.0123);
        assert_eq!(digits(98_765.0, 3), 98_800.0);
        assert_eq!(digits(-1.5, 3), -1.5);
    }
}
