//! `gpsindy diagnose --simulated`: a simulator of which there are only logs.

use super::Diagnose;
use crate::commands::identify::{LibraryOptions, all_states};
use crate::commands::{check_states, chosen, dataset, opened};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::diagnose::{Diagnose as Settings, Diagnosed, hold_out};
use gpsindy_core::{Dataset, Hold, Identify, Model, Paired};
use gpsindy_files::Task;
use std::path::PathBuf;

/// A simulator of which there are only logs.
#[derive(Debug, Args)]
#[command(next_help_heading = "Simulator known by its logs only")]
pub(super) struct SimulatorOptions {
    /// Logs of the simulator in place of MODEL, preferably of the same runs; a model is first identified from them and checked on a held-out part
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub(super) simulated: Vec<PathBuf>,
    /// Columns of the simulator's logs that are states [default: every numeric column that is not a control]
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    state: Vec<String>,
    /// Columns that are controls
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    control: Vec<String>,
    #[command(flatten)]
    library: LibraryOptions,
}

/// The diagnosis of a simulator of which there are only logs, and the model that was identified from them.
pub(super) fn paired(
    command: &Diagnose,
    settings: Settings,
    train: &[PathBuf],
    seed: u64,
    screen: &Screen,
) -> Outcome<(Diagnosed, Model)> {
    let options = &command.simulator;
    let simulated = opened(&options.simulated, &command.columns, screen)?;
    let controls = chosen(&simulated, &options.control)?;
    let mut states = chosen(&simulated, &options.state)?;
    if states.is_empty() {
        states = all_states(&simulated, &controls, screen);
    }
    if let Some(twice) = states.iter().find(|name| controls.contains(name)) {
        return Err(Failure::input(format!("column `{twice}` has two roles; name it in one option")));
    }
    let (library, constraints) = options.library.settings()?;
    let between = settings.hold.unwrap_or_default();
    let real = |paths: &[PathBuf]| -> Outcome<Dataset> {
        let logs = opened(paths, &command.columns, screen)?;
        for log in logs.files() {
            check_states(log, &states)?;
        }
        let (needed, controls) = (controls.clone(), controls.clone());
        dataset(&logs, &Task { needed, optional: states.clone(), controls, hold: between }, &command.columns, screen)
    };
    let train = real(train)?;
    let (train, holdout) =
        if command.holdout.is_empty() { hold_out(&train)? } else { (train, real(&command.holdout)?) };
    let needed: Vec<String> = states.iter().chain(&controls).cloned().collect();
    let task = Task { needed, controls: controls.clone(), hold: between, ..Task::default() };
    let simulated = dataset(&simulated, &task, &command.columns, screen)?;
    let hold: Option<Hold> = settings.hold;
    let identify = Identify { states, controls, library, constraints, hold, seed, ..Identify::default() };
    let found = Paired { identify, diagnose: settings, ..Paired::default() };
    let found = found.run(&simulated, &train, &holdout, &screen.progress())?;
    Ok((found.diagnosed, found.model))
}
