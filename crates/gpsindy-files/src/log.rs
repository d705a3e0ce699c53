//! One log of any format.

use crate::constants::with_constants;
use crate::error::{Error, Result};
use crate::formats::csv_log::CsvLog;
use crate::header::Header;
use crate::input::{Input, Kind};
use crate::options::{LogOptions, Offset};
use crate::topic::{Reading, Source};
use gpsindy_core::{Progress, Silent};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// A log that was opened; its columns are read when they are asked for.
///
/// So a column that nobody asks for may hold text.
#[derive(Debug, Clone)]
pub struct Log {
    /// The file, as the user named it.
    pub file: String,
    source: Arc<dyn Source>,
    unaligned: Vec<String>,
    /// Places of the columns by name, and by whole header.
    places: Arc<[HashMap<String, usize>; 2]>,
}

impl Log {
    /// Reads the bytes of a log of any format; `file` names them in messages.
    ///
    /// # Errors
    /// [`Error::Line`] or [`Error::File`]. CSV: not UTF-8, no header, a column twice, no time column, a row of another
    /// length, a time that is no number or does not increase, fewer than 2 samples in a run. Others: a format that is
    /// not read, a file that is broken before its first sample, a mapped topic or field that is not there.
    pub fn parse(file: &str, bytes: &[u8], options: &LogOptions) -> Result<Self> {
        Self::open(Input::of_bytes(file, bytes), options, &Silent)
    }

    /// Opens a file, or the folder of a data set.
    ///
    /// # Errors
    /// [`Error::Read`], and what [`Log::parse`] refuses.
    pub fn read(path: &Path, options: &LogOptions) -> Result<Self> {
        Self::read_with(path, options, &Silent)
    }

    /// The same with reports of progress: a table of text is looked through once for its times, a log of topics without a
    /// summary for its topics.
    ///
    /// # Errors
    /// As [`Log::read`], and a request to stop.
    pub fn read_with(path: &Path, options: &LogOptions, progress: &dyn Progress) -> Result<Self> {
        if path.is_dir() {
            return Self::of_folder(path, options, progress);
        }
        Self::open(Input::of_path(path), options, progress)
    }

    pub(crate) fn open(input: Input, options: &LogOptions, progress: &dyn Progress) -> Result<Self> {
        let file = input.file.clone();
        let source: Arc<dyn Source> = match input.kind()? {
            Kind::Csv => Arc::new(CsvLog::open(input, options, true, progress)?),
            Kind::Mcap => mcap(vec![input], &file, options, progress)?,
            Kind::Parquet => parquet(input, options)?,
            Kind::Ulog => ulog(input, options)?,
        };
        Self::of_source(file, source, options)
    }

    fn of_source(file: String, source: Arc<dyn Source>, options: &LogOptions) -> Result<Self> {
        let source = with_constants(&file, source, options)?;
        let auto = options.offset.iter().filter(|(_, offset)| *offset == Offset::Auto);
        Ok(Self::with(file, source, auto.map(|(topic, _)| topic.clone()).collect()))
    }

    /// A LeRobot data set, or the folder of a ROS 2 bag with its parts.
    fn of_folder(path: &Path, options: &LogOptions, progress: &dyn Progress) -> Result<Self> {
        let file = path.display().to_string();
        if let Some(source) = data_set(path, options)? {
            return Self::of_source(file, source, options);
        }
        let parts = parts(path)?;
        if parts.is_empty() {
            let message = "a folder that is neither a LeRobot data set (meta/info.json) nor a ROS 2 bag (*.mcap); name the files in it";
            return Err(Error::file(&file, message));
        }
        let source = mcap(parts, &file, options, progress)?;
        Self::of_source(file, source, options)
    }

    pub(crate) fn of_csv(log: CsvLog) -> Self {
        Self::with(log.file.clone(), Arc::new(log), Vec::new())
    }

    fn with(file: String, source: Arc<dyn Source>, unaligned: Vec<String>) -> Self {
        let (mut names, mut texts) = (HashMap::new(), HashMap::new());
        for (i, header) in source.columns().iter().enumerate() {
            names.entry(header.name.clone()).or_insert(i);
            texts.entry(header.text.clone()).or_insert(i);
        }
        Self { file, source, unaligned, places: Arc::new([names, texts]) }
    }

    /// The columns besides time and run, in the log's order.
    pub fn columns(&self) -> impl Iterator<Item = &Header> {
        self.source.columns().iter()
    }

    /// The column that an option or a model names, if the log has it.
    pub fn column(&self, name: &str) -> Option<&Header> {
        self.position(name).map(|i| &self.source.columns()[i])
    }

    /// Whether every value of a column is a number or missing.
    pub fn is_numeric(&self, name: &str) -> bool {
        self.position(name).is_some_and(|i| self.source.is_numeric(i))
    }

    /// The place of a column, by its name or its whole header.
    pub(crate) fn position(&self, name: &str) -> Option<usize> {
        let [names, texts] = &*self.places;
        names.get(name).or_else(|| texts.get(name.trim())).copied()
    }

    /// The error that says that `name` is not in this log and what is.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        self.source.lacks(name)
    }

    /// The topics whose offset is to be estimated.
    pub(crate) fn unaligned(&self) -> &[String] {
        &self.unaligned
    }

    pub(crate) fn read_columns(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        self.source.read(columns, progress)
    }

    /// The header of the time column and its unit, where that is another one than the second.
    pub(crate) fn foreign_time(&self) -> Option<(&Header, &str)> {
        let header = self.source.time_header()?;
        Some((header, crate::time::foreign_unit(header)?))
    }
}

/// The MCAP files of a folder in their order: `bag_9.mcap` comes before `bag_10.mcap`.
pub(crate) fn parts(folder: &Path) -> Result<Vec<Input>> {
    let failed = |source| Error::Read { file: folder.display().to_string(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|e| e == "mcap") {
            paths.push(path);
        }
    }
    paths.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(paths.iter().map(|path| Input::of_path(path)).collect())
}

#[cfg(feature = "mcap")]
fn mcap(inputs: Vec<Input>, file: &str, options: &LogOptions, progress: &dyn Progress) -> Result<Arc<dyn Source>> {
    Ok(Arc::new(crate::formats::mcap_log::McapLog::open(inputs, file, options, progress)?))
}

#[cfg(not(feature = "mcap"))]
fn mcap(_: Vec<Input>, file: &str, _: &LogOptions, _: &dyn Progress) -> Result<Arc<dyn Source>> {
    Err(without(file, "MCAP", "mcap"))
}

#[cfg(feature = "parquet")]
fn parquet(input: Input, options: &LogOptions) -> Result<Arc<dyn Source>> {
    let file = input.file.clone();
    Ok(Arc::new(crate::formats::parquet_log::ParquetLog::open(vec![input], &file, options, &HashMap::new())?))
}

#[cfg(not(feature = "parquet"))]
fn parquet(input: Input, _: &LogOptions) -> Result<Arc<dyn Source>> {
    Err(without(&input.file, "Parquet", "parquet"))
}

#[cfg(feature = "parquet")]
fn data_set(path: &Path, options: &LogOptions) -> Result<Option<Arc<dyn Source>>> {
    use crate::formats::parquet_log::lerobot;
    if !lerobot::is(path) {
        return Ok(None);
    }
    Ok(Some(Arc::new(lerobot::open(path, options)?)))
}

#[cfg(not(feature = "parquet"))]
fn data_set(_: &Path, _: &LogOptions) -> Result<Option<Arc<dyn Source>>> {
    Ok(None)
}

#[cfg(feature = "ulog")]
fn ulog(input: Input, options: &LogOptions) -> Result<Arc<dyn Source>> {
    Ok(Arc::new(crate::formats::ulog::Ulog::open(input, options)?))
}

#[cfg(not(feature = "ulog"))]
fn ulog(input: Input, _: &LogOptions) -> Result<Arc<dyn Source>> {
    Err(without(&input.file, "ULog", "ulog"))
}

#[cfg(not(all(feature = "mcap", feature = "parquet", feature = "ulog")))]
fn without(file: &str, format: &str, feature: &str) -> Error {
    let cure = format!("build gpsindy with the feature `{feature}`");
    Error::file(file, format!("a log in {format}, which this build does not read; {cure}"))
}
