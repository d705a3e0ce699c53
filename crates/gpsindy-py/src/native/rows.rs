//! Steps of many rows, as Python asks native code for them.

use crate::convert::{Matrix, vector};
use crate::native::length::Length;
use gpsindy_core::Rows;
use numpy::ndarray::{Array3, Dimension};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// How long steps are, s: all of them, or each row's.
#[derive(FromPyObject)]
pub(crate) enum Lengths<'py> {
    Of(f64),
    Each(PyReadonlyArray1<'py, f64>),
}

/// States, commands, forces and parameters.
type Given<'py> = (Matrix<'py>, PyReadonlyArray3<'py, f64>, PyReadonlyArray3<'py, f64>, Matrix<'py>);

/// States (n, samples, n_states) after samples of `count` steps of `dt` s, of all rows or of each (n,), from `x` (n, n_states); `u` and
/// `force` (n, samples, ...) are held within a sample, `parameters` (n, n_parameters) are each row's own.
pub(crate) fn step<'py>(
    py: Python<'py>,
    (x, u, force, parameters): Given<'py>,
    (dt, count): (Lengths<'py>, usize),
    by: impl FnOnce(&Rows<'_>, (&Length<'_>, usize, usize), &mut [f64]) -> PyResult<()> + Send,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (n, samples) = (x.shape()[0], u.shape()[1]);
    let shape = (n, samples, x.shape()[1]);
    let dt = match dt {
        Lengths::Of(dt) => vec![dt; n],
        Lengths::Each(dt) => vector(&dt),
    };
    let (x, u, force, parameters) = (flat(&x), flat(&u), flat(&force), flat(&parameters));
    let next = py.detach(|| {
        let rows = Rows { count: n, states: &x, commands: &u, forces: &force, parameters: &parameters };
        let mut next = vec![0.0; shape.0 * shape.1 * shape.2];
        by(&rows, (&Length::Each(&dt), samples, count), &mut next).map(|()| next)
    })?;
    // The values are as many as the shape says.
    Ok(Array3::from_shape_vec(shape, next).unwrap_or_default().into_pyarray(py))
}

/// Whether the numbers of all rows belong together: of `samples` each, of `widths` states, commands, forces and parameters; else what is wrong.
pub(crate) fn fit(rows: &Rows<'_>, samples: usize, widths: [usize; 4], next: &[f64]) -> Result<(), String> {
    let [n, m, f, p] = widths;
    let held = rows.count * samples;
    let expected = [rows.count * n, held * m, held * f, rows.count * p, held * n];
    let given = [rows.states.len(), rows.commands.len(), rows.forces.len(), rows.parameters.len(), next.len()];
    if given == expected {
        return Ok(());
    }
    Err(format!("expected {expected:?} states, commands, forces, parameters and next states, found {given:?}"))
}

/// Row after row.
fn flat<D: Dimension>(array: &PyReadonlyArray<'_, f64, D>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}
