//! Logs: runs of arrays, or CSV files.

use crate::convert::{Matrix, Vector, array1, array2, error, file_error, matrix, vector};
use gpsindy_core::{Channel, Dataset, Run};
use gpsindy_files::{Header, LogOptions, Logs};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Runs that carry the same channels.
#[pyclass(frozen, name = "Dataset", module = "gpsindy._gpsindy")]
pub(crate) struct PyDataset(pub(crate) Arc<Dataset>);

#[pymethods]
impl PyDataset {
    #[new]
    fn new(
        columns: Vec<String>,
        units: Vec<String>,
        names: Vec<String>,
        times: Vec<Vector<'_>>,
        values: Vec<Matrix<'_>>,
    ) -> PyResult<Self> {
        if columns.len() != units.len() || names.len() != times.len() || names.len() != values.len() {
            return Err(PyValueError::new_err("as many units as columns and as many names as runs are needed"));
        }
        let channels = columns.into_iter().zip(units).map(|(name, unit)| Channel { name, unit }).collect();
        let runs = names.into_iter().zip(&times).zip(&values);
        let runs = runs.map(|((name, t), x)| Run { name, time: vector(t), values: matrix(x) }).collect();
        Ok(Dataset::new(channels, runs).map_err(error)?.into())
    }

    /// Every column of numbers in the files, and what is likely a mistake in them.
    #[staticmethod]
    #[pyo3(signature = (paths, time=None, run=None, rename=Vec::new()))]
    fn read_csv(
        py: Python<'_>,
        paths: Vec<PathBuf>,
        time: Option<String>,
        run: Option<String>,
        rename: Vec<(String, String)>,
    ) -> PyResult<(Self, Vec<String>)> {
        let options = LogOptions { time, run, rename };
        let read = py.detach(|| {
            let logs = Logs::read(&paths, &options)?;
            let data = logs.dataset(&logs.numeric_columns(), &[])?;
            Ok((data.into(), logs.warnings()))
        });
        read.map_err(file_error)
    }

    #[getter]
    fn columns(&self) -> Vec<String> {
        self.0.channels().iter().map(|c| c.name.clone()).collect()
    }

    #[getter]
    fn units(&self) -> Vec<String> {
        self.0.channels().iter().map(|c| c.unit.clone()).collect()
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.0.runs().iter().map(|r| r.name.clone()).collect()
    }

    fn time<'py>(&self, py: Python<'py>, run: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(array1(py, &self.run(run)?.time))
    }

    fn values<'py>(&self, py: Python<'py>, run: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(array2(py, &self.run(run)?.values))
    }

    /// The runs with these indices.
    fn with_runs(&self, indices: Vec<usize>) -> PyResult<Self> {
        Ok(self.0.with_runs(&indices).map_err(error)?.into())
    }

    /// Without the jumps of these wrapped angles (rad).
    fn unwrap_angles(&self, columns: Vec<String>) -> PyResult<Self> {
        let mut data = Dataset::clone(&self.0);
        for column in &columns {
            data.unwrap_angle(column).map_err(error)?;
        }
        Ok(data.into())
    }

    fn __len__(&self) -> usize {
        self.0.runs().len()
    }
}

impl From<Dataset> for PyDataset {
    fn from(data: Dataset) -> Self {
        Self(Arc::new(data))
    }
}

impl PyDataset {
    fn run(&self, index: usize) -> PyResult<&Run> {
        let count = self.0.runs().len();
        self.0.runs().get(index).ok_or_else(|| PyIndexError::new_err(format!("run {index} of {count}")))
    }
}

/// Name and unit of a column from its header, as in log files.
#[pyfunction]
pub(crate) fn parse_header(text: &str) -> (String, String) {
    let header = Header::parse(text);
    (header.name, header.unit)
}
