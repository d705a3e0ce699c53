//! `gpsindy diagnose`: where a simulator is wrong, why, and how far a correction helps.

use crate::args::{AutoHold, Columns};
use crate::commands::identify::{LibraryOptions, all_states};
use crate::commands::{check_states, chosen, dataset, model_dataset};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_core::diagnose::{Diagnose as Settings, Diagnosed, Power, hold_out};
use gpsindy_core::{Dataset, Hold, Identify, Model, Paired};
use gpsindy_files::{Logs, Task, model_to_toml, read_effects, read_model, write_whole};
use std::path::{Path, PathBuf};

/// Diagnose the gap between a simulator and logs of the machine
///
/// Writes report.json, report.html (one page, opens offline) and augmented.toml (the simulator with the causes added) into --out, and a
/// summary to stdout. Held-out logs are never seen by any fit or choice; without --holdout the last quarter of the runs is held out, or of a
/// single run its last quarter in time.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy diagnose simulator.toml run_1.csv run_2.csv --holdout run_3.csv --out diagnosis"
)]
pub(crate) struct Diagnose {
    /// The nominal model (TOML or JSON); with --simulated the first log of the machine
    model: PathBuf,
    /// Logs of the machine
    #[arg(required_unless_present = "simulated", value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Logs to verify on
    #[arg(long, num_args = 1.., value_name = "LOG")]
    holdout: Vec<PathBuf>,
    /// Folder of the report; made where it does not exist
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also study which effects these logs could reveal, from what size: each is planted in copies of the logs and withheld (takes minutes)
    #[arg(long)]
    power: bool,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    columns: Columns,
    #[command(flatten)]
    simulator: SimulatorOptions,
}

/// A simulator of which there are only logs.
#[derive(Debug, Args)]
#[command(next_help_heading = "Simulator of which there are only logs")]
struct SimulatorOptions {
    /// Logs of the simulator in place of MODEL, best of the same runs: a model is identified from them first, and must follow held-out ones
    #[arg(long, num_args = 1.., value_name = "LOG")]
    simulated: Vec<PathBuf>,
    /// Columns of the simulator's logs that are states [default: every column of numbers that is no control]
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    state: Vec<String>,
    /// Columns that are controls
    #[arg(long, value_name = "COLUMN", requires = "simulated")]
    control: Vec<String>,
    #[command(flatten)]
    library: LibraryOptions,
}

/// How a diagnosis is made.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Diagnosis")]
pub(crate) struct Options {
    /// Only these effects are suspects (ids separated by commas), or, with '!' before each, all but these
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    effects: Vec<String>,
    /// Effects of your own, a TOML file of `[[effect]]` entries
    #[arg(long, value_name = "FILE")]
    effects_file: Option<PathBuf>,
    /// Confidence of intervals; a gap counts as detected when its p-value is at most one minus this
    #[arg(long, value_name = "LEVEL", default_value_t = 0.95)]
    confidence: f64,
    /// Largest number of effects together, 1 to 6; never more than four in one equation
    #[arg(long, value_name = "N", default_value_t = 6)]
    most_effects: usize,
    /// What a control does between its samples
    #[arg(long, value_enum, default_value_t = AutoHold::Auto)]
    hold: AutoHold,
}

impl Options {
    pub(crate) fn settings(&self) -> Outcome<Settings> {
        let (without, effects): (Vec<&String>, Vec<&String>) = self.effects.iter().partition(|e| e.starts_with('!'));
        if !without.is_empty() && !effects.is_empty() {
            return Err(Failure::input(
                "--effects: either name the suspects, or with '!' those that are none; not both",
            ));
        }
        let custom = self.effects_file.as_deref().map(read_effects).transpose()?.unwrap_or_default();
        Ok(Settings {
            effects: effects.into_iter().cloned().collect(),
            without: without.into_iter().map(|e| e.trim_start_matches('!').to_string()).collect(),
            custom,
            confidence: self.confidence,
            most_effects: self.most_effects,
            hold: self.hold.into(),
            power: None,
            model_error: Vec::new(),
        })
    }
}

pub(crate) fn run(command: &Diagnose, seed: u64, screen: &Screen) -> Outcome {
    if let Some(folder) = command.out.as_deref().filter(|folder| folder.exists() && !folder.is_dir()) {
        return Err(Failure::input(format!("--out: {} is a file; name a folder", folder.display())));
    }
    let simulated = &command.simulator.simulated;
    let mut train: Vec<PathBuf> = command.logs.clone();
    if !simulated.is_empty() {
        train.insert(0, command.model.clone());
    }
    if let Some(twice) = train.iter().find(|log| command.holdout.contains(log)) {
        return Err(Failure::input(format!("{} is both a log to learn from and one of --holdout", twice.display())));
    }
    if let Some(twice) = train.iter().chain(&command.holdout).find(|log| simulated.contains(log)) {
        return Err(Failure::input(format!("{} is both a log of the machine and one of --simulated", twice.display())));
    }
    let power = command.power.then(|| Power { seed, ..Power::default() });
    let settings = Settings { power, ..command.options.settings()? };
    let (diagnosed, identified) = if simulated.is_empty() {
        let model = read_model(&command.model)?;
        let (train, holdout) = logs(&model, &train, &command.holdout, settings.hold, &command.columns, screen)?;
        (settings.run(&model, &train, &holdout, &screen.progress())?, None)
    } else {
        let (diagnosed, model) = paired(command, settings, &train, seed, screen)?;
        (diagnosed, Some(model))
    };
    if let Some(folder) = &command.out {
        write(folder, &diagnosed)?;
        if let Some(model) = &identified {
            gpsindy_files::write_model(&folder.join("simulator.toml"), model)?;
        }
    }
    if screen.json() {
        return screen.out(&report_json(&diagnosed.diagnosis)?);
    }
    screen.out(&gpsindy_report::summary(&diagnosed.diagnosis, screen.width(), screen.colour()))?;
    match &command.out {
        Some(folder) => screen.out(&format!("\nreport: {}\n", folder.join("report.html").display())),
        None => {
            screen.note("for the page, the JSON and the corrected model name a folder with --out");
            Ok(())
        }
    }
}

/// The diagnosis of a simulator of which there are only logs, and the model that was identified from them.
fn paired(
    command: &Diagnose,
    settings: Settings,
    train: &[PathBuf],
    seed: u64,
    screen: &Screen,
) -> Outcome<(Diagnosed, Model)> {
    let options = &command.simulator;
    let simulated = Logs::read(&options.simulated, &command.columns.options()?)?;
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
        let logs = Logs::read(paths, &command.columns.options()?)?;
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

/// The logs to learn from and those to verify on.
pub(crate) fn logs(
    model: &Model,
    train: &[PathBuf],
    holdout: &[PathBuf],
    hold: Option<Hold>,
    columns: &Columns,
    screen: &Screen,
) -> Outcome<(Dataset, Dataset)> {
    let hold = hold.unwrap_or_default();
    let train = Logs::read(train, &columns.options()?)?;
    let train = model_dataset(&train, model, hold, columns, screen)?;
    if holdout.is_empty() {
        return Ok(hold_out(&train)?);
    }
    let holdout = Logs::read(holdout, &columns.options()?)?;
    Ok((train, model_dataset(&holdout, model, hold, columns, screen)?))
}

/// Writes the three files of a diagnosis.
pub(crate) fn write(folder: &Path, diagnosed: &Diagnosed) -> Outcome {
    // All texts first, so that nothing is written where one of them fails.
    let html = gpsindy_report::render(&diagnosed.diagnosis);
    let json = report_json(&diagnosed.diagnosis)?;
    let augmented = model_to_toml(&diagnosed.augmented)?;
    std::fs::create_dir_all(folder).map_err(|e| Failure::Work(format!("{}: {e}", folder.display())))?;
    write_whole(&folder.join("report.json"), json.as_bytes())?;
    write_whole(&folder.join("report.html"), html.as_bytes())?;
    Ok(write_whole(&folder.join("augmented.toml"), augmented.as_bytes())?)
}

/// The report without the curves of the page, which are no part of the schema's promise.
pub(crate) fn report_json(diagnosis: &Diagnosis) -> Outcome<String> {
    let report = Diagnosis { figures: None, ..diagnosis.clone() };
    let text = serde_json::to_string_pretty(&report);
    text.map(|text| text + "\n").map_err(|e| Failure::Work(format!("report.json: {e}")))
}
