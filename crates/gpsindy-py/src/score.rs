//! Errors of a model on logs.

use crate::dataset::PyDataset;
use crate::model::PyModel;
use crate::rollout::hold_of;
use crate::watch::Watch;
use gpsindy_core::{Errors, Scoring, Simulate};
use pyo3::prelude::*;
use std::sync::Arc;

/// (pooled, started, diverged, [(state, unit, rmse, normalised, samples)])
type Kind = (f64, usize, usize, Vec<(String, String, f64, f64, usize)>);

/// Whole runs, windows, single steps.
#[pyfunction]
pub(crate) fn score(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    data: &Bound<'_, PyDataset>,
    window: Option<f64>,
    hold: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Kind, Kind, Kind)> {
    let settings = Scoring { simulate: Simulate { hold: hold_of(hold)?, ..Simulate::default() }, window };
    let watch = Arc::new(Watch::default());
    let model = model.get();
    let system = model.system(py, &watch)?;
    let data = data.get().0.clone();
    let listening = watch.clone();
    let work = move || gpsindy_core::score(&system, &data, &settings, listening.as_ref());
    let found = model.run(py, &watch, progress.as_ref(), work)?;
    Ok((kind(found.rollout), kind(found.windowed), kind(found.one_step)))
}

fn kind(errors: Errors) -> Kind {
    let states = errors.by_state.into_iter().map(|s| (s.state, s.unit, s.rmse, s.normalised, s.n_samples));
    (errors.pooled, errors.n_started, errors.n_diverged, states.collect())
}
