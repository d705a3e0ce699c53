//! FMUs: fmpy unpacks and instantiates them, their steps are made here, by their C functions.

mod co_simulation;
mod component;
mod copies;
mod exchange;
mod failure;
mod instance;
mod unit;

use crate::convert::Matrix;
use crate::native::rows::{Lengths, step};
pub(crate) use copies::Copies;
use numpy::{PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use unit::References;

/// Copies of an FMU, as Python makes and calls them.
#[pyclass(frozen, name = "FmuCopies", module = "gpsindy._gpsindy")]
pub(crate) struct PyFmuCopies(pub(crate) Arc<Copies>);

#[pymethods]
impl PyFmuCopies {
    /// `instantiate` makes an instance of fmpy, of FMI 2 where `two`; as model exchange with `indicators`, the number of its events',
    /// else as co-simulation.
    #[new]
    fn new(instantiate: Py<PyAny>, name: String, two: bool, references: References, indicators: Option<usize>) -> Self {
        let (references, cost) = (Arc::new(references), AtomicU64::new(f64::NAN.to_bits()));
        Self(Arc::new(Copies { instantiate, name, two, references, indicators, cost, kept: Default::default() }))
    }

    /// What a step takes at least, s; NaN before the first.
    #[getter]
    fn cost(&self) -> f64 {
        f64::from_bits(self.0.cost.load(Ordering::Relaxed))
    }

    #[setter]
    fn set_cost(&self, seconds: f64) {
        self.0.cost.store(seconds.to_bits(), Ordering::Relaxed);
    }

    /// Whether so many steps are worth processes.
    fn is_long(&self, steps: usize) -> bool {
        self.0.is_long(steps)
    }

    /// States (n, samples, n_states) after samples of `count` steps of `dt` s, of all rows or of each (n,), from `x` (n, n_states); `u` and
    /// `force` (n, samples, ...) are held within a sample, `parameters` (n, n_parameters) are each row's own.
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
