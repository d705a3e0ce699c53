//! `gpsindy score`: rollout, windowed and one-step errors of models on logs, by state.

use crate::args::{Columns, Output};
use crate::commands::given::nominal::Nominal;
use crate::commands::given::setup::SetupOptions;
use crate::commands::given::{measured, targets};
use crate::commands::simulate::Between;
use crate::commands::{Session, check_out, columns_of, deliver, model_dataset, opened};
use crate::failure::{Failure, Outcome};
use crate::text::{aligned, count, short};
use clap::Args;
use gpsindy_core::{Channel, Dataset, Errors, Hold, Model, Score as Scores, Scoring, Simulate as Settings, score};
use gpsindy_files::Table;
use serde_json::json;
use std::path::PathBuf;

/// Score models on logs: rollout, windowed and one-step errors by state
///
/// Several models are compared on the same logs. Each error is a root mean square in the unit of the state, and relative to the standard
/// deviation of the column: 0 is perfect, 1 is as bad as predicting the mean.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy score model.toml --data run_3.csv run_4.csv --window 1\n         \
                         gpsindy score nominal.toml augmented.toml --data run_3.csv")]
pub(crate) struct Score {
    /// The models (TOML or JSON); `-` is standard input
    #[arg(required = true, value_name = "MODEL")]
    models: Vec<PathBuf>,
    /// The logs; `-` is standard input
    #[arg(long, required = true, num_args = 1.., value_name = "LOG")]
    data: Vec<PathBuf>,
    /// Length of the windows, s [default: a tenth of each run]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    window: Option<f64>,
    /// How a control behaves between its samples [default: as the model was identified, else zero]
    #[arg(long, value_enum)]
    hold: Option<Between>,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    setup: SetupOptions,
    #[command(flatten)]
    output: Output,
}

pub(crate) fn run(command: &Score, session: &Session<'_>) -> Outcome {
    let inputs = command.models.iter().chain(&command.data).chain(command.columns.files());
    check_out(command.output.out.as_deref(), inputs)?;
    let screen = &session.screen;
    let setup = command.setup.setup();
    let open = |file: &PathBuf| Nominal::open(file, &setup, session);
    let nominals = command.models.iter().map(open).collect::<Outcome<Vec<Nominal>>>()?;
    let models: Vec<Model> = nominals.iter().map(|nominal| nominal.model.clone()).collect();
    let logs = opened(&command.data, &command.columns, screen)?;
    let holds: Vec<Hold> = models.iter().map(|m| command.hold.map_or_else(|| m.hold(), Into::into)).collect();
    let (data, _) =
        model_dataset(&logs, &models, holds.first().copied().unwrap_or_default(), &command.columns, screen)?;
    for (i, model) in models.iter().enumerate() {
        // A corrected model has the columns of its nominal one.
        if !models[..i].iter().any(|other| columns_of(other) == columns_of(model)) {
            measured::tell(&logs, None, model, screen);
            measured::doubt_degrees(&logs, &data, model, screen);
            targets::doubt_targets(&data, model, screen);
        }
    }
    let progress = screen.progress();
    let scored = |(nominal, &hold): (&Nominal, &Hold)| {
        let simulate = Settings { hold, ..Settings::default() };
        let scoring = Scoring { simulate, window: command.window };
        nominal.run(|| Ok(score(&nominal.system(&nominal.model)?, &data, &scoring, &progress)?))
    };
    let scores = nominals.iter().zip(&holds).map(scored).collect::<Outcome<Vec<Scores>>>()?;
    drop(progress);
    let scored: Vec<Scored> = names(&models, &command.models).into_iter().zip(scores).collect();
    if screen.json() {
        let runs: Vec<&String> = data.runs().iter().map(|r| &r.name).collect();
        let each = scored.iter().map(|(name, score)| {
            json!({
                "model": name,
                "runs": runs,
                "rollout": as_json(&score.rollout),
                "windowed": as_json(&score.windowed),
                "one_step": as_json(&score.one_step),
            })
        });
        let mut each: Vec<serde_json::Value> = each.collect();
        let text = if each.len() == 1 { each.remove(0) } else { json!({"models": each}) };
        deliver(&command.output, &format!("{text}\n"), screen)?;
    } else {
        match &command.output.out {
            None => screen.out(&summary(&scored, &data, command.window))?,
            Some(_) => deliver(&command.output, &table(&scored).to_csv(), screen)?,
        }
    }
    match scored.iter().position(|(_, score)| is_without_number(score)) {
        Some(k) if is_without_value(&data, &models[k]) => Err(Failure::input(format!(
            "{}: the logs hold no value of a state of the model, which would be compared; log one, or score on other logs",
            command.models[k].display()
        ))),
        Some(k) => Err(Failure::Work(format!(
            "{}: no prediction of the model is a number, not one step ahead; check its parameters (a division by 0?) and its initial values",
            command.models[k].display()
        ))),
        None => Ok(()),
    }
}

/// Whether no error of any state and kind is a number.
fn is_without_number(score: &Scores) -> bool {
    kinds(score).iter().all(|(_, errors)| errors.by_state.iter().all(|state| !state.rmse.is_finite()))
}

/// Whether no state of the model has a value in the logs.
fn is_without_value(data: &Dataset, model: &Model) -> bool {
    let columns: Vec<usize> = model.states.iter().filter_map(|state| data.index_of(&state.name).ok()).collect();
    data.runs().iter().all(|run| columns.iter().all(|&column| run.column(column).iter().all(|v| v.is_nan())))
}

/// What a model is called and how it did.
type Scored = (String, Scores);

/// The models' own names; the files' where several have the same, or where one of several has none.
fn names(models: &[Model], files: &[PathBuf]) -> Vec<String> {
    let name = |i: usize| models[i].name.clone();
    let all = 0..models.len();
    let clear = all.clone().all(|i| !models[i].name.is_empty() && (0..i).all(|j| models[j].name != models[i].name));
    if clear || models.len() == 1 {
        all.map(name).collect()
    } else {
        files.iter().map(|f| f.display().to_string()).collect()
    }
}

/// The three kinds of prediction and what they are called in a file.
fn kinds(result: &Scores) -> [(&'static str, &Errors); 3] {
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

/// One row a state and kind of prediction, and model where there are several.
fn table(scored: &[Scored]) -> Table {
    let of_model = |(name, score): &'_ Scored| {
        let name = name.clone();
        let of_kind = move |(kind, e): (&'static str, Errors)| {
            let name = name.clone();
            (0..e.by_state.len()).map(move |j| (name.clone(), kind, e.clone(), j))
        };
        kinds(score).map(|(kind, e)| (kind, e.clone())).into_iter().flat_map(of_kind).collect::<Vec<_>>()
    };
    let rows: Vec<(String, &str, Errors, usize)> = scored.iter().flat_map(of_model).collect();
    let number = |pick: fn(&Errors, usize) -> f64| rows.iter().map(|(_, _, e, j)| pick(e, *j)).collect::<Vec<f64>>();
    let mut table = Table::new();
    if scored.len() > 1 {
        table = table.with_text("model", rows.iter().map(|(name, ..)| name.clone()).collect());
    }
    table
        .with_text("prediction", rows.iter().map(|(_, kind, _, _)| (*kind).to_string()).collect())
        .with_text("state", rows.iter().map(|(_, _, e, j)| e.by_state[*j].state.clone()).collect())
        .with_text("unit", rows.iter().map(|(_, _, e, j)| e.by_state[*j].unit.clone()).collect())
        .with(&Channel::new("rmse"), number(|e, j| e.by_state[j].rmse))
        .with(&Channel::new("normalised"), number(|e, j| e.by_state[j].normalised))
        .with(&Channel::new("samples"), number(|e, j| e.by_state[j].n_samples as f64))
        .with(&Channel::new("started"), number(|e, _| e.n_started as f64))
        .with(&Channel::new("diverged"), number(|e, _| e.n_diverged as f64))
}

fn summary(scored: &[Scored], data: &Dataset, window: Option<f64>) -> String {
    let windows = window.map_or("windows".into(), |s| format!("{} s windows", short(s)));
    let several = scored.len() > 1;
    // The model is in a column of its own where there are several.
    let row = |model: &str, cells: &[&str]| {
        let model = several.then(|| model.to_string());
        model.into_iter().chain(cells.iter().map(|c| (*c).to_string())).collect::<Vec<String>>()
    };
    let mut rows = vec![
        row("", &["", "", "whole runs", "", &windows, "", "one step", ""]),
        row("model", &["state", "unit", "rmse", "relative", "rmse", "relative", "rmse", "relative"]),
    ];
    let mut states: Vec<&str> = Vec::new();
    for state in scored.iter().flat_map(|(_, score)| &score.rollout.by_state) {
        if !states.contains(&state.state.as_str()) {
            states.push(&state.state);
        }
    }
    for wanted in states {
        for (model, score) in scored {
            let Some(j) = score.rollout.by_state.iter().position(|s| s.state == wanted) else { continue };
            let state = &score.rollout.by_state[j];
            let mut cells = row(model, &[&state.state, &state.unit]);
            for (_, errors) in kinds(score) {
                cells.extend([short(errors.by_state[j].rmse), short(errors.by_state[j].normalised)]);
            }
            rows.push(cells);
        }
    }
    for (model, score) in scored {
        let mut pooled = row(model, &["together", ""]);
        for (_, errors) in kinds(score) {
            pooled.extend([String::new(), short(errors.pooled)]);
        }
        rows.push(pooled);
    }
    for (model, score) in scored {
        let mut diverged = row(model, &["diverged", ""]);
        for (_, errors) in kinds(score) {
            diverged.extend([String::new(), format!("{} of {}", errors.n_diverged, errors.n_started)]);
        }
        if kinds(score).iter().any(|(_, errors)| errors.n_diverged > 0) {
            rows.push(diverged);
        }
    }
    let name = match scored {
        [(name, _)] if name.is_empty() => "model".to_string(),
        [(name, _)] => name.clone(),
        _ => count(scored.len(), "model"),
    };
    let head = format!("{name} on {}, {}", count(data.runs().len(), "run"), count(data.n_samples(), "sample"));
    format!(
        "{head}; errors are root mean square, relative ones divided by the column's standard deviation\n\n{}",
        aligned(&rows)
    )
}
