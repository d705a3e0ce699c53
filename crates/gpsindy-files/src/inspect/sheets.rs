//! The samples of a log of any format, for a closer look: every topic and every field, none wanted more than another.

use super::Sheet;
use super::column::Column;
use crate::csv_log::CsvLog;
use crate::error::{Error, Result};
use crate::input::{Input, Kind};
use crate::log::LogOptions;
use gpsindy_core::Progress;
use std::io::Read;
use std::path::Path;

#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "ulog")]
mod ulog;

/// File, format, sheets and notes.
pub(crate) type Looked = (String, &'static str, Vec<Sheet>, Vec<String>);

pub(crate) fn of(path: &Path, options: &LogOptions, progress: &dyn Progress) -> Result<Looked> {
    // A map and new names are for a task; here everything goes by its own name.
    let options = LogOptions { time: options.time.clone(), run: options.run.clone(), ..LogOptions::default() };
    let file = path.display().to_string();
    if path.is_dir() {
        return of_folder(path, &file, &options, progress);
    }
    let input = if path.as_os_str() == "-" {
        let mut bytes = Vec::new();
        let failed = |source| Error::Read { file: "stdin".into(), source };
        std::io::stdin().read_to_end(&mut bytes).map_err(failed)?;
        Input::of_bytes("stdin", &bytes)
    } else {
        Input::of_path(path)
    };
    let file = input.file.clone();
    match input.kind()? {
        Kind::Csv => of_csv(&input, &options),
        #[cfg(feature = "mcap")]
        Kind::Mcap => mcap::look(vec![input], file, options.stamp, progress),
        #[cfg(feature = "parquet")]
        Kind::Parquet => {
            let log = crate::parquet_log::ParquetLog::open(vec![input], &file, &options, &Default::default())?;
            parquet::look(&log, file, "Parquet", progress)
        }
        #[cfg(feature = "ulog")]
        Kind::Ulog => ulog::look(&input, progress),
        #[cfg(not(all(feature = "mcap", feature = "parquet", feature = "ulog")))]
        _ => Err(Error::file(&file, "a format that this build does not read; build gpsindy with its feature")),
    }
}

fn of_folder(path: &Path, file: &str, options: &LogOptions, progress: &dyn Progress) -> Result<Looked> {
    #[cfg(feature = "parquet")]
    if crate::parquet_log::lerobot::is(path) {
        let log = crate::parquet_log::lerobot::open(path, options)?;
        return parquet::look(&log, file.into(), "LeRobot data set", progress);
    }
    let parts = crate::log::parts(path)?;
    #[cfg(feature = "mcap")]
    if !parts.is_empty() {
        return mcap::look(parts, file.into(), options.stamp, progress);
    }
    let _ = (options, progress, parts);
    let message =
        "a folder that is neither a LeRobot data set (meta/info.json) nor a ROS 2 bag (*.mcap); name the files in it";
    Err(Error::file(file, message))
}

fn of_csv(input: &Input, options: &LogOptions) -> Result<Looked> {
    let log = CsvLog::open(&input.file, &input.bytes()?, options)?;
    let runs = log.runs();
    let order: Vec<usize> = runs.iter().flat_map(|(_, rows)| rows.iter().copied()).collect();
    let mut begin = 0;
    let mut begins = Vec::new();
    for (_, rows) in &runs {
        begins.push(begin);
        begin += rows.len();
    }
    let mut sheet = Sheet {
        clock: log.time_name().into(),
        stamps: order.iter().map(|&i| log.times[i]).collect(),
        runs: begins,
        origin: log.origin(),
        ..Sheet::default()
    };
    let mut notes = Vec::new();
    for (index, header) in log.columns().enumerate() {
        let numeric = crate::topic::Source::is_numeric(&log, index);
        let kind = if numeric { "number" } else { "text" };
        let mut column = Column::new(&header.name, &header.name, kind, &header.unit, numeric);
        match if numeric { log.values(&header.name) } else { Ok(Vec::new()) } {
            Ok(values) => fill(&mut column, &values, &order, &sheet.runs),
            Err(error) => notes.push(error.to_string()),
        }
        sheet.columns.push(column);
    }
    Ok((input.file.clone(), "CSV", vec![sheet], notes))
}

/// Hands a column its values, run after run.
fn fill(column: &mut Column, values: &[f64], order: &[usize], runs: &[usize]) {
    for (i, &row) in order.iter().enumerate() {
        if runs.binary_search(&i).is_ok() {
            column.end_run();
        }
        if let Some(value) = values.get(row) {
            column.push(*value);
        }
    }
}
