//! What a diagnosis left open: simulators that its logs can't distinguish, and how well they know the sizes of each.

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{OTHERS, UNKNOWN};
use crate::diagnose::steps::findings::Judged;
use crate::model::Model;
use crate::refine::Hold;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A simulator that may be the right one.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Candidate {
    /// Ids of its effects, with their places where the ids alone would name another candidate, too; or the model's own name.
    pub label: String,
    /// Its equations, fitted values in place.
    pub model: Model,
    /// Parameters that the logs or a belief know up to an error.
    pub parameters: Vec<String>,
    /// Covariance of that error, row by row.
    pub covariance: Vec<Vec<f64>>,
}

/// Simulators of which each may be the right one, and what is known of the machine and its sensors.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Open {
    /// All with the controls of the first, and its first states.
    pub candidates: Vec<Candidate>,
    /// Which of them are to be distinguished.
    pub pairs: Vec<(usize, usize)>,
    /// Logged state and standard deviation of its noise, in its unit.
    pub noise: Vec<(String, f64)>,
    /// State and where the logs began; others begin at the model's `initial`, or at zero.
    pub start: Vec<(String, f64)>,
    /// What controls do between samples.
    pub linear: bool,
}

impl Candidate {
    /// A model without logs: parameters with a tolerance are known up to it, all others exactly.
    #[must_use]
    pub fn of_model(model: Model) -> Self {
        let tolerated = model.parameters.iter().filter_map(|p| Some((p.name.clone(), p.tolerance? * p.value.abs())));
        let (parameters, deviations): (Vec<String>, Vec<f64>) = tolerated.filter(|(_, sd)| *sd > 0.0).unzip();
        let row = |i: usize| (0..deviations.len()).map(|j| if i == j { deviations[i].powi(2) } else { 0.0 }).collect();
        Self { label: model.name.clone(), covariance: (0..deviations.len()).map(row).collect(), parameters, model }
    }

    fn of(fit: &Contestant) -> Self {
        let model = fit.model();
        let ids: Vec<&str> = fit.hypotheses.iter().map(|h| h.id()).collect();
        let label = if ids.is_empty() { format!("{} as it is", model.name) } else { ids.join(" + ") };
        let inflation = fit.evidence.inflation();
        // What the logs do not determine at all may be off by many of its typical sizes.
        let variance = |(i, j): (usize, usize), value: f64| match value.is_finite() {
            true => value,
            false if i == j => (UNKNOWN * fit.free[i].scale).powi(2),
            false => 0.0,
        };
        let row = |(i, row): (usize, &Vec<f64>)| {
            row.iter().enumerate().map(|(j, v)| variance((i, j), v * inflation)).collect::<Vec<f64>>()
        };
        let covariance = fit.refined.covariance.iter().enumerate().map(row).collect();
        let parameters = fit.free.iter().map(|f| model.parameters[f.parameter].name.clone()).collect();
        Self { label, parameters, covariance, model }
    }
}

impl Open {
    /// Whether the logs left any pair open.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// The same with the pairs of which one has the effect or label `one` and the other `other`.
    #[must_use]
    pub fn separating(&self, one: &str, other: &str) -> Self {
        let has = |candidate: usize, name: &str| {
            let label = &self.candidates[candidate].label;
            let is = |part: &str| part == name || part.split_once(" (").is_some_and(|(id, _)| id == name);
            label == name || label.split(" + ").any(is)
        };
        let parts = |i: usize, j: usize| {
            has(i, one) && has(j, other) && !has(i, other) && !has(j, one)
                || has(i, other) && has(j, one) && !has(i, one) && !has(j, other)
        };
        let all = self.all_pairs().into_iter().filter(|&(i, j)| parts(i, j));
        Self { pairs: all.collect(), ..self.clone() }
    }

    /// The same with every pair to be distinguished.
    #[must_use]
    pub fn separating_all(&self) -> Self {
        Self { pairs: self.all_pairs(), ..self.clone() }
    }

    fn all_pairs(&self) -> Vec<(usize, usize)> {
        let count = self.candidates.len();
        (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j))).collect()
    }

    pub(crate) fn hold(&self) -> Hold {
        if self.linear { Hold::Linear } else { Hold::Zero }
    }
}

/// Gives candidates of the same effects the places of these.
fn name_apart(candidates: &mut [Candidate], fits: &[&Contestant]) {
    let labels: Vec<String> = candidates.iter().map(|c| c.label.clone()).collect();
    for (candidate, fit) in candidates.iter_mut().zip(fits) {
        if labels.iter().filter(|label| **label == candidate.label).count() < 2 {
            continue;
        }
        let model = fit.system.model();
        let placed = fit.hypotheses.iter().map(|h| {
            let place = h.place().unwrap_or_else(|| {
                let state = model.states[h.state].name.as_str();
                let others = h.variables.iter().map(String::as_str).filter(|name| *name != state);
                std::iter::once(state).chain(others).collect::<Vec<_>>().join(" and ")
            });
            format!("{} ({place})", h.id())
        });
        candidate.label = placed.collect::<Vec<_>>().join(" + ");
    }
}

/// The winner, its twins in every place, and the next best accounts; without a winner the nominal model and what came
/// nearest to one.
pub(crate) fn left_open(judged: &Judged) -> Open {
    let outcome = &judged.outcome;
    let best = &outcome.best;
    let alone = best.evidence.alone();
    let mut fits = vec![best];
    let mut pairs = Vec::new();
    for seat in &outcome.seats {
        let others = || seat.alternatives.iter().filter(|fit| !fit.has_effects_of(best));
        let mut group = vec![0];
        for fit in others().filter(|fit| seat.is_twin(fit, alone)) {
            pairs.extend(group.iter().map(|&known| (known, fits.len())));
            group.push(fits.len());
            fits.push(fit);
        }
        fits.extend(others().filter(|fit| !seat.is_twin(fit, alone)).take(OTHERS));
    }
    if best.hypotheses.is_empty() {
        fits.extend(outcome.singles.iter().take(OTHERS));
    }
    let mut candidates: Vec<Candidate> = fits.iter().map(|fit| Candidate::of(fit)).collect();
    name_apart(&mut candidates, &fits);
    let experiment = &best.experiment;
    let model = best.system.model();
    let noise = experiment.columns.iter().zip(&experiment.noise).map(|(&j, &sd)| (model.states[j].name.clone(), sd));
    // The first window begins with the first log.
    let first = best.refined.initial.first().map_or(&[][..], Vec::as_slice);
    let start = model.states[..best.nominal_states()].iter().zip(first).map(|(s, &value)| (s.name.clone(), value));
    let (noise, start) = (noise.collect(), start.collect());
    Open { candidates, pairs, noise, start, linear: experiment.hold == Hold::Linear }
}
