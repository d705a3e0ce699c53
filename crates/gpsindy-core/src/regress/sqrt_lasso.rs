//! LASSO with the norm not squared, as the paper prints it, by ADMM.
//!
//! `minimise ||theta xi - target||_2 + lambda sum_j s_j |xi_j|`
//!
//! Its solutions are those of the LASSO with lambda times the residual's norm, so a good lambda does not depend on the noise.
//!
//! Source: Belloni, Chernozhukov, Wang 2011, Square-root lasso; Boyd et al. 2011, section 6.1 (norms), for the splitting
//! `w = theta xi - target`, `z = xi`.

use super::dense::{Cholesky, axpy, dot, gram, residual, times, transposed_times};
use super::lasso::{geometric, soft};
use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};
use faer::Mat;

/// Settings of the LASSO with a plain norm.
#[derive(Debug, Clone, PartialEq)]
pub struct SqrtLasso {
    /// Weight of the penalty, at least 0; above 1 with scaled columns nothing is left. Default 0.1.
    pub lambda: f64,
    /// Whether the penalty counts columns as if they had unit norm. Default true.
    pub scale_columns: bool,
    /// Whether the terms that stay are fitted again without the penalty. Default true.
    pub refit: bool,
    /// Duality gap to reach, relative to the target's norm. Default 1e-8.
    pub gap_tolerance: f64,
    /// Iterations at most. Default 20000.
    pub max_iterations: usize,
}

impl Default for SqrtLasso {
    fn default() -> Self {
        Self { lambda: 0.1, scale_columns: true, refit: true, gap_tolerance: 1e-8, max_iterations: 20_000 }
    }
}

/// Over-relaxation, as in [`super::Lasso`].
const RELAXATION: f64 = 1.6;

impl Regressor for SqrtLasso {
    fn name(&self) -> &'static str {
        "sqrt-lasso"
    }

    fn level(&self) -> f64 {
        self.lambda
    }

    /// Geometric, from `lambda_max = ||A'b||_inf / ||b||` down.
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64> {
        let size = problem.target_square().sqrt();
        let top = if size > 0.0 { problem.lambda_max(self.scale_columns) / size } else { 0.0 };
        geometric(top, count)
    }

    fn level_for(&self, rows: usize, of: usize) -> f64 {
        if self.scale_columns { 1.0 } else { (rows as f64 / of as f64).sqrt() }
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        if let Some(found) = levels.iter().find(|l| !(l.is_finite() && **l >= 0.0)) {
            return Err(Error::range("lambda", "at least 0 and finite", found));
        }
        if self.max_iterations == 0 {
            return Err(Error::range("max_iterations", "at least 1", 0));
        }
        let Some(mut solver) = Admm::new(self, problem) else {
            // Only a matrix with entries near the largest number can't be factorised after 1 was added to its diagonal.
            return Err(Error::NotConverged {
                what: "sqrt-lasso".into(),
                why: "theta is too large; scale the columns".into(),
            });
        };
        let mut fits = Vec::with_capacity(levels.len());
        for &lambda in levels {
            let outcome = solver.solve(lambda);
            let coefficients: Vec<f64> = solver.z.iter().zip(&solver.scales).map(|(z, s)| z / s).collect();
            let mut fit = Fit { residual: problem.residual(&coefficients), coefficients, ..outcome };
            if self.refit {
                let again = problem.refit(&fit.support());
                fit = Fit { coefficients: again.coefficients, residual: again.residual, ..fit };
            }
            fits.push(fit);
        }
        Ok(fits)
    }
}

/// Target and columns in scaled units, and the state of the iteration.
struct Admm<'a> {
    settings: &'a SqrtLasso,
    a: Mat<f64>,
    /// Target of norm 1.
    b: Vec<f64>,
    scales: Vec<f64>,
    /// Share of lambda that each scaled variable is charged.
    weights: Vec<f64>,
    factor: Cholesky,
    rho: f64,
    z: Vec<f64>,
    w: Vec<f64>,
    u: Vec<f64>,
    y: Vec<f64>,
}

impl<'a> Admm<'a> {
    fn new(settings: &'a SqrtLasso, problem: &Reduced) -> Option<Self> {
        let p = problem.n_terms();
        let size = problem.target_square().sqrt();
        let size = if size > 0.0 { size } else { 1.0 };
        // The iteration sees unit columns; a penalty that counts them as they are has its own weight for each.
        let scale = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
        let columns: Vec<f64> = problem.norms().iter().map(|&norm| scale(norm)).collect();
        let mut a = problem.a.clone();
        for (j, s) in columns.iter().enumerate() {
            a.col_as_slice_mut(j).iter_mut().for_each(|v| *v /= s);
        }
        let b: Vec<f64> = problem.b.iter().map(|v| v / size).collect();
        let mut normal = gram(a.as_ref());
        for i in 0..p {
            normal[(i, i)] += 1.0;
        }
        let q = a.nrows();
        let weight = |s: &f64| if settings.scale_columns { 1.0 } else { s.recip() };
        Some(Self {
            weights: columns.iter().map(weight).collect(),
            factor: Cholesky::new(normal)?,
            w: b.iter().map(|v| -v).collect(),
            settings,
            a,
            b,
            scales: columns.iter().map(|s| s / size).collect(),
            rho: 1.0,
            z: vec![0.0; p],
            u: vec![0.0; q],
            y: vec![0.0; p],
        })
    }

    fn solve(&mut self, lambda: f64) -> Fit {
        let mut outcome =
            Fit { coefficients: vec![], level: lambda, residual: 0.0, converged: false, iterations: 0, gap: f64::NAN };
        for iteration in 1..=self.settings.max_iterations {
            outcome.iterations = iteration;
            // x-update: (A'A + 1) x = A'(b + w - u) + (z - y), free of rho.
            let lifted: Vec<f64> = (0..self.b.len()).map(|i| self.b[i] + self.w[i] - self.u[i]).collect();
            let mut x = transposed_times(&self.a, &lifted);
            for (j, x) in x.iter_mut().enumerate() {
                *x += self.z[j] - self.y[j];
            }
            self.factor.solve(&mut x);
            let fitted = times(&self.a, &x);
            let (mut primal, mut dual) = (0.0, 0.0);
            let relaxed: Vec<f64> = (0..self.b.len())
                .map(|i| RELAXATION * (fitted[i] - self.b[i]) + (1.0 - RELAXATION) * self.w[i] + self.u[i])
                .collect();
            // Proximal operator of the norm: shrink the whole vector by 1/rho.
            let length = dot(&relaxed, &relaxed).sqrt();
            let shrink = if length > 0.0 { (1.0 - 1.0 / (self.rho * length)).max(0.0) } else { 0.0 };
            for i in 0..self.b.len() {
                let w = shrink * relaxed[i];
                self.u[i] = relaxed[i] - w;
                primal += (fitted[i] - self.b[i] - w).powi(2);
                dual += (self.rho * (w - self.w[i])).powi(2);
                self.w[i] = w;
            }
            for (j, &x) in x.iter().enumerate() {
                let relaxed = RELAXATION * x + (1.0 - RELAXATION) * self.z[j] + self.y[j];
                let z = soft(relaxed, lambda * self.weights[j] / self.rho);
                self.y[j] = relaxed - z;
                primal += (x - z).powi(2);
                dual += (self.rho * (z - self.z[j])).powi(2);
                self.z[j] = z;
            }
            if iteration % 10 == 0 {
                self.polish(lambda);
                outcome.gap = self.gap(lambda);
                if outcome.gap <= self.settings.gap_tolerance {
                    outcome.converged = true;
                    break;
                }
                self.adapt(primal.sqrt(), dual.sqrt());
            }
        }
        outcome
    }

    /// As in the LASSO; here no factorisation depends on rho.
    fn adapt(&mut self, primal: f64, dual: f64) {
        let factor = if primal > 10.0 * dual {
            2.0
        } else if dual > 10.0 * primal {
            0.5
        } else {
            return;
        };
        self.rho = (self.rho * factor).clamp(1e-6, 1e6);
        self.u.iter_mut().chain(&mut self.y).for_each(|v| *v /= factor);
    }

    /// The exact solution on the support and signs of z, where it keeps them.
    ///
    /// With `G = A_S'A_S`, `x = G^-1 (A_S'b - lambda sigma s)` and `sigma = ||b - A_S x||`:
    /// `sigma^2 = rss / (1 - lambda^2 s'G^-1 s)`, rss the residual of least squares on the support.
    fn polish(&mut self, lambda: f64) {
        let support: Vec<usize> = (0..self.z.len()).filter(|&j| self.z[j] != 0.0).collect();
        if support.is_empty() || support.len() >= self.a.nrows() {
            return;
        }
        let columns = Mat::from_fn(self.a.nrows(), support.len(), |i, k| self.a[(i, support[k])]);
        let Some(factor) = Cholesky::new(gram(columns.as_ref())) else { return };
        let signs: Vec<f64> = support.iter().map(|&j| self.weights[j] * self.z[j].signum()).collect();
        let mut direction = signs.clone();
        factor.solve(&mut direction);
        let mut x = transposed_times(&columns, &self.b);
        factor.solve(&mut x);
        let left = residual(&columns, &self.b, &x);
        let room = 1.0 - lambda * lambda * dot(&signs, &direction);
        if room <= 0.0 {
            return;
        }
        axpy(-lambda * (dot(&left, &left) / room).sqrt(), &direction, &mut x);
        if x.iter().zip(&signs).any(|(x, s)| x * s <= 0.0 || !x.is_finite()) {
            return;
        }
        let before = (self.gap(lambda), self.z.clone());
        for (&value, &j) in x.iter().zip(&support) {
            self.z[j] = value;
        }
        if self.gap(lambda) > before.0 {
            self.z = before.1;
        }
    }

    /// Primal minus dual objective at z, for a target of norm 1. Dual: `max b'v`, `||v|| <= 1`, `||A'v||_inf <= lambda`.
    fn gap(&self, lambda: f64) -> f64 {
        let r = residual(&self.a, &self.b, &self.z);
        let length = dot(&r, &r).sqrt();
        let slopes = transposed_times(&self.a, &r);
        let largest = slopes.iter().zip(&self.weights).fold(0.0f64, |m, (c, w)| m.max(c.abs() / w));
        let size = if lambda > 0.0 { length.max(largest / lambda) } else { f64::INFINITY };
        let value = length + lambda * self.z.iter().zip(&self.weights).map(|(z, w)| w * z.abs()).sum::<f64>();
        let bound = if size > 0.0 { dot(&self.b, &r) / size } else { 0.0 };
        (value - bound).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Lasso;
    use super::super::testing::random_problem;
    use super::*;

    fn plain(lambda: f64) -> SqrtLasso {
        SqrtLasso { lambda, scale_columns: false, refit: false, ..SqrtLasso::default() }
    }

    #[test]
    fn one_column_has_its_closed_form() {
        // a = (1, 0), b = (2, 1): minimise sqrt((2 - x)^2 + 1) + x/2: (2 - x) / sqrt(..) = 1/2, so 2 - x = 1/sqrt(3).
        let theta = Mat::from_fn(2, 1, |i, _| if i == 0 { 1.0 } else { 0.0 });
        let fit = plain(0.5).fit(theta.as_ref(), &[2.0, 1.0]).unwrap();
        assert!((fit.coefficients[0] - (2.0 - 1.0 / 3f64.sqrt())).abs() < 1e-8, "{fit:?}");
    }

    #[test]
    fn it_is_the_lasso_with_lambda_times_the_residual() {
        for seed in 0..10 {
            let (theta, target) = random_problem(40, 8, &[(1, 1.0), (2, -0.5), (5, 4.0)], 0.5, seed);
            for lambda in [0.3, 0.05] {
                let ours =
                    SqrtLasso { refit: false, lambda, ..SqrtLasso::default() }.fit(theta.as_ref(), &target).unwrap();
                assert!(ours.converged, "seed {seed}: gap {}", ours.gap);
                let same = Lasso { refit: false, lambda: lambda * ours.residual.sqrt(), ..Lasso::default() };
                let theirs = same.fit(theta.as_ref(), &target).unwrap();
                for (x, y) in ours.coefficients.iter().zip(&theirs.coefficients) {
                    // The gap of 1e-8 leaves about its square root in the coefficients.
                    assert!((x - y).abs() < 1e-3 * (0.1 + y.abs()), "seed {seed}: {x} {y}");
                }
            }
        }
    }

    #[test]
    fn the_same_lambda_serves_every_noise() {
        // Belloni et al., equation 2: lambda = 1.1 Phi^-1(1 - 0.05 / (2 p)) / sqrt(r) for unit columns.
        let lambda = 1.1 * 2.81 / (120f64).sqrt();
        for noise in [1e-3, 1e-2, 1e-1] {
            let (theta, target) = random_problem(120, 10, &[(1, 3.0), (4, -3.0)], noise, 17);
            let fit = SqrtLasso { lambda, ..SqrtLasso::default() }.fit(theta.as_ref(), &target).unwrap();
            assert_eq!(fit.support(), [1, 4], "noise {noise}");
        }
    }

    #[test]
    fn a_target_of_zeros_and_a_large_lambda_leave_nothing() {
        let (theta, target) = random_problem(20, 4, &[(1, 3.0)], 0.1, 1);
        assert_eq!(plain(0.1).fit(theta.as_ref(), &[0.0; 20]).unwrap().n_terms(), 0);
        assert_eq!(
            SqrtLasso { lambda: 1.001, ..SqrtLasso::default() }.fit(theta.as_ref(), &target).unwrap().n_terms(),
            0
        );
        assert!(plain(-1.0).fit(theta.as_ref(), &target).is_err());
    }
}
