//! `gpsindy fleet`: one diagnosis per unit and period, then the comparison.

use crate::args::Columns;
use crate::commands::diagnose::Options;
use crate::commands::given::nominal;
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::text::count;
use clap::{Args, Subcommand};
use gpsindy_core::fleet::FleetReport;
use gpsindy_fleet::{Attempt, Fleet as Run, Folder, Manifest, Shard, compare};
use std::fmt::Write;
use std::path::{Path, PathBuf};

mod watch;

/// Diagnose every machine of a fleet and compare them
///
/// The manifest (TOML or CSV) has one entry per unit and period: unit, logs, model and, optionally, holdout and since; other columns are
/// covariates such as load and temperature. The reports go to DIR/tasks, the comparison to DIR/fleet.json and DIR/fleet.html. A second run
/// computes only what is missing. Exit status 4: some units have no diagnosis, the comparison is of the others.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy fleet fleet.toml --out fleet")]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Fleet {
    #[command(subcommand)]
    action: Option<Action>,
    /// The manifest (TOML or CSV); paths in it are relative to its folder
    #[arg(required = true)]
    manifest: Option<PathBuf>,
    /// Folder for the reports and the comparison; created if it does not exist
    #[arg(long, short, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
    /// Compute only part K of N of the tasks, for schedulers; the comparison is written once all parts are complete
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    #[command(flatten)]
    each: Each,
}

/// How each diagnosis of a fleet is made.
#[derive(Debug, Args)]
struct Each {
    /// Number of tasks in parallel [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    columns: Columns,
}

impl Each {
    fn run(&self, shard: Option<Shard>) -> Outcome<Run> {
        let (diagnose, options) = (self.options.settings()?, self.columns.options()?);
        Ok(Run { diagnose, options, jobs: self.jobs.map(usize::from), shard })
    }
}

#[derive(Debug, Subcommand)]
enum Action {
    Watch(watch::Watch),
}

impl Fleet {
    /// Whether it waits for logs that keep coming.
    pub(super) fn watches(&self) -> bool {
        matches!(self.action, Some(Action::Watch(_)))
    }
}

pub(crate) fn run(command: &Fleet, screen: &Screen) -> Outcome {
    if let Some(Action::Watch(watch)) = &command.action {
        return watch::run(watch, screen);
    }
    // The parser has asked for both.
    let (Some(path), Some(out)) = (&command.manifest, &command.out) else {
        return Err(Failure::input("fleet needs a manifest and --out"));
    };
    let manifest = Manifest::read(path)?;
    if let Some(task) = manifest.tasks.iter().find(|task| nominal::kind(&task.model).is_some()) {
        return Err(Failure::input(format!(
            "{}: entry of unit `{}`: {} is a simulator's own file, and a fleet needs equations (TOML or JSON); diagnose its units one by one",
            path.display(),
            task.unit,
            task.model.display()
        )));
    }
    let fleet = command.each.run(command.shard)?;
    let store = folder(out)?;
    let progress = screen.progress();
    let done = fleet.run(&manifest, &store, &progress)?;
    drop(progress);
    for (task, attempt) in manifest.tasks.iter().zip(&done.attempts) {
        if let Attempt::Failed(error) = attempt {
            screen.warn(&format!("unit {}: no diagnosis: {error}", task.unit));
        }
    }
    screen.note(&format!("{} done, {} done before, {} failed", done.done(), done.found(), done.failed()));
    if done.missing() > 0 {
        screen.note(&format!(
            "{} tasks of other parts are missing; the last part to finish writes the comparison",
            done.missing()
        ));
    } else {
        let report = compare(&manifest, &done.attempts, &store)?;
        tell(&report, out, screen)?;
        if report.units.is_empty() {
            return Err(Failure::Work("no unit has a diagnosis".into()));
        }
    }
    match done.failed() {
        0 => Ok(()),
        failed => Err(Failure::Partly(format!(
            "{failed} of {} without a diagnosis; the reasons stand above and in fleet.json",
            count(manifest.tasks.len(), "task")
        ))),
    }
}

/// The folder of the results, made if it is not there.
fn folder(out: &Path) -> Outcome<Folder> {
    if out.to_string_lossy().contains("://") {
        let what = format!("--out takes a folder, found {}; gpsindy.fleet in Python writes to a URL", out.display());
        return Err(Failure::input(what));
    }
    if out.is_file() {
        return Err(Failure::input(format!("--out: {} is a file; name a folder", out.display())));
    }
    std::fs::create_dir_all(out).map_err(|e| Failure::Work(format!("{}: {e}", out.display())))?;
    Ok(Folder::new(out))
}

/// The comparison on the screen.
fn tell(report: &FleetReport, out: &Path, screen: &Screen) -> Outcome {
    if screen.json() {
        let json = serde_json::to_string_pretty(report).map_err(|e| Failure::Work(format!("fleet.json: {e}")))?;
        return screen.out(&(json + "\n"));
    }
    screen.out(&text(report))?;
    screen.out(&format!("\ncomparison: {}\n", out.join("fleet.html").display()))
}

/// What a terminal shows.
fn text(report: &FleetReport) -> String {
    let mut text = String::new();
    // Writing to a String can't fail.
    let _ = writeln!(text, "{} reports, {} failed", report.units.len(), report.failed.len());
    if report.odd.is_empty() && !report.units.is_empty() {
        let _ = writeln!(text, "no unit stands out from the fleet");
    }
    for odd in &report.odd {
        let _ = writeln!(
            text,
            "{}: {} {} in {} is {:.4}, the fleet has {:.4} with a spread of {:.2} (false discovery rate {:.1e})",
            odd.unit,
            odd.effect,
            odd.parameter,
            odd.state,
            odd.value,
            odd.population,
            odd.spread,
            odd.false_discovery_rate
        );
    }
    for change in &report.changes {
        let day = if change.date.is_empty() { format!("day {:.0}", change.since) } else { change.date.clone() };
        let _ = writeln!(
            text,
            "{}: {} {} in {} went from {:.4} to {:.4} since {day} (probability {:.2})",
            change.unit, change.effect, change.parameter, change.state, change.from, change.to, change.probability
        );
    }
    for note in &report.notes {
        let _ = writeln!(text, "{note}");
    }
    text
}
