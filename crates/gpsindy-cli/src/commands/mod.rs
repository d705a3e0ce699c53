//! One file per command: its arguments, what it does, what it prints.

pub(crate) mod completions;
pub(crate) mod demo;
pub(crate) mod design;
pub(crate) mod diagnose;
pub(crate) mod effects;
pub(crate) mod exam;
pub(crate) mod export;
pub(crate) mod fleet;
mod follow;
mod given;
pub(crate) mod identify;
pub(crate) mod inspect;
pub(crate) mod man;
pub(crate) mod mcp;
mod output;
pub(crate) mod score;
pub(crate) mod simulate;
pub(crate) mod smooth;

use crate::args::{Arguments, Columns, Command};
use crate::engine::Engines;
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::stop::FirstRequest;
use gpsindy_core::{Dataset, Hold, Model};
use gpsindy_files::{Log, Logs, Task, TopicOffset};
use output::{check_out, deliver};
use std::ffi::OsString;
use std::path::Path;

/// What every command may ask for: the screen, the engines, and the line that started it all.
pub(crate) struct Session<'a> {
    pub(crate) screen: Screen,
    pub(crate) engines: &'a dyn Engines,
    /// The command line, the program's name first.
    pub(crate) line: &'a [OsString],
    pub(crate) seed: u64,
    pub(crate) first_request: FirstRequest,
}

/// Runs the command that was asked for.
pub(crate) fn run(arguments: &Arguments, session: &Session<'_>) -> Outcome {
    if let (true, Some(option)) = (is_without_result(&arguments.command), arguments.global.of_results()) {
        return Err(Failure::input(format!("{option}: the command computes nothing; remove the option")));
    }
    if let Some(threads) = arguments.global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
        pool.map_err(|e| Failure::Work(format!("--threads {threads}: {e}")))?;
    }
    let screen = &session.screen;
    match &arguments.command {
        Command::Inspect(command) => inspect::run(command, screen),
        Command::Smooth(command) => smooth::run(command, screen),
        Command::Simulate(command) => simulate::run(command, session),
        Command::Score(command) => score::run(command, session),
        Command::Diagnose(command) => diagnose::run(command, session),
        Command::Design(command) => design::run(command, session),
        Command::Exam(command) => exam::run(command, screen),
        Command::Effects(command) => effects::run(command, screen),
        Command::Fleet(command) => fleet::run(command, screen),
        Command::Identify(command) => identify::run(command, session.seed, screen),
        Command::Export(command) => export::run(command, screen),
        Command::Demo(command) => demo::run(command, screen),
        Command::Completions(command) => completions::run(command, screen),
        Command::Man(command) => man::run(command, screen),
        Command::Mcp(command) => mcp::run(command, session.line),
    }
}

/// Whether a command is about the program itself, so that no option of results says anything to it.
fn is_without_result(command: &Command) -> bool {
    matches!(command, Command::Completions(_) | Command::Man(_) | Command::Mcp(_))
}

/// Whether Ctrl-C is a command's usual end, which it sees to itself: what follows a growing log, and what serves another program.
pub(crate) fn ends_by_itself(command: &Command) -> bool {
    match command {
        Command::Identify(command) => command.follow.follow,
        Command::Fleet(command) => command.watches(),
        Command::Mcp(_) => true,
        _ => false,
    }
}

/// The columns that an option names, once or several times, each time one or several separated by commas.
///
/// A whole header may hold commas itself, so that is looked for first.
fn chosen(logs: &Logs, options: &[String]) -> Outcome<Vec<String>> {
    chosen_with(logs, options, &[])
}

/// The same where some names are no column.
fn chosen_with(logs: &Logs, options: &[String], others: &[String]) -> Outcome<Vec<String>> {
    let mut names = Vec::new();
    for option in options {
        if let Ok(name) = logs.resolve(option) {
            names.push(name);
            continue;
        }
        for part in option.split(',').map(str::trim) {
            let other = others.iter().find(|other| *other == part);
            names.push(other.map_or_else(|| logs.resolve(part), |other| Ok(other.clone()))?);
        }
    }
    for (i, name) in names.iter().enumerate() {
        if names[..i].contains(name) {
            return Err(Failure::input(format!("column `{name}` is named twice")));
        }
    }
    Ok(names)
}

/// Opens logs as the options of columns say.
fn opened<P: AsRef<Path>>(paths: &[P], columns: &Columns, screen: &Screen) -> Outcome<Logs> {
    Ok(Logs::read_with(paths, &columns.options()?, &screen.progress())?)
}

/// Cuts logs down to a task's columns, unwraps its angles and reports which columns were ignored.
fn dataset(logs: &Logs, task: &Task, columns: &Columns, screen: &Screen) -> Outcome<Dataset> {
    Ok(dataset_and_offsets(logs, task, columns, screen)?.0)
}

/// The same with the offsets of clocks that were estimated.
fn dataset_and_offsets(
    logs: &Logs,
    task: &Task,
    columns: &Columns,
    screen: &Screen,
) -> Outcome<(Dataset, Vec<TopicOffset>)> {
    for warning in logs.warnings() {
        screen.warn(&warning);
    }
    let read = logs.assemble(task, &screen.progress())?;
    for note in &read.notes {
        screen.warn(note);
    }
    for offset in &read.offsets {
        screen.note(&offset.to_string());
    }
    let mut data = read.data;
    for angle in &columns.angle {
        let name = logs.resolve(angle)?;
        if data.index_of(&name).is_err() {
            return Err(Failure::input(format!(
                "--angle: column `{name}` is not used by this task; remove the option"
            )));
        }
        data.unwrap_angle(&name)?;
    }
    let used: Vec<&str> = task.needed.iter().chain(&task.optional).map(String::as_str).collect();
    let ignored = logs.ignored(&used);
    if !ignored.is_empty() {
        screen.note(&format!("columns ignored: {}", ignored.join(", ")));
    }
    Ok((data, read.offsets))
}

/// The columns that a model reads: its controls, which the logs must carry, and its states, which they may.
fn columns_of(model: &Model) -> (Vec<String>, Vec<String>) {
    let controls = model.controls.iter().map(|c| c.name.clone()).collect();
    (controls, model.states.iter().map(|s| s.name.clone()).collect())
}

/// The columns of models, in logs that each carry at least one state of each.
fn model_dataset(
    logs: &Logs,
    models: &[Model],
    hold: Hold,
    columns: &Columns,
    screen: &Screen,
) -> Outcome<(Dataset, Vec<TopicOffset>)> {
    let (mut all_controls, mut all_states): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    for (controls, states) in models.iter().map(columns_of) {
        for log in logs.files() {
            check_states(log, &states)?;
        }
        for control in &controls {
            let remedy = format!(
                "; the model needs it as a control: give a column that name with --rename COLUMN={control}, or say that it was constant, --constant {control}=0"
            );
            logs.resolve(control).map_err(|error| Failure::from(error).with(&remedy))?;
        }
        all_controls.extend(controls.into_iter().filter(|name| !all_controls.contains(name)).collect::<Vec<_>>());
        all_states.extend(states.into_iter().filter(|name| !all_states.contains(name)).collect::<Vec<_>>());
    }
    for model in models {
        given::measured::check_units(logs, model)?;
    }
    // A state of one model may be a control of another.
    all_states.retain(|name| !all_controls.contains(name));
    dataset_and_offsets(
        logs,
        &Task { needed: all_controls.clone(), optional: all_states, controls: all_controls, hold },
        columns,
        screen,
    )
}

/// Refuses a log without any state of the model: most likely the wrong log, or other names.
fn check_states(log: &Log, states: &[String]) -> Outcome {
    if states.iter().any(|state| log.column(state).is_some()) {
        return Ok(());
    }
    let found: Vec<&str> = log.columns().map(|h| h.name.as_str()).collect();
    Err(Failure::input(format!(
        "{}: no column is a state of the model ({}); found: {}; name them with --rename",
        log.file,
        states.join(", "),
        found.join(", ")
    )))
}
