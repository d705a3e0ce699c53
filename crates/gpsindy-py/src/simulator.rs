//! The user's own simulator: a Python callable `f(t, x, u) -> dx` behind the core's trait.

use crate::watch::{Watch, lock};
use gpsindy_core::{Dynamics, Error, Result};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// What a model keeps of a callable.
pub(crate) struct Simulator {
    pub(crate) function: Py<PyAny>,
    pub(crate) n_states: usize,
    pub(crate) n_controls: usize,
    /// It takes many samples at once, as rows.
    pub(crate) vectorized: bool,
}

impl Simulator {
    pub(crate) fn clone_ref(&self, py: Python<'_>) -> Self {
        Self { function: self.function.clone_ref(py), ..*self }
    }

    /// For one computation, whose errors go to `watch`.
    pub(crate) fn watched(&self, py: Python<'_>, watch: &Arc<Watch>) -> Arc<dyn Dynamics> {
        Arc::new(Callable { simulator: self.clone_ref(py), watch: watch.clone(), turn: Mutex::new(()) })
    }

    fn one(&self, py: Python<'_>, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> PyResult<()> {
        let arguments = (t, PyArray1::from_slice(py, x), PyArray1::from_slice(py, u));
        let answer = self.function.bind(py).call1(arguments)?;
        let rates = match answer.cast::<PyArray1<f64>>() {
            Ok(array) => array.readonly().as_array().to_vec(),
            // Complex numbers would lose a part on the way.
            Err(_) if is_complex(&answer) => return Err(self.wrong(&described(&answer))),
            Err(_) => answer.extract::<Vec<f64>>().map_err(|_| self.wrong(&described(&answer)))?,
        };
        if rates.len() != dx.len() {
            return Err(self.wrong(&format!("{} numbers", rates.len())));
        }
        dx.copy_from_slice(&rates);
        Ok(())
    }

    fn many(&self, py: Python<'_>, t: &[f64], x: &[f64], u: &[f64], dx: &mut [f64]) -> PyResult<()> {
        let rows = t.len();
        let states = PyArray1::from_slice(py, x).reshape([rows, self.n_states])?;
        let controls = PyArray1::from_slice(py, u).reshape([rows, self.n_controls])?;
        let answer = self.function.bind(py).call1((PyArray1::from_slice(py, t), states, controls))?;
        let Ok(array) = answer.cast::<PyArray2<f64>>() else {
            return Err(self.wrong_rows(rows, &described(&answer)));
        };
        if array.shape() != [rows, self.n_states] {
            return Err(self.wrong_rows(rows, &described(&answer)));
        }
        let array = array.readonly();
        dx.iter_mut().zip(array.as_array().iter()).for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn wrong(&self, found: &str) -> PyErr {
        PyValueError::new_err(format!(
            "simulator: f(t, x, u) must return the {} rates of the states as a 1-D array of floats, found {found}",
            self.n_states
        ))
    }

    fn wrong_rows(&self, rows: usize, found: &str) -> PyErr {
        PyValueError::new_err(format!(
            "simulator: with vectorized=True f(t, x, u) must return rates of shape (n, {states}) for t of shape (n,), x of shape \
             (n, {states}) and u of shape (n, {controls}), as an array of floats; for n = {rows} found {found}",
            states = self.n_states,
            controls = self.n_controls,
        ))
    }
}

fn is_complex(answer: &Bound<'_, PyAny>) -> bool {
    let kind = answer.getattr("dtype").and_then(|dtype| dtype.getattr("kind")?.extract::<String>());
    kind.is_ok_and(|kind| kind == "c")
}

/// Shape and type of an array, else the type.
fn described(answer: &Bound<'_, PyAny>) -> String {
    let read = |name: &str| answer.getattr(name).ok().map(|v| v.to_string());
    match (read("shape"), read("dtype")) {
        (Some(shape), Some(dtype)) => format!("shape {shape} of {dtype}"),
        _ => format!("{}", answer.get_type()),
    }
}

/// One use of a callable: its first error goes to the watch, which also stops it.
struct Callable {
    simulator: Simulator,
    watch: Arc<Watch>,
    /// Taken before the interpreter: simulators keep state of their own and are called by one thread at a time.
    turn: Mutex<()>,
}

impl Callable {
    fn call(&self, work: impl FnOnce(Python<'_>) -> PyResult<()>) -> Result<()> {
        let _turn = lock(&self.turn);
        if self.watch.stopped() {
            return Err(Error::Cancelled);
        }
        Python::attach(work).map_err(|failure| {
            self.watch.fail(failure);
            Error::Cancelled
        })
    }
}

impl Dynamics for Callable {
    fn n_states(&self) -> usize {
        self.simulator.n_states
    }

    fn n_controls(&self) -> usize {
        self.simulator.n_controls
    }

    fn derivative(&self, t: f64, x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        match self.simulator.vectorized {
            true => self.call(|py| self.simulator.many(py, &[t], x, u, dx)),
            false => self.call(|py| self.simulator.one(py, t, x, u, dx)),
        }
    }

    fn derivatives(&self, t: &[f64], x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        if self.simulator.vectorized {
            return self.call(|py| self.simulator.many(py, t, x, u, dx));
        }
        let (n, m) = (self.simulator.n_states, self.simulator.n_controls);
        self.call(|py| {
            for (i, &t) in t.iter().enumerate() {
                let rows = (&x[i * n..(i + 1) * n], &u[i * m..(i + 1) * m]);
                self.simulator.one(py, t, rows.0, rows.1, &mut dx[i * n..(i + 1) * n])?;
            }
            Ok(())
        })
    }
}
