//! Detect and attribute: is there a gap, which effects cause it, and is anything left that has no name.

use super::evidence::chi_squared_tail;
use super::fitted::Fitted;
use super::rival::Rival;
use super::search::{Contest, Expansion, Summary, keep_first_of_each, sort_by_score};
use crate::error::Result;
use crate::model::System;
use crate::refine::{Experiment, Refine};

/// Whether there is a gap.
#[derive(Debug, Clone)]
pub(crate) struct Detected {
    pub(crate) gap: bool,
    pub(crate) p_value: f64,
}

/// Structure that the winner leaves.
#[derive(Debug, Clone)]
pub(crate) struct Left {
    /// Mean squared residual (noise units) that a function without a name would still remove.
    pub(crate) energy: f64,
    /// Chance that noise alone would give as much.
    pub(crate) p_value: f64,
    /// State in whose equation it lies, and the variables that it depends on.
    pub(crate) state: usize,
    pub(crate) depends_on: Vec<String>,
}

/// What the contest found.
pub(crate) struct Outcome {
    pub(crate) best: Fitted,
    /// For every effect of the winner: contestants that differ from the winner in that effect alone, the winner included.
    pub(crate) alternatives: Vec<Vec<Fitted>>,
    /// Where no effect convinced: single effects, best first.
    pub(crate) singles: Vec<Fitted>,
    pub(crate) left: Option<Left>,
    /// Straight-line gain of every hypothesis at the winner.
    pub(crate) screened: Vec<Summary>,
}

impl Outcome {
    pub(crate) fn no_gap(nominal: &Fitted, first: &Expansion) -> Self {
        Self {
            best: nominal.clone(),
            alternatives: Vec::new(),
            singles: first.fits.clone(),
            left: None,
            screened: first.screened.clone(),
        }
    }
}

/// Chance that noise gives as large a gain as the best rival (Bonferroni).
fn rival_p_value(gains: &[(f64, usize)]) -> f64 {
    let best = gains.iter().map(|&(gain, degrees)| chi_squared_tail(gain, degrees)).fold(1.0, f64::min);
    (best * gains.len() as f64).min(1.0)
}

pub(crate) fn detect(first: &Expansion, rivals: &[(f64, usize)], confidence: f64, nominal: &Fitted) -> Detected {
    let beliefs: f64 = nominal
        .free
        .iter()
        .filter_map(|f| f.prior.map(|(mean, sd)| ((nominal.refined.parameters[f.parameter] - mean) / sd).powi(2)))
        .fold(0.0, f64::max);
    let tolerated = nominal.free.len().max(1) as f64;
    let strained = (chi_squared_tail(beliefs, 1) * tolerated).min(1.0);
    // Three searches, each paid for.
    let p_value = (3.0 * first.p_value().min(rival_p_value(rivals)).min(strained)).min(1.0);
    Detected { gap: p_value <= 1.0 - confidence, p_value }
}

/// The contest from first suspects to a winner, its rivals and what it leaves.
pub(crate) fn attribute(
    contest: &Contest<'_>,
    nominal: &Fitted,
    first: Expansion,
    rivals: &[Rival],
    most: usize,
    notes: &mut Vec<String>,
) -> Result<Outcome> {
    let singles: Vec<Fitted> = first.fits.clone();
    let rough = contest.run(nominal, first, most)?;
    let (nominal, mut best) = lengthen(nominal, rough, notes)?;
    let thorough = Refine { max_iterations: 40, tolerance: 1e-7 };
    let mut alternatives: Vec<Vec<Fitted>> = Vec::new();
    // Swap: leave each effect out in turn, and let all others apply for its place.
    let mut swaps = 0;
    let mut place = 0;
    while place < best.hypotheses.len() {
        let rest = without(contest, &nominal, &best, place)?;
        let mut fits = contest.expand(&rest, "alternatives")?.fits;
        fits.push(best.clone());
        let mut fits: Vec<Fitted> = fits.into_iter().map(|f| f.on(&best.experiment, &thorough).unwrap_or(f)).collect();
        sort_by_score(&mut fits, |f| contest.score(f));
        keep_first_of_each(&mut fits);
        let gain = contest.score(&fits[0]) - contest.score(&best);
        let same = fits[0].hypotheses.iter().all(|h| best.hypotheses.contains(h));
        if !contest.is_convincing(&best, &rest) && best.hypotheses.len() > 1 {
            // Others have made this effect superfluous.
            best = rest;
            alternatives.clear();
            place = 0;
            continue;
        }
        if !same && gain > 0.5 && swaps < 4 {
            best = fits[0].clone();
            alternatives.clear();
            swaps += 1;
            place = 0;
            continue;
        }
        alternatives.push(fits);
        place += 1;
    }
    let last = contest.expand(&best, "what is left")?;
    let gains = contest.rivals(&best, rivals);
    let left = left_over(&best, &last, &gains, rivals);
    Ok(Outcome { best, alternatives, singles, left, screened: last.screened })
}

/// Initial states with every lagging input (states from `known` on) starting at its control.
pub(crate) fn with_lagging(
    system: &System,
    experiment: &Experiment,
    mut initial: Vec<Vec<f64>>,
    known: usize,
) -> Vec<Vec<f64>> {
    let model = system.model();
    for (window, start) in experiment.windows.iter().zip(&mut initial) {
        start.resize(model.states.len(), 0.0);
        for (state, value) in model.states[known..].iter().zip(&mut start[known..]) {
            let control = state.equation.variables().iter().find_map(|name| model.control_index(name));
            *value = control.map_or(0.0, |c| experiment.logs[window.log].controls[c][window.first]);
        }
    }
    initial
}

/// The winner without the effect at `place`, fitted again from the nominal model.
fn without(contest: &Contest<'_>, nominal: &Fitted, best: &Fitted, place: usize) -> Result<Fitted> {
    let mut fit = nominal.clone();
    for (i, hypothesis) in best.hypotheses.iter().enumerate().filter(|(i, _)| *i != place) {
        let applied = hypothesis.apply(fit.system.model(), &contest.scene)?;
        let values: Vec<f64> = best.added[i].iter().map(|(index, _)| best.refined.parameters[*index]).collect();
        fit = fit.with(hypothesis, &applied, &values, &contest.settings)?;
    }
    Ok(fit)
}

/// Once the model is better, rollouts may be longer: whole runs again where the winner allows it.
fn lengthen(nominal: &Fitted, best: Fitted, notes: &mut Vec<String>) -> Result<(Fitted, Fitted)> {
    let is_whole = nominal.experiment.windows.len() == nominal.experiment.logs.len();
    if is_whole || best.hypotheses.is_empty() {
        return Ok((nominal.clone(), best));
    }
    let settings = Refine { max_iterations: 15, tolerance: 1e-5 };
    let (longer, _) =
        super::prepare::choose_windows(&best.system, best.experiment.clone(), &best.refined.parameters, &best.free)?;
    if longer.windows.len() >= best.experiment.windows.len() {
        return Ok((nominal.clone(), best));
    }
    let (Ok(moved), Ok(base)) = (best.on(&longer, &settings), nominal.on(&longer, &settings)) else {
        return Ok((nominal.clone(), best));
    };
    notes.push("the corrected model stays near the logs for longer, so its fit uses longer rollouts".into());
    Ok((base, moved))
}

/// Structure that a function without a name, or one more effect, would still remove.
fn left_over(best: &Fitted, last: &Expansion, gains: &[(f64, usize)], rivals: &[Rival]) -> Option<Left> {
    let count = best.count().max(1) as f64;
    let innovation = best.colours.iter().map(|c| c.innovation * c.count as f64).sum::<f64>() / count;
    let energy = |gain: f64, degrees: usize| (gain - degrees as f64).max(0.0) / count * innovation;
    let (place, &(gain, degrees)) = gains
        .iter()
        .enumerate()
        .max_by(|a, b| (a.1.0 - 2.0 * a.1.1 as f64).total_cmp(&(b.1.0 - 2.0 * b.1.1 as f64)))?;
    let p_value = (2.0 * rival_p_value(gains).min(last.p_value())).min(1.0);
    let rival = &rivals[place];
    Some(Left { energy: energy(gain, degrees), p_value, state: rival.state, depends_on: rival.variables.clone() })
}
