//! The one file that knows numpy and the error map.

use faer::Mat;
use gpsindy_core::Error;
use numpy::ndarray::{Array2, ShapeBuilder};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::create_exception;
use pyo3::exceptions::{
    PyFileNotFoundError, PyKeyboardInterrupt, PyOSError, PyPermissionError, PyRuntimeError, PyValueError,
};
use pyo3::prelude::*;
use std::io;

create_exception!(
    gpsindy,
    NumericalError,
    PyRuntimeError,
    "The numbers refuse: a matrix is not positive definite, a trajectory diverges, a search finds nothing usable."
);

/// A vector of numbers as Python hands it in.
pub(crate) type Vector<'py> = PyReadonlyArray1<'py, f64>;
/// A matrix of numbers as Python hands it in; rows are samples.
pub(crate) type Matrix<'py> = PyReadonlyArray2<'py, f64>;

/// (r x c) numbers as the core holds them.
pub(crate) fn matrix(array: &Matrix<'_>) -> Mat<f64> {
    let view = array.as_array();
    Mat::from_fn(view.nrows(), view.ncols(), |i, j| view[(i, j)])
}

/// Numbers in order.
pub(crate) fn vector(array: &Vector<'_>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}

/// A read-only array of shape (r, c).
pub(crate) fn array2<'py>(py: Python<'py>, matrix: &Mat<f64>) -> Bound<'py, PyArray2<f64>> {
    let array = Array2::from_shape_fn((matrix.nrows(), matrix.ncols()), |(i, j)| matrix[(i, j)]).into_pyarray(py);
    array.readwrite().make_nonwriteable();
    array
}

/// A read-only array of shape (r, c) whose columns lie in one piece each, as those of a log do.
pub(crate) fn columns<'py>(py: Python<'py>, matrix: &Mat<f64>) -> Bound<'py, PyArray2<f64>> {
    let (rows, count) = (matrix.nrows(), matrix.ncols());
    let mut values = Vec::with_capacity(rows * count);
    (0..count).for_each(|column| values.extend_from_slice(matrix.col_as_slice(column)));
    // The values are as many as the shape says.
    let array = Array2::from_shape_vec((rows, count).f(), values).unwrap_or_default().into_pyarray(py);
    array.readwrite().make_nonwriteable();
    array
}

/// A read-only array of rows of equal length; `columns` where there is no row.
pub(crate) fn rows<'py>(py: Python<'py>, rows: &[Vec<f64>], columns: usize) -> Bound<'py, PyArray2<f64>> {
    let array = Array2::from_shape_fn((rows.len(), columns), |(i, j)| rows[i][j]).into_pyarray(py);
    array.readwrite().make_nonwriteable();
    array
}

/// A read-only array of shape (r,).
pub(crate) fn array1<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    let array = values.to_vec().into_pyarray(py);
    array.readwrite().make_nonwriteable();
    array
}

/// Wrong input is a `ValueError`, refusing numbers are a `NumericalError`, errors of the user's own code stay as they are.
pub(crate) fn error(error: Error) -> PyErr {
    match error {
        Error::NotPositiveDefinite { .. } | Error::Diverged { .. } | Error::NotConverged { .. } => {
            NumericalError::new_err(error.to_string())
        }
        Error::Callback(own) => match own.downcast::<PyErr>() {
            Ok(own) => *own,
            Err(other) => PyRuntimeError::new_err(other.to_string()),
        },
        Error::Cancelled => PyKeyboardInterrupt::new_err("stopped on request"),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// The same for files: what the system refuses is an `OSError`.
pub(crate) fn file_error(failure: gpsindy_files::Error) -> PyErr {
    use gpsindy_files::Error as File;
    match failure {
        File::Core(core) => error(core),
        File::Read { ref source, .. } | File::Write { ref source, .. } => match source.kind() {
            io::ErrorKind::NotFound => PyFileNotFoundError::new_err(failure.to_string()),
            io::ErrorKind::PermissionDenied => PyPermissionError::new_err(failure.to_string()),
            _ => PyOSError::new_err(failure.to_string()),
        },
        _ => PyValueError::new_err(failure.to_string()),
    }
}
