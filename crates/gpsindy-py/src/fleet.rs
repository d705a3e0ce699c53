//! A fleet, task by task: engines that spread tasks over processes are Python's.

use crate::convert::file_error;
use crate::diagnose::Options;
use crate::watch::Watch;
use gpsindy_core::Error;
use gpsindy_files::LogOptions;
use gpsindy_fleet::{Attempt, Fleet, Manifest, compare};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

fn fleet(options: Options, time: Option<String>, run: Option<String>) -> PyResult<Fleet> {
    let options = (options.settings()?, LogOptions { time, run, ..LogOptions::default() });
    Ok(Fleet { diagnose: options.0, options: options.1, jobs: None, shard: None })
}

/// (unit, since) of every task of a manifest.
#[pyfunction]
pub(crate) fn fleet_tasks(manifest: PathBuf) -> PyResult<Vec<(String, Option<String>)>> {
    let manifest = Manifest::read(&manifest).map_err(file_error)?;
    Ok(manifest.tasks.into_iter().map(|task| (task.unit, task.since)).collect())
}

/// Does one task; (whether it was done now, why it failed).
#[pyfunction]
pub(crate) fn fleet_task(
    py: Python<'_>,
    manifest: PathBuf,
    out: PathBuf,
    index: usize,
    options: Options,
    time: Option<String>,
    run: Option<String>,
) -> PyResult<(bool, Option<String>)> {
    let fleet = fleet(options, time, run)?;
    let manifest = Manifest::read(&manifest).map_err(file_error)?;
    let Some(task) = manifest.tasks.into_iter().nth(index) else {
        return Err(PyIndexError::new_err(format!("the manifest has no task {index}")));
    };
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let work = move || {
        fleet.attempt(&task, &out, listening.as_ref()).map_err(|error| match error {
            gpsindy_files::Error::Core(error) => error,
            other => Error::file(other.to_string()),
        })
    };
    Ok(match watch.run(py, None, work)? {
        Attempt::Done => (true, None),
        Attempt::Found => (false, None),
        Attempt::Failed(error) => (false, Some(error)),
    })
}

/// Compares the reports that are there and writes `fleet.json` and `fleet.html`; the JSON.
#[pyfunction]
pub(crate) fn fleet_compare(
    py: Python<'_>,
    manifest: PathBuf,
    out: PathBuf,
    options: Options,
    time: Option<String>,
    run: Option<String>,
) -> PyResult<String> {
    let fleet = fleet(options, time, run)?;
    let report = py.detach(|| {
        let manifest = Manifest::read(&manifest)?;
        compare(&manifest, &fleet, &out)
    });
    let report = report.map_err(file_error)?;
    serde_json::to_string_pretty(&report).map_err(|e| PyValueError::new_err(format!("fleet.json: {e}")))
}
