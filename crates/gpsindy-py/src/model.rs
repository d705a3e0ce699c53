//! Models: files and text, the user's own simulator, rates and rollouts.

use crate::convert::{Matrix, Vector, array2, error, file_error, matrix, rows, vector};
use crate::dataset::PyDataset;
use crate::native::Native;
use crate::rollout::{self, Arrays, How, NamedArrays, arrays, said, settings};
use crate::simulator::{Kind, Simulator};
use crate::stepper::Stepper;
use crate::watch::Watch;

use gpsindy_core::expression::Tape;
use gpsindy_core::{
    Control, Dynamics, Error, Excitation, Export, Expression, Hold, Language, Model, Port, Result, Run, Simulate,
    State, System,
};
use gpsindy_files::{model_to_json, model_to_toml, parse_model, read_model, write_model};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A table that Python owns.
type Table<'py> = Bound<'py, PyArray2<f64>>;

/// Terms, three tables of one row a state and one column a term (no row where there is none), lambda.
type Record<'py> =
    (Vec<String>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Vec<f64>);

/// A model, with the user's own simulator where its equations call one.
#[pyclass(frozen, name = "Model", module = "gpsindy._gpsindy")]
pub(crate) struct PyModel {
    pub(crate) model: Model,
    pub(crate) simulator: Option<Simulator>,
}

#[pymethods]
impl PyModel {
    /// Reads text; messages call the file `name`.
    #[staticmethod]
    fn parse(name: &str, text: &str) -> PyResult<Self> {
        Ok(parse_model(name, text).map_err(file_error)?.into())
    }

    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        Ok(read_model(&path).map_err(file_error)?.into())
    }

    /// A model whose rates come from `function(t, x, u)`; `kinematic` holds pairs (x, v) of states with `x' = v`.
    #[staticmethod]
    fn from_callable(
        function: Py<PyAny>,
        name: String,
        states: Vec<(String, String)>,
        controls: Vec<(String, String)>,
        kinematic: Vec<(String, String)>,
        initial: Vec<(String, f64)>,
        vectorized: bool,
    ) -> PyResult<Self> {
        let variables = states.iter().chain(&controls).map(|(name, _)| Expression::variable(name));
        let arguments: Vec<Expression> = std::iter::once(Expression::Time).chain(variables).collect();
        for (state, rate) in &kinematic {
            for name in [state, rate] {
                if !states.iter().any(|(known, _)| known == name) {
                    return Err(error(Error::unknown("state", name, states.iter().map(|s| &s.0))));
                }
            }
        }
        let equation = |j: usize, name: &str| match kinematic.iter().find(|(state, _)| state == name) {
            Some((_, rate)) => Expression::variable(rate),
            None => Expression::Simulator(j, arguments.clone()),
        };
        let state = |(j, (name, unit)): (usize, &(String, String))| State {
            name: name.clone(),
            unit: unit.clone(),
            equation: equation(j, name),
            measured: None,
        };
        let model = Model {
            name,
            states: states.iter().enumerate().map(state).collect(),
            controls: controls.iter().map(|(name, unit)| Control { name: name.clone(), unit: unit.clone() }).collect(),
            initial: initial.into_iter().collect(),
            ..Model::default()
        };
        model.check().map_err(error)?;
        let kind = Kind::Rates { vectorized };
        let simulator = Simulator { function, n_states: states.len(), n_controls: controls.len(), kind };
        Ok(Self { simulator: Some(simulator), model })
    }

    /// A model around `function(x, u, force, parameters, dt)`, which makes one step of many rows; with `several`, as many as its last
    /// argument says, with a `dt` for each row where there is one.
    ///
    /// `kinematic` holds pairs (x, v) of states with `x' = v`; what a log's column reads is an expression of the states.
    #[staticmethod]
    fn from_stepper(
        function: Py<PyAny>,
        name: String,
        period: f64,
        parts: Stepper,
        several: bool,
        native: Option<Native>,
    ) -> PyResult<Self> {
        if !(period.is_finite() && period > 0.0) {
            return Err(error(Error::range("dt", "above 0 s", period)));
        }
        let (n_states, n_controls) = parts.size();
        let parameters = parts.values();
        let model = parts.model(name)?;
        let kind = Kind::Steps { period, n_forces: model.ports.len(), parameters, several, native };
        let simulator = Simulator { function, n_states, n_controls, kind };
        Ok(Self { simulator: Some(simulator), model })
    }

    /// (kind, name, expression, value where it is a number) of what goes into a simulator that steps, as the model has it.
    fn simulator_inputs(&self) -> Vec<(&'static str, String, String, Option<f64>)> {
        let n = self.simulator.as_ref().map_or(0, |s| s.n_states);
        let (m, f) = (self.model.controls.len(), self.model.ports.len());
        let kind = |i: usize| match i {
            i if i < m => "command",
            i if i < m + f => "force",
            _ => "parameter",
        };
        let value = |e: &Expression| Some(Tape::new(std::slice::from_ref(e), &[]).ok()?.evaluate_once(&[], 0.0)[0]);
        let moves = |e: &Expression| {
            let mut found = false;
            e.visit(&mut |part| found |= *part == Expression::Time);
            found
        };
        let inputs = self.model.simulator_inputs(n).into_iter().enumerate();
        inputs.map(|(i, (name, e))| (kind(i), name, e.to_string(), value(&e).filter(|_| !moves(&e)))).collect()
    }

    /// (name, variable, unit, position) of every port.
    #[getter]
    fn ports(&self) -> Vec<(String, String, String, Option<String>)> {
        let one = |p: &Port| (p.name.clone(), p.variable.clone(), p.unit.clone(), p.position.clone());
        self.model.ports.iter().map(one).collect()
    }

    /// Whether the equations call the user's own simulator, so that there is no file of the model.
    /// What controls do between samples by default.
    #[getter]
    fn hold(&self) -> &'static str {
        if self.model.hold() == Hold::Linear { "linear" } else { "zero" }
    }

    #[getter]
    fn calls_simulator(&self) -> bool {
        self.simulator.is_some()
    }

    #[getter]
    fn name(&self) -> String {
        self.model.name.clone()
    }

    /// (name, unit, equation, measured) of every state.
    #[getter]
    fn states(&self) -> Vec<(String, String, String, Option<String>)> {
        let text = |e: &Expression| e.to_string();
        let one = |s: &State| (s.name.clone(), s.unit.clone(), text(&s.equation), s.measured.as_ref().map(text));
        self.model.states.iter().map(one).collect()
    }

    /// (name, unit) of every control.
    #[getter]
    fn controls(&self) -> Vec<(String, String)> {
        self.model.controls.iter().map(|c| (c.name.clone(), c.unit.clone())).collect()
    }

    /// (name, value, unit, tolerance) of every parameter.
    #[getter]
    fn parameters(&self) -> Vec<(String, f64, String, Option<f64>)> {
        self.model.parameters.iter().map(|p| (p.name.clone(), p.value, p.unit.clone(), p.tolerance)).collect()
    }

    #[getter]
    fn initial(&self) -> Vec<(String, f64)> {
        self.model.initial.iter().map(|(name, value)| (name.clone(), *value)).collect()
    }

    /// (terms, coefficients, standard errors, inclusion probabilities, lambda) of a model that was learnt.
    #[getter]
    fn identification<'py>(&self, py: Python<'py>) -> Option<Record<'py>> {
        let record = self.model.identification.as_ref()?;
        let table = |values: &[Vec<f64>]| rows(py, values, record.terms.len());
        Some((
            record.terms.clone(),
            table(&record.coefficients),
            table(&record.standard_errors),
            table(&record.inclusion_probabilities),
            record.lambda.clone(),
        ))
    }

    /// The same model with other values of these parameters.
    fn with_parameters(&self, py: Python<'_>, values: Vec<(String, f64)>) -> PyResult<Self> {
        let mut model = self.model.clone();
        for (name, value) in values {
            let Some(index) = model.parameter_index(&name) else {
                return Err(error(Error::unknown("parameter", &name, model.parameters.iter().map(|p| &p.name))));
            };
            model.parameters[index].value = value;
        }
        model.check().map_err(error)?;
        let simulator = self.simulator.as_ref().map(|s| s.clone_ref(py));
        Ok(Self { model, simulator })
    }

    fn to_toml(&self) -> PyResult<String> {
        self.check_text()?;
        model_to_toml(&self.model).map_err(file_error)
    }

    fn to_json(&self) -> PyResult<String> {
        self.check_text()?;
        model_to_json(&self.model).map_err(file_error)
    }

    /// The equations as source in another language.
    fn export(&self, target: &str, full_digits: bool) -> PyResult<String> {
        Export { full_digits }.write(&self.model, Language::parse(target).map_err(error)?).map_err(error)
    }

    fn write(&self, path: PathBuf) -> PyResult<()> {
        self.check_text()?;
        write_model(&path, &self.model).map_err(file_error)
    }

    /// Rates at every row of `x` (r x n) and `u` (r x m); `delay` and `play` read the control as it is.
    fn derivative<'py>(
        &self,
        py: Python<'py>,
        t: Vector<'py>,
        x: Matrix<'py>,
        u: Matrix<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (t, x, u) = (vector(&t), matrix(&x), matrix(&u));
        let watch = Arc::new(Watch::default());
        let system = self.system(py, &watch)?;
        let dx = self.run(py, &watch, None, move || {
            let mut dx = faer::Mat::zeros(x.nrows(), system.n_states());
            let mut rates = vec![0.0; system.n_states()];
            for i in 0..x.nrows() {
                let row = |m: &faer::Mat<f64>| (0..m.ncols()).map(|j| m[(i, j)]).collect::<Vec<f64>>();
                system.derivative(t[i], &row(&x), &row(&u), &mut rates)?;
                (0..rates.len()).for_each(|j| dx[(i, j)] = rates[j]);
            }
            Ok(dx)
        })?;
        Ok(array2(py, &dx))
    }

    /// A rollout from `initial` (n) at `t[0]` under the controls `u` (r x m).
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        initial: Vec<f64>,
        t: Vector<'py>,
        u: Matrix<'py>,
        how: How,
    ) -> PyResult<Arrays<'py>> {
        let settings = settings(&how)?;
        let (t, u) = (vector(&t), matrix(&u));
        let watch = Arc::new(Watch::default());
        let system = self.system(py, &watch)?;
        let rollout = self.run(py, &watch, None, move || {
            let excitation = Excitation::new(&system, &t, u.as_ref(), settings.hold)?;
            settings.rollout(&system, &excitation, &initial)
        })?;
        Ok(arrays(py, &rollout))
    }

    /// A rollout from `initial` (n) at `t[0]` with `controller(t, y)` in the loop, and its controls.
    fn closed_loop<'py>(
        &self,
        py: Python<'py>,
        initial: Vec<f64>,
        t: Vector<'py>,
        controller: Py<PyAny>,
        tolerance: f64,
    ) -> PyResult<(Table<'py>, Table<'py>, Table<'py>)> {
        let simulate = Simulate { tolerance, ..Simulate::default() };
        let t = vector(&t);
        let watch = Arc::new(Watch::default());
        let system = self.system(py, &watch)?;
        let listening = watch.clone();
        // The controller is Python, whatever the model is.
        let (rollout, controls) = watch.run_calling(py, 1, None, move || {
            let mut close = |time: f64, y: &[f64], u: &mut [f64]| {
                let said = Python::attach(|py| said(py, &controller, time, y, u));
                said.map_err(|failure| {
                    listening.fail(failure);
                    Error::Cancelled
                })
            };
            simulate.closed_loop(&system, &t, &initial, &mut close)
        })?;
        Ok((array2(py, &rollout.states), array2(py, &rollout.outputs), array2(py, &controls)))
    }

    /// A rollout of every run of `data`, over the samples of the span (s); `initial` overrides the log's.
    fn simulate_runs<'py>(
        &self,
        py: Python<'py>,
        data: &Bound<'py, PyDataset>,
        initial: Vec<(String, f64)>,
        span: (Option<f64>, Option<f64>),
        how: How,
    ) -> PyResult<Vec<NamedArrays<'py>>> {
        let settings = settings(&how)?;
        let data = data.get().0.clone();
        let mut model = self.model.clone();
        for (name, value) in &initial {
            if model.state_index(name).is_none() {
                return Err(error(Error::unknown("state", name, model.states.iter().map(|s| &s.name))));
            }
            // States that the log lacks start from the model's own initial values.
            model.initial.insert(name.clone(), *value);
        }
        let watch = Arc::new(Watch::default());
        let system = self.compiled(py, &model, &watch)?;
        let logs = data.clone();
        let one = move |run: &Run| rollout::of_run(&settings, &system, (run, logs.channels()), &initial, span);
        let runs = data.clone();
        let work = move || runs.runs().iter().map(one).collect::<Result<Vec<_>>>();
        let rollouts = self.run(py, &watch, None, work)?;
        let pairs = data.runs().iter().zip(rollouts);
        Ok(pairs
            .map(|(run, rollout)| {
                let (states, outputs) = arrays(py, &rollout);
                (run.name.clone(), rollout.time, states, outputs)
            })
            .collect())
    }
}

impl PyModel {
    /// Runs `work`, which may call the user's own simulator.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        py: Python<'_>,
        watch: &Arc<Watch>,
        listener: Option<&Py<PyAny>>,
        work: impl FnOnce() -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        match &self.simulator {
            Some(simulator) => watch.run_calling(py, simulator.kind.threads(), listener, work),
            None => watch.run(py, listener, work),
        }
    }

    /// The compiled model; errors of the user's own simulator go to `watch`.
    pub(crate) fn system(&self, py: Python<'_>, watch: &Arc<Watch>) -> PyResult<System> {
        self.compiled(py, &self.model, watch)
    }

    fn compiled(&self, py: Python<'_>, model: &Model, watch: &Arc<Watch>) -> PyResult<System> {
        System::with_simulator(model, self.dynamics(py, watch)).map_err(error)
    }

    pub(crate) fn dynamics(&self, py: Python<'_>, watch: &Arc<Watch>) -> Option<Arc<dyn Dynamics>> {
        self.simulator.as_ref().map(|s| s.watched(py, watch))
    }

    fn check_text(&self) -> PyResult<()> {
        if self.simulator.is_some() {
            return Err(PyValueError::new_err(
                "a model around a Python callable has no file; keep the callable and write its equations by hand to save them",
            ));
        }
        Ok(())
    }
}

impl From<Model> for PyModel {
    fn from(model: Model) -> Self {
        Self { model, simulator: None }
    }
}
