//! Online identification: samples in, the current model out.

use crate::convert::{Matrix, Vector, array1, error, matrix, vector};
use crate::identify::{choice, constraints, report};
use crate::model::PyModel;
use crate::rollout::hold_of;
use crate::watch::lock;
use gpsindy_core::gp::Kernel;
use gpsindy_core::library::LibrarySettings;
use gpsindy_core::{Channel, Choice, Error, Estimate, Online, OnlineSettings, Regression, Result};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Mutex;

/// Samples between two looks at Ctrl-C.
const CHUNK: usize = 256;

/// Value, its deviation, rate, its deviation, each one number a state.
type Estimates<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// Settings that Python hands over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Settings {
    states: Vec<(String, String)>,
    controls: Vec<(String, String)>,
    angles: Vec<String>,
    degree: usize,
    trig: bool,
    products: bool,
    terms: Vec<String>,
    control_terms: bool,
    fix: Vec<String>,
    forbid: Vec<String>,
    sign: Vec<String>,
    kernel: String,
    regressor: String,
    lambda_: Option<f64>,
    select: String,
    delays: Vec<(String, f64)>,
    hold: String,
    memory: Option<f64>,
    window: usize,
}

impl Settings {
    fn build(self, hold: gpsindy_core::Hold) -> Result<OnlineSettings> {
        let channels = |named: Vec<(String, String)>| -> Vec<Channel> {
            named.into_iter().map(|(name, unit)| Channel::new(name).with_unit(unit)).collect()
        };
        let selection = match choice(&self.select, self.lambda_)? {
            Choice::Rows(selection) => selection,
            Choice::Rollout => {
                return Err(Error::range("select", "cv, cv-best or bic for samples that come one by one", "rollout"));
            }
        };
        let mut settings = OnlineSettings {
            states: channels(self.states),
            controls: channels(self.controls),
            angles: self.angles,
            library: LibrarySettings {
                degree: self.degree,
                trig: self.trig,
                products: self.products,
                extra: self.terms,
                controls: self.control_terms,
                ..LibrarySettings::default()
            },
            constraints: constraints(&self.fix, &self.forbid, &self.sign)?,
            regressor: self.regressor.parse::<Regression>()?.regressor(),
            selection,
            delays: self.delays,
            hold,
            memory: self.memory,
            window: self.window,
            ..OnlineSettings::default()
        };
        if self.kernel != "auto" {
            settings.kernels = vec![self.kernel.parse::<Kernel>()?];
        }
        Ok(settings)
    }
}

/// A model that follows a log as it grows.
#[pyclass(frozen, name = "Online", module = "gpsindy._gpsindy")]
pub(crate) struct PyOnline(Mutex<Online>);

#[pymethods]
impl PyOnline {
    #[new]
    fn new(settings: Settings) -> PyResult<Self> {
        let hold = hold_of(&settings.hold)?;
        let online = settings.build(hold).and_then(Online::new).map_err(error)?;
        Ok(Self(Mutex::new(online)))
    }

    /// Takes samples one after the other; whether rows were added to the regression.
    fn update(&self, py: Python<'_>, t: Vector<'_>, x: Matrix<'_>, u: Matrix<'_>) -> PyResult<bool> {
        let (t, x, u) = (vector(&t), matrix(&x), matrix(&u));
        let row = |m: &faer::Mat<f64>, i: usize| (0..m.ncols()).map(|j| m[(i, j)]).collect::<Vec<f64>>();
        let mut news = false;
        for first in (0..t.len()).step_by(CHUNK) {
            let taken = py.detach(|| {
                let mut online = lock(&self.0);
                let mut news = false;
                for i in first..(first + CHUNK).min(t.len()) {
                    news |= online.update(t[i], &row(&x, i), &row(&u, i))?;
                }
                Ok(news)
            });
            news |= taken.map_err(error)?;
            py.check_signals()?;
        }
        Ok(news)
    }

    fn begin_run(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| lock(&self.0).begin_run()).map_err(error)
    }

    #[getter]
    fn n_samples(&self) -> usize {
        lock(&self.0).n_samples()
    }

    #[getter]
    fn lag(&self) -> usize {
        lock(&self.0).lag()
    }

    /// The model of all samples so far, and a dict of what is known about how it came about.
    fn identification<'py>(&self, py: Python<'py>) -> PyResult<(PyModel, Bound<'py, PyDict>)> {
        let found = py.detach(|| lock(&self.0).identification()).map_err(error)?;
        report(py, found)
    }

    fn estimate<'py>(&self, py: Python<'py>) -> PyResult<Estimates<'py>> {
        let found = py.detach(|| lock(&self.0).estimate()).map_err(error)?;
        let column = |pick: fn(&Estimate) -> f64| array1(py, &found.iter().map(pick).collect::<Vec<_>>());
        Ok((column(|e| e.value), column(|e| e.value_std), column(|e| e.rate), column(|e| e.rate_std)))
    }

    /// An independent copy.
    fn copy(&self) -> Self {
        Self(Mutex::new(lock(&self.0).clone()))
    }
}
