//! `gpsindy identify --preset author`: the pipeline behind the paper's tables.

use super::Identify;
use super::choices::Smoothing;
use super::method::level;
use crate::args::AutoHold;
use crate::commands::{check_out, chosen, dataset, opened, smooth};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use gpsindy_core::library::LibrarySettings;
use gpsindy_core::{Author, AuthorResult};
use gpsindy_files::{Logs, Task, model_to_toml, write_model};
use serde_json::json;

pub(super) fn run(command: &Identify, screen: &Screen) -> Outcome {
    refuse_other_options(command)?;
    check_out(command.output.out.as_deref(), command.inputs())?;
    let logs = opened(&command.logs, &command.columns, screen)?;
    let author = settings(command, &logs)?;
    let rates = author.derivatives.iter().map(|(_, column)| column.clone()).collect();
    let needed = [author.states.clone(), author.controls.clone(), rates].concat();
    let task = Task { needed, controls: author.controls.clone(), ..Task::default() };
    let data = dataset(&logs, &task, &command.columns, screen)?;
    let progress = screen.progress();
    let found = author.fit(&data, &progress)?;
    drop(progress);
    if let Some(path) = &command.output.out {
        write_model(path, &found.model)?;
    }
    let summary = summary(&found);
    match &command.output.out {
        _ if screen.json() => screen.out(&format!("{}\n", as_json(&found))),
        Some(path) => screen.out(&format!("{summary}\nmodel: {}\n", path.display())),
        None => {
            screen.note(&summary);
            screen.out(&model_to_toml(&found.model)?)
        }
    }
}

/// The authors' pipeline has no place for these.
fn refuse_other_options(command: &Identify) -> Outcome {
    let (library, method) = (&command.library, &command.method);
    let given = [
        ("--fix", !library.fix.is_empty()),
        ("--forbid", !library.forbid.is_empty()),
        ("--keep", !library.keep.is_empty()),
        ("--sign", !library.sign.is_empty()),
        ("--hold", !matches!(method.hold, AutoHold::Auto | AutoHold::Zero)),
        ("--derivative-method", method.derivative_method.is_some()),
        ("--regressor", method.regressor.is_some()),
        ("--select", method.select.is_some()),
        ("--delay", !method.delay.is_empty()),
        ("--standardize", method.standardize),
        ("--ensemble", method.ensemble > 0),
        ("--refine", method.refine),
    ];
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::input(format!(
            "{option}: the pipeline of --preset author is fixed; remove the option or choose another preset"
        ))),
        None if method.smoother == Some(Smoothing::None) && !method.gp_input.is_empty() => {
            Err(Failure::input("--gp-input: there is no Gaussian process with --smoother none; remove one of the two"))
        }
        None => Ok(()),
    }
}

fn settings(command: &Identify, logs: &Logs) -> Outcome<Author> {
    let (library, method) = (&command.library, &command.method);
    let states = chosen(logs, &command.state)?;
    if states.is_empty() {
        return Err(Failure::input("--preset author needs the states; name them with --state"));
    }
    let mut derivatives = Vec::new();
    for (state, column) in &command.derivative {
        derivatives.push((logs.resolve(state)?, logs.resolve(column)?));
    }
    let standard = Author::default();
    Ok(Author {
        inputs: inputs(command, logs, &states)?,
        states,
        controls: chosen(logs, &command.control)?,
        derivatives,
        library: LibrarySettings {
            degree: library.degree,
            trig: library.trig,
            products: library.products,
            extra: library.term.clone(),
            ..LibrarySettings::default()
        },
        train_fraction: method.train_fraction.unwrap_or(standard.train_fraction),
        kernels: smooth::kernels(&method.kernel, standard.kernels)?,
        lambda: if method.lambda == "auto" { None } else { Some(level(&method.lambda)?) },
    })
}

/// Inputs of the second Gaussian process of every state; none at all for their SINDy.
fn inputs(command: &Identify, logs: &Logs, states: &[String]) -> Outcome<Option<Vec<Vec<String>>>> {
    if command.method.smoother == Some(Smoothing::None) {
        return Ok(None);
    }
    let mut inputs = vec![Vec::new(); states.len()];
    for (state, column) in &command.method.gp_input {
        let name = logs.resolve(state)?;
        let Some(s) = states.iter().position(|s| *s == name) else {
            return Err(Failure::input(format!("--gp-input {state}={column}: `{name}` is no state")));
        };
        inputs[s].push(logs.resolve(column)?);
    }
    Ok(Some(inputs))
}

fn summary(found: &AuthorResult) -> String {
    let mut text = String::from("equations by the pipeline of the paper's authors, slips included:\n\n");
    for state in &found.model.states {
        text += &format!("  {}' = {}\n", state.name, state.equation);
    }
    text += &format!(
        "\n  lambda {}, Frobenius norm of the open-loop error by forward Euler: training {:.4}, test {:.4}\n",
        found.lambda, found.train_error, found.test_error
    );
    text
}

fn as_json(found: &AuthorResult) -> serde_json::Value {
    json!({
        "model": found.model,
        "lambda": found.lambda,
        "train_error": found.train_error,
        "test_error": found.test_error,
    })
}
