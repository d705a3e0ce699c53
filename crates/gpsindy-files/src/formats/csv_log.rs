//! One CSV file: a header row, then one sample per row. Every kind of bad input gives one error with file, line and column.

use crate::error::{Error, Result};
use crate::header::Header;
use crate::input::Input;
use crate::options::LogOptions;
use crate::time::{self, Clock};
use crate::topic::{Reading, Source, Topic};
use gpsindy_core::Progress;
use std::collections::HashMap;
use std::sync::OnceLock;

mod cell;
mod cells;
mod headers;
mod scan;

pub(crate) use cell::Row;
use cell::{cell, number, shown};
use cells::Cells;
pub(crate) use headers::separator;
use headers::{headers, missing, names};
use scan::Body;

/// A log file with its time column read; the other columns are read from the file when they are asked for.
///
/// So a column that nobody asks for may hold text.
#[derive(Debug, Clone)]
pub(crate) struct CsvLog {
    /// The file, as the user named it.
    pub(crate) file: String,
    /// Headers after renaming, in the file's order, time and run column included.
    headers: Vec<Header>,
    /// The same without time and run.
    columns: Vec<Header>,
    /// Places of those among the headers.
    places: Vec<usize>,
    time: usize,
    run: Option<usize>,
    clock: Clock,
    header_line: u64,
    /// Where the rows are; `None` where they come one by one.
    body: Option<(Input, Body)>,
    /// The first stamp as it is written.
    first_stamp: String,
    pub(crate) times: Vec<f64>,
    /// Runs in their order, and of several the one of each row.
    run_names: Vec<String>,
    run_of_row: Vec<u32>,
    /// What the cells under each header are, once asked for.
    cells: OnceLock<Vec<Cells>>,
}

impl CsvLog {
    /// Reads the bytes of a log; `file` names them in messages.
    ///
    /// # Errors
    /// As [`CsvLog::open`], and a time that does not increase.
    #[cfg(test)]
    pub(crate) fn parse(file: &str, bytes: &[u8], options: &LogOptions) -> Result<Self> {
        Self::open(Input::of_bytes(file, bytes), options, true, &gpsindy_core::Silent)
    }

    /// Goes through a log once for its times and runs. The other columns are read when they are asked for, by another pass:
    /// so a log is never in memory as text.
    ///
    /// # Errors
    /// [`Error::Line`] or [`Error::File`]: not UTF-8, no header, a column twice, no time column, a row of another
    /// length, a time that is no number; where `ordered`, one that does not increase, fewer than 2 samples in a run.
    pub(crate) fn open(input: Input, options: &LogOptions, ordered: bool, progress: &dyn Progress) -> Result<Self> {
        let Some((body, first)) = scan::head(&input)? else {
            let message = "the file is empty; expected a header row and then one sample a row";
            return Err(Error::file(&input.file, message));
        };
        let mut log = Self::of_header(&input.file, &first, options)?;
        log.read_times(&input, body, ordered, progress)?;
        log.body = Some((input, body));
        Ok(log)
    }

    /// A log of this header, without a sample.
    pub(crate) fn of_header(file: &str, first: &Row, options: &LogOptions) -> Result<Self> {
        let headers = headers(file, first, options)?;
        let find = |column: &str| headers.iter().position(|h| h.answers_to(column));
        let run = match &options.run {
            Some(column) => Some(find(column).ok_or_else(|| missing(file, "run column", column, &headers))?),
            None => None,
        };
        let time = match &options.time {
            Some(column) => find(column).ok_or_else(|| missing(file, "time column", column, &headers))?,
            None => time::column(&headers).ok_or_else(|| {
                let found = names(&headers);
                Error::line(
                    file,
                    first.line,
                    None,
                    format!("no column `t` or `time`; name the time column with --time; found: {found}"),
                )
            })?,
        };
        let places: Vec<usize> = (0..headers.len()).filter(|i| *i != time && Some(*i) != run).collect();
        Ok(Self {
            file: file.into(),
            columns: places.iter().map(|&i| headers[i].clone()).collect(),
            places,
            headers,
            time,
            run,
            clock: Clock::Plain,
            header_line: first.line,
            body: None,
            first_stamp: String::new(),
            times: Vec::new(),
            run_names: Vec::new(),
            run_of_row: Vec::new(),
            cells: OnceLock::new(),
        })
    }

    /// The columns besides time and run, in the file's order.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &Header> {
        self.columns.iter()
    }

    /// The name of the time column.
    pub(crate) fn time_name(&self) -> &str {
        &self.headers[self.time].name
    }

    /// The stamp from which times are counted, s; 0 where they are used as they are.
    pub(crate) fn origin(&self) -> f64 {
        self.clock.origin()
    }

    /// What the user should know of the times.
    pub(crate) fn notes(&self) -> Vec<String> {
        let time = &self.headers[self.time];
        let of_clock = self.clock.note(time, &self.first_stamp);
        of_clock.into_iter().chain(self.doubt()).map(|note| format!("{}: {note}", self.file)).collect()
    }

    /// Whether times are numbers whose unit nobody stated.
    pub(crate) fn has_plain_time(&self) -> bool {
        matches!(self.clock, Clock::Plain) && self.headers[self.time].unit.is_empty()
    }

    /// What the cells of a column are, by one pass over all columns when first asked for.
    pub(crate) fn cells_of(&self, column: usize) -> Option<&Cells> {
        let (input, body) = self.body.as_ref()?;
        let all = self.cells.get_or_init(|| Cells::of_columns(input, *body, self.headers.len()));
        all.get(self.places[column])
    }

    /// What speaks against times in seconds.
    pub(crate) fn doubt(&self) -> Option<String> {
        let time = &self.headers[self.time];
        let is_stated = self.clock.note(time, &self.first_stamp).is_some();
        if is_stated { None } else { time::doubt(time, &self.times) }
    }

    /// The error that says that `name` is not in this file and what is.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        missing(&self.file, "column", name, &self.columns)
    }

    /// The values of a column, NaN where the cell is missing.
    #[cfg(test)]
    pub(crate) fn values(&self, name: &str) -> Result<Vec<f64>> {
        let column = self.columns.iter().position(|h| h.answers_to(name)).ok_or_else(|| self.lacks(name))?;
        let mut values = Vec::with_capacity(self.times.len());
        self.each(&[column], &gpsindy_core::Silent, &mut |_, found| values.push(found[0]))?;
        Ok(values)
    }

    /// The values of columns, row by row; `take` gets the row's number.
    fn each(&self, columns: &[usize], progress: &dyn Progress, take: &mut dyn FnMut(usize, &[f64])) -> Result<()> {
        let Some((input, body)) = &self.body else { return Ok(()) };
        let places: Vec<usize> = columns.iter().map(|c| self.places[*c]).collect();
        let mut values = vec![f64::NAN; places.len()];
        let mut count = 0;
        scan::rows(input, *body, progress, &mut |row| {
            self.check_row(row)?;
            for (value, &place) in values.iter_mut().zip(&places) {
                *value = self.number(row, place)?;
            }
            if count < self.times.len() {
                take(count, &values);
            }
            count += 1;
            Ok(())
        })?;
        if count != self.times.len() {
            return Err(Error::file(
                &self.file,
                "the file changed while it was read; read it again when it is complete",
            ));
        }
        Ok(())
    }

    /// Runs of the file, for tests: name of the run (empty where the file is one run) and its rows in order.
    #[cfg(test)]
    pub(crate) fn runs(&self) -> Vec<(String, Vec<usize>)> {
        if self.run.is_none() {
            return vec![(String::new(), (0..self.times.len()).collect())];
        }
        let mut runs: Vec<(String, Vec<usize>)> =
            self.run_names.iter().map(|name| (name.clone(), Vec::new())).collect();
        for (row, &run) in self.run_of_row.iter().enumerate() {
            runs[run as usize].1.push(row);
        }
        runs
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.places.iter().copied().find(|&i| self.headers[i].answers_to(name))
    }

    fn number(&self, row: &Row, index: usize) -> Result<f64> {
        let text = cell(row, index);
        let wrong = |message: String| Error::line(&self.file, row.line, Some(&self.headers[index].name), message);
        match number(text) {
            Ok(value) if value.is_infinite() => {
                Err(wrong(format!("infinite value {}; leave the cell empty for a missing value", shown(text))))
            }
            Ok(value) => Ok(value),
            Err(()) if number(&text.replacen(',', ".", 1)).is_ok() => {
                Err(wrong(format!("not a number: {}; write the decimals behind a point", shown(text))))
            }
            Err(()) => Err(wrong(format!("not a number: {}; leave the cell empty for a missing value", shown(text)))),
        }
    }

    /// Refuses a comment, and a row of another length than the header's.
    pub(crate) fn check_row(&self, row: &Row) -> Result<()> {
        let (found, expected) = (row.cells.len(), self.headers.len());
        if cell(row, 0).starts_with('#') {
            let message = "a comment among the samples; comments go before the header";
            return Err(Error::line(&self.file, row.line, None, message));
        }
        if found != expected {
            let cells = |n: usize| if n == 1 { "1 cell".to_string() } else { format!("{n} cells") };
            let message =
                format!("{} where the header has {}; complete or remove the row", cells(found), cells(expected));
            return Err(Error::line(&self.file, row.line, None, message));
        }
        Ok(())
    }

    /// Lets the first row say how times are read: as they are, or counted from its own.
    pub(crate) fn start_clock(&mut self, first: &Row) {
        self.clock = Clock::of(cell(first, self.time), &self.headers[self.time].unit).unwrap_or(Clock::Plain);
    }

    /// The time of a row, s.
    pub(crate) fn time_of(&self, row: &Row) -> Result<f64> {
        let value = match self.clock {
            Clock::Plain => self.number(row, self.time)?,
            clock => match (clock.seconds(cell(row, self.time)), cell(row, self.time)) {
                (Some(seconds), _) => seconds,
                (None, "" | "NA" | "nan" | "NaN") => f64::NAN,
                (None, text) => {
                    let message = format!("not a time like that of the first row: {}", shown(text));
                    return Err(Error::line(&self.file, row.line, Some(&self.headers[self.time].name), message));
                }
            },
        };
        if value.is_nan() {
            let message = "the time is missing; fill it in or delete the line";
            return Err(Error::line(&self.file, row.line, Some(&self.headers[self.time].name), message));
        }
        Ok(value)
    }

    /// The run of a row; empty where the file is one run.
    pub(crate) fn run_of<'a>(&self, row: &'a Row) -> &'a str {
        self.run.map_or("", |column| cell(row, column))
    }

    /// The value of a column in a row, NaN where the cell is missing.
    pub(crate) fn value_of(&self, row: &Row, name: &str) -> Result<f64> {
        self.number(row, self.position(name).ok_or_else(|| self.lacks(name))?)
    }

    /// Refuses a time that does not lie behind the one before it in its run.
    pub(crate) fn check_step(&self, before: f64, after: f64, line: u64) -> Result<()> {
        if after > before {
            return Ok(());
        }
        let how = if after < before { "time goes back" } else { "time does not advance" };
        let cure = if self.run.is_some() {
            "sort or thin the samples"
        } else {
            "sort the samples, or name the column of the runs with --run"
        };
        let message = format!("{how}, from {before} to {after}; {cure}");
        Err(Error::line(&self.file, line, Some(&self.headers[self.time].name), message))
    }

    /// Times and runs of all rows. Where `ordered`, times must increase within a run.
    fn read_times(&mut self, input: &Input, body: Body, ordered: bool, progress: &dyn Progress) -> Result<()> {
        /// The end of a run, as far as it was read.
        struct Tail {
            first: u64,
            last: f64,
            count: usize,
        }
        let (mut times, mut run_of_row): (Vec<f64>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut known: HashMap<String, u32> = HashMap::new();
        let mut tails: Vec<Tail> = Vec::new();
        let mut run_names: Vec<String> = Vec::new();
        scan::rows(input, body, progress, &mut |row| {
            self.check_row(row)?;
            if times.is_empty() {
                self.start_clock(row);
                self.first_stamp = cell(row, self.time).into();
            }
            let time = self.time_of(row)?;
            let name = self.run_of(row);
            // Rows of a run mostly follow each other.
            let at = match run_names.last() {
                Some(last) if last == name => run_names.len() - 1,
                _ => match known.get(name) {
                    Some(at) => *at as usize,
                    None => {
                        let at = run_names.len();
                        known.insert(name.into(), u32::try_from(at).unwrap_or(u32::MAX));
                        run_names.push(name.into());
                        tails.push(Tail { first: row.line, last: f64::NEG_INFINITY, count: 0 });
                        at
                    }
                },
            };
            let tail = &mut tails[at];
            if ordered && tail.count > 0 {
                self.check_step(tail.last, time, row.line)?;
            }
            (tail.last, tail.count) = (time, tail.count + 1);
            times.push(time);
            if self.run.is_some() {
                run_of_row.push(u32::try_from(at).unwrap_or(u32::MAX));
            }
            Ok(())
        })?;
        if times.is_empty() {
            return Err(Error::line(&self.file, self.header_line, None, "no samples follow the header"));
        }
        let short = run_names.iter().zip(&tails).find(|(_, tail)| ordered && tail.count < 2);
        if let Some((name, tail)) = short {
            let whose = if name.is_empty() { String::new() } else { format!("run `{name}` has ") };
            let line = scan::line_of(input, tail.first)?;
            return Err(Error::line(&self.file, line, None, format!("{whose}1 sample; a run needs at least 2")));
        }
        (self.times, self.run_of_row, self.run_names) = (times, run_of_row, run_names);
        Ok(())
    }
}

impl Source for CsvLog {
    fn columns(&self) -> &[Header] {
        &self.columns
    }

    /// An infinite value is a number, if a bad one.
    fn is_numeric(&self, column: usize) -> bool {
        self.body.is_none() || self.cells_of(column).is_some_and(|cells| cells.texts == 0)
    }

    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        let topic = |name: &String, count: usize| Topic {
            name: String::new(),
            run: if self.run.is_some() { name.clone() } else { String::new() },
            stamps: Vec::with_capacity(count),
            columns: (0..columns.len()).map(|j| (j, Vec::with_capacity(count))).collect(),
        };
        let mut counts = vec![0_usize; self.run_names.len()];
        self.run_of_row.iter().for_each(|run| counts[*run as usize] += 1);
        if self.run.is_none() {
            counts = vec![self.times.len()];
        }
        let mut topics: Vec<Topic> = self.run_names.iter().zip(&counts).map(|(name, n)| topic(name, *n)).collect();
        self.each(columns, progress, &mut |row, values| {
            let topic = &mut topics[self.run_of_row.get(row).map_or(0, |run| *run as usize)];
            topic.stamps.push(self.times[row]);
            topic.columns.iter_mut().zip(values).for_each(|((_, column), value)| column.push(*value));
        })?;
        Ok(Reading { topics, notes: self.notes() })
    }

    fn lacks(&self, name: &str) -> Error {
        CsvLog::lacks(self, name)
    }

    fn time_header(&self) -> Option<&Header> {
        (!matches!(self.clock, Clock::Date(_))).then(|| &self.headers[self.time])
    }
}

#[cfg(test)]
mod tests;
