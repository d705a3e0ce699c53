//! Identification: the settings of Python as those of the core.

use crate::convert::error;
use crate::dataset::PyDataset;
use crate::model::PyModel;
use crate::rollout::hold_of;
use crate::smooth::smoother;
use crate::watch::Watch;
use gpsindy_core::library::{Constraints, Fixed, Forbidden, FreeNumber, Kept, LibrarySettings, Signed};
use gpsindy_core::regress::Selection;
use gpsindy_core::{
    Choice, Control, Delay, Error, Expression, Hold, Identification, Identify, Model, Regression, Result, SensorRange,
    Smoother, State,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Settings that Python hands over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Settings {
    states: Vec<String>,
    controls: Vec<String>,
    derivatives: Vec<(String, String)>,
    degree: usize,
    trig: bool,
    grow: bool,
    products: bool,
    terms: Vec<String>,
    free: Vec<String>,
    ranges: Vec<String>,
    control_terms: bool,
    fix: Vec<String>,
    forbid: Vec<String>,
    keep: Vec<String>,
    sign: Vec<String>,
    smoother: Option<String>,
    kernel: String,
    derivative_method: String,
    regressor: String,
    lambda_: Option<f64>,
    select: String,
    delays: Vec<(String, Option<f64>)>,
    max_delay: Option<f64>,
    hold: Option<String>,
    standardize: bool,
    train_fraction: f64,
    ensemble: usize,
    refine: bool,
    window: Option<f64>,
    consensus: bool,
    seed: u64,
}

impl Settings {
    pub(crate) fn identify(self) -> PyResult<Identify> {
        self.check_names().map_err(error)?;
        let kernel = smoother(&self.kernel)?;
        let hold = self.hold.as_deref().map(hold_of).transpose()?;
        let settings = self.build(kernel).map_err(error)?;
        Ok(Identify { hold, ..settings })
    }

    /// Names that a model could not carry are refused before anything is learnt.
    fn check_names(&self) -> Result<()> {
        let model = Model {
            states: self.states.iter().map(|name| State::new(name, Expression::Number(0.0))).collect(),
            controls: self.controls.iter().map(Control::new).collect(),
            ..Model::default()
        };
        model.check()
    }

    fn build(self, kernel: Smoother) -> Result<Identify> {
        let smoother = match self.smoother.as_deref() {
            None => None,
            Some("gp") => Some(kernel),
            Some(other) => return Err(Error::range("smoother", "\"gp\" or None", format!("{other:?}"))),
        };
        let known = constraints(&self.fix, &self.forbid, &self.sign)?;
        let kept = self.keep.iter().map(|text| Kept::parse(text)).collect::<Result<_>>()?;
        let constraints = Constraints { kept, ..known };
        let numbers = self.free.iter().map(|text| FreeNumber::parse(text)).collect::<Result<_>>()?;
        let ranges = self.ranges.iter().map(|text| SensorRange::parse(text)).collect::<Result<_>>()?;
        let delay = |(control, delay): (String, Option<f64>)| {
            (control, delay.map_or(Delay::Auto(self.max_delay), Delay::Fixed))
        };
        Ok(Identify {
            library: LibrarySettings {
                degree: self.degree,
                trig: self.trig,
                products: self.products,
                extra: self.terms,
                controls: self.control_terms,
                numbers,
            },
            target: self.derivative_method.parse()?,
            regressor: self.regressor.parse::<Regression>()?.regressor(),
            choice: choice(&self.select, self.lambda_)?,
            delays: self.delays.into_iter().map(delay).collect(),
            states: self.states,
            controls: self.controls,
            derivatives: self.derivatives,
            constraints,
            ranges,
            smoother,
            standardize: self.standardize,
            train_fraction: self.train_fraction,
            ensemble: self.ensemble,
            refine: self.refine,
            window: self.window,
            consensus: self.consensus,
            grow: self.grow,
            hold: None,
            seed: self.seed,
        })
    }
}

/// What is known beforehand, as text.
pub(crate) fn constraints(fix: &[String], forbid: &[String], sign: &[String]) -> Result<Constraints> {
    Ok(Constraints {
        fixed: fix.iter().map(|text| Fixed::parse(text)).collect::<Result<_>>()?,
        forbidden: forbid.iter().map(|text| Forbidden::parse(text)).collect::<Result<_>>()?,
        signed: sign.iter().map(|text| Signed::parse(text)).collect::<Result<_>>()?,
        ..Constraints::default()
    })
}

pub(crate) fn choice(name: &str, lambda: Option<f64>) -> Result<Choice> {
    lambda.map_or_else(|| name.parse(), |lambda| Ok(Choice::Rows(Selection::Fixed(lambda))))
}

/// The model, and a dict of what is known about how it came about.
#[pyfunction]
pub(crate) fn identify<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyDataset>,
    settings: Settings,
    progress: Option<Py<PyAny>>,
) -> PyResult<(PyModel, Bound<'py, PyDict>)> {
    let data = data.get().0.clone();
    let settings = settings.identify()?;
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let found = watch.run(py, progress.as_ref(), move || settings.fit(&data, listening.as_ref()))?;
    report(py, found)
}

/// The model of an identification, and a dict of the rest.
pub(crate) fn report(py: Python<'_>, found: Identification) -> PyResult<(PyModel, Bound<'_, PyDict>)> {
    let report = PyDict::new(py);
    let states = found.states.iter().map(|s| {
        let entry = PyDict::new(py);
        entry.set_item("state", &s.state)?;
        entry.set_item("terms", &s.terms)?;
        entry.set_item("lambda_", s.level)?;
        entry.set_item("score", s.score)?;
        entry.set_item("residual", s.residual)?;
        entry.set_item("noise", s.noise)?;
        entry.set_item("kernel", &s.kernel)?;
        Ok(entry)
    });
    report.set_item("states", states.collect::<PyResult<Vec<_>>>()?)?;
    report.set_item("poor", found.is_poor())?;
    report.set_item("exchangeable", exchangeable(&found))?;
    let delays = found.delays.into_iter().map(|d| (d.control, d.delay, d.standard_error));
    report.set_item("delays", delays.collect::<Vec<_>>())?;
    report.set_item("window", found.window)?;
    report.set_item("hold", if found.hold == Hold::Linear { "linear" } else { "zero" })?;
    report.set_item("notes", found.notes.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    Ok((found.model.into(), report))
}

/// State, its term, and a term that could stand there.
fn exchangeable(found: &Identification) -> Vec<(String, String, String)> {
    let pairs = found.outlook.iter().flat_map(|outlook| &outlook.exchangeable);
    pairs.map(|pair| (pair.state.clone(), pair.term.clone(), pair.other.clone())).collect()
}
