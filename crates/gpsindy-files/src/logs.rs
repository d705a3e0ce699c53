//! Several log files as one dataset: always a list of runs.

use crate::align::{TopicOffset, align};
use crate::error::{Error, Result};
use crate::log::Log;
use crate::merge::{Roles, merge};
use crate::options::LogOptions;
use gpsindy_core::{Channel, Dataset, Hold, Progress, Run, Silent};
use std::collections::HashSet;
use std::io::Read;
use std::path::Path;

/// Log files that were read and not yet cut down to the columns of a task.
///
/// ```
/// use gpsindy_files::{LogOptions, Logs};
/// let logs = Logs::parse("a.csv", b"t,x [m],remark\n0,1,ok\n1,2,ok\n", &LogOptions::default())?;
/// let data = logs.dataset(&["x"], &[])?;
/// assert_eq!(data.channels()[0].unit, "m");
/// assert_eq!(logs.ignored(&["x"]), ["remark"]);
/// # Ok::<(), gpsindy_files::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Logs {
    files: Vec<Log>,
}

/// Columns that a task reads.
#[derive(Debug, Clone, Default)]
pub struct Task {
    /// Columns that every log must have.
    pub needed: Vec<String>,
    /// Columns that a log may lack.
    pub optional: Vec<String>,
    /// Which of both are controls.
    pub controls: Vec<String>,
    /// What a control does between its own stamps, at the stamps of other topics.
    pub hold: Hold,
}

/// What was read.
#[derive(Debug, Clone)]
pub struct Assembled {
    /// One channel a column, in the order asked for.
    pub data: Dataset,
    /// What the user should know: one sentence each.
    pub notes: Vec<String>,
    /// Offsets of clocks that were estimated; each displays as one sentence.
    pub offsets: Vec<TopicOffset>,
}

impl Logs {
    /// Reads files; `-` is standard input.
    ///
    /// # Errors
    /// [`Error::Read`], and everything that [`Log::parse`] refuses.
    pub fn read<P: AsRef<Path>>(paths: &[P], options: &LogOptions) -> Result<Self> {
        Self::read_with(paths, options, &Silent)
    }

    /// The same with reports of progress.
    ///
    /// # Errors
    /// As [`Logs::read`], and a request to stop.
    pub fn read_with<P: AsRef<Path>>(paths: &[P], options: &LogOptions, progress: &dyn Progress) -> Result<Self> {
        let mut files = Vec::with_capacity(paths.len());
        for (i, path) in paths.iter().enumerate() {
            if !progress.report("opening", i, paths.len()) {
                return Err(gpsindy_core::Error::Cancelled.into());
            }
            let path = path.as_ref();
            if path.as_os_str() != "-" {
                files.push(Log::read_with(path, options, progress)?);
                continue;
            }
            if files.iter().any(|log: &Log| log.file == "stdin") {
                return Err(Error::file("stdin", "`-` appears twice; standard input can be read once"));
            }
            let mut bytes = Vec::new();
            std::io::stdin().read_to_end(&mut bytes).map_err(|source| Error::Read { file: "stdin".into(), source })?;
            files.push(Log::parse("stdin", &bytes, options)?);
        }
        if files.is_empty() {
            return Err(gpsindy_core::Error::data("no log was named; hand in at least one").into());
        }
        Ok(Self { files })
    }

    /// Reads one log from memory; `file` names it in messages.
    ///
    /// # Errors
    /// Everything that [`Log::parse`] refuses.
    pub fn parse(file: &str, bytes: &[u8], options: &LogOptions) -> Result<Self> {
        Ok(Self { files: vec![Log::parse(file, bytes, options)?] })
    }

    /// One log that was read already.
    pub fn of(log: Log) -> Self {
        Self { files: vec![log] }
    }

    /// The files, in the order they were named.
    pub fn files(&self) -> &[Log] {
        &self.files
    }

    /// Names of the columns that every file has, besides time and run, in the first file's order.
    pub fn columns(&self) -> Vec<String> {
        let Some((first, rest)) = self.files.split_first() else { return Vec::new() };
        let has = |log: &Log, name: &str| log.column(name).is_some_and(|header| header.name == name);
        let everywhere = |name: &str| rest.iter().all(|log| has(log, name));
        first.columns().map(|h| h.name.clone()).filter(|name| everywhere(name)).collect()
    }

    /// Names of the columns that every file has and that hold numbers only.
    pub fn numeric_columns(&self) -> Vec<String> {
        self.columns().into_iter().filter(|name| self.files.iter().all(|log| log.is_numeric(name))).collect()
    }

    /// The name of the column that an option means, which may be its whole header.
    ///
    /// # Errors
    /// [`Error::File`] where a file lacks it.
    pub fn resolve(&self, column: &str) -> Result<String> {
        let mut name = None;
        for log in &self.files {
            name = Some(log.column(column).ok_or_else(|| log.lacks(column))?.name.clone());
        }
        Ok(name.unwrap_or_default())
    }

    /// The columns that a task needs, as a dataset; a channel has the name given here.
    ///
    /// `optional` columns are left out where no file has them, and missing throughout a file that lacks one of them.
    ///
    /// # Errors
    /// A file that lacks a needed column, a cell that is no number or infinite.
    pub fn dataset<S: AsRef<str>>(&self, needed: &[S], optional: &[S]) -> Result<Dataset> {
        let names = |list: &[S]| list.iter().map(|s| s.as_ref().to_string()).collect();
        let task = Task { needed: names(needed), optional: names(optional), ..Task::default() };
        Ok(self.assemble(&task, &Silent)?.data)
    }

    /// The same where some columns are controls, with what the user should know about the reading.
    ///
    /// Topics on their own clocks are merged: a state is missing at the stamps of other topics, a control is held from its
    /// own (or interpolated).
    ///
    /// # Errors
    /// As [`Logs::dataset`], topics without a common time, an offset that the columns do not determine, and a request to stop.
    pub fn assemble(&self, task: &Task, progress: &dyn Progress) -> Result<Assembled> {
        let present = |name: &&String| self.files.iter().any(|log| log.position(name).is_some());
        let names: Vec<(&String, bool)> = (task.needed.iter().map(|name| (name, true)))
            .chain(task.optional.iter().filter(present).map(|name| (name, false)))
            .collect();
        let unit =
            |name: &str| self.files.iter().find_map(|log| log.column(name)).map(|h| h.unit.clone()).unwrap_or_default();
        let channels = names.iter().map(|(name, _)| Channel::new(*name).with_unit(unit(name))).collect();
        let names_of: Vec<&str> = names.iter().map(|(name, _)| name.as_str()).collect();
        let held: Vec<bool> = names.iter().map(|(name, _)| task.controls.contains(name)).collect();
        let (mut runs, mut notes, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        for (i, log) in self.files.iter().enumerate() {
            if !progress.report("reading", i, self.files.len()) {
                return Err(gpsindy_core::Error::Cancelled.into());
            }
            // Places in the log of the columns that it has, and their places in the dataset.
            let (mut places, mut targets) = (Vec::new(), Vec::new());
            for (j, (name, needed)) in names.iter().enumerate() {
                match log.position(name) {
                    Some(place) => {
                        places.push(place);
                        targets.push(j);
                    }
                    None if *needed => return Err(log.lacks(name)),
                    None => {}
                }
            }
            let mut reading = log.read_columns(&places, progress)?;
            for (column, _) in reading.topics.iter_mut().flat_map(|topic| &mut topic.columns) {
                *column = targets[*column];
            }
            let aligned = align(log, &mut reading.topics, &names_of, &held, progress)?;
            offsets.extend(aligned);
            let (found, more) = merge(&log.file, reading.topics, Roles { held: &held, hold: task.hold })?;
            runs.extend(found.into_iter().map(|run| Run { name: self.run_name(log, &run.name), ..run }));
            notes.extend(reading.notes.into_iter().chain(more));
        }
        Ok(Assembled { data: Dataset::new(channels, runs)?, notes, offsets })
    }

    /// Columns of any file that are not among the `used` ones, each once.
    pub fn ignored<S: AsRef<str>>(&self, used: &[S]) -> Vec<String> {
        let names: HashSet<&str> = used.iter().map(AsRef::as_ref).collect();
        let texts: HashSet<&str> = used.iter().map(|name| name.as_ref().trim()).collect();
        let mut seen = HashSet::new();
        let headers = self.files.iter().flat_map(Log::columns);
        let ignored = headers.filter(|h| !names.contains(h.name.as_str()) && !texts.contains(h.text.as_str()));
        ignored.filter(|h| seen.insert(h.name.as_str())).map(|h| h.name.clone()).collect()
    }

    /// What is likely a mistake but can be read: a time column in another unit than seconds.
    pub fn warnings(&self) -> Vec<String> {
        let warning = |log: &Log| {
            let (header, unit) = log.foreign_time()?;
            let text = &header.text;
            Some(format!(
                "{}: the time column `{text}` is not in seconds; its numbers are used as they are, so every rate is per {unit}",
                log.file
            ))
        };
        self.files.iter().filter_map(warning).collect()
    }

    /// The unit in which all logs count time, `s` unless every time column names another one: `t [years]`, or a column `year`.
    ///
    /// ```
    /// use gpsindy_files::{LogOptions, Logs};
    /// let logs = Logs::parse("a.csv", b"t [years],x\n0,1\n1,2\n", &LogOptions::default())?;
    /// assert_eq!(logs.time_unit(), "years");
    /// # Ok::<(), gpsindy_files::Error>(())
    /// ```
    pub fn time_unit(&self) -> &str {
        let mut units = self.files.iter().map(|log| log.foreign_time().map_or("s", |(_, unit)| unit));
        let first = units.next().unwrap_or("s");
        if units.all(|unit| unit == first) { first } else { "s" }
    }

    /// The file's name, without folders where that is clear, and the run's.
    fn run_name(&self, log: &Log, run: &str) -> String {
        let base =
            |file: &str| Path::new(file).file_name().map_or(file.to_string(), |n| n.to_string_lossy().into_owned());
        let short = base(&log.file);
        let unique = self.files.iter().filter(|other| base(&other.file) == short).count() == 1;
        let name = if unique { short } else { log.file.clone() };
        if run.is_empty() { name } else { format!("{name}:{run}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logs(files: &[(&str, &str)]) -> Logs {
        let parse = |(file, text): &(&str, &str)| Log::parse(file, text.as_bytes(), &LogOptions::default()).unwrap();
        Logs { files: files.iter().map(parse).collect() }
    }

    #[test]
    fn columns_follow_names_and_not_positions() {
        let logs = logs(&[("d/a.csv", "t,x,u\n0,1,2\n1,3,4\n"), ("d/b.csv", "u,t,x\n6,0,5\n8,1,7\n")]);
        let data = logs.dataset(&["x", "u"], &[]).unwrap();
        assert_eq!(data.runs()[1].column(0), [5.0, 7.0]);
        assert_eq!(data.runs()[1].column(1), [6.0, 8.0]);
        assert_eq!(data.runs().iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["a.csv", "b.csv"]);
    }

    #[test]
    fn a_needed_column_that_one_file_lacks_names_the_file() {
        let logs = logs(&[("a.csv", "t,x,u\n0,1,2\n1,3,4\n"), ("b.csv", "t,x\n0,1\n1,2\n")]);
        let error = logs.dataset(&["x", "u"], &[]).unwrap_err();
        assert_eq!(error.to_string(), "b.csv: column `u` is not in the file; found: x");
        let data = logs.dataset(&["x"], &["u", "w"]).unwrap();
        assert_eq!(data.channels().len(), 2);
        assert!(data.runs()[1].column(1).iter().all(|v| v.is_nan()));
    }

    #[test]
    fn equal_file_names_in_two_folders_stay_apart() {
        let logs = logs(&[("a/log.csv", "t,x\n0,1\n1,3\n"), ("b/log.csv", "t,x\n0,1\n1,2\n")]);
        let data = logs.dataset(&["x"], &[]).unwrap();
        assert_eq!(data.runs()[0].name, "a/log.csv");
        assert_eq!(data.runs()[1].name, "b/log.csv");
    }

    #[test]
    fn ignored_columns_are_listed_once() {
        let logs = logs(&[("a.csv", "t,x,y [m],z\n0,1,2,3\n1,3,4,5\n"), ("b.csv", "t,x,z\n0,1,2\n1,2,2\n")]);
        assert_eq!(logs.ignored(&["x", "y [m]"]), ["z"]);
        assert_eq!(logs.columns(), ["x", "z"]);
    }

    #[test]
    fn milliseconds_are_warned_of() {
        assert_eq!(logs(&[("a.csv", "t [ms],x\n0,1\n1,3\n")]).warnings().len(), 1);
        assert!(logs(&[("a.csv", "t [s],x\n0,1\n1,3\n"), ("b.csv", "t,x\n0,1\n1,3\n")]).warnings().is_empty());
    }

    #[test]
    fn the_unit_of_time_is_one_that_all_logs_share() {
        let years = ("a.csv", "t [years],x\n0,1\n1,3\n");
        assert_eq!(logs(&[years, ("b.csv", "t (years),x\n0,1\n1,3\n")]).time_unit(), "years");
        assert_eq!(logs(&[years, ("b.csv", "t,x\n0,1\n1,3\n")]).time_unit(), "s");
        // Dates are counted in seconds, whatever their header says.
        assert_eq!(logs(&[("a.csv", "t [day],x\n2024-05-01T12:00,1\n2024-05-02T12:00,3\n")]).time_unit(), "s");
        let options = LogOptions { time: Some("year".into()), ..LogOptions::default() };
        assert_eq!(Logs::parse("a.csv", b"year,x\n1900,1\n1901,3\n", &options).unwrap().time_unit(), "year");
    }
}
