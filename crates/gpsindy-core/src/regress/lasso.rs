//! LASSO by ADMM; along a path the optimum of the lambda before is walked to the next where rounding allows.
//!
//! `minimise 1/2 ||theta xi - target||^2 + lambda sum_j s_j |xi_j|`, `s_j` the norm of column j (or 1).
//!
//! Source: Boyd et al. 2011, Distributed Optimization and Statistical Learning via ADMM, sections 3.3, 3.4.1, 3.4.3, 4.2.4, 6.4.

use super::dense::{Cholesky, axpy, dot, gram, residual, times, transposed_times};
use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};
use factor::Factor;
use faer::Mat;
use walk::walk;

mod factor;
mod walk;

/// Settings of the LASSO.
#[derive(Debug, Clone, PartialEq)]
pub struct Lasso {
    /// Weight of the penalty, at least 0, in the unit of the target times the square root of the rows. Default 0.1.
    pub lambda: f64,
    /// Whether the penalty counts columns as if they had unit norm, so that it does not depend on units. Default true.
    pub scale_columns: bool,
    /// Whether the terms that stay are fitted again without the penalty. Default true.
    pub refit: bool,
    /// Weight of the quadratic term of the augmented Lagrangian at the start, above 0. Default 1.
    pub rho: f64,
    /// Whether rho follows the balance of the residuals (section 3.4.1). Default true.
    pub adapt_rho: bool,
    /// Over-relaxation alpha, in 0..2 (section 3.4.3). Default 1.6.
    pub relaxation: f64,
    /// Absolute tolerance of the residuals, relative to the target's norm. Default 1e-9.
    pub absolute_tolerance: f64,
    /// Relative tolerance of the residuals. Default 1e-9.
    pub relative_tolerance: f64,
    /// Duality gap to reach, relative to half the squared target; `None`: the residuals alone decide. Default 1e-10.
    pub gap_tolerance: Option<f64>,
    /// Iterations at most. Default 20000.
    pub max_iterations: usize,
}

impl Default for Lasso {
    fn default() -> Self {
        Self {
            lambda: 0.1,
            scale_columns: true,
            refit: true,
            rho: 1.0,
            adapt_rho: true,
            relaxation: 1.6,
            absolute_tolerance: 1e-9,
            relative_tolerance: 1e-9,
            gap_tolerance: Some(1e-10),
            max_iterations: 20_000,
        }
    }
}

impl Lasso {
    /// The settings with which the numbers of the paper were made: loose tolerances, fixed rho, neither scaling nor refit.
    ///
    /// It stops far from the optimum, and its results depend on where; use it to reproduce, not to identify.
    pub fn author(lambda: f64) -> Self {
        Self {
            lambda,
            scale_columns: false,
            refit: false,
            rho: 1.0,
            adapt_rho: false,
            relaxation: 1.0,
            absolute_tolerance: 1e-4,
            relative_tolerance: 1e-2,
            gap_tolerance: None,
            max_iterations: 1000,
        }
    }

    fn check(&self, levels: &[f64]) -> Result<()> {
        if let Some(found) = levels.iter().find(|l| !(l.is_finite() && **l >= 0.0)) {
            return Err(Error::range("lambda", "at least 0 and finite", found));
        }
        if !(self.rho.is_finite() && self.rho > 0.0) {
            return Err(Error::range("rho", "above 0 and finite", self.rho));
        }
        if !(self.relaxation > 0.0 && self.relaxation < 2.0) {
            return Err(Error::range("relaxation", "above 0 and below 2", self.relaxation));
        }
        if self.max_iterations == 0 {
            return Err(Error::range("max_iterations", "at least 1", 0));
        }
        Ok(())
    }
}

/// Ratio of the smallest lambda of a path to the largest.
const PATH_RATIO: f64 = 1e-5;

impl Regressor for Lasso {
    fn name(&self) -> &'static str {
        "lasso"
    }

    fn level(&self) -> f64 {
        self.lambda
    }

    /// Geometric, from `lambda_max = ||A'b||_inf` down.
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64> {
        geometric(problem.lambda_max(self.scale_columns), count)
    }

    /// The correlations `A'b` grow with the rows, those of unit columns with their square root.
    fn level_for(&self, rows: usize, of: usize) -> f64 {
        let share = rows as f64 / of as f64;
        if self.scale_columns { share.sqrt() } else { share }
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        self.check(levels)?;
        let mut solver = Admm::new(self, problem);
        // The paper's settings start every lambda from zero.
        let warm = self.gap_tolerance.is_some();
        let mut fits: Vec<Fit> = Vec::with_capacity(levels.len());
        let mut refitted: Option<(Vec<usize>, Fit)> = None;
        for &lambda in levels {
            // Once rounding decides, it does so for every smaller lambda, too: what was found last is used for them.
            if let (true, [.., before, last]) = (warm, &fits[..])
                && !before.converged
                && !last.converged
            {
                fits.push(Fit { level: lambda, iterations: 0, ..last.clone() });
                continue;
            }
            if !warm {
                solver.reset();
            }
            let walked = if warm && levels.len() > 1 { solver.walk(lambda) } else { None };
            let outcome = walked.unwrap_or_else(|| solver.solve(lambda));
            let coefficients = solver.coefficients();
            let mut fit = Fit { residual: problem.residual(&coefficients), coefficients, level: lambda, ..outcome };
            if self.refit {
                let support = fit.support();
                let again = match refitted.take() {
                    Some((of, again)) if of == support => again,
                    _ => problem.refit(&support),
                };
                fit = Fit { coefficients: again.coefficients.clone(), residual: again.residual, ..fit };
                refitted = Some((support, again));
            }
            fits.push(fit);
        }
        Ok(fits)
    }
}

/// `count` values in geometric steps from `top` to `top * PATH_RATIO`.
pub(super) fn geometric(top: f64, count: usize) -> Vec<f64> {
    let step = PATH_RATIO.powf(1.0 / (count.max(2) - 1) as f64);
    (0..count).map(|k| top * step.powi(k as i32)).collect()
}

/// The problem in scaled variables and the state of the iteration.
///
/// Unless the paper's settings are asked for, the iteration always sees unit columns, since it converges badly on
/// others; a penalty that counts columns as they are then has its own weight for each.
struct Admm<'a> {
    settings: &'a Lasso,
    a: Mat<f64>,
    b: Vec<f64>,
    correlations: Vec<f64>,
    scales: Vec<f64>,
    /// Share of lambda that each scaled variable is charged.
    weights: Vec<f64>,
    /// Norm of the target; the gap is counted in half its square.
    size: f64,
    /// `A'A`, and `AA'` where that is the smaller one.
    gram: Mat<f64>,
    outer: Option<Mat<f64>>,
    rho: f64,
    factor: Factor,
    z: Vec<f64>,
    u: Vec<f64>,
}

impl<'a> Admm<'a> {
    fn new(settings: &'a Lasso, problem: &Reduced) -> Self {
        let p = problem.n_terms();
        let scaled = settings.scale_columns || settings.gap_tolerance.is_some();
        let scale = |norm: f64| if scaled && norm > 0.0 { norm } else { 1.0 };
        let scales: Vec<f64> = problem.norms().iter().map(|&norm| scale(norm)).collect();
        let weights = scales.iter().map(|s| if settings.scale_columns { 1.0 } else { s.recip() }).collect();
        let mut a = problem.a.clone();
        for (j, s) in scales.iter().enumerate() {
            a.col_as_slice_mut(j).iter_mut().for_each(|v| *v /= s);
        }
        let b = problem.b.clone();
        let size = dot(&b, &b).sqrt();
        let outer = (a.nrows() < p).then(|| gram(a.transpose()));
        let gram = gram(a.as_ref());
        let factor = Factor::new(&gram, outer.as_ref(), settings.rho);
        Self {
            correlations: transposed_times(&a, &b),
            settings,
            a,
            b,
            scales,
            weights,
            size,
            gram,
            outer,
            rho: settings.rho,
            factor,
            z: vec![0.0; p],
            u: vec![0.0; p],
        }
    }

    fn reset(&mut self) {
        self.z.fill(0.0);
        self.u.fill(0.0);
    }

    fn coefficients(&self) -> Vec<f64> {
        self.z.iter().zip(&self.scales).map(|(z, s)| z / s).collect()
    }

    /// Iterates from the present state until the stopping rule holds; `self.z` is the answer.
    fn solve(&mut self, lambda: f64) -> Fit {
        let (settings, p) = (self.settings, self.z.len());
        let exact = settings.gap_tolerance.is_some();
        let unit = if exact { self.size } else { 1.0 };
        let mut outcome =
            Fit { coefficients: vec![], level: lambda, residual: 0.0, converged: false, iterations: 0, gap: f64::NAN };
        let mut s = vec![0.0; p];
        for iteration in 1..=settings.max_iterations {
            outcome.iterations = iteration;
            for (j, s) in s.iter_mut().enumerate() {
                *s = self.correlations[j] + self.rho * (self.z[j] - self.u[j]);
            }
            let x = self.factor.solve(&self.a, &s);
            let mut sums = [0.0; 5];
            for (j, &x) in x.iter().enumerate() {
                let relaxed = settings.relaxation * x + (1.0 - settings.relaxation) * self.z[j];
                let z = soft(relaxed + self.u[j], lambda * self.weights[j] / self.rho);
                self.u[j] += relaxed - z;
                let (primal, dual) = (x - z, self.rho * (z - self.z[j]));
                for (sum, value) in sums.iter_mut().zip([primal, dual, x, z, self.rho * self.u[j]]) {
                    *sum += value * value;
                }
                self.z[j] = z;
            }
            let [primal, dual, x_norm, z_norm, u_norm] = sums.map(f64::sqrt);
            let absolute = (p as f64).sqrt() * settings.absolute_tolerance * unit;
            let settled = primal <= absolute + settings.relative_tolerance * x_norm.max(z_norm)
                && dual <= absolute + settings.relative_tolerance * u_norm;
            if let Some(tolerance) = settings.gap_tolerance {
                if settled || iteration % 10 == 0 {
                    self.polish(lambda);
                    outcome.gap = self.gap(lambda);
                    outcome.converged = outcome.gap <= tolerance;
                }
            } else {
                outcome.converged = settled;
            }
            if outcome.converged {
                break;
            }
            if settings.adapt_rho && iteration % 10 == 0 {
                self.adapt(primal, dual);
            }
        }
        if outcome.gap.is_nan() {
            outcome.gap = self.gap(lambda);
        }
        outcome
    }

    /// The optimum from that of the lambda before, without iterating; `None` (and nothing changed) where that fails.
    fn walk(&mut self, lambda: f64) -> Option<Fit> {
        let tolerance = self.settings.gap_tolerance?;
        let before = self.z.clone();
        let iterations = walk(self, lambda)?;
        let gap = self.gap(lambda);
        if gap > tolerance || gap.is_nan() {
            self.z = before;
            return None;
        }
        self.couple();
        Some(Fit { coefficients: vec![], level: lambda, residual: 0.0, converged: true, iterations, gap })
    }

    /// The dual variable that belongs to z, so that the next lambda starts from an optimum.
    fn couple(&mut self) {
        let r = residual(&self.a, &self.b, &self.z);
        for (u, c) in self.u.iter_mut().zip(transposed_times(&self.a, &r)) {
            *u = c / self.rho;
        }
    }

    /// Boyd's rule with mu = 10, tau = 2, at most every tenth iteration, since each change costs a factorisation.
    fn adapt(&mut self, primal: f64, dual: f64) {
        let factor = if primal > 10.0 * dual {
            2.0
        } else if dual > 10.0 * primal {
            0.5
        } else {
            return;
        };
        self.rho = (self.rho * factor).clamp(1e-6, 1e6);
        self.u.iter_mut().for_each(|u| *u /= factor);
        self.factor = Factor::new(&self.gram, self.outer.as_ref(), self.rho);
    }

    /// Replaces z by the exact solution on its support and signs, where that solution keeps them.
    ///
    /// On the support S with signs s the optimum solves `A_S'A_S x = A_S'b - lambda s`; ADMM only has to find S and s.
    fn polish(&mut self, lambda: f64) {
        let support: Vec<usize> = (0..self.z.len()).filter(|&j| self.z[j] != 0.0).collect();
        if support.is_empty() || support.len() > self.a.nrows() {
            return;
        }
        let columns = Mat::from_fn(self.a.nrows(), support.len(), |i, k| self.a[(i, support[k])]);
        let Some(factor) = Cholesky::new(gram(columns.as_ref())) else { return };
        let mut x: Vec<f64> = support.iter().map(|&j| self.correlations[j] - self.charge(lambda, j)).collect();
        factor.solve(&mut x);
        // One step of iterative refinement: the Gram matrix has the squared condition number.
        let fitted = times(&columns, &x);
        let left: Vec<f64> = self.b.iter().zip(&fitted).map(|(b, f)| b - f).collect();
        let mut correction = transposed_times(&columns, &left);
        for (value, &j) in correction.iter_mut().zip(&support) {
            *value -= self.charge(lambda, j);
        }
        factor.solve(&mut correction);
        axpy(1.0, &correction, &mut x);
        if x.iter().zip(&support).any(|(x, &j)| x * self.z[j] <= 0.0 || !x.is_finite()) {
            return;
        }
        let before = self.z.clone();
        let gap_before = self.gap(lambda);
        for (&value, &j) in x.iter().zip(&support) {
            self.z[j] = value;
        }
        if self.gap(lambda) > gap_before {
            self.z = before;
            return;
        }
        self.couple();
    }

    /// Slope of the penalty in the scaled variable j.
    fn charge(&self, lambda: f64, j: usize) -> f64 {
        lambda * self.weights[j] * self.z[j].signum()
    }

    /// Primal minus dual objective at z, relative to half the squared target.
    ///
    /// The dual point is the residual, shrunk until `||A'r||_inf <= lambda`.
    fn gap(&self, lambda: f64) -> f64 {
        if self.size == 0.0 {
            return if self.z.iter().all(|z| *z == 0.0) { 0.0 } else { f64::INFINITY };
        }
        let r = residual(&self.a, &self.b, &self.z);
        let slopes = transposed_times(&self.a, &r);
        let largest = slopes.iter().zip(&self.weights).fold(0.0f64, |m, (c, w)| m.max(c.abs() / w));
        let shrink = if largest > lambda { lambda / largest } else { 1.0 };
        // P - D = 1/2 r'r + lambda |z|_1 - 1/2 b'b + 1/2 (b - s r)'(b - s r), written without the cancelling b'b.
        let penalty = lambda * self.z.iter().zip(&self.weights).map(|(z, w)| w * z.abs()).sum::<f64>();
        let gap = 0.5 * (1.0 + shrink * shrink) * dot(&r, &r) + penalty - shrink * dot(&self.b, &r);
        gap.max(0.0) / (0.5 * self.size * self.size)
    }
}

/// Soft thresholding, the proximal operator of `width * |v|`.
pub(super) fn soft(v: f64, width: f64) -> f64 {
    if v > width {
        v - width
    } else if v < -width {
        v + width
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests;
