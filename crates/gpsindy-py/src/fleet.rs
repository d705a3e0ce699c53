//! A fleet, task by task: engines that spread tasks over processes are Python's.

use crate::convert::file_error;
use crate::diagnose::Options;
use crate::watch::Watch;
use gpsindy_core::Error;
use gpsindy_files::LogOptions;
use gpsindy_fleet::{Attempt, Fleet, Folder, Manifest, Store, Task, compare};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A place of files that Python keeps: an object with `read`, `has`, `write`, `remove` and `place`.
struct Kept(Py<PyAny>);

impl Kept {
    fn ask<T>(&self, name: &str, of: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> gpsindy_files::Result<T> {
        Python::attach(|py| of(self.0.bind(py)).map_err(|e| Error::file(format!("{name}: {e}")).into()))
    }
}

impl Store for Kept {
    fn read(&self, name: &str) -> gpsindy_files::Result<Option<Vec<u8>>> {
        self.ask(name, |store| store.call_method1("read", (name,))?.extract())
    }

    fn has(&self, name: &str) -> gpsindy_files::Result<bool> {
        self.ask(name, |store| store.call_method1("has", (name,))?.extract())
    }

    fn write(&self, name: &str, content: &[u8]) -> gpsindy_files::Result<()> {
        self.ask(name, |store| store.call_method1("write", (name, content)).map(drop))
    }

    fn remove(&self, name: &str) -> gpsindy_files::Result<()> {
        self.ask(name, |store| store.call_method1("remove", (name,)).map(drop))
    }

    fn place(&self, name: &str) -> String {
        self.ask(name, |store| store.call_method1("place", (name,))?.extract()).unwrap_or_else(|_| name.into())
    }
}

/// A folder's path, or an object that keeps files.
#[derive(FromPyObject)]
pub(crate) enum Place {
    Folder(PathBuf),
    Object(Py<PyAny>),
}

impl Place {
    fn store(self) -> Box<dyn Store + Send> {
        match self {
            Self::Folder(path) => Box::new(Folder::new(path)),
            Self::Object(object) => Box::new(Kept(object)),
        }
    }
}

/// The units and periods of a fleet.
#[pyclass(frozen, module = "gpsindy._gpsindy")]
pub(crate) struct FleetManifest(Manifest);

#[pymethods]
impl FleetManifest {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        Ok(Self(Manifest::read(&path).map_err(file_error)?))
    }

    /// Every task as a text, for `fleet_task` in any process.
    fn tasks(&self) -> PyResult<Vec<String>> {
        let text = |task| serde_json::to_string(task).map_err(|e| PyValueError::new_err(format!("task: {e}")));
        self.0.tasks.iter().map(text).collect()
    }

    /// Compares the reports of the tasks, given the key or the error of each, and writes `fleet.json` and `fleet.html`; the JSON.
    fn compare(
        &self,
        py: Python<'_>,
        results: Vec<(Option<String>, Option<String>)>,
        place: Place,
    ) -> PyResult<String> {
        let attempt = |result| match result {
            (Some(key), _) => Attempt::Found(key),
            (None, Some(error)) => Attempt::Failed(error),
            (None, None) => Attempt::Missing,
        };
        let attempts: Vec<Attempt> = results.into_iter().map(attempt).collect();
        let store = place.store();
        let report = py.detach(|| compare(&self.0, &attempts, store.as_ref())).map_err(file_error)?;
        serde_json::to_string_pretty(&report).map_err(|e| PyValueError::new_err(format!("fleet.json: {e}")))
    }
}

/// Does one task on so many threads, or on all; (key of its report, why it failed), one of them absent.
#[pyfunction]
pub(crate) fn fleet_task(
    py: Python<'_>,
    task: &str,
    place: Place,
    options: Options,
    time: Option<String>,
    run: Option<String>,
    threads: Option<usize>,
) -> PyResult<(Option<String>, Option<String>)> {
    let task: Task = serde_json::from_str(task).map_err(|e| PyValueError::new_err(format!("task: {e}")))?;
    let options = (options.settings()?, LogOptions { time, run, ..LogOptions::default() });
    let fleet = Fleet { diagnose: options.0, options: options.1, jobs: None, shard: None };
    let store = place.store();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = threads.map(pool).transpose();
    let pool = pool.map_err(|e| PyRuntimeError::new_err(format!("no thread for the task: {e}")))?;
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let attempt = move || {
        fleet.attempt(&task, store.as_ref(), listening.as_ref()).map_err(|error| match error {
            gpsindy_files::Error::Core(error) => error,
            other => Error::file(other.to_string()),
        })
    };
    let work = move || match &pool {
        Some(pool) => pool.install(attempt),
        None => attempt(),
    };
    Ok(match watch.run(py, None, work)? {
        Attempt::Done(key) | Attempt::Found(key) => (Some(key), None),
        Attempt::Failed(error) => (None, Some(error)),
        Attempt::Missing => (None, None),
    })
}
