//! From folded rows to equations: terms chosen, coefficients with standard errors.

use super::accumulate::{Accumulator, Weight};
use super::settings::OnlineSettings;
use super::smoothing::Smoothing;
use crate::error::{Error, Result};
use crate::identify::algorithm1::regress::Chosen;
use crate::identify::equations::Equations;
use crate::identify::limits::online::ENOUGH;
use crate::identify::limits::{FEWEST, FOLDS};
use crate::identify::notes::Note;
use crate::identify::report::Found;
use crate::identify::result::Identification;
use crate::regress::{Reduced, Selection};

pub(super) fn report(
    settings: &OnlineSettings,
    frame: &Equations,
    smoothing: &Smoothing,
    rows: &Accumulator,
) -> Result<Identification> {
    let n = frame.n_states();
    let mut equations = frame.clone();
    let mut chosen = Vec::with_capacity(n);
    let mut notes = Vec::new();
    for (s, fit) in smoothing.fits.iter().enumerate() {
        if !fit.weak.is_empty() {
            notes.push(Note::WeakSmoothing { column: frame.states[s].0.clone(), reasons: fit.weak.clone() });
        }
        chosen.push(match frame.fixed[s] {
            Some(_) => None,
            None => Some(choose(settings, frame, s, rows)?.in_units_of(fit.noise)),
        });
        if let Some(chosen) = &chosen[s] {
            equations.set(s, &chosen.coefficients);
        }
    }
    let errors = chosen.iter().map(|c| c.as_ref().map_or_else(|| vec![0.0; frame.n_terms()], |c| c.errors.clone()));
    let found = Found {
        errors: errors.collect(),
        equations,
        inclusion: Vec::new(),
        delay_errors: Vec::new(),
        noise: smoothing.fits.iter().map(|fit| fit.noise).collect(),
        window: None,
        hold: settings.hold,
        fidelity: None,
        outlook: None,
    };
    let kernels: Vec<String> = smoothing.fits.iter().map(|fit| fit.kernel.to_string()).collect();
    Ok(crate::identify::report::report(found, &chosen, &kernels, notes))
}

/// The sparse regression of state `s`; a term that comes out with a forbidden sign is taken out and the regression runs again.
fn choose(settings: &OnlineSettings, frame: &Equations, s: usize, rows: &Accumulator) -> Result<Chosen> {
    if frame.allowed[s].is_empty() {
        return Err(Error::settings("the library holds no term; allow at least one"));
    }
    let (groups, weights) = rows.groups(s);
    let total =
        weights.iter().fold(Weight::default(), |a, b| Weight { sum: a.sum + b.sum, squares: a.squares + b.squares });
    if total.sum < FEWEST as f64 {
        let what = format!("regression of state `{}`", frame.states[s].0);
        return Err(Error::TooFewSamples { what, needed: FEWEST, found: total.sum as usize });
    }
    let (folds, sums) = folds(&groups, &weights)?;
    let few = matches!(settings.selection, Selection::CrossValidation { .. }) && folds.len() < FOLDS;
    let selection = if few { Selection::Bic { noise: None } } else { settings.selection.clone() };
    let mut allowed = frame.allowed[s].clone();
    loop {
        let parts: Vec<Reduced> = folds.iter().map(|fold| fold.with_terms(&allowed)).collect();
        let choice = selection.choose_from(settings.regressor.as_ref(), &parts, &sums)?;
        let support = choice.fit.support();
        let refused =
            |k: &usize| frame.signs[s][allowed[*k]].is_some_and(|up| (choice.fit.coefficients[*k] > 0.0) != up);
        let wrong: Vec<usize> = support.iter().copied().filter(refused).map(|k| allowed[k]).collect();
        if !wrong.is_empty() && wrong.len() < allowed.len() {
            allowed.retain(|j| !wrong.contains(j));
            continue;
        }
        let residual = choice.fit.residual / (total.sum - support.len() as f64).max(1.0);
        let found = if groups.len() < ENOUGH {
            // Rows of unequal weight carry errors of equal size: their squares count once more.
            let noise = (residual * total.squares / total.sum).sqrt();
            Reduced::stack(&parts.iter().collect::<Vec<_>>())?.standard_errors(&support, noise)
        } else {
            let parts: Vec<Reduced> = groups.iter().map(|group| group.with_terms(&allowed)).collect();
            Reduced::clustered_errors(&parts, &support, &choice.fit.coefficients)
        };
        let (mut coefficients, mut errors) = (vec![0.0; frame.n_terms()], vec![0.0; frame.n_terms()]);
        for (&k, error) in support.iter().zip(found) {
            // Where every allowed term came out with a sign that it must not have, none is left.
            if !wrong.contains(&allowed[k]) {
                coefficients[allowed[k]] = choice.fit.coefficients[k];
                errors[allowed[k]] = error;
            }
        }
        let score = choice.candidates.scores[choice.index];
        let level = choice.fit.level;
        return Ok(Chosen { coefficients, errors, level, score, residual, path: Vec::new(), best: None });
    }
}

/// Every fifth group to a fold, and the weight of each fold.
fn folds(groups: &[Reduced], weights: &[Weight]) -> Result<(Vec<Reduced>, Vec<f64>)> {
    let count = groups.len().min(FOLDS);
    let own = |k: usize| (k..groups.len()).step_by(FOLDS);
    let folds = (0..count).map(|k| Reduced::stack(&own(k).map(|g| &groups[g]).collect::<Vec<_>>()));
    let sums = (0..count).map(|k| own(k).map(|g| weights[g].sum).sum()).collect();
    Ok((folds.collect::<Result<_>>()?, sums))
}
