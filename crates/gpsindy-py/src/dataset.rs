//! Logs: runs of arrays, or CSV files.

use crate::convert::{Matrix, Vector, array1, columns, error, file_error, matrix, vector};
use crate::watch::Watch;
use gpsindy_core::{Channel, Dataset, Hold, Run};
use gpsindy_files::{Header, LogOptions, Logs, Offset, Stamp, Task};
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

    /// Columns of logs of any format, and what the user should know about them. Without names every column of numbers.
    #[staticmethod]
    #[pyo3(signature = (paths, options, columns=None, controls=Vec::new(), linear=false))]
    fn read_log(
        py: Python<'_>,
        paths: Vec<PathBuf>,
        options: &PyLogOptions,
        columns: Option<Vec<String>>,
        controls: Vec<String>,
        linear: bool,
    ) -> PyResult<(Self, Vec<String>)> {
        let options = options.0.clone();
        let watch = Arc::new(Watch::default());
        let progress = Arc::clone(&watch);
        let hold = if linear { Hold::Linear } else { Hold::Zero };
        let read = move || {
            let logs = Logs::read(&paths, &options)?;
            let needed = columns.unwrap_or_else(|| logs.numeric_columns());
            let read = logs.assemble(&Task { needed, controls, hold, ..Task::default() }, &*progress)?;
            let offsets = read.offsets.iter().map(ToString::to_string).collect();
            Ok((read.data, [logs.warnings(), read.notes, offsets].concat()))
        };
        let (data, doubts) = watch.run(py, None, move || Ok(read()))?.map_err(file_error)?;
        Ok((data.into(), doubts))
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
        Ok(columns(py, &self.run(run)?.values))
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

/// How columns of logs are found.
#[pyclass(frozen, name = "LogOptions", module = "gpsindy._gpsindy")]
pub(crate) struct PyLogOptions(LogOptions);

#[pymethods]
impl PyLogOptions {
    #[new]
    #[pyo3(signature = (time=None, run=None, rename=Vec::new(), map=Vec::new(), unit=Vec::new(), offset=Vec::new(), stamp=None, map_file=None))]
    #[expect(clippy::too_many_arguments, reason = "one a keyword of Python's")]
    fn new(
        time: Option<String>,
        run: Option<String>,
        rename: Vec<(String, String)>,
        map: Vec<(String, String)>,
        unit: Vec<(String, String)>,
        offset: Vec<(String, String)>,
        stamp: Option<&str>,
        map_file: Option<PathBuf>,
    ) -> PyResult<Self> {
        let wrong = |message: String| PyValueError::new_err(message);
        let stamp = match stamp {
            None => Stamp::Auto,
            Some("header") => Stamp::Header,
            Some("log") => Stamp::Log,
            Some(other) => return Err(wrong(format!("stamp: expected 'header' or 'log', found {other:?}"))),
        };
        let offset = offset.into_iter().map(|(topic, shift)| {
            shift.parse::<Offset>().map(|shift| (topic, shift)).map_err(|e| wrong(format!("offset: {e}")))
        });
        let offset = offset.collect::<PyResult<Vec<_>>>()?;
        let mut options = LogOptions { time, run, rename, constant: Vec::new(), map, unit, stamp, offset };
        if let Some(file) = map_file {
            options.add_map_file(&file).map_err(file_error)?;
        }
        Ok(Self(options))
    }
}

/// What a log holds: as JSON, and as text of at most `width` characters a line.
#[pyfunction]
pub(crate) fn inspect(
    py: Python<'_>,
    path: PathBuf,
    options: &PyLogOptions,
    width: usize,
) -> PyResult<(String, String)> {
    let options = options.0.clone();
    let watch = Arc::new(Watch::default());
    let progress = Arc::clone(&watch);
    let found =
        watch.run(py, None, move || Ok(gpsindy_files::inspect(&path, &options, &*progress)))?.map_err(file_error)?;
    Ok((found.json().to_string(), found.text(width)))
}
