//! Rollouts as Python asks for them: their settings by name, their tables, and one of every run of a dataset.

use crate::convert::{array2, error};
use gpsindy_core::{Channel, Error, Excitation, Hold, Method, Result, Rollout, Run, Simulate, StateReader, System};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// States and what the logs' columns read of them, of one rollout.
pub(crate) type Arrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// The same of one run, with its name and times before it.
pub(crate) type NamedArrays<'py> = (String, Vec<f64>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Hold, method, tolerance.
pub(crate) type How = (String, String, f64);

/// A rollout of a run, over the samples of the span (s); `initial` (name and value) overrides the log's start.
pub(crate) fn of_run(
    settings: &Simulate,
    system: &System,
    (run, channels): (&Run, &[Channel]),
    initial: &[(String, f64)],
    (start, stop): (Option<f64>, Option<f64>),
) -> Result<Rollout> {
    let excitation = Excitation::of_run(system, run, channels, settings.hold)?;
    let first = start.map_or(0, |start| run.time.partition_point(|t| *t < start));
    let end = stop.map_or(run.n_samples(), |stop| run.time.partition_point(|t| *t <= stop));
    if first >= end {
        let lasts = format!("{} to {} s", run.time[0], run.time[run.n_samples() - 1]);
        let message = format!("run `{}`: no sample between `start` and `stop`; it lasts from {lasts}", run.name);
        return Err(Error::model(message));
    }
    let mut state = StateReader::new(system, run, channels, &excitation)?.at(first)?;
    for (name, value) in initial {
        if let Some(index) = system.model().state_index(name) {
            state[index] = *value;
        }
    }
    settings.rollout_range(system, &excitation, &state, first..end)
}

/// What a control does between its samples, by name.
pub(crate) fn hold_of(text: &str) -> PyResult<Hold> {
    match text {
        "zero" => Ok(Hold::Zero),
        "linear" => Ok(Hold::Linear),
        other => Err(error(Error::range("hold", "\"zero\" or \"linear\"", format!("{other:?}")))),
    }
}

/// What a controller says.
pub(crate) fn said(py: Python<'_>, controller: &Py<PyAny>, time: f64, y: &[f64], u: &mut [f64]) -> PyResult<()> {
    let answer = controller.bind(py).call1((time, numpy::PyArray1::from_slice(py, y)))?;
    let values: Vec<f64> =
        answer.extract().or_else(|_| answer.extract::<f64>().map(|one| vec![one])).map_err(|_| {
            PyValueError::new_err(format!("controller: expected {} numbers, found {}", u.len(), answer.get_type()))
        })?;
    if values.len() != u.len() {
        return Err(PyValueError::new_err(format!("controller: expected {} numbers, found {}", u.len(), values.len())));
    }
    u.copy_from_slice(&values);
    Ok(())
}

/// The settings of a rollout, by name.
pub(crate) fn settings((hold, method, tolerance): &How) -> PyResult<Simulate> {
    let method = match method.as_str() {
        "auto" => Method::DormandPrince,
        "rosenbrock" => Method::Rosenbrock,
        "rk4" => Method::RungeKutta4 { substeps: 1 },
        "euler" => Method::Euler { substeps: 1 },
        other => {
            let known = "\"auto\", \"rosenbrock\", \"rk4\" or \"euler\"";
            return Err(error(Error::range("method", known, format!("{other:?}"))));
        }
    };
    Ok(Simulate { hold: hold_of(hold)?, method, tolerance: *tolerance, ..Simulate::default() })
}

pub(crate) fn arrays<'py>(py: Python<'py>, rollout: &Rollout) -> Arrays<'py> {
    (array2(py, &rollout.states), array2(py, &rollout.outputs))
}
