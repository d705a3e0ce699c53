//! MuJoCo models: the package loads and changes them, their steps are made here, by the C functions of its batches.

mod batch;
mod copies;
mod plan;
mod simulations;

use crate::convert::Matrix;
use crate::native::rows::{Lengths, step};
use batch::Library;
pub(crate) use copies::Copies;
use numpy::{PyArray3, PyReadonlyArray3};
use plan::Plan;
use pyo3::prelude::*;
use std::sync::Arc;

/// Copies of a MuJoCo model, as Python makes and calls them.
#[pyclass(frozen, name = "MujocoCopies", module = "gpsindy._gpsindy")]
pub(crate) struct PyMujocoCopies(pub(crate) Arc<Copies>);

#[pymethods]
impl PyMujocoCopies {
    /// Of the `MjModel` at an `address`, by the functions of a `library` of ctypes.
    #[new]
    fn new(model: Py<PyAny>, address: usize, library: &Bound<'_, PyAny>, plan: Plan, threads: usize) -> PyResult<Self> {
        Copies::new(model, address, plan, Library::of(library)?, threads).map(|copies| Self(Arc::new(copies)))
    }

    /// As [`PyFmuCopies::step`](crate::native::fmu::PyFmuCopies).
    #[expect(clippy::too_many_arguments, reason = "those of a simulator that steps")]
    #[pyo3(signature = (x, u, force, parameters, dt, count = 1))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
        u: PyReadonlyArray3<'py, f64>,
        force: PyReadonlyArray3<'py, f64>,
        parameters: Matrix<'py>,
        dt: Lengths<'py>,
        count: usize,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        step(py, (x, u, force, parameters), (dt, count), |rows, how, next| self.0.step(rows, how, next))
    }
}
