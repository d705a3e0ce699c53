//! Lines 7 to 9 of Algorithm 1: the sparse regression of one state: which terms, by held-out error, BIC or a given number, under
//! the constraints.

use crate::error::Result;
use crate::identify::algorithm1::rows::Rows;
use crate::identify::equations::Equations;
use crate::identify::limits::{DEPENDENT, FOLDS, GAP};
use crate::identify::settings::{Choice, Identify};
use crate::parallel;
use crate::progress::{Progress, step};
use crate::regress::{Candidates, Ensemble, Fit, Folds, Reduced, Regressor, Selection, Stability};
use faer::Mat;

/// What the regression came to.
#[derive(Debug, Clone)]
pub(crate) struct Regressed {
    pub(crate) equations: Equations,
    /// One entry a state; none where its equation is given.
    pub(crate) chosen: Vec<Option<Chosen>>,
}

/// The sparse regression of every state whose equation is not given.
pub(crate) fn regress(
    settings: &Identify,
    frame: Equations,
    rows: &[Option<Rows>],
    progress: &dyn Progress,
) -> Result<Regressed> {
    let selection = match &settings.choice {
        Choice::Rows(selection) => selection.clone(),
        Choice::Rollout => Selection::default(),
    };
    step(progress, "choose terms", 0, 1)?;
    let one = |(s, rows): (usize, &Option<Rows>)| {
        rows.as_ref().map(|rows| Task::new(settings, &frame, s, &selection).choose(rows)).transpose()
    };
    let chosen = parallel::try_map(rows.iter().enumerate(), one)?;
    let mut equations = frame;
    for (s, chosen) in chosen.iter().enumerate() {
        if let Some(chosen) = chosen {
            equations.set(s, &chosen.coefficients);
        }
    }
    Ok(Regressed { equations, chosen })
}

/// Inclusion probabilities by block bootstraps of the regression, one row a state; nothing where none are asked for.
pub(crate) fn inclusion(settings: &Identify, regressed: &Regressed, rows: &[Option<Rows>]) -> Result<Vec<Vec<f64>>> {
    if settings.ensemble == 0 {
        return Ok(Vec::new());
    }
    let ensemble = Ensemble { replicates: settings.ensemble, seed: settings.seed, ..Ensemble::default() };
    let (equations, selection) = (&regressed.equations, Selection::default());
    let one = |s: usize| match (&rows[s], &regressed.chosen[s]) {
        (Some(rows), Some(chosen)) => {
            Task::new(settings, equations, s, &selection).stability(rows, chosen.level, &ensemble)
        }
        _ => Ok(vec![0.0; equations.n_terms()]),
    };
    (0..equations.n_states()).map(one).collect()
}

/// What the regression of one state may do.
struct Task<'a> {
    /// Columns that may enter.
    allowed: &'a [usize],
    /// Columns that are in whatever the rows say.
    kept: &'a [usize],
    /// Sign that each column's coefficient must have, `Some(true)` above 0.
    signs: &'a [Option<bool>],
    regressor: &'a dyn Regressor,
    selection: &'a Selection,
    /// Whether columns and target are brought to unit size before the regression.
    standardize: bool,
}

/// A chosen equation of one state, and the sparser and denser ones it was chosen from.
#[derive(Debug, Clone)]
pub(crate) struct Chosen {
    /// p coefficients.
    pub(crate) coefficients: Vec<f64>,
    /// The tuning value: lambda, threshold or number of terms.
    pub(crate) level: f64,
    /// Held-out mean squared error in units of the noise, or the criterion's value; NaN for a given number.
    pub(crate) score: f64,
    /// Mean squared residual in units of the noise.
    pub(crate) residual: f64,
    /// p standard errors, 0 where a term is out.
    pub(crate) errors: Vec<f64>,
    /// Every candidate of the path, p coefficients each.
    pub(crate) path: Vec<Vec<f64>>,
    /// Place of the candidate of the best evidence by its own rows; the chosen one may be sparser.
    pub(crate) best: Option<usize>,
}

impl Chosen {
    /// With score and residual in units of `noise`, from the square of the target's unit.
    pub(crate) fn in_units_of(self, noise: f64) -> Self {
        let square = noise * noise;
        Self { score: self.score / square, residual: self.residual / square, ..self }
    }
}

/// Place of the smallest `n ln(residual / n) + k (ln n + 2 ln p)`, n rows, k of p terms.
fn best_of(fits: &[Fit], n: usize, p: usize) -> Option<usize> {
    let (rows, terms) = (n as f64, p.max(1) as f64);
    let evidence = |fit: &Fit| {
        rows * (fit.residual.max(f64::MIN_POSITIVE) / rows).ln() + fit.n_terms() as f64 * (rows.ln() + 2.0 * terms.ln())
    };
    let stated = (0..fits.len()).filter(|&i| 2 * fits[i].n_terms() < n);
    stated.min_by(|&a, &b| evidence(&fits[a]).total_cmp(&evidence(&fits[b])))
}

/// An orthonormal basis of the columns `kept` of theta.
fn directions(theta: &Mat<f64>, kept: &[usize]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(kept.len());
    for &k in kept {
        let mut column = theta.col_as_slice(k).to_vec();
        let before = norm(&column);
        // Twice, since once leaves the rounding errors of nearly dependent columns.
        for _ in 0..2 {
            basis.iter().for_each(|direction| take_out(direction, &mut column));
        }
        let left = norm(&column);
        if left > DEPENDENT * before {
            column.iter_mut().for_each(|v| *v /= left);
            basis.push(column);
        }
    }
    basis
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Takes the part along the unit vector `direction` out of `values`.
fn take_out(direction: &[f64], values: &mut [f64]) {
    let along: f64 = direction.iter().zip(values.iter()).map(|(d, v)| d * v).sum();
    values.iter_mut().zip(direction).for_each(|(v, d)| *v -= along * d);
}

impl<'a> Task<'a> {
    fn new(settings: &'a Identify, frame: &'a Equations, s: usize, selection: &'a Selection) -> Self {
        Self {
            allowed: &frame.allowed[s],
            kept: &frame.kept[s],
            signs: &frame.signs[s],
            regressor: settings.regressor.as_ref(),
            selection,
            standardize: settings.standardize,
        }
    }

    /// Runs the regression; a term that comes out with a forbidden sign is taken out and the regression runs again.
    fn choose(&self, rows: &Rows) -> Result<Chosen> {
        let mut allowed = self.allowed.to_vec();
        loop {
            let chosen = self.choose_among(rows, &allowed)?;
            let wrong = |j: usize| match self.signs[j] {
                Some(positive) => chosen.coefficients[j] != 0.0 && (chosen.coefficients[j] > 0.0) != positive,
                None => false,
            };
            let before = allowed.len();
            allowed.retain(|&j| !wrong(j) || self.kept.contains(&j));
            if allowed.len() == before || allowed.is_empty() {
                return Ok(chosen);
            }
        }
    }

    fn choose_among(&self, rows: &Rows, allowed: &[usize]) -> Result<Chosen> {
        let (theta, scales, size) = self.scaled(rows, allowed);
        let target: Vec<f64> = rows.target.iter().map(|v| v / size).collect();
        let problem = Reduced::new(theta.as_ref(), &target)?;
        let Candidates { fits, scores, .. } = &self.candidates(rows, allowed, (&theta, &target), &problem)?;
        let index = fits.len() - 1;
        let (chosen, path) = (&fits[index], &fits[..index]);
        let p = self.signs.len();
        let spread = |values: &[f64]| {
            let mut all = vec![0.0; p];
            for ((&j, &value), scale) in allowed.iter().zip(values).zip(&scales) {
                all[j] = value * size / scale;
            }
            all
        };
        let support = chosen.support();
        let freedom = rows.target.len().saturating_sub(support.len() + rows.lengths.len()).max(1) as f64;
        let noise = (chosen.residual / freedom).sqrt();
        let mut errors = vec![0.0; scales.len()];
        for (&j, error) in support.iter().zip(problem.standard_errors(&support, noise)) {
            errors[j] = error;
        }
        Ok(Chosen {
            coefficients: spread(&chosen.coefficients),
            level: chosen.level,
            score: scores[index] * size * size,
            residual: noise * noise * size * size,
            errors: spread(&errors),
            path: path.iter().map(|fit| spread(&fit.coefficients)).collect(),
            best: best_of(path, rows.target.len(), allowed.len()),
        })
    }

    /// The path, and behind it the chosen fit.
    ///
    /// Terms that are kept are taken out of the target and of all other columns first, so that any regression can
    /// choose among the others; then every candidate is fitted again with them.
    fn candidates(
        &self,
        rows: &Rows,
        allowed: &[usize],
        (theta, target): (&Mat<f64>, &[f64]),
        problem: &Reduced,
    ) -> Result<Candidates> {
        let gap = (rows.target.len() / (FOLDS * 20)).min(GAP);
        let folds = Folds::new(&rows.lengths, FOLDS.min(rows.target.len() / 2).max(2), gap)?;
        let choose = |theta: &Mat<f64>, target: &[f64]| {
            let choice = self.selection.choose(self.regressor, theta.as_ref(), target, &folds)?;
            let mut candidates = choice.candidates;
            candidates.scores.push(candidates.scores[choice.index]);
            candidates.fits.push(choice.fit);
            Ok(candidates)
        };
        let (kept, open): (Vec<usize>, Vec<usize>) = (0..allowed.len()).partition(|&k| self.kept.contains(&allowed[k]));
        if kept.is_empty() {
            return choose(theta, target);
        }
        let with_kept = |fit: &Fit| {
            let support: Vec<usize> = kept.iter().copied().chain(fit.support().iter().map(|&k| open[k])).collect();
            Fit { level: fit.level, ..problem.refit(&support) }
        };
        if open.is_empty() {
            let fit = problem.refit(&kept);
            return Ok(Candidates {
                fits: vec![fit.clone(), fit],
                scores: vec![f64::NAN; 2],
                errors: vec![f64::NAN; 2],
            });
        }
        let mut left = Mat::from_fn(theta.nrows(), open.len(), |i, k| theta[(i, open[k])]);
        let mut target = target.to_vec();
        for direction in directions(theta, &kept) {
            for k in 0..open.len() {
                take_out(&direction, left.col_as_slice_mut(k));
            }
            take_out(&direction, &mut target);
        }
        let mut candidates = choose(&left, &target)?;
        candidates.fits = candidates.fits.iter().map(with_kept).collect();
        Ok(candidates)
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
    fn stability(&self, rows: &Rows, level: f64, ensemble: &Ensemble) -> Result<Vec<f64>> {
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
