//! The times of a table: numbers, numbers since 1970, dates, or text that says either.

use super::ParquetLog;
use super::leaf::TEXT;
use crate::error::{Error, Result};
use crate::time::{self, Clock, EPOCH, Tick};

/// The times of all rows.
pub(super) struct Times {
    pub(super) stamps: Vec<f64>,
    pub(super) origin: f64,
    pub(super) notes: Vec<String>,
}

impl ParquetLog {
    /// The times, s, and what to say about them.
    pub(super) fn times(&self) -> Result<Times> {
        let mut notes = Vec::new();
        let leaf = &self.time.leaf;
        if leaf.kind == TEXT && !leaf.listed {
            return self.written_times();
        }
        if leaf.whole && !leaf.listed {
            let mut stamps: Vec<i64> = Vec::new();
            for table in self.tables() {
                stamps.extend(table?.integers(leaf)?);
            }
            let first = stamps.first().copied().unwrap_or(0);
            let by_size = Tick::of(first as f64, &self.time_header.unit).filter(|_| leaf.seconds.is_none());
            notes.extend(
                by_size.map(|tick| format!("{}: {}", self.file, tick.note(&self.time_header, &first.to_string()))),
            );
            let (times, parts) = leaf.seconds.unwrap_or((1.0, by_size.map_or(1.0, Tick::per_second)));
            let origin = if first.unsigned_abs() as f64 * times / parts >= EPOCH { first } else { 0 };
            let seconds = |t: i64| {
                if t == i64::MIN { f64::NAN } else { (i128::from(t) - i128::from(origin)) as f64 * times / parts }
            };
            let stamps: Vec<f64> = stamps.into_iter().map(seconds).collect();
            if leaf.seconds.is_none() && by_size.is_none() {
                notes.extend(self.doubt(&stamps));
            }
            return Ok(Times { stamps, origin: origin as f64 * times / parts, notes });
        }
        let mut stamps = self.column(&self.time)?;
        if let Some((rate, frames)) = self.frames {
            let frames = self.column(self.place(frames))?;
            // What LeRobot itself tolerates; a float32 at an hour is twice as coarse.
            let near = |(t, frame): (&f64, &f64)| (t - frame / rate).abs() <= 1e-4 + t.abs() * 1.2e-7;
            if stamps.iter().zip(&frames).all(near) {
                notes.push(format!(
                    "{}: the stamps are {}; they were made again as frame_index / {rate} Hz, with which they agree",
                    self.file, leaf.kind
                ));
                stamps = frames.iter().map(|frame| frame / rate).collect();
            } else {
                notes.push(format!(
                    "{}: the stamps do not agree with frame_index / {rate} Hz; they were used unchanged, {}",
                    self.file, leaf.kind
                ));
            }
        }
        if self.lacks_rate && leaf.kind == "float32" {
            notes.push(format!(
                "{}: meta/info.json has no `fps` above 0; the stamps were used unchanged, as float32, and not computed from frame_index",
                self.file
            ));
        }
        let first = stamps.first().copied().unwrap_or(0.0);
        let origin = if first.abs() >= EPOCH { first } else { 0.0 };
        let by_size = Tick::of(first, &self.time_header.unit);
        notes
            .extend(by_size.map(|tick| format!("{}: {}", self.file, tick.note(&self.time_header, &first.to_string()))));
        let per_second = by_size.map_or(1.0, Tick::per_second);
        stamps.iter_mut().for_each(|t| *t = (*t - origin) / per_second);
        if by_size.is_none() {
            notes.extend(self.doubt(&stamps));
        }
        Ok(Times { stamps, origin: origin / per_second, notes })
    }

    /// Times that are written as text: dates, or numbers.
    fn written_times(&self) -> Result<Times> {
        let mut texts: Vec<String> = Vec::new();
        for table in self.tables() {
            texts.extend(table?.texts(&self.time.leaf)?);
        }
        let time = &self.time_header;
        let first = texts.first().map(|text| text.trim()).unwrap_or_default();
        let wrong = |row: usize, text: &str, remedy: &str| {
            let place = format!("row {}, column `{}`", row + 1, time.name);
            Error::file(
                &self.file,
                format!("{place}: not a time: {:?}; {remedy}", text.chars().take(40).collect::<String>()),
            )
        };
        let clock = Clock::of(first, &time.unit);
        let clock =
            clock.ok_or_else(|| wrong(0, first, "write it as 2024-05-01T12:00:00 or as a number of seconds"))?;
        let stamp = |(row, text): (usize, &String)| match text.trim() {
            "" => Ok(f64::NAN),
            text => clock.seconds(text).ok_or_else(|| wrong(row, text, "write it as in the first row")),
        };
        let stamps = texts.iter().enumerate().map(stamp).collect::<Result<_>>()?;
        let notes = clock.note(time, first).into_iter().map(|note| format!("{}: {note}", self.file)).collect();
        Ok(Times { stamps, origin: clock.origin(), notes })
    }

    fn doubt(&self, stamps: &[f64]) -> Option<String> {
        Some(format!("{}: {}", self.file, time::doubt(&self.time_header, stamps)?))
    }

    /// Refuses times that are missing or do not increase within a run.
    pub(super) fn check_times(&self, times: &[f64], run: &str, rows: &[usize]) -> Result<()> {
        let name = &self.time_header.name;
        let whose = if run.is_empty() { String::new() } else { format!("run `{run}`: ") };
        let wrong = |message: String| Err(Error::file(&self.file, format!("{whose}{message}")));
        if rows.len() < 2 {
            return wrong(format!("{}; a run needs at least 2", ["no sample", "1 sample"][rows.len()]));
        }
        if let Some(row) = rows.iter().find(|&&row| !times[row].is_finite()) {
            return wrong(format!(
                "row {}, column `{name}`: the time is missing; fill it in or leave the row out when you write the table",
                row + 1
            ));
        }
        for pair in rows.windows(2) {
            let (before, after) = (times[pair[0]], times[pair[1]]);
            if after <= before {
                let how = if after < before { "goes back" } else { "stands still" };
                let cure = if run.is_empty() {
                    "sort the rows, or name the column of the runs with --run"
                } else {
                    "sort or thin the rows"
                };
                return wrong(format!(
                    "row {}, column `{name}`: time {how}, from {before} to {after}; {cure}",
                    pair[1] + 1
                ));
            }
        }
        Ok(())
    }
}
