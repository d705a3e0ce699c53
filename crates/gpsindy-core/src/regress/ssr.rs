//! Stepwise sparse regression: terms leave one at a time.
//!
//! Source: Boninsegna, Nueske, Clementi 2018, Sparse learning of stochastic dynamical equations.

use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};

/// Which term leaves next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SsrRule {
    /// The one of the smallest coefficient, times its column's norm where columns are scaled.
    Coefficient,
    /// The one whose loss raises the residual least.
    Residual,
}

/// Backward elimination from all terms to none.
#[derive(Debug, Clone, PartialEq)]
pub struct Ssr {
    /// Which term leaves. Default by residual.
    pub rule: SsrRule,
    /// Number of terms to stop at; `None`: the number of the smallest BIC, `r ln(residual / r) + k ln r`. Default `None`.
    pub size: Option<usize>,
    /// Whether coefficients are compared as if columns had unit norm. Default true.
    pub scale_columns: bool,
}

impl Default for Ssr {
    fn default() -> Self {
        Self { rule: SsrRule::Residual, size: None, scale_columns: true }
    }
}

impl Ssr {
    /// By coefficient, unscaled, as the literature does.
    pub fn by_coefficient() -> Self {
        Self { rule: SsrRule::Coefficient, size: None, scale_columns: false }
    }

    /// By residual.
    pub fn by_residual() -> Self {
        Self::default()
    }

    /// The fits of p, p - 1, ..., 0 terms.
    fn eliminate(&self, problem: &Reduced) -> Vec<Fit> {
        let mut support: Vec<usize> = (0..problem.n_terms()).collect();
        let mut fits = vec![problem.refit(&support)];
        while !support.is_empty() {
            let Some(last) = fits.last() else { break };
            let leaves = self.weakest(problem, &support, last);
            support.remove(leaves);
            fits.push(problem.refit(&support));
        }
        fits
    }

    /// Place in `support` of the term that leaves.
    fn weakest(&self, problem: &Reduced, support: &[usize], fit: &Fit) -> usize {
        let importance: Vec<f64> = match self.rule {
            SsrRule::Coefficient => {
                let scale = |j: usize| if self.scale_columns { problem.norms()[j] } else { 1.0 };
                support.iter().map(|&j| fit.coefficients[j].abs() * scale(j)).collect()
            }
            SsrRule::Residual => {
                // The residual grows by x_j^2 / [(A_S'A_S)^-1]_jj when term j leaves.
                let errors = problem.standard_errors(support, 1.0);
                let rise = |(&j, &e): (&usize, &f64)| if e > 0.0 { (fit.coefficients[j] / e).powi(2) } else { 0.0 };
                support.iter().zip(&errors).map(rise).collect()
            }
        };
        (0..support.len()).min_by(|&x, &y| importance[x].total_cmp(&importance[y])).unwrap_or(0)
    }
}

impl Regressor for Ssr {
    fn name(&self) -> &'static str {
        match self.rule {
            SsrRule::Coefficient => "ssr-coefficient",
            SsrRule::Residual => "ssr-residual",
        }
    }

    /// The number of terms, NaN where BIC chooses it.
    fn level(&self) -> f64 {
        self.size.map_or(f64::NAN, |k| k as f64)
    }

    /// Numbers of terms: 0, 1, 2, ...
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64> {
        (0..=problem.n_terms()).take(count).map(|k| k as f64).collect()
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        let p = problem.n_terms();
        if let Some(found) = levels.iter().find(|l| **l < 0.0 || **l > p as f64) {
            return Err(Error::range("number of terms", &format!("from 0 to {p}"), found));
        }
        let all = self.eliminate(problem);
        let sparse_first: Vec<Fit> = all.iter().rev().cloned().collect();
        let best = smallest_bic(problem, &sparse_first);
        let size = |level: f64| if level.is_nan() { best } else { level as usize };
        Ok(levels.iter().map(|&level| Fit { level: size(level) as f64, ..all[p - size(level)].clone() }).collect())
    }
}

/// Place of the smallest `r ln(residual / r) + k ln r` among fits of growing size.
pub(super) fn smallest_bic(problem: &Reduced, fits: &[Fit]) -> usize {
    let r = problem.n_rows() as f64;
    // A residual of rounding size would make the logarithm reward one more term for nothing.
    let floor = 1e-26 * problem.target_square() + f64::MIN_POSITIVE;
    let bic = |k: usize| r * (fits[k].residual.max(floor) / r).ln() + fits[k].n_terms() as f64 * r.ln();
    (0..fits.len()).filter(|&k| k < problem.n_rows()).min_by(|&x, &y| bic(x).total_cmp(&bic(y))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::*;
    use faer::Mat;

    #[test]
    fn both_rules_find_a_clear_support_by_bic() {
        for seed in 0..10 {
            let truth = [(0, 2.0), (3, 1.0), (7, -1.5)];
            let (theta, target) = random_problem(200, 9, &truth, 1e-3, seed);
            for method in [Ssr::by_residual(), Ssr { rule: SsrRule::Coefficient, ..Ssr::default() }] {
                // BIC keeps a false term with probability about 6 * P(chi2_1 > ln 200) = 0.13, so give it its size.
                let fit = Ssr { size: Some(3), ..method.clone() }.fit(theta.as_ref(), &target).unwrap();
                assert_eq!(fit.support(), [0, 3, 7], "seed {seed}, {}", method.name());
                let free = method.fit(theta.as_ref(), &target).unwrap();
                assert!([0, 3, 7].iter().all(|j| free.support().contains(j)));
                assert!(free.n_terms() <= 5);
            }
        }
    }

    #[test]
    fn the_residual_rule_removes_the_term_whose_loss_costs_least() {
        let (theta, target) = random_problem(30, 4, &[(0, 1.0), (1, 1.0), (2, 1.0), (3, 0.02)], 0.1, 3);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let three = Ssr { size: Some(3), ..Ssr::default() }.fit(theta.as_ref(), &target).unwrap();
        let best = (0..4)
            .map(|out| problem.refit(&(0..4).filter(|&j| j != out).collect::<Vec<_>>()).residual)
            .fold(f64::INFINITY, f64::min);
        assert!((three.residual - best).abs() < 1e-12 * best);
    }

    #[test]
    fn noiseless_rows_do_not_reward_extra_terms() {
        let (theta, target) = random_problem(50, 6, &[(2, 1.0)], 0.0, 4);
        assert_eq!(Ssr::by_residual().fit(theta.as_ref(), &target).unwrap().support(), [2]);
        assert_eq!(Ssr::by_residual().fit(theta.as_ref(), &[0.0; 50]).unwrap().n_terms(), 0);
    }

    #[test]
    fn a_size_beyond_the_library_is_refused() {
        let theta = Mat::from_fn(5, 2, |i, j| (i + j) as f64);
        let error = Ssr { size: Some(3), ..Ssr::default() }.fit(theta.as_ref(), &[1.0; 5]).unwrap_err();
        assert!(error.to_string().contains("from 0 to 2"), "{error}");
    }
}
