//! What was identified, for the screen and as JSON.

use crate::text::{aligned, count, short};
use gpsindy_core::{Dataset, Hold, Identification, Score};
use serde_json::json;

/// The equations, how sure each coefficient is, and how well rollouts follow the logs.
pub(crate) fn summary(data: &Dataset, found: &Identification, fit: Option<&Score>) -> String {
    let runs = format!("{}, {}", count(data.runs().len(), "run"), count(data.n_samples(), "sample"));
    summary_of(&runs, found, fit)
}

/// The same of `logs`, told in words.
pub(crate) fn summary_of(logs: &str, found: &Identification, fit: Option<&Score>) -> String {
    let mut text = format!("equations from {logs}:\n\n");
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
    let mut rows = vec![vec!["  state".to_string(), "noise".into(), "rollout rmse".into(), "relative".into()]];
    for (s, state) in found.states.iter().enumerate() {
        let error = fit.and_then(|f| f.rollout.by_state.iter().find(|e| e.state == state.state));
        let unit = &found.model.states[s].unit;
        let with_unit = |v: f64| if unit.is_empty() { short(v) } else { format!("{} {unit}", short(v)) };
        rows.push(vec![
            format!("  {}", state.state),
            with_unit(state.noise),
            error.map_or("-".into(), |e| with_unit(e.rmse)),
            error.map_or("-".into(), |e| short(e.normalised)),
        ]);
    }
    text += &format!("\n{}", aligned(&rows));
    if let Some(fit) = fit.filter(|f| f.rollout.n_diverged > 0) {
        text += &format!("  {} of {} rollouts diverged\n", fit.rollout.n_diverged, fit.rollout.n_started);
    }
    text
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

pub(crate) fn as_json(found: &Identification, fit: Option<&Score>) -> serde_json::Value {
    let states = found.states.iter().map(|s| {
        json!({"state": s.state, "terms": s.terms, "level": s.level, "score": s.score, "residual": s.residual, "noise": s.noise, "kernel": s.kernel})
    });
    let delays = found
        .delays
        .iter()
        .map(|d| json!({"control": d.control, "value": d.delay, "standard_error": d.standard_error}));
    let rollout = fit.map(|fit| crate::commands::score::as_json(&fit.rollout));
    json!({
        "model": found.model,
        "states": states.collect::<Vec<_>>(),
        "delays": delays.collect::<Vec<_>>(),
        "hold": if found.hold == Hold::Zero { "zero" } else { "linear" },
        "rollout": rollout,
        "notes": found.notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}
