//! `gpsindy exam`: diagnoses every case of a suite, then reads the answers and prints the score card.

use crate::args::Columns;
use crate::commands::diagnose::{self, Options, Parts};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::Progress;
use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_core::diagnose::{Diagnose as Settings, Diagnosed, Handed};
use gpsindy_files::{read_model, write_whole};
use gpsindy_report::Provenance;
use gpsindy_report::scorecard::{HandedOver, LeftOut, ScoreCard, Suite, read_report};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Test the diagnosis on a suite of cases with known effects
///
/// A case is a folder with model.toml, real_*.csv and, optionally, holdout_*.csv. Every case is diagnosed into a folder of its name in --out,
/// never inside the suite. Only then are the answers read from answers.toml and the score card printed.
#[derive(Debug, Args)]
#[command(
    before_help = "Example: gpsindy exam suite --out exam\n         gpsindy exam suite --reports other_tool --out exam_other"
)]
pub(crate) struct Exam {
    /// Folder of the suite
    suite: PathBuf,
    /// Folder for the diagnoses, one subfolder per case, and for scorecard.json; created if it does not exist
    #[arg(long, short, value_name = "DIR", default_value = "exam")]
    out: PathBuf,
    /// The answers, if they are not in the suite [default: SUITE/answers.toml]
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// Score the reports of another tool, DIR/CASE/report.json, instead of diagnosing; a case without one counts as missed
    #[arg(long, value_name = "DIR")]
    reports: Option<PathBuf>,
    /// Diagnose only these cases, separated by commas
    #[arg(long, value_name = "CASE", value_delimiter = ',')]
    only: Vec<String>,
    /// Also take each effect of a case out of the catalogue in turn, and count what is then called explained; the answers say which
    #[arg(long, conflicts_with = "reports")]
    leave_out: bool,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    columns: Columns,
}

pub(crate) fn run(command: &Exam, screen: &Screen) -> Outcome {
    let mut cases = cases(&command.suite)?;
    if !command.only.is_empty() {
        if let Some(unknown) = command.only.iter().find(|id| !cases.contains(id)) {
            return Err(Failure::input(format!("--only: {} has no case `{unknown}`", command.suite.display())));
        }
        cases.retain(|id| command.only.contains(id));
    }
    let answers = command.answers.clone().unwrap_or_else(|| command.suite.join("answers.toml"));
    if !answers.is_file() {
        return Err(Failure::input(format!("{}: there is no such file; the score card needs it", answers.display())));
    }
    check_out(command, &cases)?;
    let (diagnoses, handed) = match &command.reports {
        Some(folder) => (read(folder, &cases, screen)?, None),
        None => {
            let (diagnoses, handed) = apart(diagnose_all(command, &cases, screen)?);
            (diagnoses, Some(handed))
        }
    };
    // From here on nothing is diagnosed any more: the answers may be read.
    let text = std::fs::read_to_string(&answers).map_err(|e| Failure::input(format!("{}: {e}", answers.display())))?;
    let mut suite = Suite::from_toml(&text)?;
    if !command.only.is_empty() {
        suite.cases.retain(|case| command.only.contains(&case.id));
    }
    let mut card = ScoreCard::new(&suite, &diagnoses);
    card.handed = handed.map(|handed| HandedOver::new(&suite, &handed));
    if command.leave_out {
        card.left_out = Some(LeftOut::new(&suite, &diagnoses, &apart(leave_out(command, &suite, screen)?).0));
    }
    let json = serde_json::to_string_pretty(&card).map_err(|e| Failure::Work(format!("scorecard.json: {e}")))? + "\n";
    std::fs::create_dir_all(&command.out).map_err(|e| Failure::Work(format!("{}: {e}", command.out.display())))?;
    write_whole(&command.out.join("scorecard.json"), json.as_bytes())?;
    if screen.json() {
        return screen.out(&json);
    }
    screen.out(&card.text())?;
    screen.out(&format!("\ndiagnoses: {}\n", command.reports.as_ref().unwrap_or(&command.out).display()))
}

/// A diagnosis to make.
struct Job<'a, K> {
    key: K,
    case: &'a str,
    settings: Settings,
    /// The folder for what comes of it.
    out: PathBuf,
}

/// A diagnosis of every case that could be diagnosed.
fn diagnose_all(command: &Exam, cases: &[String], screen: &Screen) -> Outcome<BTreeMap<String, Diagnosed>> {
    let settings = command.options.settings()?;
    let jobs =
        cases.iter().map(|id| Job { key: id.clone(), case: id, settings: settings.clone(), out: command.out.join(id) });
    Ok(all(command, &jobs.collect::<Vec<_>>(), "diagnose", screen))
}

/// A diagnosis of every case of the catalogue without each of its effects, into CASE/without_N_EFFECT.
fn leave_out(command: &Exam, suite: &Suite, screen: &Screen) -> Outcome<BTreeMap<(String, usize), Diagnosed>> {
    let settings = command.options.settings()?;
    let known = suite.cases.iter().filter(|answer| answer.in_catalogue);
    let jobs = known.flat_map(|answer| (0..answer.effects.len()).map(move |of| (answer, of))).map(|(answer, of)| {
        let without = settings.without.iter().cloned().chain(answer.ids_of(of)).collect();
        let folder = format!("without_{}_{}", of + 1, answer.effects[of].effect);
        Job {
            key: (answer.id.clone(), of),
            case: &answer.id,
            settings: Settings { without, ..settings.clone() },
            out: command.out.join(&answer.id).join(folder),
        }
    });
    Ok(all(command, &jobs.collect::<Vec<_>>(), "diagnose without an effect", screen))
}

/// What came of the jobs; one that fails is reported and left out.
fn all<K: Clone + Ord + Send + Sync>(
    command: &Exam,
    jobs: &[Job<'_, K>],
    stage: &str,
    screen: &Screen,
) -> BTreeMap<K, Diagnosed> {
    let progress = screen.progress();
    let done = AtomicUsize::new(0);
    let outcomes: Vec<Outcome<Diagnosed>> = jobs
        .par_iter()
        .map(|job| {
            let outcome = case(command, job, screen);
            progress.report(stage, done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
            outcome
        })
        .collect();
    drop(progress);
    let mut diagnoses = BTreeMap::new();
    for (job, outcome) in jobs.iter().zip(outcomes) {
        match outcome {
            Ok(diagnosed) => drop(diagnoses.insert(job.key.clone(), diagnosed)),
            Err(failure) => {
                let name = job.out.strip_prefix(&command.out).unwrap_or(&job.out);
                screen.warn(&format!("{}: no diagnosis: {failure}", name.display()));
            }
        }
    }
    diagnoses
}

/// The reports, and what was handed over to fits.
fn apart<K: Ord + Clone>(all: BTreeMap<K, Diagnosed>) -> (BTreeMap<K, Diagnosis>, BTreeMap<K, Vec<Handed>>) {
    all.into_iter().map(|(key, found)| ((key.clone(), found.diagnosis), (key, found.handed))).unzip()
}

/// The reports of another tool; one that can't be read is an error, since a score of the rest would flatter it.
fn read(folder: &Path, cases: &[String], screen: &Screen) -> Outcome<BTreeMap<String, Diagnosis>> {
    let mut diagnoses = BTreeMap::new();
    for id in cases {
        let path = folder.join(id).join("report.json");
        let Ok(text) = std::fs::read_to_string(&path) else {
            screen.warn(&format!("{}: there is no such file; the case counts as missed", path.display()));
            continue;
        };
        let report = read_report(&text).map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        diagnoses.insert(id.clone(), report);
    }
    if diagnoses.is_empty() {
        return Err(Failure::input(format!("--reports: {} has no CASE/report.json of this suite", folder.display())));
    }
    Ok(diagnoses)
}

/// Refuses to write among the cases, or through a link to somewhere else: a suite may come from a stranger.
fn check_out(command: &Exam, cases: &[String]) -> Outcome {
    let out = &command.out;
    if out.exists() && !out.is_dir() {
        return Err(Failure::input(format!("--out: {} is a file; name a folder", out.display())));
    }
    if let (Ok(suite), Ok(out)) = (command.suite.canonicalize(), out.canonicalize())
        && (out == suite || cases.iter().any(|id| out == suite.join(id)))
    {
        return Err(Failure::input(format!("--out: {} holds the cases; name another folder", command.out.display())));
    }
    for id in cases {
        let folder = out.join(id);
        if folder.is_symlink() {
            return Err(Failure::input(format!(
                "--out: {} is a symbolic link; remove it or name another folder",
                folder.display()
            )));
        }
    }
    Ok(())
}

/// Diagnoses one case from its folder alone and writes what came of it.
fn case<K>(command: &Exam, job: &Job<'_, K>, screen: &Screen) -> Outcome<Diagnosed> {
    let Job { settings, out, .. } = job;
    let folder = command.suite.join(job.case);
    let model = read_model(&folder.join("model.toml"))?;
    let quiet = screen.quietly();
    let Parts { train, holdout, .. } = diagnose::logs(
        &model,
        &[],
        (&files(&folder, "real_")?, &files(&folder, "holdout_")?),
        settings.hold,
        &command.columns,
        &quiet,
    )?;
    let diagnosed = settings.run(&model, &train, &holdout, &quiet.progress())?;
    diagnose::write(out, &diagnosed, &Provenance::default())?;
    Ok(diagnosed)
}

/// Names of the folders that hold a model, sorted.
fn cases(suite: &Path) -> Outcome<Vec<String>> {
    let entries = std::fs::read_dir(suite)
        .map_err(|_| Failure::input(format!("{}: not a folder that can be read", suite.display())))?;
    let cases = entries.flatten().filter(|e| e.path().join("model.toml").is_file());
    let mut names: Vec<String> = cases.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    if names.is_empty() {
        return Err(Failure::input(format!("{}: no case; a case is a folder with a model.toml", suite.display())));
    }
    Ok(names)
}

/// The logs of a case that begin with `start`, in the order of their numbers.
fn files(folder: &Path, start: &str) -> Outcome<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Failure::input(format!("{}: {e}", folder.display())))?;
    let named = |path: &PathBuf| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(start));
    let mut files: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| named(p) && p.extension().is_some_and(|e| e == "csv")).collect();
    files.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(files)
}
