//! Best subset by forward selection with swaps.
//!
//! Libraries hold near-copies of terms (`x` and `sin(x)`, `x^2` and `cos(x)`), with which one-way methods go wrong early and
//! can't turn back. Here each size starts from the best smaller subset plus the best term, and then exchanges terms
//! until no exchange lowers the residual.
//!
//! Source: Miller 2002, Subset Selection in Regression, sections 3.4 and 3.5 (sequential replacement).

use super::dense::{axpy, dot};
use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};

/// Settings of the search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subset {
    /// Number of terms; `None`: the number of the smallest BIC. Default `None`.
    pub size: Option<usize>,
    /// Largest number of terms that is searched. Default 12.
    pub max_terms: usize,
}

impl Default for Subset {
    fn default() -> Self {
        Self { size: None, max_terms: 12 }
    }
}

/// Passes of exchanges at one size; two are usual, and a cycle is impossible since each lowers the residual.
const MOST_EXCHANGES: usize = 50;

/// Share of a column's square that must be left outside the span of the others for it to count as a direction of its own.
const INDEPENDENT: f64 = 1e-12;

impl Subset {
    fn largest(&self, problem: &Reduced) -> usize {
        self.max_terms.max(self.size.unwrap_or(0)).min(problem.n_terms()).min(problem.n_rows())
    }

    /// The best subset found of each size 0, 1, ..., the largest.
    pub(crate) fn search(&self, problem: &Reduced) -> Vec<Vec<usize>> {
        let mut subsets: Vec<Vec<usize>> = vec![vec![]];
        for _ in 0..self.largest(problem) {
            let mut support = subsets.last().cloned().unwrap_or_default();
            let (gains, _) = gains(problem, &support);
            let Some(best) = largest(&gains) else { break };
            support.push(best);
            exchange(problem, &mut support);
            support.sort_unstable();
            subsets.push(support);
        }
        subsets
    }
}

/// Exchanges one term of `support` for one outside while that lowers the residual.
fn exchange(problem: &Reduced, support: &mut [usize]) {
    for _ in 0..MOST_EXCHANGES {
        let now = problem.refit(support).residual;
        let mut best = (now * (1.0 - 1e-9), None);
        for place in 0..support.len() {
            let others: Vec<usize> = support.iter().copied().filter(|&j| j != support[place]).collect();
            let (gains, without) = gains(problem, &others);
            if let Some(term) = largest(&gains)
                && without - gains[term] < best.0
            {
                best = (without - gains[term], Some((place, term)));
            }
        }
        let Some((place, term)) = best.1 else { return };
        support[place] = term;
    }
}

fn largest(gains: &[f64]) -> Option<usize> {
    (0..gains.len()).filter(|&j| gains[j] > 0.0).max_by(|&x, &y| gains[x].total_cmp(&gains[y]).then(y.cmp(&x)))
}

/// By how much the residual would fall if each term joined `support` (0 for members), and the residual of `support`.
pub(crate) fn gains(problem: &Reduced, support: &[usize]) -> (Vec<f64>, f64) {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(support.len());
    let project = |basis: &[Vec<f64>], column: &mut [f64]| {
        for _ in 0..2 {
            for q in basis {
                let overlap = dot(q, column);
                axpy(-overlap, q, column);
            }
        }
    };
    for &j in support {
        let mut column = problem.a.col_as_slice(j).to_vec();
        let before = dot(&column, &column);
        project(&basis, &mut column);
        let left = dot(&column, &column);
        if left > INDEPENDENT * before {
            let norm = left.sqrt();
            column.iter_mut().for_each(|v| *v /= norm);
            basis.push(column);
        }
    }
    let mut rest = problem.b.clone();
    project(&basis, &mut rest);
    let gain = |j: usize| {
        if support.contains(&j) {
            return 0.0;
        }
        let mut column = problem.a.col_as_slice(j).to_vec();
        let before = dot(&column, &column);
        project(&basis, &mut column);
        let left = dot(&column, &column);
        if left > INDEPENDENT * before { dot(&column, &rest).powi(2) / left } else { 0.0 }
    };
    ((0..problem.n_terms()).map(gain).collect(), dot(&rest, &rest))
}

impl Regressor for Subset {
    fn name(&self) -> &'static str {
        "subset"
    }

    /// The number of terms, NaN where BIC chooses it.
    fn level(&self) -> f64 {
        self.size.map_or(f64::NAN, |k| k as f64)
    }

    /// Numbers of terms: 0, 1, 2, ...
    fn levels(&self, problem: &Reduced, count: usize) -> Vec<f64> {
        (0..=self.largest(problem)).take(count).map(|k| k as f64).collect()
    }

    fn path(&self, problem: &Reduced, levels: &[f64]) -> Result<Vec<Fit>> {
        let most = self.largest(problem);
        if let Some(found) = levels.iter().find(|l| **l < 0.0) {
            return Err(Error::range("number of terms", &format!("from 0 to {most}"), found));
        }
        let fits: Vec<Fit> = self.search(problem).iter().map(|support| problem.refit(support)).collect();
        let best = super::ssr::smallest_bic(problem, &fits);
        let place = |level: f64| if level.is_nan() { best } else { (level as usize).min(fits.len() - 1) };
        Ok(levels.iter().map(|&level| fits[place(level)].clone()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::*;
    use faer::Mat;

    #[test]
    fn the_subset_of_every_size_is_the_best_of_all_on_small_problems() {
        for seed in 0..10 {
            let (theta, target) = random_problem(30, 7, &[(0, 1.0), (2, -1.0), (5, 0.3)], 0.5, seed);
            let problem = Reduced::new(theta.as_ref(), &target).unwrap();
            for (size, support) in Subset::default().search(&problem).iter().enumerate() {
                let found = problem.refit(support).residual;
                let all = (0u32..1 << 7).filter(|bits| bits.count_ones() as usize == size);
                let best = all
                    .map(|bits| problem.refit(&(0..7).filter(|j| bits >> j & 1 == 1).collect::<Vec<_>>()).residual)
                    .fold(f64::INFINITY, f64::min);
                assert!(found <= best * (1.0 + 1e-9), "seed {seed}, size {size}: {found} {best}");
            }
        }
    }

    #[test]
    fn near_copies_do_not_lead_astray() {
        // The target is columns 0 and 1; column 2 is near their sum, so that a forward step takes it first.
        let (mut theta, _) = random_problem(50, 3, &[], 1.0, 5);
        for i in 0..50 {
            theta[(i, 0)] *= 10.0;
            theta[(i, 2)] = theta[(i, 0)] + theta[(i, 1)] + 0.01 * theta[(i, 2)];
        }
        let target: Vec<f64> = (0..50).map(|i| theta[(i, 0)] + theta[(i, 1)]).collect();
        let fit = Subset { size: Some(2), ..Subset::default() }.fit(theta.as_ref(), &target).unwrap();
        assert_eq!(fit.support(), [0, 1]);
    }

    #[test]
    fn degenerate_input_gives_a_plain_answer() {
        let duplicate = Mat::from_fn(6, 3, |i, j| if j == 2 { 0.0 } else { i as f64 });
        let fit = Subset::default().fit(duplicate.as_ref(), &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]).unwrap();
        assert_eq!(fit.n_terms(), 1);
        assert_eq!(Subset::default().fit(duplicate.as_ref(), &[0.0; 6]).unwrap().n_terms(), 0);
        let (theta, target) = random_problem(4, 9, &[(0, 1.0)], 0.1, 1);
        assert!(Subset { size: Some(9), ..Subset::default() }.fit(theta.as_ref(), &target).unwrap().n_terms() <= 4);
    }
}
