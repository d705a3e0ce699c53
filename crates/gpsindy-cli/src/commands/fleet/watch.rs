//! `gpsindy fleet watch`: a fleet whose logs are added one by one.

use super::{Each, folder, tell};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::stop;
use clap::Args;
use gpsindy_core::{Error as CoreError, Progress};
use gpsindy_files::Error;
use gpsindy_fleet::{Attempt, Look, Watched};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Diagnose new logs as they are added to a folder, and update the comparison
///
/// If FOLDER has a fleet.toml or fleet.csv, that manifest is read again at every look. Otherwise each folder in FOLDER is a unit, and each
/// log in it is a period that begins at the date in the log's name (2026-01-31 or 2026-01-31T14-05), or when the log was last written if
/// its name has no date. A folder in a unit's folder is one period with several logs. A log is read once its size has stayed the same from
/// one look to the next. Ctrl-C ends normally; the next start continues.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy fleet watch logs --model arm.toml --out result")]
pub(crate) struct Watch {
    /// The folder to which logs are added
    folder: PathBuf,
    /// The nominal model of every unit; without a manifest only [default: FOLDER/model.toml]
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Folder for the reports and the comparison [default: FOLDER/result]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Time between two looks at the folder
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0, allow_negative_numbers = true)]
    every: f64,
    /// End after nothing was added for this time [default: never]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    idle: Option<f64>,
    #[command(flatten)]
    each: Each,
}

/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// Progress that ends on Ctrl-C.
struct Stoppable<'a> {
    progress: &'a dyn Progress,
    stop: &'a AtomicBool,
}

impl Progress for Stoppable<'_> {
    fn report(&self, stage: &str, done: usize, total: usize) -> bool {
        self.progress.report(stage, done, total) && !self.stop.load(Ordering::Relaxed)
    }
}

pub(super) fn run(command: &Watch, screen: &Screen) -> Outcome {
    let every = above_0("--every", command.every)?;
    let idle = command.idle.map(|seconds| above_0("--idle", seconds)).transpose()?;
    if !command.folder.is_dir() {
        return Err(Failure::input(format!("{}: not a folder", command.folder.display())));
    }
    let fleet = command.each.run(None)?;
    let out = command.out.clone().unwrap_or_else(|| command.folder.join("result"));
    let store = folder(&out)?;
    let stop = stop::requested().map_err(|e| Failure::Work(format!("cannot listen to Ctrl-C: {e}")))?;
    let mut watched = Watched::new(&command.folder, command.model.clone(), &out);
    let (mut trouble, mut last) = (String::new(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        let progress = screen.progress();
        let look = watched.look(&fleet, &store, &Stoppable { progress: &progress, stop: &stop });
        drop(progress);
        match look {
            Ok(look) => {
                trouble.clear();
                if let Some(report) = &look.report {
                    last = Instant::now();
                    news(&look, screen);
                    tell(report, &out, screen)?;
                } else if look.waiting > 0 {
                    last = Instant::now();
                }
            }
            Err(Error::Core(CoreError::Cancelled)) => break,
            // A manifest may be half written, or a disk away for a while.
            Err(error) if error.to_string() != trouble => {
                trouble = error.to_string();
                screen.warn(&format!("{trouble}; looking again"));
            }
            Err(_) => {}
        }
        if idle.is_some_and(|idle| last.elapsed() >= idle) {
            break;
        }
        let begun = Instant::now();
        while begun.elapsed() < every && !stop.load(Ordering::Relaxed) {
            thread::sleep(LOOK.min(every));
        }
    }
    screen.note("stopped; the next start continues");
    Ok(())
}

fn above_0(option: &str, seconds: f64) -> Outcome<Duration> {
    let valid = Duration::try_from_secs_f64(seconds).ok().filter(|d| !d.is_zero());
    valid.ok_or_else(|| Failure::input(format!("{option} must be above 0, found {seconds}")))
}

/// What was diagnosed at a look.
fn news(look: &Look, screen: &Screen) {
    for (task, attempt) in &look.news {
        let period = task.since.as_deref().map(|since| format!(" since {since}")).unwrap_or_default();
        match attempt {
            Attempt::Done(key) => screen.note(&format!("{}{period}: tasks/{key}/report.html", task.unit)),
            Attempt::Failed(error) => screen.warn(&format!("unit {}{period}: no diagnosis: {error}", task.unit)),
            Attempt::Found(_) | Attempt::Missing => {}
        }
    }
}
