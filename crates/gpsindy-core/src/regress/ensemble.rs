//! Stability of a support: the regression repeated on block bootstraps of the rows.
//!
//! Source: Kuensch 1989 (moving blocks); Meinshausen and Buehlmann 2010, Stability selection; Fasel et al. 2022, Ensemble-SINDy.

use super::{Reduced, Regressor};
use crate::error::{Error, Result};
use crate::parallel;
use faer::{Mat, MatRef};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Settings of the bootstrap.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ensemble {
    /// Bootstraps, at least 1. Default 100.
    pub replicates: usize,
    /// Rows of a block, at least 1; `None`: the cube root of the rows, rounded up, at least 5. Default `None`.
    pub block: Option<usize>,
    /// Seed; replicate k draws from stream k. Default 0.
    pub seed: u64,
}

impl Default for Ensemble {
    fn default() -> Self {
        Self { replicates: 100, block: None, seed: 0 }
    }
}

/// What the bootstraps say about each term.
#[derive(Debug, Clone, PartialEq)]
pub struct Stability {
    /// Share of the bootstraps in which the term is in, p of them.
    pub inclusion: Vec<f64>,
    /// Coefficients, one row a replicate (N x p), 0 where the term is out.
    pub coefficients: Mat<f64>,
}

impl Stability {
    /// The `level` quantile (0..1) of each coefficient over the bootstraps, zeros included; linear between neighbours.
    pub fn quantile(&self, level: f64) -> Vec<f64> {
        let n = self.coefficients.nrows();
        (0..self.coefficients.ncols())
            .map(|j| {
                let mut values = self.coefficients.col_as_slice(j).to_vec();
                values.sort_by(f64::total_cmp);
                let place = level.clamp(0.0, 1.0) * (n - 1) as f64;
                let below = place.floor() as usize;
                let above = (below + 1).min(n - 1);
                values[below] + (place - below as f64) * (values[above] - values[below])
            })
            .collect()
    }
}

impl Ensemble {
    /// Fits `regressor` at `level` on bootstraps of the rows; a block never crosses from one run into the next.
    ///
    /// # Shapes
    /// `theta`: (r x p). `target`: r. `lengths`: rows of each run, r in total.
    ///
    /// # Errors
    /// Those of [`Regressor::fit`], no replicate, or lengths of another total.
    pub fn run(
        &self,
        regressor: &dyn Regressor,
        level: f64,
        theta: MatRef<'_, f64>,
        target: &[f64],
        lengths: &[usize],
    ) -> Result<Stability> {
        let rows = theta.nrows();
        if self.replicates == 0 {
            return Err(Error::range("ensemble", "at least 1", 0));
        }
        if lengths.iter().sum::<usize>() != rows {
            return Err(Error::shape("rows of the runs", rows, lengths.iter().sum::<usize>()));
        }
        Reduced::new(theta, target)?;
        let block = self.block.unwrap_or_else(|| ((rows as f64).cbrt().ceil() as usize).max(5)).max(1);
        let starts = block_starts(lengths, block);
        let one = |k: usize| -> Result<Vec<f64>> {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(k as u64);
            let mut drawn = Vec::with_capacity(rows + block);
            while drawn.len() < rows {
                let (from, to) = starts[below(&mut rng, starts.len())];
                drawn.extend(from..to);
            }
            drawn.truncate(rows);
            let part = Mat::from_fn(rows, theta.ncols(), |i, j| theta[(drawn[i], j)]);
            let values: Vec<f64> = drawn.iter().map(|&i| target[i]).collect();
            let fits = regressor.path(&Reduced::new(part.as_ref(), &values)?, &[level])?;
            Ok(fits.into_iter().next().map(|fit| fit.coefficients).unwrap_or_default())
        };
        let fits: Vec<Vec<f64>> = parallel::try_map(0..self.replicates, one)?;
        let coefficients = Mat::from_fn(self.replicates, theta.ncols(), |k, j| fits[k][j]);
        let share = |j: usize| {
            coefficients.col_as_slice(j).iter().filter(|c| **c != 0.0).count() as f64 / self.replicates as f64
        };
        Ok(Stability { inclusion: (0..theta.ncols()).map(share).collect(), coefficients })
    }
}

/// Every block of `block` rows (the whole run where it is shorter) as (first row, row after the last).
fn block_starts(lengths: &[usize], block: usize) -> Vec<(usize, usize)> {
    let mut starts = Vec::new();
    let mut first = 0;
    for &n in lengths {
        let size = block.min(n);
        if n > 0 {
            starts.extend((0..=n - size).map(|i| (first + i, first + i + size)));
        }
        first += n;
    }
    starts
}

/// A uniform number below `n`, by multiplication (bias below n / 2^64).
fn below(rng: &mut ChaCha8Rng, n: usize) -> usize {
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::super::{Lasso, LeastSquares};
    use super::*;

    #[test]
    fn true_terms_are_always_in_and_false_ones_seldom() {
        let (theta, target) = random_problem(200, 8, &[(1, 1.0), (4, -2.0)], 0.05, 1);
        let level = 0.02 * Reduced::new(theta.as_ref(), &target).unwrap().lambda_max(true);
        let stability = Ensemble::default().run(&Lasso::default(), level, theta.as_ref(), &target, &[120, 80]).unwrap();
        for (j, share) in stability.inclusion.iter().enumerate() {
            if [1, 4].contains(&j) { assert_eq!(*share, 1.0) } else { assert!(*share < 0.5, "{j}: {share}") }
        }
    }

    #[test]
    fn quantiles_of_independent_rows_have_the_textbook_width() {
        // Slope of 400 rows, column and noise normal: standard error 1/20 for the column of size 1 (index 1).
        let (theta, target) = random_problem(400, 2, &[(1, 1.0)], 1.0, 2);
        let ensemble = Ensemble { replicates: 400, block: Some(1), seed: 3 };
        let stability = ensemble.run(&LeastSquares, 0.0, theta.as_ref(), &target, &[400]).unwrap();
        let width = stability.quantile(0.975)[1] - stability.quantile(0.025)[1];
        // 400 bootstraps know a 95 % width to about 6 %, and the sample itself to about 5 %.
        assert!((width / (2.0 * 1.96 / 20.0) - 1.0).abs() < 0.25, "{width}");
        let (low, middle) = (stability.quantile(0.1)[1], stability.quantile(0.5)[1]);
        assert!(low < middle && (middle - 1.0).abs() < 0.2);
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
        let (theta, target) = random_problem(60, 5, &[(0, 1.0)], 0.3, 4);
        let run = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let ensemble = Ensemble { replicates: 20, seed, ..Ensemble::default() };
            pool.install(|| ensemble.run(&Lasso::default(), 0.5, theta.as_ref(), &target, &[60]).unwrap())
        };
        assert_eq!(run(1, 7), run(3, 7));
        assert_ne!(run(1, 7), run(1, 8));
    }

    #[test]
    fn blocks_stay_inside_runs() {
        assert_eq!(block_starts(&[3, 1], 2), [(0, 2), (1, 3), (3, 4)]);
        let (theta, target) = random_problem(10, 2, &[], 1.0, 1);
        assert!(Ensemble::default().run(&LeastSquares, 0.0, theta.as_ref(), &target, &[4]).is_err());
    }
}
