//! A folder to which logs are added: what is new and whole is diagnosed, and the comparison made again.
//!
//! A log counts as whole once its size and its time of change stayed the same from one look to the next. A log that grows after that is
//! another task, by its content, and takes the place of the first.

use crate::date;
use crate::gather::compare;
use crate::manifest::{Entry, Manifest};
use crate::run::{Attempt, Fleet};
use crate::store::Store;
use crate::task::Task;
use gpsindy_core::Progress;
use gpsindy_core::fleet::FleetReport;
use gpsindy_files::{Error, Result};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Manifests that a folder may have.
const MANIFESTS: [&str; 2] = ["fleet.toml", "fleet.csv"];

/// Endings that programs give to files they are still writing.
const UNFINISHED: [&str; 5] = ["part", "partial", "tmp", "crdownload", "active"];

/// Size, time of change and number of files.
type Stamp = (u64, SystemTime, usize);

/// A unit and a period.
type Name = (String, Option<String>);

/// A folder that is looked at again and again.
///
/// With `fleet.toml` or `fleet.csv` in it, that manifest is read at every look. Without, each folder in it is a unit and each log in that a
/// period, which begins at the date in the log's name (`2026-01-31`, `2026-01-31T14-05`), or else when the log was last written; a folder
/// within a unit is one period of several logs.
#[derive(Debug)]
pub struct Watched {
    folder: PathBuf,
    model: PathBuf,
    results: PathBuf,
    /// Files at the last look.
    seen: HashMap<PathBuf, Stamp>,
    /// What became of a task, and its files then.
    known: HashMap<Name, (Vec<Option<Stamp>>, Attempt)>,
}

/// What one look brought.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Units and periods that were diagnosed now, and what became of each.
    pub news: Vec<(Task, Attempt)>,
    /// Units and periods whose files are missing or still change.
    pub waiting: usize,
    /// The comparison, where there is news.
    pub report: Option<FleetReport>,
}

impl Watched {
    /// Logs below `folder`, of machines that `model` describes; without one `model.toml` in the folder does. What is below `results` is
    /// no log.
    pub fn new(folder: &Path, model: Option<PathBuf>, results: &Path) -> Self {
        let model = model.unwrap_or_else(|| folder.join("model.toml"));
        let results = results.canonicalize().unwrap_or_else(|_| results.to_path_buf());
        Self { folder: folder.to_path_buf(), model, results, seen: HashMap::new(), known: HashMap::new() }
    }

    /// Looks once: diagnoses what is new and whole, and compares again where anything is.
    ///
    /// # Errors
    /// A folder or manifest that can't be read, a request to stop, a store that does not answer.
    pub fn look(&mut self, fleet: &Fleet, store: &dyn Store, progress: &dyn Progress) -> Result<Look> {
        let manifest = self.manifest()?;
        let (mut whole, mut fresh) = (Vec::new(), Vec::new());
        let mut now = HashMap::new();
        for task in &manifest.tasks {
            let stamps: Vec<Option<Stamp>> = task.files().map(|file| stamp(file)).collect();
            let stays = task.files().zip(&stamps).all(|(f, s)| s.is_some() && self.seen.get(f) == s.as_ref());
            now.extend(task.files().cloned().zip(stamps.iter().copied()).filter_map(|(f, s)| Some((f, s?))));
            if !stays {
                continue;
            }
            if self.known.get(&name(task)).is_none_or(|(before, _)| *before != stamps) {
                fresh.push((task.clone(), stamps));
            }
            whole.push(task.clone());
        }
        self.seen = now;
        let waiting = manifest.tasks.len() - whole.len();
        let covariates = manifest.covariates;
        if fresh.is_empty() {
            return Ok(Look { news: Vec::new(), waiting, report: None });
        }
        let tasks = fresh.iter().map(|(task, _)| task.clone()).collect();
        let attempts = fleet.run(&Manifest { tasks, covariates: covariates.clone() }, store, progress)?.attempts;
        let mut news = Vec::new();
        for ((task, stamps), attempt) in fresh.into_iter().zip(attempts) {
            self.known.insert(name(&task), (stamps, attempt.clone()));
            news.push((task, attempt));
        }
        let attempts: Vec<Attempt> = whole.iter().map(|task| self.known[&name(task)].1.clone()).collect();
        let report = compare(&Manifest { tasks: whole, covariates }, &attempts, store)?;
        Ok(Look { news, waiting, report: Some(report) })
    }

    /// The units and periods of the folder as it is now; none yet is no error.
    fn manifest(&self) -> Result<Manifest> {
        if let Some(path) = MANIFESTS.map(|name| self.folder.join(name)).into_iter().find(|path| path.is_file()) {
            return Manifest::read(&path);
        }
        let mut periods: BTreeMap<(String, String), Vec<PathBuf>> = BTreeMap::new();
        for unit in entries(&self.folder)?.into_iter().filter(|path| path.is_dir() && !self.is_result(path)) {
            let name = unit.file_name().unwrap_or_default().to_string_lossy().into_owned();
            for path in entries(&unit)? {
                let Some(since) = date::within(&path.file_stem().unwrap_or_default().to_string_lossy())
                    .or_else(|| stamp(&path).and_then(|(_, time, _)| date::of(time)))
                else {
                    continue;
                };
                // A data set that is a folder is one log.
                let is_set = path.join("meta/info.json").is_file();
                let logs = if path.is_dir() && !is_set { entries(&path)? } else { vec![path] };
                periods.entry((name.clone(), since)).or_default().extend(logs);
            }
        }
        let entry = |((unit, since), logs): ((String, String), Vec<PathBuf>)| {
            let logs = logs.iter().map(|path| glob::Pattern::escape(&path.to_string_lossy())).collect();
            let model = self.model.to_string_lossy().into_owned();
            let one = |key: &str, value: String| (key.to_string(), vec![value]);
            Entry::from([one("unit", unit), one("since", since), one("model", model), ("logs".into(), logs)])
        };
        let entries: Vec<Entry> = periods.into_iter().filter(|(_, logs)| !logs.is_empty()).map(entry).collect();
        if entries.is_empty() {
            return Ok(Manifest { tasks: Vec::new(), covariates: Vec::new() });
        }
        // Paths are whole already.
        Manifest::new(&entries, Path::new(""))
            .map_err(|source| Error::Content { file: self.folder.display().to_string(), source })
    }

    fn is_result(&self, path: &Path) -> bool {
        path.canonicalize().is_ok_and(|path| path == self.results)
    }
}

fn name(task: &Task) -> Name {
    (task.unit.clone(), task.since.clone())
}

/// What is in a folder, by name; hidden and unfinished files are left out.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |source| Error::Read { file: folder.display().to_string(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        let is_unfinished = path.extension().is_some_and(|e| UNFINISHED.iter().any(|u| e.eq_ignore_ascii_case(u)));
        if !is_hidden && !is_unfinished {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Size and time of change of a file, or of all files below a folder; none where there is nothing.
fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(path).ok()?;
    let own = (metadata.len(), metadata.modified().ok()?, 1);
    if !metadata.is_dir() {
        return Some(own);
    }
    let below = std::fs::read_dir(path).ok()?.filter_map(|entry| stamp(&entry.ok()?.path()));
    Some(below.fold((0, own.1, 0), |(size, time, count), (s, t, c)| (size + s, time.max(t), count + c)))
}
