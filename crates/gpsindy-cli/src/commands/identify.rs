//! `gpsindy identify`: a model from logs.

mod author;
mod choices;
mod library;
mod method;
mod result;
mod scored;

pub(crate) use library::LibraryOptions;
pub(super) use method::{delays, settings};
pub(crate) use result::{Fit, On, as_json, rounded, summary, summary_of};

use crate::args::{Columns, Output, pair};
use crate::commands::follow::{self, FollowOptions};
use crate::commands::{check_out, dataset_and_offsets, opened};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use choices::Preset;
use clap::Args;
use gpsindy_core::{Dataset, Identify as Settings};
use gpsindy_files::{Logs, Task, TopicOffset, model_to_toml, write_model};
use method::MethodOptions;
use scored::Scored;
use std::path::PathBuf;

/// Identify a model from logs: equations with standard errors
///
/// Writes the model to --out and a summary to stdout; without --out, the model to stdout and the summary to stderr.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy identify run_1.csv run_2.csv --state x,v --control u --out model.toml\n         \
                   gpsindy identify car_*.csv --state x,y,v,phi --control u --angle phi --term 'v*cos(phi)' --delay u=auto\n         \
                   tail -f -n +1 robot.csv | gpsindy identify - --follow --state x,v --control u --json"
)]
pub(crate) struct Identify {
    /// One or more logs: CSV, MCAP, Parquet, ULog or the folder of a data set; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    pub(super) logs: Vec<PathBuf>,
    /// Logs for scoring only, not for training
    #[arg(long, num_args = 1.., value_name = "LOG")]
    holdout: Vec<PathBuf>,
    /// Columns that are states, separated by commas [default: every numeric column that no other option names]
    #[arg(long, value_name = "COLUMN")]
    state: Vec<String>,
    /// Columns that are controls, separated by commas
    #[arg(long, value_name = "COLUMN")]
    control: Vec<String>,
    /// The column that carries a state's time derivative
    #[arg(long, value_name = "STATE=COLUMN", value_parser = pair)]
    derivative: Vec<(String, String)>,
    #[command(flatten)]
    pub(super) columns: Columns,
    #[command(flatten)]
    library: LibraryOptions,
    #[command(flatten)]
    method: MethodOptions,
    #[command(flatten)]
    pub(super) follow: FollowOptions,
    #[command(flatten)]
    pub(super) output: Output,
}

impl Identify {
    /// Whether the refinement was asked for by name.
    pub(super) fn refines(&self) -> bool {
        self.method.refine
    }

    /// Every file that it reads.
    fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.logs.iter().chain(&self.holdout).chain(self.columns.files())
    }

    /// Whether a kernel was named.
    pub(super) fn names_kernel(&self) -> bool {
        self.method.kernel != "auto"
    }
}

pub(crate) fn run(command: &Identify, seed: u64, screen: &Screen) -> Outcome {
    if command.method.preset == Preset::Author {
        if command.follow.follow {
            return Err(Failure::input("--preset author does not go with --follow: it needs the whole log"));
        }
        return author::run(command, screen);
    }
    if !command.method.gp_input.is_empty() {
        return Err(Failure::input("--gp-input is for --preset author alone; remove it"));
    }
    check_out(command.output.out.as_deref(), command.inputs())?;
    if command.follow.follow {
        if let Some((name, _)) = command.columns.constant.first() {
            return Err(Failure::input(format!(
                "--constant {name} does not go with --follow; a control that never changes needs no column there"
            )));
        }
        return follow::run(command, screen);
    }
    if let Some(twice) = command.logs.iter().find(|log| command.holdout.contains(log)) {
        return Err(Failure::input(format!("{} is named both for training and in --holdout", twice.display())));
    }
    let logs = opened(&command.logs, &command.columns, screen)?;
    let mut settings = settings(command, &logs, seed)?;
    let by_default = settings.states.is_empty();
    let rates: Vec<String> = settings.derivatives.iter().map(|(_, column)| column.clone()).collect();
    if by_default {
        settings.states = all_states(&logs, &[&settings.controls[..], &rates[..]].concat(), screen);
        let unlogged = unlogged(&settings, &logs);
        settings.states.extend(unlogged);
    }
    let needed: Vec<String> = [&settings.states[..], &settings.controls[..], &rates[..]].concat();
    if let Some(twice) = needed.iter().enumerate().find(|(i, name)| needed[..*i].contains(name)) {
        return Err(Failure::input(format!("column `{}` has two roles; name it in one option", twice.1)));
    }
    let unlogged = unlogged(&settings, &logs);
    let needed: Vec<String> = needed.into_iter().filter(|name| !unlogged.contains(name)).collect();
    let task = Task {
        needed,
        controls: settings.controls.clone(),
        hold: settings.hold.unwrap_or_default(),
        ..Task::default()
    };
    let (data, offsets) = dataset_and_offsets(&logs, &task, &command.columns, screen)?;
    if by_default {
        leave_clocks_out(&mut settings.states, &data, screen);
    }
    settings.delays = delays(command, &logs)?;
    let scored_on = Scored::new(command, &settings, &task, &data, screen)?;
    let progress = screen.progress();
    let found = settings.fit(&data, &progress)?;
    let fit = scored_on.score(&found, &progress)?;
    drop(progress);
    for note in found.notes.iter().map(ToString::to_string).chain(result::astray(&found, &fit)) {
        screen.warn(&note);
    }
    if let Some(path) = &command.output.out {
        write_model(path, &found.model)?;
    }
    let summary = summary(&data, &found, Some(&fit));
    match &command.output.out {
        _ if screen.json() => {
            let mut value = as_json(&found, Some(&fit));
            if !offsets.is_empty() {
                value["clock_offsets"] = offsets.iter().map(TopicOffset::json).collect();
            }
            screen.out(&format!("{value}\n"))?;
        }
        Some(path) => screen.out(&format!("{summary}\nmodel: {}\n", path.display()))?,
        None => {
            screen.note(&summary);
            screen.out(&model_to_toml(&found.model)?)?;
        }
    }
    match result::poor(&found) {
        Some(how) if !command.method.accept_poor => {
            Err(Failure::Work(format!("{how}; --accept-poor exits with status 0 nevertheless")))
        }
        _ => Ok(()),
    }
}

/// Takes columns that are a straight line of time out of the states, unless nothing else is left.
fn leave_clocks_out(states: &mut Vec<String>, data: &Dataset, screen: &Screen) {
    let is_clock = |name: &String| {
        let column = data.index_of(name).ok();
        column.is_some_and(|c| data.runs().iter().all(|run| run.is_line_of_time(c)))
    };
    let (clocks, moving): (Vec<String>, Vec<String>) = states.iter().cloned().partition(is_clock);
    if !clocks.is_empty() && !moving.is_empty() {
        let names = clocks.join(", ");
        screen.note(&format!(
            "not used as a state, because it is a linear function of time: {names} (name it with --state to keep it)"
        ));
        *states = moving;
    }
}

/// Names in the given equations that no log carries and that are no free number.
fn unlogged(settings: &Settings, logs: &Logs) -> Vec<String> {
    let is_number = |name: &String| settings.library.numbers.iter().any(|number| number.name == *name);
    let mut names: Vec<String> = settings.constraints.fixed.iter().flat_map(|one| one.equation.variables()).collect();
    names.retain(|name| !is_number(name) && logs.files().iter().all(|log| log.column(name).is_none()));
    names.sort();
    names.dedup();
    names
}

/// Every column of numbers but those `taken`.
pub(crate) fn all_states(logs: &Logs, taken: &[String], screen: &Screen) -> Vec<String> {
    let states: Vec<String> = logs.numeric_columns().into_iter().filter(|name| !taken.contains(name)).collect();
    screen.note(&format!("states: {} (all numeric columns; choose with --state)", states.join(", ")));
    states
}
