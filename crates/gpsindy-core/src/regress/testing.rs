//! Random problems with a known support, shared by the tests of the family.

pub(crate) use crate::random::normal;

use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

/// (r x p) normal columns of norms that differ by 100, and `theta * truth + noise`.
pub(crate) fn random_problem(
    r: usize,
    p: usize,
    truth: &[(usize, f64)],
    noise: f64,
    seed: u64,
) -> (Mat<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut theta = Mat::zeros(r, p);
    for j in 0..p {
        let scale = 10f64.powi(j as i32 % 3 - 1);
        theta.col_as_slice_mut(j).iter_mut().for_each(|v| *v = scale * normal(&mut rng));
    }
    let target =
        (0..r).map(|i| truth.iter().map(|&(j, c)| c * theta[(i, j)]).sum::<f64>() + noise * normal(&mut rng)).collect();
    (theta, target)
}
