//! A growing log: one line at a time, with the same rules and messages as a whole file.

use crate::error::{Error, Result};
use crate::formats::csv_log::{CsvLog, Row, separator};
use crate::log::Log;
use crate::options::LogOptions;
use csv::StringRecord;

/// A row that is put behind each line to see that the line is a whole one; of two cells, which no quotes make into these.
const NEXT: [&str; 2] = ["next", "row"];

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
        let text = if self.line == 1 { text.strip_prefix('\u{feff}').unwrap_or(text) } else { text };
        let text = text.trim_end_matches(['\n', '\r']);
        // Among the samples only a line without any character is none, as in a whole file.
        let before_header = self.header.is_none();
        if text.is_empty() || (before_header && (text.trim().is_empty() || text.trim_start().starts_with('#'))) {
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

    /// Columns that hold a number or nothing in this sample, besides time and run.
    pub fn numeric_columns(&self, sample: &Sample) -> Vec<String> {
        let columns = self.header.iter().flat_map(|(log, _)| log.columns()).map(|h| h.name.clone());
        columns.filter(|name| self.values(sample, &[name]).is_ok()).collect()
    }

    fn cells(&self, text: &str) -> Result<StringRecord> {
        let wrong = |message: String| Error::line(&self.file, self.line, None, message);
        // A second line after this one is a record of its own, unless a quoted cell or a line end of its own comes between.
        // An empty line goes before a sample, because the reader would take a byte order mark off its first one.
        let lead = if self.header.is_some() { "\n" } else { "" };
        let followed = format!("{lead}{text}\n{}", NEXT.join(&char::from(self.separator).to_string()));
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(self.separator)
            .trim(csv::Trim::All)
            .from_reader(followed.as_bytes());
        let mut read = || -> Result<Option<StringRecord>> {
            let mut cells = StringRecord::new();
            let more = reader.read_record(&mut cells).map_err(|e| wrong(format!("not a row of CSV: {e}")))?;
            Ok(more.then_some(cells))
        };
        let (cells, next, end) = (read()?, read()?, read()?);
        match (cells, next, end) {
            (Some(cells), Some(next), None) if next.iter().eq(NEXT) => Ok(cells),
            (Some(_), None, _) => Err(wrong("a quoted cell that does not end in its line; end the quotes".into())),
            _ => Err(wrong("a carriage return within the line; end lines by a line feed".into())),
        }
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
    fn random_lines_are_rows_of_the_whole_file_or_are_refused() {
        // Everything that a reader of CSV treats in a way of its own, and some that look as if it did.
        let pieces = [
            "t", "x", ",", ",", "\n", "\n", "\r\n", "\r", "\"", "\"", "\0", " ", "#", "0", "1", "2", ";", "\u{b}",
            "\u{feff}", "NA",
        ];
        let mut state = 7u64;
        let mut pick = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        let (mut both, mut refused) = (0, 0);
        for _ in 0..10_000 {
            // A header and rows that would do, with characters put into them.
            let mut text: Vec<&str> =
                ["t", ",", "x", "\n", "0", ",", "1", "\n", "1", ",", "2", "\n", "2", ",", "", "\n"].into();
            for _ in 0..1 + pick(4) {
                let at = pick(text.len());
                text.insert(at, pieces[pick(pieces.len())]);
            }
            let text = text.concat();
            let whole = CsvLog::parse("log.csv", text.as_bytes(), &LogOptions::default());
            let mut stream = Stream::new("log.csv", LogOptions::default());
            let lines = text.split_inclusive('\n').map(|line| stream.push(line.as_bytes()));
            let lines =
                lines.collect::<Result<Vec<_>>>().map(|found| found.iter().flatten().map(Sample::time).collect());
            match (whole, lines) {
                (Ok(log), Ok(times)) => {
                    let times: Vec<f64> = times;
                    assert_eq!(times, log.times, "{text:?}");
                    both += 1;
                }
                (Ok(_), Err(error)) => {
                    let said = error.to_string();
                    let own = said.contains("does not end in its line") || said.contains("carriage return");
                    assert!(own, "{text:?}: {said}");
                    refused += 1;
                }
                // A stream can't know that nothing follows.
                (Err(error), Ok(times)) => {
                    let times: Vec<f64> = times;
                    let said = error.to_string();
                    let short = said.contains("a run needs at least 2")
                        || said.contains("no samples follow")
                        || said.contains("is empty");
                    assert!(short && times.len() < 2, "{text:?}: {said}");
                }
                (Err(_), Err(_)) => {}
            }
        }
        assert!(both > 1000 && refused > 10, "{both} {refused}");
    }

    #[test]
    fn a_new_run_begins_its_time_anew() {
        let found = stream("run,t,x\na,0,1\na,1,2\nb,0,3\nb,1,4\na,0.5,5\n", Some("run")).unwrap();
        assert_eq!(found.iter().map(|s| s.1).collect::<Vec<_>>(), [true, false, true, false, true]);
    }
}
