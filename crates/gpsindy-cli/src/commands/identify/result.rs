//! The result of an identification, for the screen and as JSON.

use crate::text::{aligned, count, short};
use gpsindy_core::{Dataset, Hold, Identification, Note, Outlook, Score, StateError};
use serde_json::json;

/// What a score was taken on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum On {
    /// Logs of their own.
    Holdout,
    /// The last part of every run.
    Rest,
    /// The logs that were learnt from.
    Training,
}

/// How well the model predicts.
#[derive(Debug)]
pub(crate) struct Fit {
    pub(crate) score: Score,
    pub(crate) on: On,
}

impl On {
    fn name(self) -> &'static str {
        match self {
            Self::Holdout => "holdout",
            Self::Rest => "rest",
            Self::Training => "training",
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Holdout => "whole held-out runs",
            Self::Rest => "the last part of every run, which was not used for training",
            Self::Training => "whole training runs; --holdout scores on other logs",
        }
    }
}

/// In what way the model is poor, where it is.
pub(super) fn poor(found: &Identification) -> Option<String> {
    let Some(fidelity) = found.fidelity.filter(|fidelity| fidelity.is_poor()) else {
        let part = found.left_out().filter(|part| part.is_poor())?;
        let mean = short(part.mean);
        return Some(match part.error {
            None => "the model, fitted to the first three quarters of the logs, diverges in the last quarter".into(),
            Some(error) => format!(
                "the model, fitted to the first three quarters of the logs, predicts the last quarter worse than its mean: relative error {} against {mean}",
                short(error)
            ),
        });
    };
    let length = short(fidelity.length);
    Some(match fidelity.error {
        None => format!("the model diverges in rollouts of {length} s over its training logs"),
        Some(error) => {
            let (what, level) =
                if fidelity.still < 1.0 { ("a constant state", fidelity.still) } else { ("the mean", 1.0) };
            format!(
                "the model predicts its training logs no better than {what} does: relative error {} against {} in rollouts of {length} s",
                short(error),
                short(level)
            )
        }
    })
}

/// Exchangeable terms that the summary names at most; the JSON result has all.
const EXCHANGES: usize = 5;

/// Share of the variance that rollouts over whole runs may miss without a warning: more than half of it is not followed.
const MISSED: f64 = 0.5;

/// That rollouts follow little of the logs, where they do although the model is not poor and the motion can be foretold.
pub(super) fn astray(found: &Identification, fit: &Fit) -> Option<String> {
    let missed = fit.score.rollout.pooled.powi(2);
    let foretold = !found.notes.iter().any(|note| matches!(note, Note::Unpredictable { .. } | Note::Unstable { .. }));
    (missed > MISSED && foretold && !found.is_poor()).then(|| {
        format!(
            "rollouts miss {} of the logs' variance; try a lower --degree, other terms, or a known equation (--fix)",
            if missed < 1.0 { format!("{:.0} %", 100.0 * missed) } else { "all".into() }
        )
    })
}

/// The equations, how sure each coefficient is, and how well rollouts follow the logs.
pub(crate) fn summary(data: &Dataset, found: &Identification, fit: Option<&Fit>) -> String {
    let runs = format!("{}, {}", count(data.runs().len(), "run"), count(data.n_samples(), "sample"));
    summary_of(&runs, found, fit)
}

/// The same of `logs`, in words.
pub(crate) fn summary_of(logs: &str, found: &Identification, fit: Option<&Fit>) -> String {
    let mut text = poor(found).map_or_else(String::new, |how| format!("POOR: {how}\n\n"));
    text += &format!("equations from {logs}:\n\n");
    for state in &found.model.states {
        text += &format!("  {}' = {}\n", state.name, rounded(found, state));
    }
    let Some(record) = &found.model.identification else { return text };
    let with_inclusion = !record.inclusion_probabilities.is_empty();
    let mut rows = vec![vec!["  coefficient".to_string(), "value".into(), "std error".into()]];
    if with_inclusion {
        rows[0].push("inclusion".into());
    }
    for (s, state) in found.model.states.iter().enumerate() {
        for (j, term) in record.terms.iter().enumerate() {
            let value = record.coefficients[s][j];
            if value == 0.0 {
                continue;
            }
            let error = record.standard_errors.get(s).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN);
            let mut row = vec![format!("  {}': {term}", state.name), short(value), short(error)];
            if with_inclusion {
                row.push(format!("{:.2}", record.inclusion_probabilities[s][j]));
            }
            rows.push(row);
        }
    }
    if rows.len() > 1 {
        text += &format!("\n{}", aligned(&rows));
    }
    for late in &found.delays {
        let error = late.standard_error.map_or("given".into(), |error| format!("std error {}", short(error)));
        text += &format!("  delay of {}: {} s, {error}\n", late.control, short(late.delay));
    }
    for number in &found.model.parameters {
        let error = number.tolerance.map_or("-".into(), |share| short(share * number.value.abs()));
        text += &format!("  {}: {}, std error {error}\n", number.name, short(number.value));
    }
    for pair in found.outlook.iter().flat_map(|outlook| &outlook.exchangeable).take(EXCHANGES) {
        text += &format!("  {}': {} could also be {}, as far as these logs show\n", pair.state, pair.term, pair.other);
    }
    let mut rows = vec![["  state", "noise", "rollout rmse", "relative", "fit"].map(String::from).to_vec()];
    for (s, state) in found.states.iter().enumerate() {
        let error = fit.and_then(|f| f.score.rollout.by_state.iter().find(|e| e.state == state.state));
        let unit = &found.model.states[s].unit;
        let with_unit = |v: f64| if unit.is_empty() { short(v) } else { format!("{} {unit}", short(v)) };
        rows.push(vec![
            format!("  {}", state.state),
            with_unit(state.noise),
            error.map_or("-".into(), |e| with_unit(e.rmse)),
            error.map_or("-".into(), |e| short(e.normalised)),
            error.filter(|e| e.normalised.is_finite()).map_or("-".into(), fit_percent),
        ]);
    }
    text += &format!("\n{}", aligned(&rows));
    if let Some(fit) = fit {
        text += &format!("  rollouts over {}\n", fit.on.words());
        let errors = &fit.score.rollout;
        if errors.n_diverged > 0 {
            text += &format!("  {} of {} rollouts diverged\n", errors.n_diverged, errors.n_started);
        }
    }
    text
}

/// Share of the motion that is predicted, 1 less the relative error, in percent: 0 and below is no better than the mean.
fn fit_percent(error: &StateError) -> String {
    format!("{:.1} %", 100.0 * (1.0 - error.normalised))
}

/// The right side of an equation with four significant digits.
pub(crate) fn rounded(found: &Identification, state: &gpsindy_core::State) -> String {
    let Some(record) = &found.model.identification else { return state.equation.to_string() };
    let s = found.model.state_index(&state.name).unwrap_or(0);
    let kept = record.terms.iter().zip(&record.coefficients[s]).filter(|(_, value)| **value != 0.0);
    let mut text = String::new();
    for (term, value) in kept {
        text += match (text.is_empty(), *value < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += &short(value.abs());
        if term != "1" {
            text += &format!("*{term}");
        }
    }
    // An equation that was given, or one without a term.
    if text.is_empty() { state.equation.to_string() } else { text }
}

pub(crate) fn as_json(found: &Identification, fit: Option<&Fit>) -> serde_json::Value {
    let states = found.states.iter().map(|s| {
        json!({"state": s.state, "terms": s.terms, "level": s.level, "score": s.score, "residual": s.residual, "noise": s.noise, "kernel": s.kernel})
    });
    let delays = found
        .delays
        .iter()
        .map(|d| json!({"control": d.control, "value": d.delay, "standard_error": d.standard_error}));
    let rollout = fit.map(|fit| crate::commands::score::as_json(&fit.score.rollout));
    json!({
        "model": found.model,
        "states": states.collect::<Vec<_>>(),
        "delays": delays.collect::<Vec<_>>(),
        "hold": if found.hold == Hold::Zero { "zero" } else { "linear" },
        "rollout": rollout,
        "scored_on": fit.map(|fit| fit.on.name()),
        "poor": found.is_poor(),
        "fidelity": found.fidelity.map(|f| json!({"length": f.length, "error": f.error, "still": f.still})),
        "outlook": found.outlook.as_ref().map(outlook_as_json),
        "notes": found.notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn outlook_as_json(outlook: &Outlook) -> serde_json::Value {
    let pairs = outlook.exchangeable.iter().map(|e| json!({"state": e.state, "term": e.term, "other": e.other}));
    json!({
        "left_out": outlook.left_out.map(|part| json!({"error": part.error, "mean": part.mean})),
        "diverging": outlook.doubt.diverging,
        "open": outlook.doubt.open,
        "unstable": outlook.doubt.unstable,
        "exchangeable": pairs.collect::<Vec<_>>(),
    })
}
