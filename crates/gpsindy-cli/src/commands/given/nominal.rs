//! The simulator that a command is given: equations, or the file of an engine.

use crate::commands::Session;
use crate::engine::{Corrected, Engine, FileKind, Setup};
use crate::failure::{Failure, Outcome};
use gpsindy_core::diagnose::{Diagnosed, Part};
use gpsindy_core::{Dynamics, Model, System};
use gpsindy_files::read_model;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// A simulator with its names.
pub(crate) struct Nominal {
    pub(crate) model: Model,
    engine: Option<Box<dyn Engine>>,
}

impl Nominal {
    pub(crate) fn open(path: &Path, setup: &Setup, session: &Session<'_>) -> Outcome<Self> {
        let kind = kind(path);
        if kind.is_none() && !path.exists() {
            // A file that is missing is none of the wrong kind.
            return Ok(Self { model: read_model(path)?, engine: None });
        }
        let of_mujoco = !setup.drivers.is_empty() || setup.base.is_some() || !setup.locks.is_empty();
        if of_mujoco && kind != Some(FileKind::MuJoCo) {
            return Err(Failure::input(format!(
                "{}: --driver, --base and --lock are for MuJoCo models; write a driver's loop into the equations",
                path.display()
            )));
        }
        if !setup.forces.is_empty() && kind != Some(FileKind::Fmu) {
            return Err(Failure::input(format!(
                "{}: --force-input is for FMUs; effects act on every joint of a MuJoCo model and in every equation without it",
                path.display()
            )));
        }
        let Some(kind) = kind else { return Ok(Self { model: read_model(path)?, engine: None }) };
        let engine = session.engines.open(kind, path, setup);
        let engine = engine.map_err(|why| Failure::input(format!("{}: {why}", path.display())))?;
        Ok(Self { model: engine.model().clone(), engine: Some(engine) })
    }

    /// Its joints and actuators, where it is an engine's.
    pub(crate) fn parts(&self) -> Outcome<Vec<Part>> {
        self.engine.as_ref().map_or(Ok(Vec::new()), |engine| engine.parts().map_err(Failure::Work))
    }

    /// Its steps, where it is an engine's.
    pub(crate) fn dynamics(&self) -> Option<Arc<dyn Dynamics>> {
        self.engine.as_ref().map(|engine| engine.dynamics())
    }

    /// Compiled, with the names and values of `model`.
    pub(crate) fn system(&self, model: &Model) -> Outcome<System> {
        Ok(System::with_simulator(model, self.dynamics())?)
    }

    /// Does `work`, which steps the simulator; the simulator's own error goes before what followed from it.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce() -> Outcome<T> + Send) -> Outcome<T> {
        let Some(engine) = &self.engine else { return work() };
        let mut done = None;
        engine.within(Box::new(|| done = Some(work())));
        match (engine.failure(), done) {
            (Some(failure), _) => Err(Failure::Work(failure)),
            (None, Some(done)) => done,
            (None, None) => Err(Failure::Work("the simulator's thread ended before its work".into())),
        }
    }

    /// The engine's own file with the corrections in it; nothing where the simulator is equations.
    pub(crate) fn corrected(&self, model: &Model, folder: &Path) -> Option<Result<Corrected, String>> {
        self.engine.as_ref().map(|engine| engine.corrected(model, folder))
    }

    /// Further files of its diagnosis.
    pub(crate) fn beside(&self, diagnosed: &Diagnosed) -> Outcome<Vec<(String, String)>> {
        let files = self.engine.as_ref().map(|engine| engine.beside(diagnosed));
        files.unwrap_or_else(|| Ok(Vec::new())).map_err(Failure::Work)
    }
}

/// Kind of an engine's file; none where the file can't be read, which reading it as equations says best.
pub(crate) fn kind(path: &Path) -> Option<FileKind> {
    if path.as_os_str() == "-" {
        return None;
    }
    let mut start = Vec::new();
    std::fs::File::open(path).ok()?.take(1024).read_to_end(&mut start).ok()?;
    FileKind::of(&start)
}
