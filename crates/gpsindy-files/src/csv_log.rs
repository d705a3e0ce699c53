//! One CSV file: a header row, then one sample per row. Every kind of bad input gives one error with file, line and column.

use crate::error::{Error, Result};
use crate::header::Header;
use crate::log::LogOptions;
use crate::near::hint;
use crate::time::{self, Clock};
use crate::topic::{Reading, Source, Topic};
use csv::StringRecord;
use gpsindy_core::Progress;
use std::collections::HashMap;

/// A log file with its time column read; the other columns are read when they are asked for.
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
    separator: u8,
    time: usize,
    run: Option<usize>,
    clock: Clock,
    header_line: u64,
    rows: Vec<Row>,
    pub(crate) times: Vec<f64>,
}

/// Cells of one line, which begins at line number `line`.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) line: u64,
    pub(crate) cells: StringRecord,
}

impl CsvLog {
    /// Reads the bytes of a log; `file` names them in messages.
    ///
    /// # Errors
    /// [`Error::Line`] or [`Error::File`]: not UTF-8, no header, a column twice, no time column, a row of another
    /// length, a time that is no number or does not increase, fewer than 2 samples in a run.
    pub(crate) fn parse(file: &str, bytes: &[u8], options: &LogOptions) -> Result<Self> {
        let log = Self::open(file, bytes, options)?;
        log.check_times()?;
        Ok(log)
    }

    /// The same without a look at the order of the times.
    pub(crate) fn open(file: &str, bytes: &[u8], options: &LogOptions) -> Result<Self> {
        let text = decode(file, bytes)?;
        let (start, first_line) = skip_comments(text);
        let mut lines = Lines { text, at: start, line: first_line };
        let separator = separator(text[start..].lines().next().unwrap_or_default());
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(separator)
            .trim(csv::Trim::All)
            .from_reader(&text.as_bytes()[start..]);
        let mut records = Vec::new();
        loop {
            let mut cells = StringRecord::new();
            let more = reader.read_record(&mut cells).map_err(|e| Error::file(file, format!("not a CSV file: {e}")))?;
            if !more {
                break;
            }
            let at = cells.position().map_or(0, csv::Position::byte) as usize;
            records.push(Row { line: lines.of(start + at), cells });
        }
        let mut records = records.into_iter();
        let Some(first) = records.next() else {
            return Err(Error::file(file, "the file is empty; expected a header row and then one sample per row"));
        };
        let mut log = Self::of_header(file, &first, options)?;
        log.separator = separator;
        log.rows = records.collect();
        log.check_lengths()?;
        log.read_times()?;
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
        let columns = headers.iter().enumerate().filter(|(i, _)| *i != time && Some(*i) != run);
        Ok(Self {
            file: file.into(),
            columns: columns.map(|(_, h)| h.clone()).collect(),
            separator: b',',
            headers,
            time,
            run,
            clock: Clock::Plain,
            header_line: first.line,
            rows: Vec::new(),
            times: Vec::new(),
        })
    }

    /// The columns beside time and run, in the file's order.
    pub(crate) fn columns(&self) -> impl Iterator<Item = &Header> {
        self.columns.iter()
    }

    /// The name of the time column.
    pub(crate) fn time_name(&self) -> &str {
        &self.headers[self.time].name
    }

    /// The stamp from which times are counted, s; 0 where they stand as they are.
    pub(crate) fn origin(&self) -> f64 {
        self.clock.origin()
    }

    /// The error that says that `name` is not in this file and what is.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        missing(&self.file, "column", name, &self.columns)
    }

    /// The values of a column, NaN where the cell is missing.
    pub(crate) fn values(&self, name: &str) -> Result<Vec<f64>> {
        let Some(index) = self.position(name) else { return Err(self.lacks(name)) };
        self.rows.iter().map(|row| self.number(row, index)).collect()
    }

    /// Runs of the file: name of the run (empty where the file is one run) and its rows in order.
    pub(crate) fn runs(&self) -> Vec<(String, Vec<usize>)> {
        let Some(column) = self.run else { return vec![(String::new(), (0..self.rows.len()).collect())] };
        let mut order: HashMap<&str, usize> = HashMap::new();
        let mut runs: Vec<(String, Vec<usize>)> = Vec::new();
        for (i, row) in self.rows.iter().enumerate() {
            let name = cell(row, column);
            let at = *order.entry(name).or_insert_with(|| {
                runs.push((name.to_string(), Vec::new()));
                runs.len() - 1
            });
            runs[at].1.push(i);
        }
        runs
    }

    fn position(&self, name: &str) -> Option<usize> {
        (0..self.headers.len())
            .filter(|&i| i != self.time && Some(i) != self.run)
            .find(|&i| self.headers[i].answers_to(name))
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

    fn check_lengths(&self) -> Result<()> {
        if self.rows.is_empty() {
            return Err(Error::line(&self.file, self.header_line, None, "no samples follow the header"));
        }
        self.rows.iter().try_for_each(|row| self.check_row(row))
    }

    /// Refuses a comment, and a row of another length than the header's.
    pub(crate) fn check_row(&self, row: &Row) -> Result<()> {
        let (found, expected) = (row.cells.len(), self.headers.len());
        if cell(row, 0).starts_with('#') {
            let message = "a comment among the samples; comments stand before the header";
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

    /// Lets the first row say how times are read: as they stand, or counted from its own.
    pub(crate) fn start_clock(&mut self, first: &Row) {
        self.clock = Clock::of(cell(first, self.time)).unwrap_or(Clock::Plain);
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
            let message = "the time is missing; remove the row or fill the time in";
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
        let how = if after < before { "time goes back" } else { "time stands still" };
        let cure = if self.run.is_some() {
            "sort or thin the samples"
        } else {
            "sort the samples, or tell the runs apart with --run"
        };
        let message = format!("{how}, from {before} to {after}; {cure}");
        Err(Error::line(&self.file, line, Some(&self.headers[self.time].name), message))
    }

    fn read_times(&mut self) -> Result<()> {
        if let Some(first) = self.rows.first().cloned() {
            self.start_clock(&first);
        }
        self.times = self.rows.iter().map(|row| self.time_of(row)).collect::<Result<_>>()?;
        Ok(())
    }

    fn check_times(&self) -> Result<()> {
        for (run, rows) in self.runs() {
            for pair in rows.windows(2) {
                self.check_step(self.times[pair[0]], self.times[pair[1]], self.rows[pair[1]].line)?;
            }
            if rows.len() < 2 {
                let whose = if run.is_empty() { String::new() } else { format!("run `{run}` has ") };
                let line = rows.first().map_or(self.header_line, |&i| self.rows[i].line);
                return Err(Error::line(&self.file, line, None, format!("{whose}1 sample; a run needs at least 2")));
            }
        }
        Ok(())
    }
}

/// What separates the cells: a comma, or where the header has none, a semicolon or a tab.
pub(crate) fn separator(header: &str) -> u8 {
    let outside: String = header.split('"').step_by(2).collect();
    if outside.contains(';') && (!outside.contains(',') || outside.matches(';').count() > outside.matches(',').count())
    {
        return b';';
    }
    if outside.contains('\t') && !outside.contains(',') { b'\t' } else { b',' }
}

impl Source for CsvLog {
    fn columns(&self) -> &[Header] {
        &self.columns
    }

    /// An infinite value is a number, if a bad one.
    fn is_numeric(&self, column: usize) -> bool {
        let index = self.position(&self.columns[column].name);
        index.is_some_and(|i| self.rows.iter().all(|row| number(cell(row, i)).is_ok()))
    }

    fn read(&self, columns: &[usize], _: &dyn Progress) -> Result<Reading> {
        let mut values = Vec::with_capacity(columns.len());
        for &column in columns {
            values.push(self.values(&self.columns[column].name)?);
        }
        let topic = |(run, rows): (String, Vec<usize>)| Topic {
            name: String::new(),
            run,
            stamps: rows.iter().map(|&i| self.times[i]).collect(),
            columns: values.iter().enumerate().map(|(j, v)| (j, rows.iter().map(|&i| v[i]).collect())).collect(),
        };
        let topics = self.runs().into_iter().map(topic).collect();
        let first = self.rows.first().map_or("", |row| cell(row, self.time));
        let notes = match self.clock {
            Clock::Plain => Vec::new(),
            _ => vec![format!("{}: times are counted from the first stamp, {first}", self.file)],
        };
        Ok(Reading { topics, notes })
    }

    fn lacks(&self, name: &str) -> Error {
        CsvLog::lacks(self, name)
    }

    fn time_header(&self) -> Option<&Header> {
        (!matches!(self.clock, Clock::Date(_))).then(|| &self.headers[self.time])
    }
}

/// Headers of the first row, renamed, each name once.
fn headers(file: &str, first: &Row, options: &LogOptions) -> Result<Vec<Header>> {
    let wrong = |message: String| Error::line(file, first.line, None, message);
    if first.cells.len() == 1 && first.cells[0].contains('|') {
        return Err(wrong("the cells look separated by bars; separate them by commas, semicolons or tabs".into()));
    }
    if first.cells.get(0).is_some_and(|cell| cell.starts_with("schema") && cell.contains("gpsindy.model/")) {
        return Err(wrong("this is a model, not a log; a log has a header row and then one sample per row".into()));
    }
    if first.cells.iter().all(|c| number(c).is_ok()) {
        return Err(wrong("no header: the first row holds only numbers; put a row of column names before it".into()));
    }
    let mut headers: Vec<Header> = first.cells.iter().map(Header::parse).collect();
    for (i, header) in headers.iter_mut().enumerate() {
        if header.name.is_empty() {
            header.name = format!("column_{}", i + 1);
        }
    }
    for (old, new) in &options.rename {
        // The whole header is looked for first, so that two columns of one name can be told apart.
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        let Some(at) = at else { return Err(missing(file, "--rename: column", old, &headers)) };
        headers[at].name.clone_from(new);
    }
    for (new, old) in &options.map {
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        match at {
            Some(at) => headers[at].name.clone_from(new),
            // A map may serve logs of several kinds: this one has the name already.
            None if headers.iter().any(|h| h.name == *new) => {}
            None => return Err(missing(file, &format!("--map {new}: column"), old, &headers)),
        }
    }
    for (i, header) in headers.iter().enumerate() {
        if let Some(other) = headers[..i].iter().find(|h| h.name == header.name) {
            let message = format!(
                "column stands twice, as `{}` and as `{}`; remove one or name one otherwise with --rename '{}=...'",
                other.text, header.text, header.text
            );
            return Err(Error::line(file, first.line, Some(&header.name), message));
        }
    }
    Ok(headers)
}

fn missing(file: &str, kind: &str, name: &str, headers: &[Header]) -> Error {
    let found = hint(name, headers.iter().map(|h| h.name.as_str()));
    Error::file(file, format!("{kind} `{name}` is not in the file{found}"))
}

fn names(headers: &[Header]) -> String {
    headers.iter().map(|h| h.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn cell(row: &Row, index: usize) -> &str {
    row.cells.get(index).unwrap_or_default()
}

/// A cell as a number: missing is NaN, an overflow is infinite, other text is `Err`.
fn number(text: &str) -> std::result::Result<f64, ()> {
    if matches!(text, "" | "NA") {
        return Ok(f64::NAN);
    }
    text.parse().map_err(|_| ())
}

/// A cell in quotes, cut where it is long.
fn shown(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    format!("{short:?}")
}

/// UTF-8 without a byte order mark.
fn decode<'a>(file: &str, bytes: &'a [u8]) -> Result<&'a str> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Error::line(file, 1, None, "the file is UTF-16; save it as UTF-8"));
    }
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() as u64;
        let byte = bytes[e.valid_up_to()];
        Error::line(file, line, None, format!("byte 0x{byte:02x} is not UTF-8; save the file as UTF-8"))
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// Where the header begins (byte) and the line it stands in.
fn skip_comments(text: &str) -> (usize, u64) {
    let (mut start, mut line) = (0, 1);
    for piece in text.split_inclusive('\n') {
        let trimmed = piece.trim();
        if !(trimmed.is_empty() || trimmed.starts_with('#')) {
            break;
        }
        start += piece.len();
        line += 1;
    }
    (start, line)
}

/// Line numbers of ascending byte positions. The csv crate's own count is of the blank line before a record.
struct Lines<'a> {
    text: &'a str,
    at: usize,
    line: u64,
}

impl Lines<'_> {
    fn of(&mut self, mut position: usize) -> u64 {
        let bytes = self.text.as_bytes();
        while bytes.get(position).is_some_and(|b| matches!(b, b'\r' | b'\n')) {
            position += 1;
        }
        self.line += bytes[self.at..position].iter().filter(|b| **b == b'\n').count() as u64;
        self.at = position;
        self.line
    }
}

#[cfg(test)]
mod tests;
