//! Choice of the place on a path from folds that were reduced one by one: the rows themselves are not needed any more.
//!
//! Each fold is `[R z]` of its rows, at most p + 1 of them; the training part of a fold is the stack of the others. So the
//! work does not grow with the number of rows, and a stream of rows can be cross-validated.

use super::dense::{Cholesky, dot, gram, residual};
use super::select::{Candidates, Choice, PATH_LENGTH, Selection, over_folds, smallest_bic, sparsest};
use super::{Reduced, Regressor};
use crate::error::{Error, Result};
use crate::parallel;

impl Selection {
    /// As [`Selection::choose`], on `folds` of rows with a sum of `weights` each (the number of rows where all weigh 1).
    ///
    /// # Errors
    /// No fold, fewer than two for cross-validation, folds of different terms, those of [`Regressor::path`].
    pub fn choose_from(&self, regressor: &dyn Regressor, folds: &[Reduced], weights: &[f64]) -> Result<Choice> {
        let problem = Reduced::stack(&folds.iter().collect::<Vec<_>>())?;
        if weights.len() != folds.len() {
            return Err(Error::shape("weights of the folds", folds.len(), weights.len()));
        }
        let levels = match *self {
            Self::Fixed(level) => vec![level],
            _ => regressor.levels(&problem, PATH_LENGTH),
        };
        let fits = regressor.path(&problem, &levels)?;
        match *self {
            Self::Fixed(_) => {
                let fit = fits[0].clone();
                let candidates = Candidates { fits, scores: vec![f64::NAN], errors: vec![f64::NAN] };
                Ok(Choice { fit, index: 0, candidates })
            }
            Self::Bic { noise } => smallest_bic(fits, weights.iter().sum(), problem.target_square(), noise),
            Self::CrossValidation { one_standard_error } => {
                if folds.len() < 2 {
                    return Err(Error::range("folds", "at least 2", folds.len()));
                }
                let by_fold = parallel::try_map(0..folds.len(), |k| {
                    held_out(regressor, folds, k, &levels, problem.n_rows(), weights[k])
                })?;
                let (scores, errors) = over_folds(&by_fold);
                sparsest(Candidates { fits, scores, errors }, one_standard_error)
            }
        }
    }
}

impl Reduced {
    /// Standard errors of a refit on `support` that allow for errors which rows of the same part have in common.
    ///
    /// `sqrt(diag(H^-1 (sum_g s_g s_g') H^-1) G / (G - 1))` with H = A'A of all G parts and `s_g = A_g' r_g` of each. One a term
    /// of `support`, 0 for one that depends on the others.
    ///
    /// Source: Liang and Zeger 1986, Longitudinal data analysis using generalized linear models.
    pub fn clustered_errors(parts: &[Self], support: &[usize], coefficients: &[f64]) -> Vec<f64> {
        let count = parts.len() as f64;
        let Ok(whole) = Self::stack(&parts.iter().collect::<Vec<_>>()) else { return vec![0.0; support.len()] };
        let small = whole.with_terms(support);
        let units: Vec<f64> = small.norms().iter().map(|&n| if n > 0.0 { n } else { 1.0 }).collect();
        let mut normal = gram(small.a.as_ref());
        for (i, j) in (0..support.len()).flat_map(|i| (0..support.len()).map(move |j| (i, j))) {
            normal[(i, j)] /= units[i] * units[j];
        }
        let Ok((factor, _)) = Cholesky::with_jitter(&normal, "terms of the regression") else {
            return whole.standard_errors(support, 0.0);
        };
        let mut squares = vec![0.0; support.len()];
        for part in parts {
            let left = residual(&part.a, &part.b, coefficients);
            let mut score: Vec<f64> =
                support.iter().zip(&units).map(|(&j, unit)| dot(part.a.col_as_slice(j), &left) / unit).collect();
            factor.solve(&mut score);
            squares.iter_mut().zip(&score).for_each(|(sum, s)| *sum += s * s);
        }
        squares.iter().zip(&units).map(|(sum, unit)| (sum * count / (count - 1.0)).sqrt() / unit).collect()
    }
}

/// Mean squared error on fold `k` of the fits at each level to the others.
fn held_out(
    regressor: &dyn Regressor,
    folds: &[Reduced],
    k: usize,
    levels: &[f64],
    n_rows: usize,
    weight: f64,
) -> Result<Vec<f64>> {
    let others: Vec<&Reduced> = folds.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, fold)| fold).collect();
    let training = Reduced::stack(&others)?;
    let share = regressor.level_for(training.n_rows(), n_rows);
    let levels: Vec<f64> = levels.iter().map(|level| level * share).collect();
    Ok(regressor.path(&training, &levels)?.iter().map(|fit| folds[k].residual(&fit.coefficients) / weight).collect())
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::super::{Folds, Lasso, Subset};
    use super::*;
    use faer::Mat;

    #[test]
    fn folds_reduced_one_by_one_choose_as_the_rows_do() {
        let (theta, target) = random_problem(60, 8, &[(1, 1.0), (4, -0.5)], 0.4, 3);
        let lengths = [10, 14, 12, 9, 15];
        let folds = Folds::new(&lengths, 5, 0).unwrap();
        let mut first = 0;
        let parts: Vec<Reduced> = lengths
            .iter()
            .map(|&n| {
                let part = Reduced::new(theta.subrows(first, n), &target[first..first + n]).unwrap();
                first += n;
                part
            })
            .collect();
        let weights = lengths.map(|n| n as f64);
        let selections = [Selection::default(), Selection::Bic { noise: None }, Selection::Fixed(2.0)];
        for regressor in [&Subset::default() as &dyn Regressor, &Lasso::default()] {
            for selection in &selections {
                let whole = selection.choose(regressor, theta.as_ref(), &target, &folds).unwrap();
                let parted = selection.choose_from(regressor, &parts, &weights).unwrap();
                assert_eq!(whole.index, parted.index, "{selection:?}");
                for (a, b) in whole.fit.coefficients.iter().zip(&parted.fit.coefficients) {
                    // LASSO stops at a relative gap of 1e-6 or finer; both see the same problem up to rounding.
                    assert!((a - b).abs() < 1e-6, "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_weight_of_rows_is_the_square_of_their_factor() {
        let (theta, target) = random_problem(20, 3, &[(0, 1.0)], 0.2, 1);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let x = [0.5, 0.0, -1.0];
        let half = problem.clone().scaled(0.5).residual(&x);
        // Rounding of a sum of twenty squares.
        assert!((half / problem.residual(&x) - 0.25).abs() < 1e-14);
        let some = problem.with_terms(&[2, 0]);
        assert!((some.residual(&[-1.0, 0.5]) / problem.residual(&x) - 1.0).abs() < 1e-14);
        assert_eq!(some.norms(), [problem.norms()[2], problem.norms()[0]]);
    }

    #[test]
    fn clustered_errors_cover_where_rows_of_a_part_err_together() {
        let mut squares = 0.0;
        let (trials, parts) = (200, 30);
        for seed in 0..trials {
            let (theta, target) = random_problem(300, 2, &[(0, 1.0)], 0.3, seed);
            let (_, shift) = random_problem(parts, 1, &[], 1.0, seed + 1000);
            // Rows of a part share an error and, by the first column, a sign with it.
            let theta = Mat::from_fn(300, 2, |i, j| if j == 0 { 1.0 + 0.2 * theta[(i, 0)] } else { theta[(i, 1)] });
            let truth = |i: usize| theta[(i, 0)] + 0.1 * (target[i] - theta[(i, 0)]).sin() + shift[i / 10];
            let rows: Vec<f64> = (0..300).map(truth).collect();
            let groups: Vec<Reduced> = (0..parts)
                .map(|g| Reduced::new(theta.subrows(10 * g, 10), &rows[10 * g..10 * g + 10]).unwrap())
                .collect();
            let whole = Reduced::stack(&groups.iter().collect::<Vec<_>>()).unwrap();
            let fit = whole.refit(&[0]);
            let error = Reduced::clustered_errors(&groups, &[0], &fit.coefficients)[0];
            squares += ((fit.coefficients[0] - 1.0) / error).powi(2) / trials as f64;
        }
        // The square of Student's t of 29 degrees has the mean 29/27, and over 200 trials a deviation of 0.11; errors taken
        // as independent would give about 10.
        assert!((0.7..1.5).contains(&squares), "{squares}");
    }

    #[test]
    fn one_fold_cannot_be_cross_validated() {
        let (theta, target) = random_problem(20, 3, &[(0, 1.0)], 0.2, 1);
        let part = [Reduced::new(theta.as_ref(), &target).unwrap()];
        let error = Selection::default().choose_from(&Subset::default(), &part, &[20.0]).unwrap_err();
        assert_eq!(error.to_string(), "`folds` must be at least 2, found 1");
    }
}
