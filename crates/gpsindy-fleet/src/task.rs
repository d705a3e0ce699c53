//! One task: the diagnosis of one unit in one period, named by its content.

use crate::store::Store;
use gpsindy_core::diagnose::{Diagnose, Diagnosed, hold_out};
use gpsindy_core::{Dataset, Hold, Model, Progress};
use gpsindy_files::{Error, LogOptions, Logs, Result, Task as Columns, model_to_toml, read_model};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One unit in one period.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The machine.
    pub unit: String,
    /// When the period began, as the manifest says it.
    pub since: Option<String>,
    /// The nominal model.
    pub model: PathBuf,
    /// Logs to learn from.
    pub logs: Vec<PathBuf>,
    /// Logs to verify on; without any, a part of `logs` is held out.
    pub holdout: Vec<PathBuf>,
    /// Covariates of the period by name.
    pub covariates: BTreeMap<String, f64>,
}

impl Task {
    /// The task's name: a hash of model, logs, settings and version, 32 hexadecimal digits.
    ///
    /// # Errors
    /// A file that can't be read.
    pub fn key(&self, settings: &Diagnose, options: &LogOptions) -> Result<String> {
        let mut hash = Sha256::new();
        let mut add = |part: &str, bytes: &[u8]| {
            // Lengths keep two files from being taken for one.
            hash.update(part.as_bytes());
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        };
        add("version", env!("CARGO_PKG_VERSION").as_bytes());
        add("settings", format!("{settings:?} {options:?}").as_bytes());
        for (part, path) in std::iter::once(("model", &self.model))
            .chain(self.logs.iter().map(|p| ("log", p)))
            .chain(self.holdout.iter().map(|p| ("holdout", p)))
        {
            for path in files(path)? {
                let file = path.display().to_string();
                add(part, &std::fs::read(&path).map_err(|source| Error::Read { file, source })?);
                // The run's name is in the report.
                add("name", path.file_name().unwrap_or_default().as_encoded_bytes());
            }
        }
        Ok(name(hash))
    }

    /// Every file that the task reads.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.model).chain(&self.logs).chain(&self.holdout)
    }

    /// The file in which a failure of this task is recorded. Its logs may be what is missing, so its entry names it.
    fn failure(&self) -> String {
        let entry = format!("{:?}", (&self.unit, &self.since, &self.model, &self.logs, &self.holdout));
        format!("failed/{}.txt", name(Sha256::new().chain_update(entry)))
    }

    /// Why the task failed when it was last tried, here or elsewhere.
    pub(crate) fn failed(&self, store: &dyn Store) -> Result<Option<String>> {
        Ok(store.read(&self.failure())?.map(|text| String::from_utf8_lossy(&text).into_owned()))
    }

    /// Tells that the task failed and why, or with none that it did not.
    ///
    /// # Errors
    /// A file that can't be written.
    pub(crate) fn tell(&self, store: &dyn Store, error: Option<&str>) -> Result<()> {
        match error {
            Some(error) => store.write(&self.failure(), error.as_bytes()),
            None if store.has(&self.failure())? => store.remove(&self.failure()),
            None => Ok(()),
        }
    }

    /// Diagnoses the unit and writes `report.html`, `augmented.toml` and `report.json` below `tasks/KEY`; the JSON comes last, so that a
    /// key with it is whole.
    ///
    /// # Errors
    /// What is wrong with a file, or why there is no diagnosis.
    pub(crate) fn run(
        &self,
        settings: &Diagnose,
        options: &LogOptions,
        (store, key): (&dyn Store, &str),
        progress: &dyn Progress,
    ) -> Result<()> {
        let model = read_model(&self.model)?;
        let read = |logs: &[PathBuf]| dataset(&model, logs, options, settings.hold.unwrap_or_default(), progress);
        let train = read(&self.logs)?;
        let (train, holdout) = if self.holdout.is_empty() { hold_out(&train)? } else { (train, read(&self.holdout)?) };
        let Diagnosed { diagnosis, augmented, .. } = settings.run(&model, &train, &holdout, progress)?;
        let html = gpsindy_report::render(&diagnosis);
        let json = gpsindy_report::json(&diagnosis).map_err(|e| gpsindy_core::Error::file(e.to_string()))?;
        let augmented = gpsindy_report::augmented(&diagnosis, &model_to_toml(&augmented)?);
        store.write(&format!("tasks/{key}/report.html"), html.as_bytes())?;
        store.write(&format!("tasks/{key}/augmented.toml"), augmented.as_bytes())?;
        store.write(&report(key), json.as_bytes())
    }
}

/// The file of a task's report.
pub(crate) fn report(key: &str) -> String {
    format!("tasks/{key}/report.json")
}

/// A file itself, or the files below a data set that is a folder, by name.
fn files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    let failed = |source| Error::Read { file: path.display().to_string(), source };
    let entries = std::fs::read_dir(path).map_err(failed)?.collect::<std::io::Result<Vec<_>>>().map_err(failed)?;
    let mut below: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    below.sort();
    let nested = below.iter().map(|path| files(path)).collect::<Result<Vec<_>>>()?;
    Ok(nested.into_iter().flatten().collect())
}

/// The first 16 bytes of a hash in hexadecimal digits.
fn name(hash: Sha256) -> String {
    hash.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}

/// The columns that a model reads.
fn dataset(
    model: &Model,
    logs: &[PathBuf],
    options: &LogOptions,
    hold: Hold,
    progress: &dyn Progress,
) -> Result<Dataset> {
    let controls: Vec<String> = model.controls.iter().map(|c| c.name.clone()).collect();
    let optional = model.states.iter().map(|s| s.name.clone()).collect();
    let columns = Columns { needed: controls.clone(), optional, controls, hold };
    Ok(Logs::read(logs, options)?.assemble(&columns, progress)?.data)
}
