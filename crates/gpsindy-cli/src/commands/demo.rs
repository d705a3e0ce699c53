//! `gpsindy demo`: identify and diagnose on built-in data.

use crate::commands::identify::{Fit, On};
use crate::commands::{diagnose, identify};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::diagnose::{Diagnose, Diagnosed, hold_out};
use gpsindy_core::{Dataset, Identification, Identify, Scoring, score};
use gpsindy_files::{LogOptions, Logs, parse_model, write_model, write_whole};
use serde_json::json;
use std::path::{Path, PathBuf};

const PREY: &str = include_str!("../../demo/lotka_volterra.csv");
const PENDULUM: &str = include_str!("../../demo/pendulum.csv");
const SIMULATOR: &str = include_str!("../../demo/pendulum.toml");

/// Run identify and diagnose on built-in data
///
/// Identifies the equations of a predator-prey system from a noisy log, then diagnoses a pendulum simulator without dry friction, and lists
/// the files it wrote. Needs no input.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy demo")]
pub(crate) struct Demo {
    /// Folder for the results; created if it does not exist
    #[arg(long, short, value_name = "DIR", default_value = "gpsindy-demo")]
    out: PathBuf,
}

pub(crate) fn run(command: &Demo, screen: &Screen) -> Outcome {
    let folder = &command.out;
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::input(format!("--out: {} is a file; name a folder", folder.display())));
    }
    screen.note("1 of 2: identify the equations of a predator-prey system");
    let (data, found, fit) = learn(screen)?;
    screen.note("2 of 2: diagnose a pendulum's simulator");
    let diagnosed = examine(screen)?;
    write(folder, &found, &diagnosed)?;
    if screen.json() {
        let report = diagnose::report_json(&diagnosed.diagnosis)?;
        let report: serde_json::Value =
            serde_json::from_str(&report).map_err(|e| Failure::Work(format!("report.json: {e}")))?;
        let result = json!({"identify": identify::as_json(&found, Some(&fit)), "diagnose": report});
        return screen.out(&format!("{result}\n"));
    }
    screen.out(&format!(
        "IDENTIFY: a predator-prey system, simulated as x1' = 1.1*x1 - 0.4*x1*x2, x2' = -x2 + 0.4*x1*x2, with measurement noise of 0.05\n\n{}\n\
         DIAGNOSE: a pendulum with dry friction of 0.35 rad/s^2 in its bearing; its simulator has none\n\n{}\n{}",
        identify::summary(&data, &found, Some(&fit)),
        gpsindy_report::summary(&diagnosed.diagnosis, screen.width(), screen.colour()),
        files(folder),
    ))
}

/// Equations from the log of predator and prey.
fn learn(screen: &Screen) -> Outcome<(Dataset, Identification, Fit)> {
    let data =
        Logs::parse("lotka_volterra.csv", PREY.as_bytes(), &LogOptions::default())?.dataset(&["x1", "x2"], &[])?;
    let settings = Identify { states: vec!["x1".into(), "x2".into()], ..Identify::default() };
    let progress = screen.progress();
    let mut found = settings.fit(&data, &progress)?;
    found.model.name = "predator_prey".into();
    let score = score(&found.model.compile()?, &data, &Scoring::default(), &progress)?;
    Ok((data, found, Fit { score, on: On::Training }))
}

/// What the simulator of the pendulum lacks.
fn examine(screen: &Screen) -> Outcome<Diagnosed> {
    let model = parse_model("pendulum.toml", SIMULATOR)?;
    let options = LogOptions { run: Some("run".into()), ..LogOptions::default() };
    let data = Logs::parse("pendulum.csv", PENDULUM.as_bytes(), &options)?.dataset(&["phi", "omega", "u"], &[])?;
    let (train, holdout) = hold_out(&data)?;
    Ok(Diagnose::default().run(&model, &train, &holdout, &screen.progress())?)
}

fn write(folder: &Path, found: &Identification, diagnosed: &Diagnosed) -> Outcome {
    std::fs::create_dir_all(folder).map_err(|e| Failure::Work(format!("{}: {e}", folder.display())))?;
    for (name, text) in [("predator_prey.csv", PREY), ("pendulum.csv", PENDULUM), ("pendulum.toml", SIMULATOR)] {
        write_whole(&folder.join(name), text.as_bytes())?;
    }
    write_model(&folder.join("predator_prey.toml"), &found.model)?;
    diagnose::write(&folder.join("diagnosis"), diagnosed, &gpsindy_report::Provenance::default())
}

/// Where everything is, and what to try next.
fn files(folder: &Path) -> String {
    let at = |name: &str| folder.join(name).display().to_string();
    format!(
        "Files\n  {}  the report: open it in a browser\n  {}  the simulator with the causes added\n  {}  the identified model\n\n\
         Try next\n  gpsindy score {} --data {} --run run\n  gpsindy export {} --to python\n",
        at("diagnosis/report.html"),
        at("diagnosis/augmented.toml"),
        at("predator_prey.toml"),
        at("diagnosis/augmented.toml"),
        at("pendulum.csv"),
        at("predator_prey.toml"),
    )
}
