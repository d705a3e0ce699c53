//! The user's own simulator: a Python callable `f(t, x, u) -> dx` behind the core's trait.

use crate::watch::{Watch, lock};
use gpsindy_core::{Dynamics, Error, Result};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// One use of a callable: its first error goes to the watch, which also stops it.
pub(crate) struct Callable {
    pub(crate) function: Py<PyAny>,
    pub(crate) n_states: usize,
    pub(crate) n_controls: usize,
    pub(crate) watch: Arc<Watch>,
    /// Taken before the interpreter: simulators keep state of their own and are called by one thread at a time.
    pub(crate) turn: Mutex<()>,
}

impl Callable {
    fn call(&self, py: Python<'_>, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> PyResult<()> {
        let arguments = (t, PyArray1::from_slice(py, x), PyArray1::from_slice(py, u));
        let answer = self.function.bind(py).call1(arguments)?;
        let rates = match answer.cast::<PyArray1<f64>>() {
            Ok(array) => array.readonly().as_array().to_vec(),
            Err(_) => answer.extract::<Vec<f64>>().map_err(|_| self.wrong(&format!("{}", answer.get_type())))?,
        };
        if rates.len() != dx.len() {
            return Err(self.wrong(&format!("{} numbers", rates.len())));
        }
        dx.copy_from_slice(&rates);
        Ok(())
    }

    fn wrong(&self, found: &str) -> PyErr {
        PyValueError::new_err(format!(
            "simulator: f(t, x, u) must return the {} rates of the states as a 1-D array of floats, found {found}",
            self.n_states
        ))
    }
}

impl Dynamics for Callable {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_controls(&self) -> usize {
        self.n_controls
    }

    fn derivative(&self, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        let _turn = lock(&self.turn);
        if self.watch.stopped() {
            return Err(Error::Cancelled);
        }
        Python::attach(|py| self.call(py, t, x, u, dx)).map_err(|failure| {
            self.watch.fail(failure);
            Error::Cancelled
        })
    }
}
