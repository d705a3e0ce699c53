//! From folded rows to equations: terms chosen, coefficients with standard errors.

use super::OnlineSettings;
use super::accumulate::{Accumulator, FOLDS, Weight};
use super::smoothing::Smoothing;
use crate::error::{Error, Result};
use crate::identify::support::equations::Equations;
use crate::identify::{Identification, StateReport};
use crate::model::IdentificationRecord;
use crate::regress::{Reduced, Selection};

/// The equation of one state.
struct Chosen {
    coefficients: Vec<f64>,
    errors: Vec<f64>,
    level: f64,
    score: f64,
    /// Mean squared residual, in the state's unit squared.
    residual: f64,
}

pub(super) fn report(
    settings: &OnlineSettings,
    frame: &Equations,
    smoothing: &Smoothing,
    rows: &Accumulator,
) -> Result<Identification> {
    let (n, p) = (frame.n_states(), frame.n_terms());
    let mut equations = frame.clone();
    let mut errors = vec![vec![0.0; p]; n];
    let mut states = Vec::with_capacity(n);
    let names = frame.library.names();
    let mut notes = Vec::new();
    for s in 0..n {
        let fit = &smoothing.fits[s];
        let state = frame.states[s].0.clone();
        let weak: Vec<String> = fit.weak.iter().map(ToString::to_string).collect();
        if !weak.is_empty() {
            notes.push(format!("smoothing of `{state}`: {}", weak.join("; ")));
        }
        let mut report = StateReport {
            state,
            terms: Vec::new(),
            level: f64::NAN,
            score: f64::NAN,
            residual: f64::NAN,
            noise: fit.noise,
            kernel: fit.kernel.to_string(),
        };
        if frame.fixed[s].is_none() {
            let chosen = choose(settings, frame, s, rows)?;
            let square = fit.noise * fit.noise;
            (report.level, report.score) = (chosen.level, chosen.score / square);
            report.residual = chosen.residual / square;
            equations.coefficients[s] = chosen.coefficients;
            errors[s] = chosen.errors;
        }
        states.push(report);
    }
    let support = equations.support();
    for (report, terms) in states.iter_mut().zip(&support) {
        report.terms = terms.iter().map(|&j| names[j].to_string()).collect();
    }
    let mut model = equations.model(&support, false);
    model.identification = Some(IdentificationRecord {
        terms: names.iter().map(ToString::to_string).collect(),
        coefficients: equations.coefficients.clone(),
        standard_errors: errors,
        inclusion_probabilities: Vec::new(),
        lambda: states.iter().map(|s| if s.level.is_finite() { s.level } else { 0.0 }).collect(),
    });
    let late = equations.delays.iter().zip(&equations.controls).filter(|(delay, _)| delay.value != 0.0);
    let delays = late.map(|(delay, (control, _))| (control.clone(), delay.value, 0.0)).collect();
    Ok(Identification { model, states, delays, window: f64::NAN, hold: settings.hold, notes })
}

/// The sparse regression of state `s`; a term that comes out with a forbidden sign is taken out and the regression runs again.
fn choose(settings: &OnlineSettings, frame: &Equations, s: usize, rows: &Accumulator) -> Result<Chosen> {
    if frame.allowed[s].is_empty() {
        return Err(Error::invalid("the library holds no term; allow at least one"));
    }
    let (groups, weights) = rows.groups(s);
    let total =
        weights.iter().fold(Weight::default(), |a, b| Weight { sum: a.sum + b.sum, squares: a.squares + b.squares });
    if total.sum < 4.0 {
        let what = format!("regression of state `{}`", frame.states[s].0);
        return Err(Error::TooFewSamples { what, needed: 4, found: total.sum as usize });
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
        return Ok(Chosen { coefficients, errors, level: choice.fit.level, score, residual });
    }
}

/// Groups that it takes to see what the errors of a stretch have in common.
const ENOUGH: usize = 10;

/// Every fifth group to a fold, and the weight of each fold.
fn folds(groups: &[Reduced], weights: &[Weight]) -> Result<(Vec<Reduced>, Vec<f64>)> {
    let count = groups.len().min(FOLDS);
    let own = |k: usize| (k..groups.len()).step_by(FOLDS);
    let folds = (0..count).map(|k| Reduced::stack(&own(k).map(|g| &groups[g]).collect::<Vec<_>>()));
    let sums = (0..count).map(|k| own(k).map(|g| weights[g].sum).sum()).collect();
    Ok((folds.collect::<Result<_>>()?, sums))
}
