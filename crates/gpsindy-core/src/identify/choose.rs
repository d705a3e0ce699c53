//! The sparse regression of one state: which terms, by held-out error, BIC or a given number, under the constraints.

use super::rows::Rows;
use crate::error::Result;
use crate::regress::{Ensemble, Fit, Folds, Reduced, Regressor, Selection, Stability};
use faer::Mat;

/// What the regression of one state may do.
pub(super) struct Task<'a> {
    /// Columns that may enter.
    pub(super) allowed: &'a [usize],
    /// Sign that each column's coefficient must have, `Some(true)` above 0.
    pub(super) signs: &'a [Option<bool>],
    pub(super) regressor: &'a dyn Regressor,
    pub(super) selection: &'a Selection,
    /// Whether columns and target are brought to unit size before the regression.
    pub(super) standardize: bool,
}

/// A chosen equation of one state, and the sparser and denser ones it was chosen from.
#[derive(Debug, Clone)]
pub(super) struct Chosen {
    /// p coefficients.
    pub(super) coefficients: Vec<f64>,
    /// The tuning value: lambda, threshold or number of terms.
    pub(super) level: f64,
    /// Held-out mean squared error in units of the noise, or the criterion's value; NaN for a given number.
    pub(super) score: f64,
    /// Mean squared residual in units of the noise.
    pub(super) residual: f64,
    /// p standard errors, 0 where a term is out.
    pub(super) errors: Vec<f64>,
    /// Every candidate of the path, p coefficients each.
    pub(super) path: Vec<Vec<f64>>,
    /// Place of the candidate of the best evidence by its own rows; the chosen one may be sparser.
    pub(super) best: Option<usize>,
}

/// Place of the smallest `n ln(residual / n) + k (ln n + 2 ln p)`, n rows, k of p terms.
fn best_of(fits: &[Fit], n: usize, p: usize) -> Option<usize> {
    let (rows, terms) = (n as f64, p.max(1) as f64);
    let evidence = |fit: &Fit| {
        rows * (fit.residual.max(f64::MIN_POSITIVE) / rows).ln() + fit.n_terms() as f64 * (rows.ln() + 2.0 * terms.ln())
    };
    let told = (0..fits.len()).filter(|&i| 2 * fits[i].n_terms() < n);
    told.min_by(|&a, &b| evidence(&fits[a]).total_cmp(&evidence(&fits[b])))
}

/// Folds of the cross-validation.
const FOLDS: usize = 5;

impl Task<'_> {
    /// Runs the regression; a term that comes out with a forbidden sign is taken out and the regression runs again.
    pub(super) fn choose(&self, rows: &Rows) -> Result<Chosen> {
        let mut allowed = self.allowed.to_vec();
        loop {
            let chosen = self.choose_among(rows, &allowed)?;
            let wrong = |j: usize| match self.signs[j] {
                Some(positive) => chosen.coefficients[j] != 0.0 && (chosen.coefficients[j] > 0.0) != positive,
                None => false,
            };
            let before = allowed.len();
            allowed.retain(|&j| !wrong(j));
            if allowed.len() == before || allowed.is_empty() {
                return Ok(chosen);
            }
        }
    }

    fn choose_among(&self, rows: &Rows, allowed: &[usize]) -> Result<Chosen> {
        let (theta, scales, size) = self.scaled(rows, allowed);
        let target: Vec<f64> = rows.target.iter().map(|v| v / size).collect();
        let gap = (rows.target.len() / (FOLDS * 20)).min(10);
        let folds = Folds::new(&rows.lengths, FOLDS.min(rows.target.len() / 2).max(2), gap)?;
        let choice = self.selection.choose(self.regressor, theta.as_ref(), &target, &folds)?;
        let p = self.signs.len();
        let spread = |values: &[f64]| {
            let mut all = vec![0.0; p];
            for ((&j, &value), scale) in allowed.iter().zip(values).zip(&scales) {
                all[j] = value * size / scale;
            }
            all
        };
        let problem = Reduced::new(theta.as_ref(), &target)?;
        let support = choice.fit.support();
        let freedom = rows.target.len().saturating_sub(support.len() + rows.lengths.len()).max(1) as f64;
        let noise = (choice.fit.residual / freedom).sqrt();
        let mut errors = vec![0.0; scales.len()];
        for (&j, error) in support.iter().zip(problem.standard_errors(&support, noise)) {
            errors[j] = error;
        }
        Ok(Chosen {
            coefficients: spread(&choice.fit.coefficients),
            level: choice.fit.level,
            score: choice.candidates.scores[choice.index] * size * size,
            residual: noise * noise * size * size,
            errors: spread(&errors),
            path: choice.candidates.fits.iter().map(|fit| spread(&fit.coefficients)).collect(),
            best: best_of(&choice.candidates.fits, rows.target.len(), allowed.len()),
        })
    }

    /// Allowed columns, their scales, and the target's.
    fn scaled(&self, rows: &Rows, allowed: &[usize]) -> (Mat<f64>, Vec<f64>, f64) {
        let n = rows.target.len();
        let size_of = |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        let usable = |size: f64| if self.standardize && size > 0.0 { size } else { 1.0 };
        let scales: Vec<f64> =
            allowed.iter().map(|&j| usable(size_of(&mut (0..n).map(|i| rows.theta[(i, j)])))).collect();
        let theta = Mat::from_fn(n, allowed.len(), |i, k| rows.theta[(i, allowed[k])] / scales[k]);
        (theta, scales, usable(size_of(&mut rows.target.iter().copied())))
    }

    /// The same regression on block bootstraps of the rows, at the tuning value chosen; p inclusion probabilities.
    pub(super) fn stability(&self, rows: &Rows, level: f64, ensemble: &Ensemble) -> Result<Vec<f64>> {
        let (theta, _, size) = self.scaled(rows, self.allowed);
        let target: Vec<f64> = rows.target.iter().map(|v| v / size).collect();
        let Stability { inclusion, .. } =
            ensemble.run(self.regressor, level, theta.as_ref(), &target, &rows.lengths)?;
        let mut all = vec![0.0; self.signs.len()];
        for (&j, share) in self.allowed.iter().zip(inclusion) {
            all[j] = share;
        }
        Ok(all)
    }
}
