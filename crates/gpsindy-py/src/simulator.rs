//! The user's own simulator behind the core's traits: a Python callable `f(t, x, u) -> dx`, or one that steps.

use crate::native::Native;
use crate::native::length::Length;
use crate::watch::{Watch, lock};
use gpsindy_core::{Dynamics, Error, Result, Rows, Steps};
use numpy::ndarray::IntoDimension;
use numpy::{PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// What a model keeps of a callable.
pub(crate) struct Simulator {
    pub(crate) function: Py<PyAny>,
    pub(crate) n_states: usize,
    pub(crate) n_controls: usize,
    pub(crate) kind: Kind,
}

/// How a callable is called.
#[derive(Clone)]
pub(crate) enum Kind {
    /// `f(t, x, u)` gives rates; of many samples at once, as rows, or of one.
    Rates { vectorized: bool },
    /// `step(x, u, force, parameters, dt)` gives the next states of many rows.
    /// With `several` it takes commands and forces of many samples and as its last argument the steps of each, and `dt` may be one a row.
    /// Native copies make the steps without the interpreter, unless so many that the callable may share them out.
    Steps { period: f64, n_forces: usize, parameters: Vec<f64>, several: bool, native: Option<Native> },
}

impl Kind {
    /// Threads that calls are worth; 0: one a processor. A simulator that steps is called for many rows at once, and what is
    /// computed from its derivatives takes as long as itself.
    pub(crate) fn threads(&self) -> usize {
        match self {
            Self::Rates { .. } => 1,
            Self::Steps { .. } => 0,
        }
    }
}

impl Simulator {
    pub(crate) fn clone_ref(&self, py: Python<'_>) -> Self {
        let Self { n_states, n_controls, .. } = *self;
        Self { function: self.function.clone_ref(py), n_states, n_controls, kind: self.kind.clone() }
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

    /// One step of many rows.
    fn step(&self, py: Python<'_>, rows: &Rows<'_>, dt: f64, next: &mut [f64]) -> PyResult<()> {
        let array = |values: &[f64]| table(py, values, [rows.count, values.len() / rows.count.max(1)]);
        let (x, u, force) = (array(rows.states)?, array(rows.commands)?, array(rows.forces)?);
        let answer = self.function.bind(py).call1((x, u, force, array(rows.parameters)?, dt))?;
        let array = answer.cast::<PyArray2<f64>>().ok().filter(|a| a.shape() == [rows.count, self.n_states]);
        let array = array.ok_or_else(|| self.wrong_step(&[rows.count, self.n_states], &answer))?.readonly();
        next.iter_mut().zip(array.as_array().iter()).for_each(|(to, from)| *to = *from);
        Ok(())
    }

    /// So many samples of so many steps.
    fn rollout(
        &self,
        py: Python<'_>,
        rows: &Rows<'_>,
        (dt, samples, count): (Length<'_>, usize, usize),
        next: &mut [f64],
    ) -> PyResult<()> {
        let array = |values: &[f64]| table(py, values, [rows.count, values.len() / rows.count.max(1)]);
        let of_samples =
            |values: &[f64]| table(py, values, [rows.count, samples, values.len() / (rows.count * samples).max(1)]);
        let dt = match dt {
            Length::Of(dt) => dt.into_pyobject(py)?.into_any(),
            Length::Each(dt) => PyArray1::from_slice(py, dt).into_any(),
        };
        let (x, u, force) = (array(rows.states)?, of_samples(rows.commands)?, of_samples(rows.forces)?);
        let answer = self.function.bind(py).call1((x, u, force, array(rows.parameters)?, dt, count))?;
        let shape = [rows.count, samples, self.n_states];
        let array = answer.cast::<PyArray3<f64>>().ok().filter(|a| a.shape() == shape);
        let array = array.ok_or_else(|| self.wrong_step(&shape, &answer))?.readonly();
        next.iter_mut().zip(array.as_array().iter()).for_each(|(to, from)| *to = *from);
        Ok(())
    }

    fn wrong_step(&self, shape: &[usize], answer: &Bound<'_, PyAny>) -> PyErr {
        let shape = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        PyValueError::new_err(format!(
            "simulator: step must return the next states as an array of floats of shape ({shape}), found {}",
            described(answer)
        ))
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

/// Numbers as an array of a shape.
fn table<'py, D: IntoDimension>(
    py: Python<'py>,
    values: &[f64],
    shape: D,
) -> PyResult<Bound<'py, PyArray<f64, D::Dim>>> {
    PyArray1::from_slice(py, values).reshape(shape)
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
        self.watched(|| Python::attach(work))
    }

    /// Work that is not begun once the computation was asked to stop, and whose failure stops it.
    fn watched(&self, work: impl FnOnce() -> PyResult<()>) -> Result<()> {
        if self.watch.stopped() {
            return Err(Error::Cancelled);
        }
        work().map_err(|failure| {
            self.watch.fail(failure);
            Error::Cancelled
        })
    }

    /// So many samples of so many steps, of a callable that takes several.
    fn several(&self, rows: &Rows<'_>, how: (Length<'_>, usize, usize), next: &mut [f64]) -> Result<()> {
        if let Kind::Steps { native: Some(native), .. } = &self.simulator.kind
            && !native.is_long(rows.count * how.1 * how.2)
        {
            return self.watched(|| native.step(rows, (&how.0, how.1, how.2), next));
        }
        self.call(|py| self.simulator.rollout(py, rows, how, next))
    }
}

impl Steps for Callable {
    fn period(&self) -> f64 {
        if let Kind::Steps { period, .. } = self.simulator.kind { period } else { f64::NAN }
    }

    fn n_forces(&self) -> usize {
        if let Kind::Steps { n_forces, .. } = self.simulator.kind { n_forces } else { 0 }
    }

    fn n_parameters(&self) -> usize {
        if let Kind::Steps { parameters, .. } = &self.simulator.kind { parameters.len() } else { 0 }
    }

    fn is_concurrent(&self) -> bool {
        matches!(self.simulator.kind, Kind::Steps { native: Some(_), .. })
    }

    fn step(&self, rows: &Rows<'_>, dt: f64, next: &mut [f64]) -> Result<()> {
        match self.simulator.kind {
            Kind::Steps { several: true, .. } => self.several(rows, (Length::Of(dt), 1, 1), next),
            _ => self.call(|py| self.simulator.step(py, rows, dt, next)),
        }
    }

    fn rollout(&self, rows: &Rows<'_>, (samples, count): (usize, usize), next: &mut [f64]) -> Result<()> {
        let Kind::Steps { period, several: true, .. } = self.simulator.kind else {
            return self.one_by_one(rows, (samples, count), next);
        };
        self.several(rows, (Length::Of(period), samples, count), next)
    }

    fn unequal_steps(&self, rows: &Rows<'_>, dt: &[f64], next: &mut [f64]) -> Result<()> {
        match self.simulator.kind {
            Kind::Steps { several: true, .. } => self.several(rows, (Length::Each(dt), 1, 1), next),
            _ => self.by_length(rows, dt, next),
        }
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
        match &self.simulator.kind {
            Kind::Rates { vectorized: true } => self.call(|py| self.simulator.many(py, &[t], x, u, dx)),
            Kind::Rates { vectorized: false } => self.call(|py| self.simulator.one(py, t, x, u, dx)),
            Kind::Steps { period, n_forces, parameters, .. } => {
                let forces = vec![0.0; *n_forces];
                let rows = Rows { count: 1, states: x, commands: u, forces: &forces, parameters };
                self.step(&rows, *period, dx)?;
                dx.iter_mut().zip(x).for_each(|(next, x)| *next = (*next - x) / period);
                Ok(())
            }
        }
    }

    fn steps(&self) -> Option<&dyn Steps> {
        matches!(self.simulator.kind, Kind::Steps { .. }).then_some(self)
    }

    fn derivatives(&self, t: &[f64], x: &[f64], u: &[f64], dx: &mut [f64]) -> Result<()> {
        let (n, m) = (self.simulator.n_states, self.simulator.n_controls);
        match self.simulator.kind {
            Kind::Rates { vectorized: true } => self.call(|py| self.simulator.many(py, t, x, u, dx)),
            Kind::Rates { vectorized: false } => self.call(|py| {
                for (i, &t) in t.iter().enumerate() {
                    let rows = (&x[i * n..(i + 1) * n], &u[i * m..(i + 1) * m]);
                    self.simulator.one(py, t, rows.0, rows.1, &mut dx[i * n..(i + 1) * n])?;
                }
                Ok(())
            }),
            Kind::Steps { .. } => {
                for (i, &t) in t.iter().enumerate() {
                    let (x, u) = (&x[i * n..(i + 1) * n], &u[i * m..(i + 1) * m]);
                    self.derivative(t, x, u, &mut dx[i * n..(i + 1) * n])?;
                }
                Ok(())
            }
        }
    }
}
