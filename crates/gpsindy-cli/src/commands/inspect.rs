//! `gpsindy inspect`: what a log of any format holds, and which of its flaws would harm an identification.

use crate::args::{Clock, Output};
use crate::commands::{check_out, deliver};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use clap::builder::PossibleValuesParser;
use gpsindy_files::{Finding, Inspection, LogOptions, Stamp, inspect};
use std::path::PathBuf;

/// Kinds of flaws, as [`gpsindy_files::Finding`] names them.
const KINDS: [&str; 18] = [
    "time_unit",
    "jitter",
    "gaps",
    "repeated_stamps",
    "backward_stamps",
    "float32_stamps",
    "clock_drift",
    "constant",
    "quantised",
    "held",
    "frozen",
    "clipped",
    "wrapped",
    "difference",
    "missing",
    "text",
    "short",
    "unread",
];

/// Show what a log holds, and which of its flaws would harm an identification
///
/// Lists every topic, field and column with type, unit, rate, jitter, gaps, missing values and quantisation step. Then reports flaws: jitter,
/// gaps, repeated and float32 stamps, clock drift, quantised, held, frozen and clipped signals, signals that drop out, constant columns, wrapped angles, text among numbers,
/// runs of fewer than 30 samples, and columns that are differences of other columns.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy inspect flight.mcap\n         gpsindy inspect run_*.csv --json\n         gpsindy inspect recording.mcap --strict"
)]
pub(crate) struct Inspect {
    /// One or more logs: CSV, MCAP, Parquet, ULog, the folder of a LeRobot data set or of a ROS 2 bag; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The time column of a table, in seconds [default: `t`, else `time`]
    #[arg(long, value_name = "COLUMN")]
    time: Option<String>,
    /// The column that identifies the run of each row [default: one file is one run]
    #[arg(long, value_name = "COLUMN")]
    run: Option<String>,
    /// Which time stamps of messages to use [default: that of the header if there is one, else the recording time]
    #[arg(long, value_enum, value_name = "CLOCK")]
    stamp: Option<Clock>,
    /// End with status 3 where a log has a flaw, with the flaws on standard error
    #[arg(long)]
    strict: bool,
    /// With --strict: kinds of flaws that are accepted, such as `held` for commands or `constant` for unused columns
    #[arg(long, value_name = "KIND", value_delimiter = ',', requires = "strict", value_parser = PossibleValuesParser::new(KINDS))]
    allow: Vec<String>,
    /// With --strict: columns that are commands, which may be held, limited or at rest
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', requires = "strict")]
    control: Vec<String>,
    #[command(flatten)]
    output: Output,
}

/// What is no flaw of a command: a controller holds it, limits it, and may leave it where it is.
const OF_COMMANDS: [&str; 3] = ["held", "constant", "clipped"];

pub(crate) fn run(command: &Inspect, screen: &Screen) -> Outcome {
    check_out(command.output.out.as_deref(), &command.logs)?;
    let stamp = command.stamp.map_or(Stamp::Auto, Into::into);
    let options = LogOptions { time: command.time.clone(), run: command.run.clone(), stamp, ..LogOptions::default() };
    let (mut texts, mut values, mut flaws) = (Vec::new(), Vec::new(), Vec::new());
    for log in &command.logs {
        let found = inspect(log, &options, &screen.progress())?;
        texts.push(found.text(screen.width()));
        values.push(found.json());
        flaws.extend(flaws_of(&found, command));
    }
    let text = if screen.json() {
        format!("{}\n", serde_json::json!({ "schema": "gpsindy.inspection/1", "logs": values }))
    } else {
        texts.join("\n")
    };
    deliver(&command.output, &text, screen)?;
    if command.strict && !flaws.is_empty() {
        let (count, all) = (flaws.len(), flaws.join("; "));
        return Err(Failure::Verdict(format!("{count} flaw{}: {all}", if count == 1 { "" } else { "s" })));
    }
    Ok(())
}

/// The flaws of a log that are not allowed, in one line each.
fn flaws_of(found: &Inspection, command: &Inspect) -> Vec<String> {
    let place = |flaw: &Finding| {
        let parts = [flaw.topic.as_str(), flaw.column.as_deref().unwrap_or_default()];
        let place: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        if place.is_empty() { "stamps".into() } else { place.join(".") }
    };
    let is_of_command = |flaw: &Finding| {
        let is_named = |name: &String| flaw.column.as_ref() == Some(name) || place(flaw) == *name;
        OF_COMMANDS.contains(&flaw.kind.as_str()) && command.control.iter().any(is_named)
    };
    let is_flaw = |flaw: &&Finding| !command.allow.contains(&flaw.kind) && !is_of_command(flaw);
    found
        .findings
        .iter()
        .filter(is_flaw)
        .map(|flaw| format!("{}: {}: {}", found.file, place(flaw), flaw.text))
        .collect()
}
