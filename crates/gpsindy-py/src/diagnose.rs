//! The diagnosis, its page and its summary, and the catalogue of effects.

use crate::convert::{error, file_error};
use crate::dataset::PyDataset;
use crate::design::PyOpen;
use crate::model::PyModel;
use crate::rollout::hold_of;
use crate::watch::Watch;
use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_core::diagnose::{
    CustomEffect, CustomParameter, Diagnose, Diagnosed, Effect, Part, PartKind, Power, hold_out,
};
use gpsindy_core::{Dataset, Expression, Model, Paired};
use gpsindy_files::hint;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// (id, state, form, [(parameter, low, high, unit)])
type Custom = (String, String, String, Vec<(String, f64, f64, String)>);

/// (kind, name, states, controls, ports, parameters)
pub(crate) type PartParts = (String, String, Vec<String>, Vec<String>, Vec<String>, Vec<String>);

/// A joint or an actuator.
pub(crate) fn part((kind, name, states, controls, ports, parameters): PartParts) -> PyResult<Part> {
    let kinds = [PartKind::Joint, PartKind::Actuator];
    let found = kinds.into_iter().find(|known| known.as_str() == kind);
    let kind = found.ok_or_else(|| PyValueError::new_err(format!("part {name:?}: unknown kind {kind:?}")))?;
    Ok(Part { kind, name, states, controls, ports, parameters })
}

/// How a diagnosis is made, handed over by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    effects: Vec<String>,
    without: Vec<String>,
    custom: Vec<Custom>,
    /// Joints and actuators of the simulator; none where it names none, as equations.
    #[pyo3(default)]
    parts: Vec<PartParts>,
    /// Names of the joints and the actuators whose effects are suspects.
    #[pyo3(default)]
    joints: Vec<String>,
    #[pyo3(default)]
    actuators: Vec<String>,
    allow_place: bool,
    all_suspects: bool,
    confidence: f64,
    most_effects: usize,
    hold: Option<String>,
    /// Share of the motion below which a gap is none.
    #[pyo3(default)]
    material: f64,
    keep_function: bool,
    /// Seconds after which the search ends.
    time_limit: Option<f64>,
    /// Seed of the power study, where one is wanted.
    power: Option<u64>,
}

/// The part that a user names.
fn named(parts: &[Part], kind: PartKind, name: &str) -> PyResult<Part> {
    Part::find(parts, kind, name).cloned().map_err(|_| {
        let known = parts.iter().filter(|part| part.kind == kind).map(|part| part.name.as_str());
        let (kind, hint) = (kind.as_str(), hint(name, known));
        PyValueError::new_err(format!("{kind}s: the model has no {kind} `{name}`{hint}"))
    })
}

impl Options {
    pub(crate) fn settings(self) -> PyResult<Diagnose> {
        let parts = self.parts.into_iter().map(part).collect::<PyResult<Vec<Part>>>()?;
        let joints = self.joints.iter().map(|name| (PartKind::Joint, name));
        let actuators = self.actuators.iter().map(|name| (PartKind::Actuator, name));
        let only = joints.chain(actuators).map(|(kind, name)| named(&parts, kind, name)).collect::<PyResult<_>>()?;
        Ok(Diagnose {
            parts,
            only,
            effects: self.effects,
            without: self.without,
            custom: self.custom.into_iter().map(custom_effect).collect::<PyResult<_>>()?,
            allow_place: self.allow_place,
            all_suspects: self.all_suspects,
            confidence: self.confidence,
            most_effects: self.most_effects,
            hold: self.hold.as_deref().map(hold_of).transpose()?,
            material: self.material,
            keep_function: self.keep_function,
            time_limit: self.time_limit,
            power: self.power.map(|seed| Power { seed, ..Power::default() }),
            ..Diagnose::default()
        })
    }
}

/// Logs to learn from and to verify on.
fn split(
    train: &Bound<'_, PyDataset>,
    holdout: Option<&Bound<'_, PyDataset>>,
) -> PyResult<(Arc<Dataset>, Arc<Dataset>)> {
    match holdout {
        Some(holdout) => Ok((train.get().0.clone(), holdout.get().0.clone())),
        None => {
            let (train, holdout) = hold_out(&train.get().0).map_err(error)?;
            Ok((train.into(), holdout.into()))
        }
    }
}

/// A diagnosis.
#[pyfunction]
pub(crate) fn diagnose(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    train: &Bound<'_, PyDataset>,
    holdout: Option<&Bound<'_, PyDataset>>,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<Findings> {
    let settings = options.settings()?;
    let (train, holdout) = split(train, holdout)?;
    let model = model.get();
    let watch = Arc::new(Watch::default());
    let dynamics = model.dynamics(py, &watch);
    let (nominal, listening) = (model.model.clone(), watch.clone());
    let work = move || match dynamics {
        Some(dynamics) => settings.run_simulator(&nominal, dynamics, &train, &holdout, listening.as_ref()),
        None => settings.run(&nominal, &train, &holdout, listening.as_ref()),
    };
    let diagnosed = model.run(py, &watch, progress.as_ref(), work)?;
    let around = |inner: Model| PyModel { model: inner, simulator: model.simulator.as_ref().map(|s| s.clone_ref(py)) };
    findings(diagnosed, model.model.clone(), around)
}

/// The report as JSON, the nominal model, the corrected one, that without each of the included causes, and what was left
/// open.
pub(crate) type Findings = (String, PyModel, PyModel, Vec<PyModel>, PyOpen);

pub(crate) fn findings(diagnosed: Diagnosed, nominal: Model, around: impl Fn(Model) -> PyModel) -> PyResult<Findings> {
    let Diagnosed { diagnosis, augmented, open, without, .. } = diagnosed;
    let report = serde_json::to_string_pretty(&diagnosis).map_err(internal)?;
    let without = without.into_iter().map(&around).collect();
    Ok((report, around(nominal), around(augmented), without, PyOpen(open)))
}

/// The same for a simulator of which there are only logs.
#[pyfunction]
pub(crate) fn diagnose_paired(
    py: Python<'_>,
    simulated: &Bound<'_, PyDataset>,
    identify: crate::identify::Settings,
    train: &Bound<'_, PyDataset>,
    holdout: Option<&Bound<'_, PyDataset>>,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<Findings> {
    let simulated = simulated.get().0.clone();
    let settings = Paired { identify: identify.identify()?, diagnose: options.settings()?, ..Paired::default() };
    let (train, holdout) = split(train, holdout)?;
    let watch = Arc::new(Watch::default());
    let listening = watch.clone();
    let work = move || settings.run(&simulated, &train, &holdout, listening.as_ref());
    let found = watch.run(py, progress.as_ref(), work)?;
    findings(found.diagnosed, found.model, PyModel::from)
}

/// The self-contained page of a report.
#[pyfunction]
pub(crate) fn render(report: &str) -> PyResult<String> {
    Ok(gpsindy_report::render(&read(report)?))
}

/// The file report.json of a report.
#[pyfunction]
pub(crate) fn report_json(report: &str) -> PyResult<String> {
    gpsindy_report::json(&read(report)?).map_err(internal)
}

/// The file augmented.toml of a report, from the model's text.
#[pyfunction]
pub(crate) fn augmented_toml(report: &str, model: &str) -> PyResult<String> {
    Ok(gpsindy_report::augmented(&read(report)?, model))
}

/// A screenful of text about a report.
#[pyfunction]
pub(crate) fn summary(report: &str, width: usize, colour: bool) -> PyResult<String> {
    Ok(gpsindy_report::summary(&read(report)?, width, colour))
}

/// Effects of the user's own from a TOML file.
#[pyfunction]
pub(crate) fn read_effects(path: PathBuf) -> PyResult<Vec<Custom>> {
    let parameter = |p: CustomParameter| (p.name, p.low, p.high, p.unit);
    let effects = gpsindy_files::read_effects(&path).map_err(file_error)?.into_iter();
    let parts = effects.map(|e| (e.id, e.state, e.form.to_string(), e.parameters.into_iter().map(parameter).collect()));
    Ok(parts.collect())
}

/// Writes a text file, whole or not at all.
#[pyfunction]
pub(crate) fn write_whole(path: PathBuf, text: &str) -> PyResult<()> {
    gpsindy_files::write_whole(&path, text.as_bytes()).map_err(file_error)
}

/// Writes the files of a diagnosis into their folder, all or none, and removes those of an earlier one that have no successor.
#[pyfunction]
pub(crate) fn write_report(folder: PathBuf, files: Vec<(String, String)>) -> PyResult<()> {
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let stale = gpsindy_report::stale(&names, |name| gpsindy_files::start_of(&folder.join(name)));
    let stale: Vec<PathBuf> = stale.into_iter().map(|name| folder.join(name)).collect();
    let whole: Vec<(PathBuf, &[u8])> = files.iter().map(|(name, text)| (folder.join(name), text.as_bytes())).collect();
    gpsindy_files::write_together(&whole, &stale).map_err(file_error)
}

/// Id, form, parameters, signature, name, meaning, and twins with their experiments.
type Entry = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    Vec<(&'static str, &'static str)>,
);

/// Every effect of the catalogue.
#[pyfunction]
pub(crate) fn effects() -> Vec<Entry> {
    let twins = |e: &Effect| e.twins().into_iter().map(|(twin, experiment)| (twin.id(), experiment)).collect();
    let entry = |e: &Effect| (e.id(), e.form(), e.parameters(), e.signature(), e.name(), e.meaning(), twins(e));
    Effect::ALL.iter().map(entry).collect()
}

fn custom_effect((id, state, form, parameters): Custom) -> PyResult<CustomEffect> {
    let form = Expression::parse(&form).map_err(error)?;
    let parameter = |(name, low, high, unit)| CustomParameter { name, low, high, unit };
    Ok(CustomEffect { id, state, form, parameters: parameters.into_iter().map(parameter).collect() })
}

fn read(report: &str) -> PyResult<Diagnosis> {
    serde_json::from_str(report).map_err(|e| PyValueError::new_err(format!("report: not a diagnosis: {e}")))
}

fn internal(failure: serde_json::Error) -> PyErr {
    PyValueError::new_err(format!("report: cannot be written as JSON: {failure}"))
}
