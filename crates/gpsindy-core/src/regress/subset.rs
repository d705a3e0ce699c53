//! Best subset by forward selection with exchanges and backward steps.
//!
//! Libraries hold nearly collinear terms (`x` and `sin(x)`, `x^2` and `cos(x)`), for which greedy methods err early and cannot
//! recover. Here each size starts from the best smaller subset plus the best term, and then exchanges terms
//! until no exchange lowers the residual, of two terms at once while the subset is small; a larger subset that beats a smaller one by a term less takes its place.
//!
//! Source: Miller 2002, Subset Selection in Regression, sections 3.4 and 3.5 (sequential replacement); Pudil, Novovicova and
//! Kittler 1994, Floating search methods in feature selection.

use super::dense::{axpy, gram, transposed_times};
use super::{Fit, Reduced, Regressor};
use crate::error::{Error, Result};
use faer::Mat;

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

/// Largest subset in which two terms are exchanged at once: the cost grows with its cube times the square of the library.
const PAIRS: usize = 6;

/// Passes of exchanges at one size; two are usual, and a cycle is impossible since each lowers the residual.
const MOST_EXCHANGES: usize = 50;

/// Share of a column's square that must be left outside the span of the others for it to count as a direction of its own.
const INDEPENDENT: f64 = 1e-10;

impl Subset {
    fn largest(&self, problem: &Reduced) -> usize {
        self.max_terms.max(self.size.unwrap_or(0)).min(problem.n_terms()).min(problem.n_rows())
    }

    /// The best subset found of each size 0, 1, ..., the largest.
    pub(crate) fn search(&self, problem: &Reduced) -> Vec<Vec<usize>> {
        let gains = Gains::new(problem);
        let mut subsets: Vec<Vec<usize>> = vec![vec![]];
        for _ in 0..self.largest(problem) {
            let mut support = subsets.last().cloned().unwrap_or_default();
            let Some(best) = largest(&gains.beside(&support).0) else { break };
            support.push(best);
            exchange(&gains, &mut support);
            for _ in 0..MOST_EXCHANGES {
                if !exchange_pair(&gains, &mut support) {
                    break;
                }
                exchange(&gains, &mut support);
            }
            support.sort_unstable();
            subsets.push(support);
            look_back(&gains, &mut subsets);
        }
        subsets
    }
}

/// Takes the least term out of each subset, from the largest down, while that beats the subset of the smaller size.
///
/// Terms that explain much together and little alone (`x` and `x y`) are met late; this brings them to their own size.
fn look_back(gains: &Gains, subsets: &mut [Vec<usize>]) {
    for size in (1..subsets.len() - 1).rev() {
        let larger = &subsets[size + 1];
        let without = |&out: &usize| larger.iter().copied().filter(|&j| j != out).collect::<Vec<_>>();
        let residual = |support: &Vec<usize>| gains.beside(support).1;
        let fewer = larger.iter().map(without).min_by(|a, b| residual(a).total_cmp(&residual(b)));
        let Some(mut fewer) = fewer else { return };
        exchange(gains, &mut fewer);
        if residual(&fewer) >= residual(&subsets[size]) * (1.0 - 1e-9) {
            return;
        }
        fewer.sort_unstable();
        subsets[size] = fewer;
    }
}

/// Exchanges one term of `support` for one outside while that lowers the residual.
fn exchange(gains: &Gains, support: &mut [usize]) {
    for _ in 0..MOST_EXCHANGES {
        let (_, now) = gains.beside(support);
        let mut best = (now * (1.0 - 1e-9), None);
        for place in 0..support.len() {
            let others: Vec<usize> = support.iter().copied().filter(|&j| j != support[place]).collect();
            let (rise, without) = gains.beside(&others);
            if let Some(term) = largest(&rise)
                && without - rise[term] < best.0
            {
                best = (without - rise[term], Some((place, term)));
            }
        }
        let Some((place, term)) = best.1 else { return };
        support[place] = term;
    }
}

/// Exchanges two terms of a small `support` for the best two outside; says whether that lowered the residual.
///
/// Of two terms that explain only together (`x` and `x y`) no single exchange brings the first.
fn exchange_pair(gains: &Gains, support: &mut [usize]) -> bool {
    if !(2..=PAIRS).contains(&support.len()) {
        return false;
    }
    let (_, now) = gains.beside(support);
    // Below that share of the target a fall is rounding.
    let mut best = (now * (1.0 - 1e-9) - 1e-12 * gains.square, None);
    for one in 0..support.len() {
        for other in 0..one {
            let rest: Vec<usize> =
                support.iter().copied().filter(|&j| j != support[one] && j != support[other]).collect();
            let mut beside = rest.clone();
            for first in (0..gains.correlations.len()).filter(|first| !rest.contains(first)) {
                beside.truncate(rest.len());
                beside.push(first);
                let (rise, without) = gains.beside(&beside);
                if let Some(second) = largest(&rise)
                    && without - rise[second] < best.0
                {
                    best = (without - rise[second], Some((one, other, first, second)));
                }
            }
        }
    }
    let Some((one, other, first, second)) = best.1 else { return false };
    (support[one], support[other]) = (first, second);
    true
}

fn largest(gains: &[f64]) -> Option<usize> {
    (0..gains.len()).filter(|&j| gains[j] > 0.0).max_by(|&x, &y| gains[x].total_cmp(&gains[y]).then(y.cmp(&x)))
}

/// What each term would add to any support; from the Gram matrix of unit columns, made once for all supports.
#[derive(Debug)]
pub(crate) struct Gains {
    gram: Mat<f64>,
    correlations: Vec<f64>,
    square: f64,
}

/// The columns at unit norm; one without any is zero.
fn scaled_columns(problem: &Reduced) -> Mat<f64> {
    let mut a = problem.a.clone();
    for (j, &norm) in problem.norms().iter().enumerate() {
        let factor = if norm > 0.0 { norm.recip() } else { 0.0 };
        a.col_as_slice_mut(j).iter_mut().for_each(|v| *v *= factor);
    }
    a
}

impl Gains {
    pub(crate) fn new(problem: &Reduced) -> Self {
        let a = scaled_columns(problem);
        let correlations = transposed_times(&a, &problem.b);
        Self { gram: gram(a.as_ref()), correlations, square: problem.target_square() }
    }

    /// Those of `problem`, which has the same columns and another target.
    pub(crate) fn of_target(&self, problem: &Reduced) -> Self {
        let correlations = transposed_times(&scaled_columns(problem), &problem.b);
        Self { gram: self.gram.clone(), correlations, square: problem.target_square() }
    }

    /// By how much the residual would fall if each term joined `support` (0 for members), and the residual of `support`.
    ///
    /// A Cholesky factorisation of the Gram matrix that is carried on for all columns at once.
    pub(crate) fn beside(&self, support: &[usize]) -> (Vec<f64>, f64) {
        let p = self.correlations.len();
        let mut left: Vec<f64> = (0..p).map(|j| self.gram[(j, j)]).collect();
        let mut slopes = self.correlations.clone();
        let mut residual = self.square;
        let mut factor: Vec<Vec<f64>> = Vec::with_capacity(support.len());
        for &s in support {
            if left[s] <= INDEPENDENT {
                continue;
            }
            let mut row = self.gram.col_as_slice(s).to_vec();
            for earlier in &factor {
                axpy(-earlier[s], earlier, &mut row);
            }
            let pivot = left[s].sqrt();
            let step = slopes[s] / pivot;
            for j in 0..p {
                row[j] /= pivot;
                left[j] -= row[j] * row[j];
                slopes[j] -= row[j] * step;
            }
            residual -= step * step;
            factor.push(row);
        }
        let gain = |j: usize| {
            if left[j] <= INDEPENDENT || support.contains(&j) { 0.0 } else { slopes[j] * slopes[j] / left[j] }
        };
        ((0..p).map(gain).collect(), residual.max(0.0))
    }
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
    fn a_gain_is_the_fall_of_the_residual() {
        let (theta, target) = random_problem(30, 6, &[(0, 1.0), (3, 2.0)], 0.5, 3);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let (gains, residual) = Gains::new(&problem).beside(&[3, 1]);
        assert!((residual / problem.refit(&[1, 3]).residual - 1.0).abs() < 1e-10);
        for j in [0, 2, 4, 5] {
            let fall = residual - problem.refit(&[1, 3, j]).residual;
            assert!((gains[j] - fall).abs() < 1e-9 * residual, "{j}");
        }
        assert_eq!((gains[1], gains[3]), (0.0, 0.0));
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
    fn a_pair_that_tells_nothing_alone_is_found_at_its_own_size() {
        // Columns 0 and 1 share a large part, and the target is their difference; 2 and 3 are poor copies of it.
        let (random, _) = random_problem(60, 5, &[], 1.0, 8);
        let theta = Mat::from_fn(60, 4, |i, j| {
            let (shared, copy) = (30.0 * random[(i, 4)], 1.5 * random[(i, 2 + j % 2)]);
            if j < 2 { shared + random[(i, j)] } else { random[(i, j - 2)] + copy }
        });
        let target: Vec<f64> = (0..60).map(|i| theta[(i, 0)] - theta[(i, 1)]).collect();
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let subsets = Subset::default().search(&problem);
        assert!(matches!(subsets[1][..], [2] | [3]), "{subsets:?}");
        assert_eq!(subsets[2], [0, 1]);
    }

    #[test]
    fn the_best_pair_replaces_a_pair() {
        let (random, _) = random_problem(60, 5, &[], 1.0, 8);
        let theta = Mat::from_fn(60, 4, |i, j| {
            let (shared, copy) = (30.0 * random[(i, 4)], 1.5 * random[(i, 2 + j % 2)]);
            if j < 2 { shared + random[(i, j)] } else { random[(i, j - 2)] + copy }
        });
        let target: Vec<f64> = (0..60).map(|i| theta[(i, 0)] - theta[(i, 1)]).collect();
        let gains = Gains::new(&Reduced::new(theta.as_ref(), &target).unwrap());
        let mut support = [2, 3];
        assert!(exchange_pair(&gains, &mut support));
        support.sort_unstable();
        assert_eq!(support, [0, 1]);
        // Nothing is left to explain, and rounding must not count as a gain.
        assert!(!exchange_pair(&gains, &mut support));
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
