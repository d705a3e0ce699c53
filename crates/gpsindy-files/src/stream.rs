//! A log that is still being written: one line at a time, with the same rules and messages as a whole file.

use crate::csv_log::{CsvLog, Row, separator};
use crate::error::{Error, Result};
use crate::log::{Log, LogOptions};
use csv::StringRecord;

/// Reads the lines of a log as they come.
///
/// ```
/// use gpsindy_files::{LogOptions, Stream};
/// let mut stream = Stream::new("stdin", LogOptions::default());
/// assert!(stream.push(b"t,x [m]\n")?.is_none());
/// let sample = stream.push(b"0.1,2.5\n")?.expect("a sample");
/// assert_eq!((sample.time(), stream.values(&sample, &["x"])?), (0.1, vec![2.5]));
/// # Ok::<(), gpsindy_files::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Stream {
    file: String,
    options: LogOptions,
    line: u64,
    separator: u8,
    header: Option<(CsvLog, Log)>,
    /// Run and time of the last sample.
    last: Option<(String, f64)>,
}

/// One row of a log.
#[derive(Debug, Clone)]
pub struct Sample {
    row: Row,
    time: f64,
    run: String,
    begins: bool,
}

impl Sample {
    /// Its time, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Its run; empty where the log is one run.
    pub fn run(&self) -> &str {
        &self.run
    }

    /// Whether it is the first of its run. A run that comes back after another counts as a new one.
    pub fn begins(&self) -> bool {
        self.begins
    }
}

impl Stream {
    /// A log of which nothing was read yet; `file` names it in messages.
    pub fn new(file: &str, options: LogOptions) -> Self {
        Self { file: file.into(), options, line: 0, separator: b',', header: None, last: None }
    }

    /// The columns, once the header was read.
    pub fn header(&self) -> Option<&Log> {
        self.header.as_ref().map(|(_, log)| log)
    }

    /// Takes the next line, with or without its end; `None` for the header, comments before it and blank lines.
    ///
    /// # Errors
    /// Everything that [`Log::parse`] refuses in a line, a quoted cell that does not end in it, time that goes back.
    pub fn push(&mut self, line: &[u8]) -> Result<Option<Sample>> {
        self.line += 1;
        let text = std::str::from_utf8(line).map_err(|e| {
            let message = format!("byte 0x{:02x} is not UTF-8; save the file as UTF-8", line[e.valid_up_to()]);
            Error::line(&self.file, self.line, None, message)
        })?;
        let text = if self.line == 1 { text.trim_start_matches('\u{feff}') } else { text };
        let text = text.trim_end_matches(['\n', '\r']);
        if text.trim().is_empty() || (self.header.is_none() && text.trim_start().starts_with('#')) {
            return Ok(None);
        }
        if self.header.is_none() {
            self.separator = separator(text);
        }
        let row = Row { line: self.line, cells: self.cells(text)? };
        let Some((log, _)) = &mut self.header else {
            let log = CsvLog::of_header(&self.file, &row, &self.options)?;
            self.header = Some((log.clone(), Log::of_csv(log)));
            return Ok(None);
        };
        if self.last.is_none() {
            log.start_clock(&row);
        }
        log.check_row(&row)?;
        let (time, run) = (log.time_of(&row)?, log.run_of(&row).to_string());
        let same = self.last.as_ref().filter(|(name, _)| *name == run);
        if let Some((_, before)) = same {
            log.check_step(*before, time, row.line)?;
        }
        let begins = same.is_none();
        self.last = Some((run.clone(), time));
        Ok(Some(Sample { row, time, run, begins }))
    }

    /// Values of some columns of a sample, NaN where the cell is missing.
    ///
    /// # Errors
    /// A column that the log lacks, a cell that is no number or infinite.
    pub fn values<S: AsRef<str>>(&self, sample: &Sample, names: &[S]) -> Result<Vec<f64>> {
        let Some((log, _)) = &self.header else {
            return Err(Error::file(&self.file, "no header was read; hand in its line first"));
        };
        names.iter().map(|name| log.value_of(&sample.row, name.as_ref())).collect()
    }

    /// Columns that hold a number or nothing in this sample, beside time and run.
    pub fn numeric_columns(&self, sample: &Sample) -> Vec<String> {
        let columns = self.header.iter().flat_map(|(log, _)| log.columns()).map(|h| h.name.clone());
        columns.filter(|name| self.values(sample, &[name]).is_ok()).collect()
    }

    fn cells(&self, text: &str) -> Result<StringRecord> {
        let wrong = |message: String| Error::line(&self.file, self.line, None, message);
        if text.matches('"').count() % 2 == 1 {
            return Err(wrong("a quoted cell that does not end in its line; end the quotes".into()));
        }
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.separator)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let mut cells = StringRecord::new();
        reader.read_record(&mut cells).map_err(|e| wrong(format!("not a row of CSV: {e}")))?;
        Ok(cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(text: &str, run: Option<&str>) -> Result<Vec<(f64, bool, Vec<f64>)>> {
        let options = LogOptions { run: run.map(Into::into), ..LogOptions::default() };
        let mut stream = Stream::new("log.csv", options);
        let mut samples = Vec::new();
        for line in text.split_inclusive('\n') {
            if let Some(sample) = stream.push(line.as_bytes())? {
                samples.push((sample.time(), sample.begins(), stream.values(&sample, &["x"])?));
            }
        }
        Ok(samples)
    }

    #[test]
    fn lines_give_the_samples_that_the_whole_file_gives() {
        let text = "\u{feff}# a comment\r\n\r\nt [s],\"x [m], of the cart\",word\r\n0,1.5,a\r\n\r\n0.1,2.5,\"b, c\"\r\n0.2,NA,\n";
        let found = stream(text, None).unwrap();
        let log = CsvLog::parse("log.csv", text.as_bytes(), &LogOptions::default()).unwrap();
        assert_eq!(found.iter().map(|s| s.0).collect::<Vec<_>>(), log.times);
        assert_eq!(found[1].2, log.values("x").unwrap()[1..2]);
        assert!(found[2].2[0].is_nan() && log.values("x").unwrap()[2].is_nan());
        assert_eq!(found.iter().map(|s| s.1).collect::<Vec<_>>(), [true, false, false]);
    }

    #[test]
    fn bad_lines_are_refused_in_the_words_of_the_whole_file() {
        for text in [
            "t,x\n0,1\n1,n/a?\n",
            "t,x\n0,1\n1,inf\n",
            "t,x\n0,1\n1,2\n0.5,3\n",
            "t,x\n0,1\n0,2\n",
            "t,x\n0,1\n,2\n",
            "t,x\n0,1\n1\n",
            "t,x\n0,1\n# pause\n1,2\n",
            "0,1\n1,2\n",
            "a,x\n0,1\n1,2\n",
            "t|x\n0|1\n",
            "t;x\n0;1,5\n1;2\n",
            "t,x,x\n0,1,2\n1,2,3\n",
        ] {
            let options = LogOptions::default();
            let whole = match CsvLog::parse("log.csv", text.as_bytes(), &options) {
                Ok(log) => log.values("x").unwrap_err(),
                Err(error) => error,
            };
            assert_eq!(stream(text, None).unwrap_err().to_string(), whole.to_string(), "{text:?}");
        }
        let message = |text: &[u8]| {
            let mut stream = Stream::new("log.csv", LogOptions::default());
            text.split_inclusive(|b| *b == b'\n').find_map(|line| stream.push(line).err()).unwrap().to_string()
        };
        assert!(message(b"t,x\n0,\xff\n").starts_with("log.csv:2: byte 0xff is not UTF-8"));
        assert!(message(b"t,x\n0,\"1\n").starts_with("log.csv:2: a quoted cell that does not end in its line"));
    }

    #[test]
    fn a_new_run_begins_its_time_anew() {
        let found = stream("run,t,x\na,0,1\na,1,2\nb,0,3\nb,1,4\na,0.5,5\n", Some("run")).unwrap();
        assert_eq!(found.iter().map(|s| s.1).collect::<Vec<_>>(), [true, false, true, false, true]);
    }
}
