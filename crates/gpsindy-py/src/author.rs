//! The pipeline behind the paper's tables: settings of Python as those of the core.

use crate::convert::error;
use crate::dataset::PyDataset;
use crate::model::PyModel;
use crate::watch::Watch;
use gpsindy_core::Author;
use gpsindy_core::gp::Kernel;
use gpsindy_core::library::LibrarySettings;
use pyo3::prelude::*;
use std::sync::Arc;

/// Settings that Python hands over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct AuthorSettings {
    states: Vec<String>,
    controls: Vec<String>,
    derivatives: Vec<(String, String)>,
    degree: usize,
    trig: bool,
    products: bool,
    terms: Vec<String>,
    train_fraction: f64,
    inputs: Option<Vec<Vec<String>>>,
    kernels: Option<Vec<String>>,
    lambda_: Option<f64>,
}

/// The model, lambda, and the errors on the training part and on the rest.
#[pyfunction]
pub(crate) fn author(
    py: Python<'_>,
    data: &Bound<'_, PyDataset>,
    settings: AuthorSettings,
    progress: Option<Py<PyAny>>,
) -> PyResult<(PyModel, f64, f64, f64)> {
    let data = data.get().0.clone();
    let standard = Author::default();
    let kernels = match settings.kernels {
        Some(names) => names.iter().map(|name| name.parse::<Kernel>().map_err(error)).collect::<PyResult<_>>()?,
        None => standard.kernels,
    };
    let author = Author {
        states: settings.states,
        controls: settings.controls,
        derivatives: settings.derivatives,
        library: LibrarySettings {
            degree: settings.degree,
            trig: settings.trig,
            products: settings.products,
            extra: settings.terms,
            ..LibrarySettings::default()
        },
        train_fraction: settings.train_fraction,
        inputs: settings.inputs,
        kernels,
        lambda: settings.lambda_,
    };
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let found = watch.run(py, progress.as_ref(), move || author.fit(&data, listening.as_ref()))?;
    Ok((found.model.into(), found.lambda, found.train_error, found.test_error))
}
