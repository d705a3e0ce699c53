//! `gpsindy inspect`: what a log of any format holds, and what in it spoils an identification.

use crate::args::{Clock, Output};
use crate::commands::{check_folder_of, deliver};
use crate::failure::Outcome;
use crate::screen::Screen;
use clap::Args;
use gpsindy_files::{LogOptions, Stamp, inspect};
use std::path::PathBuf;

/// What a log of any format holds, and what in it spoils an identification
///
/// Every topic, field and column with its type, unit, rate, jitter, gaps, missing values and levels; then jitter, gaps, repeated and float32
/// stamps, clocks that run apart, coarse and held sensors, constant columns, wrapped angles, and columns that are a difference of another.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy inspect flight.mcap\n         gpsindy inspect run_*.csv --json")]
pub(crate) struct Inspect {
    /// The logs: CSV, MCAP, Parquet, ULog, the folder of a LeRobot data set or of a ROS 2 bag; `-` is standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The time column of a table, in seconds [default: `t`, else `time`]
    #[arg(long, value_name = "COLUMN")]
    time: Option<String>,
    /// The column that tells the runs of a table apart [default: one file is one run]
    #[arg(long, value_name = "COLUMN")]
    run: Option<String>,
    /// The clock of messages [default: their header's stamp where there is one, else the time of recording]
    #[arg(long, value_enum, value_name = "CLOCK")]
    stamp: Option<Clock>,
    #[command(flatten)]
    output: Output,
}

pub(crate) fn run(command: &Inspect, screen: &Screen) -> Outcome {
    check_folder_of(command.output.out.as_deref())?;
    let stamp = command.stamp.map_or(Stamp::Auto, Into::into);
    let options = LogOptions { time: command.time.clone(), run: command.run.clone(), stamp, ..LogOptions::default() };
    let (mut texts, mut values) = (Vec::new(), Vec::new());
    for log in &command.logs {
        let found = inspect(log, &options, &screen.progress())?;
        texts.push(found.text(screen.width()));
        values.push(found.json());
    }
    let text = if screen.json() {
        format!("{}\n", serde_json::json!({ "schema": "gpsindy.inspection/1", "logs": values }))
    } else {
        texts.join("\n")
    };
    deliver(&command.output, &text, screen)
}
