//! `gpsindy score`: rollout, windowed and one-step errors of a model on logs, by state.

use crate::args::{Columns, Output};
use crate::commands::simulate::Between;
use crate::commands::{check_folder_of, deliver, model_dataset};
use crate::failure::Outcome;
use crate::screen::Screen;
use crate::text::{aligned, count, short};
use clap::Args;
use gpsindy_core::{Channel, Dataset, Errors, Model, Score as Result, Scoring, Simulate as Settings, score};
use gpsindy_files::{Logs, Table, read_model};
use serde_json::json;
use std::path::PathBuf;

/// Rollout, windowed and one-step errors of a model on logs, by state
///
/// Each is a root mean square error in the state's unit, and relative to the column's standard deviation in the logs: 0 is perfect,
/// 1 is as bad as predicting the mean.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy score model.toml --data run_3.csv run_4.csv --window 1")]
pub(crate) struct Score {
    /// The model (TOML or JSON); `-` is standard input
    model: PathBuf,
    /// The logs; `-` is standard input
    #[arg(long, required = true, num_args = 1.., value_name = "LOG")]
    data: Vec<PathBuf>,
    /// Length of the windows, s [default: a tenth of each run]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    window: Option<f64>,
    /// What a control does between its samples
    #[arg(long, value_enum, default_value_t = Between::Zero)]
    hold: Between,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    output: Output,
}

pub(crate) fn run(command: &Score, screen: &Screen) -> Outcome {
    check_folder_of(command.output.out.as_deref())?;
    let model = read_model(&command.model)?;
    let system = model.compile()?;
    let logs = Logs::read(&command.data, &command.columns.options()?)?;
    let data = model_dataset(&logs, &model, command.hold.into(), &command.columns, screen)?;
    let simulate = Settings { hold: command.hold.into(), ..Settings::default() };
    let progress = screen.progress();
    let result = score(&system, &data, &Scoring { simulate, window: command.window }, &progress)?;
    drop(progress);
    if screen.json() {
        let text = json!({
            "model": model.name,
            "runs": data.runs().iter().map(|r| &r.name).collect::<Vec<_>>(),
            "rollout": as_json(&result.rollout),
            "windowed": as_json(&result.windowed),
            "one_step": as_json(&result.one_step),
        });
        return deliver(&command.output, &format!("{text}\n"), screen);
    }
    match &command.output.out {
        None => screen.out(&summary(&model, &data, &result, command.window)),
        Some(_) => deliver(&command.output, &table(&result).to_csv(), screen),
    }
}

/// The three kinds of prediction and what they are called in a file.
fn kinds(result: &Result) -> [(&'static str, &Errors); 3] {
    [("rollout", &result.rollout), ("windowed", &result.windowed), ("one_step", &result.one_step)]
}

pub(crate) fn as_json(errors: &Errors) -> serde_json::Value {
    let by_state = errors.by_state.iter().map(|s| {
        json!({"state": s.state, "unit": s.unit, "rmse": s.rmse, "normalised": s.normalised, "samples": s.n_samples})
    });
    json!({
        "pooled": errors.pooled,
        "started": errors.n_started,
        "diverged": errors.n_diverged,
        "by_state": by_state.collect::<Vec<_>>(),
    })
}

/// One row a state and kind of prediction.
fn table(result: &Result) -> Table {
    let rows: Vec<(&str, &Errors, usize)> =
        kinds(result).into_iter().flat_map(|(kind, e)| (0..e.by_state.len()).map(move |j| (kind, e, j))).collect();
    let number = |pick: fn(&Errors, usize) -> f64| rows.iter().map(|(_, e, j)| pick(e, *j)).collect::<Vec<f64>>();
    Table::new()
        .with_text("prediction", rows.iter().map(|(kind, _, _)| (*kind).to_string()).collect())
        .with_text("state", rows.iter().map(|(_, e, j)| e.by_state[*j].state.clone()).collect())
        .with_text("unit", rows.iter().map(|(_, e, j)| e.by_state[*j].unit.clone()).collect())
        .with(&Channel::new("rmse"), number(|e, j| e.by_state[j].rmse))
        .with(&Channel::new("normalised"), number(|e, j| e.by_state[j].normalised))
        .with(&Channel::new("samples"), number(|e, j| e.by_state[j].n_samples as f64))
        .with(&Channel::new("started"), number(|e, _| e.n_started as f64))
        .with(&Channel::new("diverged"), number(|e, _| e.n_diverged as f64))
}

fn summary(model: &Model, data: &Dataset, result: &Result, window: Option<f64>) -> String {
    let windows = window.map_or("windows".into(), |s| format!("{} s windows", short(s)));
    let text = |cells: &[&str]| cells.iter().map(|c| (*c).to_string()).collect::<Vec<String>>();
    let mut rows = vec![
        text(&["", "", "whole runs", "", &windows, "", "one step", ""]),
        text(&["state", "unit", "rmse", "relative", "rmse", "relative", "rmse", "relative"]),
    ];
    for (j, state) in result.rollout.by_state.iter().enumerate() {
        let mut row = vec![state.state.clone(), state.unit.clone()];
        for (_, errors) in kinds(result) {
            row.extend([short(errors.by_state[j].rmse), short(errors.by_state[j].normalised)]);
        }
        rows.push(row);
    }
    let mut pooled = text(&["together", ""]);
    let mut diverged = text(&["diverged", ""]);
    for (_, errors) in kinds(result) {
        pooled.extend([String::new(), short(errors.pooled)]);
        diverged.extend([String::new(), format!("{} of {}", errors.n_diverged, errors.n_started)]);
    }
    rows.push(pooled);
    if kinds(result).iter().any(|(_, errors)| errors.n_diverged > 0) {
        rows.push(diverged);
    }
    let name = if model.name.is_empty() { "model" } else { &model.name };
    let head = format!("{name} on {}, {}", count(data.runs().len(), "run"), count(data.n_samples(), "sample"));
    format!(
        "{head}; errors are root mean square, relative ones divided by the column's standard deviation\n\n{}",
        aligned(&rows)
    )
}
