//! The compiled part of the Python package `gpsindy`, private to it: converts and names only.
//!
//! What a user sees, with types and documentation, is the Python package in `python/gpsindy`.

mod author;
mod command;
mod convert;
mod dataset;
mod design;
mod diagnose;
mod fleet;
mod identify;
mod model;
mod native;
mod online;
mod rollout;
mod score;
mod simulator;
mod smooth;
mod stepper;
mod watch;

use pyo3::prelude::*;

/// The compiled part of gpsindy.
#[pymodule(gil_used = false)]
mod _gpsindy {
    use super::PyResult;
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::author::author;
    #[pymodule_export]
    use super::command::command;
    #[pymodule_export]
    use super::convert::NumericalError;
    #[pymodule_export]
    use super::dataset::{PyDataset, PyLogOptions, inspect, parse_header};
    #[pymodule_export]
    use super::design::{PyOpen, design};
    #[pymodule_export]
    use super::diagnose::{
        augmented_toml, diagnose, diagnose_paired, effects, read_effects, render, report_json, summary, write_report,
        write_whole,
    };
    #[pymodule_export]
    use super::fleet::{FleetManifest, fleet_task};
    #[pymodule_export]
    use super::identify::identify;
    #[pymodule_export]
    use super::model::PyModel;
    #[pymodule_export]
    use super::native::fmu::PyFmuCopies;
    #[pymodule_export]
    use super::native::mujoco::PyMujocoCopies;
    #[pymodule_export]
    use super::online::PyOnline;
    #[pymodule_export]
    use super::score::score;
    #[pymodule_export]
    use super::smooth::smooth;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
