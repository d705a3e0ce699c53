//! Choice of the place on a path: cross-validation with one standard error, BIC, a given number, or a score of the caller.

use super::{Fit, Folds, Reduced, Regressor};
use crate::error::{Error, Result};
use crate::parallel;
use faer::{Mat, MatRef};

/// How a place on the path is chosen.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Selection {
    /// Error on held-out folds; with `one_standard_error` the sparsest fit whose mean error lies within one standard
    /// error of the smallest.
    CrossValidation {
        /// Whether the rule of one standard error is used.
        one_standard_error: bool,
    },
    /// The smallest `r ln(residual / r) + k ln r`, or `residual / noise^2 + k ln r` where the rows' noise is known.
    ///
    /// Source: Schwarz 1978.
    Bic {
        /// Standard deviation of a row's error, where it is known (1 for whitened rows).
        noise: Option<f64>,
    },
    /// The tuning value itself.
    Fixed(f64),
}

impl Default for Selection {
    fn default() -> Self {
        Self::CrossValidation { one_standard_error: true }
    }
}

/// The fits of a path, and what was made of them.
#[derive(Debug, Clone)]
pub struct Candidates {
    /// Fits on all rows, from no term toward all.
    pub fits: Vec<Fit>,
    /// Score of each, smaller is better: held-out mean squared error, BIC, or the caller's.
    pub scores: Vec<f64>,
    /// Standard error of each score over the folds, NaN where there are none.
    pub errors: Vec<f64>,
}

/// A chosen fit.
#[derive(Debug, Clone)]
pub struct Choice {
    /// The fit on all rows.
    pub fit: Fit,
    /// Its place among the candidates.
    pub index: usize,
    /// What it was chosen from.
    pub candidates: Candidates,
}

/// Places on a path unless the method has fewer.
pub(super) const PATH_LENGTH: usize = 60;

impl Selection {
    /// Fits the path of `regressor` and chooses one place.
    ///
    /// # Shapes
    /// `theta`: (r x p). `target`: r. `folds`: of the same r rows; read by cross-validation only.
    ///
    /// # Errors
    /// Those of [`Regressor::fit`], or folds of another number of rows.
    pub fn choose(
        &self,
        regressor: &dyn Regressor,
        theta: MatRef<'_, f64>,
        target: &[f64],
        folds: &Folds,
    ) -> Result<Choice> {
        let problem = Reduced::new(theta, target)?;
        if let Self::Fixed(level) = *self {
            let fit = regressor.path(&problem, &[level])?.remove(0);
            let candidates = Candidates { fits: vec![fit.clone()], scores: vec![f64::NAN], errors: vec![f64::NAN] };
            return Ok(Choice { fit, index: 0, candidates });
        }
        let levels = regressor.levels(&problem, PATH_LENGTH);
        let fits = regressor.path(&problem, &levels)?;
        match *self {
            Self::CrossValidation { one_standard_error } => {
                let (scores, errors) = held_out_errors(regressor, theta, target, &levels, folds)?;
                sparsest(Candidates { fits, scores, errors }, one_standard_error)
            }
            Self::Bic { noise } => smallest_bic(fits, problem.n_rows() as f64, problem.target_square(), noise),
            Self::Fixed(_) => Err(Error::settings("a fixed tuning value leaves nothing to choose")),
        }
    }
}

/// The sparsest fit whose score lies within one standard error of the smallest, or the one of the smallest.
pub(super) fn sparsest(candidates: Candidates, one_standard_error: bool) -> Result<Choice> {
    let best = smallest(&candidates.scores)?;
    let margin = if one_standard_error { candidates.errors[best] } else { 0.0 };
    let limit = candidates.scores[best] + margin;
    let index = (0..candidates.fits.len())
        .filter(|&i| candidates.scores[i] <= limit)
        .min_by_key(|&i| (candidates.fits[i].n_terms(), i))
        .unwrap_or(best);
    Ok(Choice { fit: candidates.fits[index].clone(), index, candidates })
}

/// The fit of the smallest BIC on `rows` rows, which may be a sum of weights.
pub(super) fn smallest_bic(fits: Vec<Fit>, rows: f64, target_square: f64, noise: Option<f64>) -> Result<Choice> {
    let floor = 1e-26 * target_square + f64::MIN_POSITIVE;
    choose_by(fits, |fit| {
        let k = fit.n_terms() as f64;
        if k >= rows && noise.is_none() {
            return f64::INFINITY;
        }
        let misfit = noise.map_or_else(|| rows * (fit.residual.max(floor) / rows).ln(), |n| fit.residual / (n * n));
        misfit + k * rows.ln()
    })
}

/// The fit with the smallest finite `score`; the hook by which a rollout error can choose.
///
/// # Errors
/// No candidate, or none with a finite score.
pub fn choose_by(fits: Vec<Fit>, score: impl FnMut(&Fit) -> f64) -> Result<Choice> {
    let scores: Vec<f64> = fits.iter().map(score).collect();
    let index = smallest(&scores)?;
    let errors = vec![f64::NAN; fits.len()];
    Ok(Choice { fit: fits[index].clone(), index, candidates: Candidates { fits, scores, errors } })
}

fn smallest(scores: &[f64]) -> Result<usize> {
    (0..scores.len()).filter(|&i| scores[i].is_finite()).min_by(|&x, &y| scores[x].total_cmp(&scores[y])).ok_or_else(
        || Error::NotConverged {
            what: "choice of lambda".into(),
            why: "no candidate has a finite score; give lambda as a number or shrink the library".into(),
        },
    )
}

/// Mean squared error of each level on the held-out rows, and its standard error over the folds.
fn held_out_errors(
    regressor: &dyn Regressor,
    theta: MatRef<'_, f64>,
    target: &[f64],
    levels: &[f64],
    folds: &Folds,
) -> Result<(Vec<f64>, Vec<f64>)> {
    if folds.n_rows() != theta.nrows() {
        return Err(Error::shape("folds", format!("{} rows", theta.nrows()), folds.n_rows()));
    }
    let rows = |keep: &[usize]| {
        let part = Mat::from_fn(keep.len(), theta.ncols(), |i, j| theta[(keep[i], j)]);
        let values: Vec<f64> = keep.iter().map(|&i| target[i]).collect();
        Reduced::new(part.as_ref(), &values)
    };
    let one_fold = |k: usize| -> Result<Vec<f64>> {
        let training = rows(&folds.training(k))?;
        let share = regressor.level_for(training.n_rows(), theta.nrows());
        let fitted: Vec<f64> = levels.iter().map(|level| level * share).collect();
        let held_out = rows(&folds.held_out(k))?;
        let count = held_out.n_rows() as f64;
        Ok(regressor.path(&training, &fitted)?.iter().map(|fit| held_out.residual(&fit.coefficients) / count).collect())
    };
    let by_fold: Vec<Vec<f64>> = parallel::try_map(0..folds.n_folds(), one_fold)?;
    Ok(over_folds(&by_fold))
}

/// Mean of each level's score over the folds, and its standard error.
pub(super) fn over_folds(by_fold: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let n = by_fold.len() as f64;
    let levels = by_fold.first().map_or(0, Vec::len);
    let column = |i: usize| by_fold.iter().map(move |errors| errors[i]);
    let mean: Vec<f64> = (0..levels).map(|i| column(i).sum::<f64>() / n).collect();
    let error =
        (0..levels).map(|i| (column(i).map(|e| (e - mean[i]).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()).collect();
    (mean, error)
}

#[cfg(test)]
mod tests {
    use super::super::testing::random_problem;
    use super::super::{Lasso, SqrtLasso, Ssr, Stlsq, Subset};
    use super::*;

    #[test]
    fn every_method_finds_an_easy_support_by_cross_validation_and_by_bic() {
        let truth = [(1, 1.0), (5, -2.0), (8, 0.5)];
        let ssr = (Ssr::by_residual(), Ssr::by_coefficient());
        let (lasso, sqrt_lasso, stlsq, subset) =
            (Lasso::default(), SqrtLasso::default(), Stlsq::default(), Subset::default());
        let methods: [&dyn Regressor; 6] = [&lasso, &sqrt_lasso, &stlsq, &ssr.0, &ssr.1, &subset];
        let folds = Folds::new(&[100, 100], 5, 2).unwrap();
        for seed in 0..5 {
            let (theta, target) = random_problem(200, 10, &truth, 0.02, 100 + seed);
            for method in methods {
                for selection in [Selection::default(), Selection::Bic { noise: None }] {
                    let choice = selection.choose(method, theta.as_ref(), &target, &folds).unwrap();
                    let support = choice.fit.support();
                    assert!(
                        truth.iter().all(|(j, _)| support.contains(j)),
                        "{} {selection:?}: {support:?}",
                        method.name()
                    );
                    // One false term is what BIC and cross-validation may keep by chance.
                    assert!(support.len() <= 4, "{} {selection:?} seed {seed}: {support:?}", method.name());
                    assert_eq!(choice.candidates.fits.len(), choice.candidates.scores.len());
                }
            }
        }
    }

    #[test]
    fn one_standard_error_is_never_the_denser_choice() {
        for seed in 0..10 {
            let (theta, target) = random_problem(60, 12, &[(0, 1.0), (3, 0.3)], 0.5, seed);
            let folds = Folds::new(&[60], 5, 1).unwrap();
            let terms = |one_standard_error| {
                let selection = Selection::CrossValidation { one_standard_error };
                selection.choose(&Lasso::default(), theta.as_ref(), &target, &folds).unwrap().fit.n_terms()
            };
            assert!(terms(true) <= terms(false));
        }
    }

    #[test]
    fn pure_noise_keeps_nothing_more_often_than_not() {
        let folds = Folds::new(&[80], 5, 0).unwrap();
        let empty = (0..20).filter(|&seed| {
            let (theta, target) = random_problem(80, 10, &[], 1.0, 500 + seed);
            Selection::default().choose(&Lasso::default(), theta.as_ref(), &target, &folds).unwrap().fit.n_terms() == 0
        });
        assert!(empty.count() >= 14);
    }

    #[test]
    fn the_answer_does_not_depend_on_threads() {
        let (theta, target) = random_problem(90, 10, &[(2, 1.0)], 0.3, 77);
        let folds = Folds::new(&[90], 5, 1).unwrap();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Selection::default().choose(&Lasso::default(), theta.as_ref(), &target, &folds).unwrap())
        };
        let (one, four) = (run(1), run(4));
        assert_eq!(one.fit, four.fit);
        assert_eq!(one.candidates.scores, four.candidates.scores);
    }

    #[test]
    fn a_score_of_the_caller_chooses() {
        let (theta, target) = random_problem(40, 4, &[(1, 1.0)], 0.1, 5);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let fits = Ssr::default().path(&problem, &[0.0, 1.0, 2.0, 3.0, 4.0]).unwrap();
        let choice = choose_by(fits, |fit| if fit.n_terms() == 2 { 1.0 } else { f64::NAN }).unwrap();
        assert_eq!(choice.index, 2);
        assert!(choose_by(vec![], |_| 0.0).is_err());
    }

    #[test]
    fn folds_of_another_size_are_refused() {
        let (theta, target) = random_problem(40, 4, &[(1, 1.0)], 0.1, 5);
        let folds = Folds::new(&[30], 5, 0).unwrap();
        let error = Selection::default().choose(&Lasso::default(), theta.as_ref(), &target, &folds).unwrap_err();
        assert!(error.to_string().contains("folds"), "{error}");
    }
}
