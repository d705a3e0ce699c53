//! The next experiment: a control signal that distinguishes what a diagnosis left open.

use crate::convert::{array1, rows};
use crate::model::PyModel;
use crate::watch::Watch;
use gpsindy_core::diagnose::{Candidate, Design, Open};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Arc;

/// What a diagnosis left open.
#[pyclass(frozen, name = "Open", module = "gpsindy._gpsindy")]
pub(crate) struct PyOpen(pub(crate) Open);

#[pymethods]
impl PyOpen {
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        let open = serde_json::from_str(text);
        open.map(Self).map_err(|e| PyValueError::new_err(format!("open.json: {e}; diagnose again")))
    }

    /// The file open.json; only of models that are equations.
    fn to_json(&self) -> PyResult<String> {
        let text = serde_json::to_string(&self.0).map_err(|e| PyValueError::new_err(format!("open.json: {e}")))?;
        Ok(text + "\n")
    }

    /// Labels of the simulators that may be right.
    #[getter]
    fn labels(&self) -> Vec<String> {
        self.0.candidates.iter().map(|c| c.label.clone()).collect()
    }

    /// (one, other) of every pair that the logs left open.
    #[getter]
    fn pairs(&self) -> Vec<(String, String)> {
        let label = |candidate: usize| self.0.candidates[candidate].label.clone();
        self.0.pairs.iter().map(|&(one, other)| (label(one), label(other))).collect()
    }

    /// Names, values and covariance of the parameters that the logs know up to an error, of the account that was taken.
    #[getter]
    fn sizes(&self) -> (Vec<String>, Vec<f64>, Vec<Vec<f64>>) {
        let Candidate { model, parameters, covariance, .. } = &self.0.candidates[0];
        let value = |name: &String| model.parameter_index(name).map_or(f64::NAN, |i| model.parameters[i].value);
        (parameters.clone(), parameters.iter().map(value).collect(), covariance.clone())
    }
}

/// Settings of an experiment, handed over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Settings {
    limits: Vec<(String, f64, f64)>,
    rate_limits: Vec<(String, f64)>,
    bounds: Vec<(String, f64, f64)>,
    duration: f64,
    rate: f64,
    start: Vec<(String, f64)>,
    separate: Option<(String, String)>,
    seed: u64,
    time_limit: Option<f64>,
}

/// (one, other, nats, seconds to 95 %)
type Pairs = Vec<(String, String, f64, Option<f64>)>;
type Signal<'py> = (Bound<'py, PyArray1<f64>>, Vec<String>, Bound<'py, PyArray2<f64>>, &'static str, Pairs, bool);

/// Times, controls, their values (one row a control), form, pairs, and whether all signals were tried. `model` brings the simulator, where there is one.
#[pyfunction]
pub(crate) fn design<'py>(
    py: Python<'py>,
    open: &Bound<'py, PyOpen>,
    model: &Bound<'py, PyModel>,
    settings: Settings,
    progress: Option<Py<PyAny>>,
) -> PyResult<Signal<'py>> {
    let Settings { limits, rate_limits, bounds, duration, rate, start, separate, seed, time_limit } = settings;
    let design = Design { limits, rate_limits, bounds, duration, rate, start, seed, time_limit };
    let open = &open.get().0;
    let open = match separate {
        Some((one, other)) => {
            let apart = open.separating(&one, &other);
            if apart.is_empty() {
                let labels: Vec<&str> = open.candidates.iter().map(|c| c.label.as_str()).collect();
                let there = labels.join(", ");
                return Err(PyValueError::new_err(format!(
                    "separate: no pair of {one} and {other}; there are: {there}"
                )));
            }
            apart
        }
        None if open.is_empty() => open.separating_all(),
        None => open.clone(),
    };
    let watch = Arc::new(Watch::default());
    let model = model.get();
    let (dynamics, listening) = (model.dynamics(py, &watch), watch.clone());
    let designed = model.run(py, &watch, progress.as_ref(), move || design.run(&open, dynamics, listening.as_ref()))?;
    let pairs = designed.pairs.into_iter().map(|p| (p.one, p.other, p.nats, p.seconds)).collect();
    let values = rows(py, &designed.values, designed.time.len());
    Ok((array1(py, &designed.time), designed.controls, values, designed.form, pairs, designed.is_complete))
}
