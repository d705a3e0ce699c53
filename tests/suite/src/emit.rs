//! Writes a case: the nominal model, the logs, and the entry of the answers.

use crate::case::{Case, HELD_OUT, Kind};
use crate::effect::{Act, Effect, Variable};
use crate::plant::Plant;
use crate::simulate::rows_of;
use crate::twins::{Fitted, accept};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Entry of a case in `answers.toml`.
#[derive(Debug, serde::Serialize)]
#[allow(missing_docs)]
pub struct Answer {
    pub id: String,
    pub seed: u64,
    pub name: String,
    pub system: String,
    pub kind: &'static str,
    pub in_catalogue: bool,
    pub localise: Vec<String>,
    pub logged: Vec<String>,
    pub test_reset: f64,
    pub trap: String,
    pub sample_rate: f64,
    pub difficulty: &'static str,
    pub effects: Vec<Named>,
    pub accept: Vec<Named>,
    pub partial: Vec<Named>,
    pub noise: BTreeMap<String, f64>,
    pub oracle: Oracle,
}

/// An effect by its names.
#[derive(Debug, serde::Serialize)]
#[allow(missing_docs)]
pub struct Named {
    pub effect: String,
    pub state: String,
    pub variables: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameters: Option<BTreeMap<String, f64>>,
}

/// What the generator knows of the gap.
#[derive(Debug, serde::Serialize)]
#[allow(missing_docs)]
pub struct Oracle {
    pub n: usize,
    pub rmse_nominal: f64,
    pub rmse_oracle: f64,
    pub rmse_nominal_noisy: f64,
    pub rmse_oracle_noisy: f64,
    pub noise_floor: f64,
    pub snr: f64,
    pub closure_oracle: f64,
    pub nominal_by_state: BTreeMap<String, f64>,
    pub noise_by_state: BTreeMap<String, f64>,
}

/// The model file of a plant.
pub fn model(plant: &Plant) -> String {
    let mut text = format!("schema = \"gpsindy.model/1\"\nname = \"{}\"\n", plant.name);
    let unit = |text: &mut String, unit: &str| {
        if !unit.is_empty() {
            let _ = writeln!(text, "unit = \"{unit}\"");
        }
    };
    for state in &plant.states {
        let _ = write!(text, "\n[[state]]\nname = \"{}\"\n", state.name);
        unit(&mut text, &state.unit);
        let _ = writeln!(text, "equation = \"{}\"", state.equation);
    }
    for control in &plant.controls {
        let _ = write!(text, "\n[[control]]\nname = \"{}\"\n", control.name);
        unit(&mut text, &control.unit);
    }
    for parameter in &plant.parameters {
        let _ = write!(text, "\n[[parameter]]\nname = \"{}\"\nvalue = {:?}\n", parameter.name, parameter.value);
        unit(&mut text, &parameter.unit);
        if let Some(tolerance) = parameter.tolerance {
            let _ = writeln!(text, "tolerance = {tolerance:?}");
        }
    }
    text
}

/// The log of run `k` as CSV.
pub fn log(case: &Case, k: usize) -> String {
    let plant = &case.plant;
    // Three of four logs carry their units.
    let units = case.seed % 4 != 3;
    let header =
        |name: &str, unit: &str| if units && !unit.is_empty() { format!("{name} [{unit}]") } else { name.into() };
    let mut names = vec![header("t", "s")];
    names.extend(plant.controls.iter().map(|c| header(&c.name, &c.unit)));
    names.extend(plant.logged.iter().map(|&i| header(&plant.states[i].name, &plant.states[i].unit)));
    let mut text = names.join(",");
    text.push('\n');
    let run = &case.runs[k];
    for (i, t) in run.setup.times.iter().enumerate() {
        let _ = write!(text, "{t}");
        for u in &run.trace.controls[i] {
            let _ = write!(text, ",{u}");
        }
        for y in &run.log[i] {
            let _ = if y.is_nan() { write!(text, ",") } else { write!(text, ",{y}") };
        }
        text.push('\n');
    }
    text
}

/// The files of a case: name and text.
pub fn files(case: &Case) -> Vec<(String, String)> {
    let mut list = vec![("model.toml".to_string(), model(&case.plant))];
    for k in 0..case.runs.len() {
        let name =
            if k < case.given { format!("real_{}.csv", k + 1) } else { format!("holdout_{}.csv", k + 1 - case.given) };
        list.push((name, log(case, k)));
    }
    list
}

/// The entry of a case in the answers.
pub fn answer(case: &Case, id: &str) -> Answer {
    let plant = &case.plant;
    let state = |i: usize| plant.states[i].name.clone();
    let outside = case.kind == Kind::Outside;
    let effects: Vec<Named> = case
        .effects
        .iter()
        .map(|e| Named {
            effect: e.id.into(),
            state: state(e.state),
            variables: e.names(plant),
            of: None,
            parameters: Some(e.act.numbers().into_iter().map(|(n, v)| (n.to_string(), v)).collect()),
        })
        .collect();
    let names = |effect: &'static str, row: usize, variables: Vec<Variable>, of: usize| {
        let full = Effect { id: effect, state: row, variables, act: Act::Constant { c: 0.0 } };
        Named { effect: effect.into(), state: state(row), variables: full.names(plant), of: Some(of), parameters: None }
    };
    let mut accepted = Vec::new();
    let mut partial = Vec::new();
    let mut localise: Vec<String> = Vec::new();
    for (k, effect) in case.effects.iter().enumerate() {
        let outcome = case.outcomes.get(k).and_then(Option::as_ref);
        localise.push(state(effect.state));
        if outside || (case.kind == Kind::Beside && k > 0) {
            let mut list: Vec<(&str, usize, Vec<Variable>)> =
                covers(effect).into_iter().map(|(name, variables)| (name, effect.state, variables)).collect();
            if let Some(outcome) = outcome {
                // And whatever was seen in the same equation to cover half of the gap.
                let here = |f: &&Fitted| f.name.state == effect.state && f.left < 0.5 * outcome.gap;
                let near = outcome.near.iter().filter(here);
                list.extend(near.map(|f| (f.name.effect, f.name.state, f.name.variables.clone())));
            }
            for (i, entry) in list.iter().enumerate() {
                if !list[..i].contains(entry) {
                    partial.push(names(entry.0, entry.1, entry.2.clone(), k));
                }
            }
            continue;
        }
        for a in accept(plant, &case.survey, effect, k, outcome) {
            localise.push(state(a.state));
            accepted.push(names(a.effect, a.state, a.variables, a.of));
        }
    }
    if let (true, Some(Act::Actuator { control, .. })) = (outside, case.effects.first().map(|e| e.act)) {
        localise.extend(rows_of(plant, Variable::Control(control), &case.survey.points).into_iter().map(state));
    }
    localise.sort();
    localise.dedup();
    let (floor, by_state) = floor(case);
    let snr = case.gap.snr;
    let columns: Vec<String> = plant.logged.iter().map(|&i| state(i)).collect();
    let by = |values: &[f64]| columns.iter().cloned().zip(values.iter().copied()).collect();
    Answer {
        id: id.into(),
        seed: case.seed,
        name: format!("{}_{}", plant.name, case.effects.first().map_or("null", |e| e.id)),
        system: plant.name.into(),
        kind: match case.kind {
            Kind::Null => "null",
            Kind::Pair => "pair",
            Kind::Outside => "outside",
            Kind::Beside => "beside",
            Kind::Second => "single",
            Kind::Single if matches!(case.effects[0].act, Act::Sensor { .. }) && accepted.len() > 1 => "equivalence",
            Kind::Single => "single",
        },
        in_catalogue: !matches!(case.kind, Kind::Outside | Kind::Beside),
        localise,
        logged: columns.clone(),
        test_reset: case.reset,
        trap: case.trap.clone(),
        sample_rate: crate::random::digits(1.0 / (case.runs[0].setup.times[1] - case.runs[0].setup.times[0]), 3),
        difficulty: match snr {
            _ if case.kind == Kind::Null => "null",
            s if s >= 5.0 => "easy",
            s if s >= 2.0 => "medium",
            _ => "hard",
        },
        effects,
        accept: accepted,
        partial,
        noise: by(&case.noise),
        oracle: Oracle {
            n: case.runs[..case.given].iter().map(|r| r.log.len() * columns.len()).sum(),
            rmse_nominal: snr,
            rmse_oracle: 0.0,
            rmse_nominal_noisy: snr.hypot(floor),
            rmse_oracle_noisy: floor,
            noise_floor: floor,
            snr,
            closure_oracle: if case.effects.is_empty() { 0.0 } else { 1.0 },
            nominal_by_state: by(&case.gap.by_column),
            noise_by_state: by(&by_state),
        },
    }
}

/// Realised noise of the held-out runs: in units of the noise, and by column.
fn floor(case: &Case) -> (f64, Vec<f64>) {
    let columns = case.plant.logged.len();
    let mut squares = vec![0.0; columns];
    let mut counts = vec![0.0; columns];
    for run in &case.runs[case.runs.len() - HELD_OUT..] {
        for (log, reading) in run.log.iter().zip(&run.trace.readings) {
            for (c, &i) in case.plant.logged.iter().enumerate() {
                if log[c].is_finite() {
                    squares[c] += (log[c] - reading[i]).powi(2);
                    counts[c] += 1.0;
                }
            }
        }
    }
    let by_column: Vec<f64> = squares.iter().zip(&counts).map(|(s, n)| (s / n).sqrt()).collect();
    let pooled: f64 = squares.iter().zip(&case.noise).map(|(s, n)| s / (n * n)).sum();
    ((pooled / counts.iter().sum::<f64>()).sqrt(), by_column)
}

/// Catalogue effects that honestly cover a part of an effect outside it.
fn covers(effect: &Effect) -> Vec<(&'static str, Vec<Variable>)> {
    let v = vec![Variable::State(effect.state)];
    let first: Vec<Variable> = effect.variables.first().copied().into_iter().collect();
    let polynomial = |z: &Vec<Variable>| {
        let mut list: Vec<(&'static str, Vec<Variable>)> = vec![("bias", vec![])];
        for id in ["linear_stiffness", "viscous_friction", "coupling", "cubic_stiffness", "quadratic_drag"] {
            list.push((id, z.clone()));
        }
        list.push(("product_coupling", [z.clone(), z.clone()].concat()));
        list
    };
    match effect.id {
        "load_dependent_friction" | "friction_at_a_place" => {
            vec![("coulomb_friction", v.clone()), ("stribeck_friction", v.clone()), ("viscous_friction", v)]
        }
        "hysteresis" => vec![
            ("linear_stiffness", first.clone()),
            ("coulomb_friction", v.clone()),
            ("stribeck_friction", v.clone()),
            ("viscous_friction", v),
        ],
        "missing_resonance" => vec![("viscous_friction", v), ("linear_stiffness", first)],
        "rate_limit" => vec![
            ("input_lag", first.clone()),
            ("input_delay", first.clone()),
            ("input_saturation", first.clone()),
            ("input_gain", first),
        ],
        "triple_product" => {
            let mut list = Vec::new();
            for &a in &effect.variables {
                list.push(("coupling", vec![a]));
                for &b in &effect.variables {
                    list.push(("product_coupling", vec![a, b]));
                }
            }
            list
        }
        _ => polynomial(&first),
    }
}
