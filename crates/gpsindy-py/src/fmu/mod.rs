//! Instances of FMUs: fmpy unpacks and instantiates them, their steps are made here, by their C functions.

mod co_simulation;
mod component;
mod exchange;
mod failure;
mod unit;

use crate::convert::{Matrix, Vector, vector};
use crate::watch::lock;
use co_simulation::CoSimulation;
use component::Component;
use exchange::Exchange;
use failure::Failure;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::Mutex;
use unit::{References, Unit};

/// How an FMU is stepped.
enum Kind {
    ModelExchange(Exchange),
    CoSimulation(CoSimulation),
}

/// An instance of an FMU that makes steps, each from a state of its own.
#[pyclass(frozen, name = "FmuInstance", module = "gpsindy._gpsindy")]
pub(crate) struct PyFmuInstance {
    name: String,
    /// Numbers of states and of inputs.
    size: (usize, usize),
    /// Taken without the interpreter only: the FMU may call back into Python. None after `free`.
    own: Mutex<Option<(Unit, Kind)>>,
}

#[pymethods]
impl PyFmuInstance {
    /// Of an instance of fmpy, of FMI 2 where `two`; as model exchange with `indicators`, the number of its events', else as co-simulation.
    #[new]
    fn new(
        py: Python<'_>,
        fmu: &Bound<'_, PyAny>,
        name: String,
        two: bool,
        references: References,
        parameters: Vector<'_>,
        indicators: Option<usize>,
    ) -> PyResult<Self> {
        let size = (references.states.len(), references.inputs.len());
        let mut unit = Unit { component: Component::of(fmu, two)?, references, parameters: vector(&parameters) };
        let begun = py.detach(|| {
            let kind = match indicators {
                Some(count) => Kind::ModelExchange(Exchange::begin(&mut unit, count)?),
                None => Kind::CoSimulation(CoSimulation::begin(&unit)),
            };
            Ok((unit, kind))
        });
        let own = Mutex::new(Some(begun.map_err(|failure| error(&name, failure))?));
        Ok(Self { name, size, own })
    }

    /// States (n, samples, n_states) after samples of `count` steps, of `dt` (n,) s, from `x` (n, n_states); `inputs` (n, samples, n_inputs)
    /// are held within a sample.
    fn step<'py>(
        &self,
        py: Python<'py>,
        x: Matrix<'py>,
        inputs: PyReadonlyArray3<'py, f64>,
        dt: Vector<'py>,
        count: usize,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (states, width) = self.size;
        let (rows, samples) = (x.shape()[0], inputs.shape()[1]);
        if x.shape()[1] != states || inputs.shape() != [rows, samples, width] || dt.shape() != [rows] {
            return Err(PyValueError::new_err(format!(
                "{}: expected x (n, {states}), inputs (n, samples, {width}) and dt (n,), found {:?}, {:?} and {:?}",
                self.name,
                x.shape(),
                inputs.shape(),
                dt.shape()
            )));
        }
        let x: Vec<f64> = x.as_array().iter().copied().collect();
        let inputs: Vec<f64> = inputs.as_array().iter().copied().collect();
        let lengths = vector(&dt);
        let stepped = py.detach(|| {
            let mut own = lock(&self.own);
            let (unit, kind) = own.as_mut().ok_or(Failure::Freed)?;
            let mut found = Vec::with_capacity(rows * samples * states);
            let mut state = vec![0.0; states];
            for row in 0..rows {
                state.copy_from_slice(&x[row * states..(row + 1) * states]);
                for sample in row * samples..(row + 1) * samples {
                    let inputs = &inputs[sample * width..(sample + 1) * width];
                    for _ in 0..count {
                        match kind {
                            Kind::ModelExchange(exchange) => exchange.step(unit, &mut state, inputs, lengths[row])?,
                            Kind::CoSimulation(slave) => slave.step(unit, &mut state, inputs, lengths[row])?,
                        }
                    }
                    found.extend_from_slice(&state);
                }
            }
            Ok(found)
        });
        let found = stepped.map_err(|failure| error(&self.name, failure))?;
        // The values are as many as the shape says.
        Ok(Array3::from_shape_vec((rows, samples, states), found).unwrap_or_default().into_pyarray(py))
    }

    /// Resets the instance and initialises it with other values of its parameters.
    fn reset(&self, py: Python<'_>, parameters: Vector<'_>) -> PyResult<()> {
        let parameters = vector(&parameters);
        let outcome = py.detach(|| {
            let mut own = lock(&self.own);
            let (unit, kind) = own.as_mut().ok_or(Failure::Freed)?;
            unit.parameters = parameters;
            match kind {
                Kind::ModelExchange(_) => exchange::reset(unit),
                // Every step does it.
                Kind::CoSimulation(_) => Ok(()),
            }
        });
        outcome.map_err(|failure| error(&self.name, failure))
    }

    /// Frees the instance; later steps are an error.
    fn free(&self, py: Python<'_>) -> PyResult<()> {
        let own = py.detach(|| lock(&self.own).take());
        own.map_or(Ok(()), |(unit, _)| unit.component.free(py))
    }
}

fn error(name: &str, failure: Failure) -> PyErr {
    PyValueError::new_err(format!("{name}: {failure}"))
}
