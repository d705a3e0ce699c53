//! Random numbers from an explicit seed, the same on every machine.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// A number from 0 to 1, without 1.
pub(crate) fn uniform(random: &mut ChaCha8Rng) -> f64 {
    StandardUniform.sample(random)
}

/// A standard normal number.
pub(crate) fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;

    #[test]
    fn a_seed_gives_the_same_numbers_whatever_the_release_of_the_library() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let drawn = [normal(&mut random), normal(&mut random), uniform(&mut random)];
        assert_eq!(drawn, [-0.23484705855592097, -1.4108177006109994, 0.5965601809348549]);
    }

    #[test]
    fn normal_numbers_have_the_moments_and_the_tails_of_a_normal_variable() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let drawn: Vec<f64> = (0..100_000).map(|_| normal(&mut random)).collect();
        let moment = |power: i32| drawn.iter().map(|v| v.powi(power)).sum::<f64>() / drawn.len() as f64;
        // Standard errors: sqrt(1, 2, 15, 96) / sqrt(100,000), five of each.
        assert!(moment(1).abs() < 0.016 && (moment(2) - 1.0).abs() < 0.023, "{} {}", moment(1), moment(2));
        assert!(moment(3).abs() < 0.062 && (moment(4) - 3.0).abs() < 0.16, "{} {}", moment(3), moment(4));
    }
}
