//! Smoothed channels and their derivatives.

use crate::convert::{array1, array2, error};
use crate::dataset::PyDataset;
use crate::watch::Watch;
use gpsindy_core::gp::Kernel;
use gpsindy_core::{Noise, Smoother};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::sync::Arc;

/// Kernels to try: those of the default for `auto`.
pub(crate) fn smoother(kernel: &str) -> PyResult<Smoother> {
    let mut smoother = Smoother::default();
    if kernel != "auto" {
        smoother.kernels = vec![kernel.parse::<Kernel>().map_err(error)?];
    }
    Ok(smoother)
}

/// One dict a run and one dict a column.
#[pyfunction]
pub(crate) fn smooth<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyDataset>,
    columns: Vec<String>,
    kernel: &str,
    noise: Option<Vec<f64>>,
    covariance: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyList>, Bound<'py, PyList>)> {
    let data = data.get().0.clone();
    let channels = data.indices_of(&columns).map_err(error)?;
    let noise = noise.map_or(Noise::Estimated, Noise::Given);
    let smoother = Smoother { noise, covariance, ..smoother(kernel)? };
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let work = move || smoother.smooth(&data, &channels, listening.as_ref());
    let smoothed = watch.run(py, progress.as_ref(), work)?;
    let runs = PyList::empty(py);
    for run in &smoothed.runs {
        let entry = PyDict::new(py);
        entry.set_item("name", &run.name)?;
        entry.set_item("t", array1(py, &run.time))?;
        entry.set_item("x", array2(py, &run.mean))?;
        entry.set_item("x_std", array2(py, &run.std))?;
        entry.set_item("x_dot", array2(py, &run.derivative))?;
        entry.set_item("x_dot_std", array2(py, &run.derivative_std))?;
        let covariances = run.derivative_covariance.iter().map(|c| array2(py, c));
        entry.set_item("x_dot_covariance", covariances.collect::<Vec<_>>())?;
        runs.append(entry)?;
    }
    let fits = PyList::empty(py);
    for (channel, fit) in smoothed.channels.iter().zip(&smoothed.fits) {
        let entry = PyDict::new(py);
        entry.set_item("column", &channel.name)?;
        entry.set_item("unit", &channel.unit)?;
        entry.set_item("kernel", fit.kernel.to_string())?;
        entry.set_item("hyper", array1(py, &fit.hyper.iter().map(|h| h.exp()).collect::<Vec<_>>()))?;
        entry.set_item("noise", fit.noise)?;
        entry.set_item("nll", fit.nll)?;
        entry.set_item("converged", fit.converged)?;
        entry.set_item("weak", fit.weak.iter().map(ToString::to_string).collect::<Vec<_>>())?;
        fits.append(entry)?;
    }
    Ok((runs, fits))
}
