//! The samples of a log of any format, for a closer look: every topic and every field, none wanted more than another.

use super::Sheet;
use super::column::Column;
use crate::error::{Error, Result};
use crate::formats::csv_log::CsvLog;
use crate::header::Header;
use crate::input::{Input, Kind};
use crate::options::LogOptions;
use crate::topic::{Reading, Source};
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
        Kind::Csv => of_csv(&input, &options, progress),
        #[cfg(feature = "mcap")]
        Kind::Mcap => mcap::look(vec![input], file, options.stamp, progress),
        #[cfg(feature = "parquet")]
        Kind::Parquet => {
            let log = crate::formats::parquet_log::ParquetLog::open(vec![input], &file, &options, &Default::default())?;
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
    if crate::formats::parquet_log::lerobot::is(path) {
        let log = crate::formats::parquet_log::lerobot::open(path, options)?;
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

/// Values that are in memory at a time.
const AT_ONCE: usize = 4_000_000;

fn of_csv(input: &Input, options: &LogOptions, progress: &dyn Progress) -> Result<Looked> {
    let log = CsvLog::open(input.clone(), options, false, progress)?;
    let doubt = log.doubt();
    let mut notes = log.notes();
    notes.retain(|note| !doubt.as_ref().is_some_and(|doubt| note.ends_with(doubt)));
    let has_plain_time = log.has_plain_time();
    let mut sheet =
        Sheet { clock: log.time_name().into(), origin: log.origin(), doubt, has_plain_time, ..Sheet::default() };
    let column = |(index, header): (usize, &Header)| {
        let numeric = log.is_numeric(index);
        let kind = if numeric { "number" } else { "text" };
        let cells = log.cells_of(index).filter(|cells| cells.texts > 0 && cells.texts <= cells.numbers);
        let texts = cells.map(|cells| (cells.texts, cells.text.clone()));
        Column::new(&header.name, &header.name, kind, &header.unit, numeric).with_texts(texts)
    };
    sheet.columns = log.columns().enumerate().map(column).collect();
    let numeric: Vec<usize> = (0..sheet.columns.len()).filter(|&i| sheet.columns[i].numeric).collect();
    // A log without a number still has stamps.
    let groups = numeric.chunks((AT_ONCE / log.times.len().max(1)).max(1));
    for group in groups.chain(numeric.is_empty().then_some(&[][..])) {
        // An infinite value is reported, and its column left without values.
        for columns in readable(&log, group, progress, &mut notes)? {
            take(&mut sheet, &columns.0, columns.1);
        }
    }
    Ok((input.file.clone(), "CSV", vec![sheet], notes))
}

/// What can be read of columns: all at once, or one by one where one of them holds what is no value.
fn readable(
    log: &CsvLog,
    columns: &[usize],
    progress: &dyn Progress,
    notes: &mut Vec<String>,
) -> Result<Vec<(Vec<usize>, Reading)>> {
    match log.read(columns, progress) {
        Ok(reading) => Ok(vec![(columns.to_vec(), reading)]),
        Err(error @ Error::Line { .. }) if columns.len() <= 1 => {
            notes.push(error.to_string());
            Ok(vec![(Vec::new(), log.read(&[], progress)?)])
        }
        Err(Error::Line { .. }) => {
            let mut found = Vec::new();
            for column in columns {
                found.extend(readable(log, &[*column], progress, notes)?);
            }
            Ok(found)
        }
        Err(other) => Err(other),
    }
}

/// Hands columns their values, run after run; the first reading brings the stamps.
fn take(sheet: &mut Sheet, columns: &[usize], reading: Reading) {
    let first = sheet.stamps.is_empty();
    for topic in reading.topics {
        if first {
            sheet.runs.push(sheet.stamps.len());
            sheet.stamps.extend(&topic.stamps);
        }
        for (j, values) in topic.columns {
            let column = &mut sheet.columns[columns[j]];
            column.end_run();
            values.into_iter().for_each(|value| column.push(value));
        }
    }
}
