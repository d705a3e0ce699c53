//! One task: the diagnosis of one unit in one period, named by its content.

use gpsindy_core::diagnose::{Diagnose, Diagnosed, hold_out};
use gpsindy_core::{Dataset, Hold, Model, Progress};
use gpsindy_files::{Error, LogOptions, Logs, Result, Task as Columns, model_to_toml, read_model, write_whole};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One unit in one period.
#[derive(Debug, Clone, PartialEq)]
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
            // Lengths keep two files from being told as one.
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
            let file = path.display().to_string();
            add(part, &std::fs::read(path).map_err(|source| Error::Read { file, source })?);
            // The run's name stands in the report.
            add("name", path.file_name().unwrap_or_default().as_encoded_bytes());
        }
        Ok(name(hash))
    }

    /// Where below the fleet's folder a failure of this task is told. Its files may be what is missing, so its entry names it.
    fn failure(&self, out: &Path) -> PathBuf {
        let entry = format!("{:?}", (&self.unit, &self.since, &self.model, &self.logs, &self.holdout));
        out.join("failed").join(name(Sha256::new().chain_update(entry)) + ".txt")
    }

    /// Why the task failed when it was last tried, here or elsewhere.
    pub(crate) fn failed(&self, out: &Path) -> Option<String> {
        std::fs::read_to_string(self.failure(out)).ok()
    }

    /// Tells that the task failed and why, or with none that it did not.
    ///
    /// # Errors
    /// A file that can't be written.
    pub(crate) fn tell(&self, out: &Path, error: Option<&str>) -> Result<()> {
        let path = self.failure(out);
        let Some(error) = error else {
            // Nothing to remove is as good.
            let _ = std::fs::remove_file(&path);
            return Ok(());
        };
        let folder = out.join("failed");
        let file = folder.display().to_string();
        std::fs::create_dir_all(&folder).map_err(|source| Error::Write { file, source })?;
        write_whole(&path, error.as_bytes())
    }

    /// Diagnoses the unit and writes `report.json`, `report.html` and `augmented.toml` into `folder`; the JSON comes last, so that a folder
    /// with it is whole.
    ///
    /// # Errors
    /// What is wrong with a file, or why there is no diagnosis.
    pub fn run(&self, settings: &Diagnose, options: &LogOptions, folder: &Path, progress: &dyn Progress) -> Result<()> {
        let model = read_model(&self.model)?;
        let read = |logs: &[PathBuf]| dataset(&model, logs, options, settings.hold.unwrap_or_default(), progress);
        let train = read(&self.logs)?;
        let (train, holdout) = if self.holdout.is_empty() { hold_out(&train)? } else { (train, read(&self.holdout)?) };
        let Diagnosed { diagnosis, augmented, .. } = settings.run(&model, &train, &holdout, progress)?;
        let html = gpsindy_report::render(&diagnosis);
        let json = gpsindy_report::json(&diagnosis).map_err(|e| gpsindy_core::Error::file(e.to_string()))?;
        let augmented = gpsindy_report::augmented(&diagnosis, &model_to_toml(&augmented)?);
        let name = folder.display().to_string();
        std::fs::create_dir_all(folder).map_err(|source| Error::Write { file: name, source })?;
        write_whole(&folder.join("report.html"), html.as_bytes())?;
        write_whole(&folder.join("augmented.toml"), augmented.as_bytes())?;
        write_whole(&folder.join("report.json"), json.as_bytes())
    }
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
