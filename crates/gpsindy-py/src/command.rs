//! The command line, with the simulators of the Python package as its engines.

use crate::diagnose::findings;
use crate::diagnose::{PartParts, part};
use crate::model::PyModel;
use crate::simulator::Kind;
use crate::watch::{Watch, calling_pool};
use gpsindy_cli::{Corrected, Driver, Engine, Engines, FileKind, Force, Lock, Setup};
use gpsindy_core::diagnose::{Diagnosed, Part};
use gpsindy_core::{Dynamics, Model};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;

/// Runs a command line, the program's name first, and gives its exit status.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, line: Vec<OsString>) -> u8 {
    py.detach(|| gpsindy_cli::run(line, &InPython))
}

/// The package's own modules `gpsindy.mujoco` and `gpsindy.fmu`.
struct InPython;

impl Engines for InPython {
    fn open(&self, kind: FileKind, path: &Path, setup: &Setup) -> Result<Box<dyn Engine>, String> {
        let (what, module) = kind.words();
        let open = |py: Python<'_>| -> PyResult<Simulator> {
            let own = py.import(format!("gpsindy.{module}"))?;
            let given = PyDict::new(py);
            if !setup.drivers.is_empty() {
                let drivers = PyDict::new(py);
                for Driver { actuator, values: [kp, kd, delay], guessed } in &setup.drivers {
                    let names = ["kp", "kd", "delay"].into_iter().zip(guessed);
                    let find: Vec<&str> = names.filter(|(_, guessed)| **guessed).map(|(name, _)| name).collect();
                    drivers.set_item(actuator, own.getattr("Driver")?.call1((kp, kd, delay, find))?)?;
                }
                given.set_item("drivers", drivers)?;
            }
            if let Some(base) = setup.base {
                given.set_item("base", base.as_str())?;
            }
            if !setup.locks.is_empty() {
                let locked = PyDict::new(py);
                for Lock { joint, position } in &setup.locks {
                    locked.set_item(joint, position)?;
                }
                given.set_item("locked", locked)?;
            }
            if !setup.forces.is_empty() {
                let (forces, kinematic) = (PyDict::new(py), PyDict::new(py));
                for Force { input, rate, position } in &setup.forces {
                    match position {
                        Some(position) => {
                            forces.set_item(input, (rate, position))?;
                            kinematic.set_item(position, rate)?;
                        }
                        None => forces.set_item(input, rate)?,
                    }
                }
                given.set_item("forces", forces)?;
                given.set_item("kinematic", kinematic)?;
            }
            let simulator = own.getattr("Simulator")?.call((path,), Some(&given))?;
            let nominal = simulator.getattr("model")?.getattr("_inner")?.cast_into::<PyModel>()?.unbind();
            let watch = Arc::new(Watch::default());
            let dynamics = nominal.get().dynamics(py, &watch);
            let dynamics = dynamics.ok_or_else(|| pyo3::exceptions::PyTypeError::new_err("it does not step"))?;
            Ok(Simulator { nominal, dynamics, watch, source: simulator.unbind() })
        };
        let opened = Python::attach(|py| open(py).map_err(|error| message(py, &error)));
        opened.map(|simulator| Box::new(simulator) as Box<dyn Engine>).map_err(|why| format!("{what}: {why}"))
    }
}

/// One of the package's simulators.
struct Simulator {
    nominal: Py<PyModel>,
    dynamics: Arc<dyn Dynamics>,
    /// Keeps what the simulator raised.
    watch: Arc<Watch>,
    source: Py<PyAny>,
}

impl Engine for Simulator {
    fn model(&self) -> &Model {
        &self.nominal.get().model
    }

    fn parts(&self) -> Result<Vec<Part>, String> {
        let read = |py: Python<'_>| -> PyResult<Vec<Part>> {
            let Some(parts) = self.source.bind(py).getattr_opt("_parts")? else { return Ok(Vec::new()) };
            parts.call0()?.extract::<Vec<PartParts>>()?.into_iter().map(part).collect()
        };
        Python::attach(|py| read(py).map_err(|error| message(py, &error)))
    }

    fn dynamics(&self) -> Arc<dyn Dynamics> {
        Arc::clone(&self.dynamics)
    }

    fn within(&self, work: Box<dyn FnOnce() + Send + '_>) {
        let kind = self.nominal.get().simulator.as_ref().map(|s| &s.kind);
        match calling_pool(kind.map_or(1, Kind::threads)) {
            Ok(pool) => pool.install(work),
            // Slower, and the same numbers.
            Err(_) => work(),
        }
    }

    fn failure(&self) -> Option<String> {
        let failure = self.watch.failure()?;
        Some(Python::attach(|py| message(py, &failure)))
    }

    fn corrected(&self, model: &Model, folder: &Path) -> Result<Corrected, String> {
        let correct = |py: Python<'_>| -> PyResult<Corrected> {
            let simulator = self.nominal.get().simulator.as_ref().map(|s| s.clone_ref(py));
            let inner = Bound::new(py, PyModel { model: model.clone(), simulator })?;
            let file = self.source.bind(py).call_method1("_corrected_file", (inner, folder))?;
            let (name, text, difference) = file.extract()?;
            Ok(Corrected { name, text, difference })
        };
        Python::attach(|py| correct(py).map_err(|error| message(py, &error)))
    }

    fn beside(&self, diagnosed: &Diagnosed) -> Result<Vec<(String, String)>, String> {
        let write = |py: Python<'_>| -> PyResult<Vec<(String, String)>> {
            let nominal = self.nominal.get();
            let around =
                |model: Model| PyModel { model, simulator: nominal.simulator.as_ref().map(|s| s.clone_ref(py)) };
            let (report, nominal, augmented, without, open) =
                findings(diagnosed.clone(), nominal.model.clone(), around)?;
            let made = py.import("gpsindy.diagnosing")?.getattr("_diagnosis")?;
            let found = made.call1((report, (nominal, augmented, without), open, self.source.bind(py)))?;
            found.call_method0("_beside")?.extract()
        };
        Python::attach(|py| write(py).map_err(|error| message(py, &error)))
    }
}

/// What an exception says; with its type where that says more, as of a KeyError.
fn message(py: Python<'_>, error: &PyErr) -> String {
    use pyo3::exceptions::{PyImportError, PyOSError, PyValueError};
    let plain = error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<PyImportError>(py)
        || error.is_instance_of::<PyOSError>(py);
    if plain { error.value(py).to_string() } else { error.to_string() }
}
