//! The arguments of the program and those that several commands share.

// The comments of the fields are the help that the program prints: its brackets are text, not links.
#![allow(rustdoc::broken_intra_doc_links)]

use crate::commands::{
    completions, demo, design, diagnose, effects, exam, export, fleet, identify, inspect, man, mcp, score, simulate,
    smooth,
};
use crate::failure::Outcome;
use clap::{Args, Parser, Subcommand, ValueEnum};
use gpsindy_core::Hold;
use gpsindy_files::{LogOptions, Offset, Stamp};
use std::path::PathBuf;

/// Identify equations from sparse, noisy logs, and diagnose where a simulator is wrong.
#[derive(Debug, Parser)]
#[command(
    name = "gpsindy",
    version,
    max_term_width = 110,
    before_help = "Example: gpsindy demo\n         gpsindy identify run_1.csv run_2.csv --control u --out model.toml",
    after_help = "`gpsindy COMMAND --help` describes a command in full. Exit status: 0 success, 1 the computation failed, 2 bad input or usage, 3 a verdict that --fail-if names, 4 some units of a fleet failed."
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What every command takes.
#[derive(Debug, Args)]
pub(crate) struct Global {
    /// Print the machine-readable result and nothing else on stdout
    #[arg(long, global = true, help_heading = "Global options")]
    pub(crate) json: bool,
    /// Print no progress and no notes on stderr
    #[arg(long, short, global = true, help_heading = "Global options")]
    pub(crate) quiet: bool,
    /// Number of threads; the result does not depend on it [default: one per core]
    #[arg(long, global = true, value_name = "N", help_heading = "Global options", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Seed of the random number generator [default: 0]
    #[arg(long, global = true, value_name = "N", help_heading = "Global options")]
    pub(crate) seed: Option<u64>,
}

impl Global {
    /// The first option that says how a result is computed or printed, where one was given.
    pub(crate) fn of_results(&self) -> Option<&'static str> {
        let given = [("--json", self.json), ("--threads", self.threads.is_some()), ("--seed", self.seed.is_some())];
        given.iter().find(|(_, given)| *given).map(|(option, _)| *option)
    }
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Inspect(inspect::Inspect),
    Identify(Box<identify::Identify>),
    Smooth(smooth::Smooth),
    Simulate(simulate::Simulate),
    Score(score::Score),
    Export(export::Export),
    Diagnose(Box<diagnose::Diagnose>),
    Design(Box<design::Design>),
    Exam(exam::Exam),
    Effects(effects::Effects),
    Fleet(Box<fleet::Fleet>),
    Demo(demo::Demo),
    Completions(completions::Completions),
    Man(man::Man),
    Mcp(mcp::Mcp),
}

/// How the columns of logs are found.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Columns of the logs")]
pub(crate) struct Columns {
    /// The time column of a table, in seconds [default: `t`, else `time`]
    #[arg(long, value_name = "COLUMN")]
    pub(crate) time: Option<String>,
    /// The column that identifies the run of each row [default: one file is one run]
    #[arg(long, value_name = "COLUMN")]
    pub(crate) run: Option<String>,
    /// Rename a column; a `*` on both sides stands for the same characters, as in 'q_*=*_joint'
    #[arg(long, value_name = "COLUMN=NAME", value_parser = pair)]
    pub(crate) rename: Vec<(String, String)>,
    /// Add a column that no log has and that had one value throughout, such as gripper_ctrl=0
    #[arg(long, value_name = "COLUMN=VALUE", value_parser = constant, allow_hyphen_values = true)]
    pub(crate) constant: Vec<(String, f64)>,
    /// Take a column from a field of a topic, such as q=/joint_states.position[elbow] or u=/command.data[0]; `gpsindy inspect` lists the fields
    #[arg(long, value_name = "NAME=TOPIC.FIELD", value_parser = place)]
    pub(crate) map: Vec<(String, String)>,
    /// Read the column mapping of a project from a TOML file with [map], [unit], [offset] and stamp
    #[arg(long, value_name = "FILE")]
    pub(crate) map_file: Option<PathBuf>,
    /// Which time stamps of messages to use [default: that of the header if there is one, else the recording time]
    #[arg(long, value_enum, value_name = "CLOCK")]
    pub(crate) stamp: Option<Clock>,
    /// Shift the stamps of a topic by a number of seconds; `auto` estimates the shift, with an interval, from the agreement with other topics
    #[arg(long, value_name = "TOPIC=SECONDS|auto", value_parser = offset, allow_hyphen_values = true)]
    pub(crate) offset: Vec<(String, Offset)>,
    /// Unwrap an angle (rad) that jumps by full turns, at the full sampling rate
    #[arg(long, value_name = "COLUMN")]
    pub(crate) angle: Vec<String>,
}

impl Columns {
    pub(crate) fn options(&self) -> Outcome<LogOptions> {
        let mut options = LogOptions {
            time: self.time.clone(),
            run: self.run.clone(),
            rename: self.rename.clone(),
            constant: self.constant.clone(),
            map: self.map.clone(),
            unit: Vec::new(),
            stamp: self.stamp.map_or(Stamp::Auto, Into::into),
            offset: self.offset.clone(),
        };
        if let Some(file) = &self.map_file {
            options.add_map_file(file)?;
        }
        Ok(options)
    }
}

/// The clock of messages.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Clock {
    /// The stamp in the message header
    Header,
    /// The recording time
    Log,
}

impl From<Clock> for Stamp {
    fn from(clock: Clock) -> Self {
        match clock {
            Clock::Header => Self::Header,
            Clock::Log => Self::Log,
        }
    }
}

/// `NAME=PLACE`, cut at the first `=` because a name holds none.
fn place(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((a, b)) if !a.trim().is_empty() && !b.trim().is_empty() => Ok((a.trim().into(), b.trim().into())),
        _ => Err("expected NAME=TOPIC.FIELD".into()),
    }
}

fn offset(text: &str) -> Result<(String, Offset), String> {
    let (topic, shift) = pair(text).map_err(|_| "expected TOPIC=SECONDS or TOPIC=auto".to_string())?;
    Ok((topic, shift.parse()?))
}

fn constant(text: &str) -> Result<(String, f64), String> {
    match <[_; 1]>::try_from(values(text)?) {
        Ok([column]) => Ok(column),
        Err(_) => Err("expected COLUMN=VALUE; give the option once a column".into()),
    }
}

/// `A=B`, cut at the last `=` because a header may hold one.
pub(crate) fn pair(text: &str) -> Result<(String, String), String> {
    match text.rsplit_once('=') {
        Some((a, b)) if !a.trim().is_empty() && !b.trim().is_empty() => Ok((a.trim().into(), b.trim().into())),
        _ => Err("expected A=B".into()),
    }
}

/// `name=number`, several of them separated by commas.
pub(crate) fn values(text: &str) -> Result<Vec<(String, f64)>, String> {
    text.split(',')
        .map(|part| {
            let (name, value) = pair(part).map_err(|_| format!("expected name=number, found `{part}`"))?;
            let number = value.parse().ok().filter(|v: &f64| v.is_finite());
            number.map(|v| (name, v)).ok_or_else(|| format!("`{value}` is not a number"))
        })
        .collect()
}

/// Where a result goes.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Result")]
pub(crate) struct Output {
    /// Write the result to a file, completely or not at all [default: stdout]
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// What a control does between its samples, if the logs can show it.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum AutoHold {
    /// Whichever of zero and linear explains the logs better
    Auto,
    /// Zero-order hold: the control keeps the value of the last sample
    Zero,
    /// First-order hold: linear interpolation to the next sample
    Linear,
}

impl From<AutoHold> for Option<Hold> {
    fn from(hold: AutoHold) -> Self {
        match hold {
            AutoHold::Auto => None,
            AutoHold::Zero => Some(Hold::Zero),
            AutoHold::Linear => Some(Hold::Linear),
        }
    }
}
