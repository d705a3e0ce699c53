//! Parquet: plain tables, a column or an element of a list a channel.
//!
//! Read by the `parquet` crate without arrow: columns are wanted one by one, as numbers.

use crate::error::{Error, Result};
use crate::header::Header;
use crate::input::Input;
use crate::near::hint;
use crate::options::LogOptions;
use crate::time;
use crate::topic::{Reading, Source, Topic};
use gpsindy_core::Progress;
use std::collections::HashMap;

mod arrow;
mod episodes;
mod footer;
mod guard;
mod leaf;
pub(crate) mod lerobot;
mod names;
mod times;

use episodes::Episodes;
use leaf::{Leaf, Rows, TEXT, Table};
use names::{columns, names};
use times::Times;

/// Elements of a list that become columns.
const WIDEST: usize = 256;

/// A table, or the parts of one in their order.
#[derive(Debug)]
pub(crate) struct ParquetLog {
    file: String,
    inputs: Vec<Input>,
    headers: Vec<Header>,
    places: Vec<Place>,
    time: Place,
    time_header: Header,
    run: Option<usize>,
    /// Frames per second, and the column that counts them, where stamps can be computed from both.
    frames: Option<(f64, usize)>,
    /// Whether it is a data set that lacks the frames per second that it should state.
    lacks_rate: bool,
    episodes: Episodes,
}

/// A column of the table: a leaf of its schema, and the element where that is a list.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Place {
    pub(crate) leaf: Leaf,
    pub(crate) element: Option<usize>,
}

/// Names for the elements of a list, by the list's name.
pub(crate) type Elements = HashMap<String, Vec<String>>;

impl ParquetLog {
    /// Opens a table.
    ///
    /// # Errors
    /// A broken file, no time column, options that name no column.
    pub(crate) fn open(inputs: Vec<Input>, file: &str, options: &LogOptions, elements: &Elements) -> Result<Self> {
        options.check(file, true)?;
        let Some(first) = inputs.first() else { return Err(Error::file(file, "holds no table")) };
        let table = Table::open(first)?;
        let (mut headers, mut places) = (Vec::new(), Vec::new());
        for leaf in table.leaves() {
            let width = if leaf.listed { table.width(&leaf)?.min(WIDEST) } else { 0 };
            for (header, element) in columns(&leaf, width, elements.get(&leaf.name)) {
                headers.push(header);
                places.push(Place { leaf: leaf.clone(), element });
            }
        }
        names(file, &mut headers, &places, options)?;
        let find = |column: &str| headers.iter().position(|h| h.answers_to(column));
        let lacks = |kind: &str, column: &str| {
            let found = hint(column, headers.iter().map(|h| h.name.as_str()));
            Error::file(file, format!("{kind} `{column}` is not in the table{found}"))
        };
        let time = match &options.time {
            Some(column) => find(column).ok_or_else(|| lacks("time column", column))?,
            None => time::column(&headers).or_else(|| find("timestamp")).ok_or_else(|| {
                let found: Vec<&str> = headers.iter().map(|h| h.name.as_str()).collect();
                let message = "no column `t`, `time` or `timestamp`; name the time column with --time; found:";
                Error::file(file, format!("{message} {}", found.join(", ")))
            })?,
        };
        let run = match &options.run {
            Some(column) => Some(find(column).ok_or_else(|| lacks("run column", column))?),
            None => None,
        };
        let mut log = Self {
            file: file.into(),
            inputs,
            time: places[time].clone(),
            time_header: headers[time].clone(),
            headers: Vec::new(),
            places: Vec::new(),
            run: None,
            frames: None,
            lacks_rate: false,
            episodes: Episodes::default(),
        };
        if let Some(run) = run {
            log.run = Some(log.places.len());
            log.places.push(places[run].clone());
            log.headers.push(headers[run].clone());
        }
        let rest = headers.into_iter().zip(places).enumerate().filter(|(i, _)| *i != time && Some(*i) != run);
        for (_, (header, place)) in rest {
            log.headers.push(header);
            log.places.push(place);
        }
        // The run's column is kept before the others, out of sight.
        if log.run.is_some() {
            log.headers.remove(0);
        }
        Ok(log)
    }

    /// The place of a column among those in sight.
    fn place(&self, column: usize) -> &Place {
        &self.places[column + usize::from(self.run.is_some())]
    }

    fn run_place(&self) -> Option<&Place> {
        self.run.map(|_| &self.places[0])
    }

    /// What `frames` counts and how fast: stamps are made again where they agree with it.
    pub(crate) fn with_frames(mut self, rate: f64, column: &str) -> Self {
        self.frames = self.headers.iter().position(|h| h.name == column).map(|index| (rate, index));
        self
    }

    /// Stamps in single precision can't be computed exactly, and a note says so.
    pub(crate) fn without_rate(mut self) -> Self {
        self.lacks_rate = true;
        self
    }

    /// What the data set says of its episodes.
    pub(crate) fn with_episodes(mut self, episodes: Episodes) -> Self {
        self.episodes = episodes;
        self
    }

    /// The parts, opened one after the other: a data set may have more files than a program may open at once.
    fn tables(&self) -> impl Iterator<Item = Result<Table>> + '_ {
        self.inputs.iter().map(Table::open)
    }

    /// The type of a column, for people.
    pub(crate) fn kind(&self, column: usize) -> &str {
        &self.place(column).leaf.kind
    }

    /// The name and type of the time column.
    pub(crate) fn clock(&self) -> (&Header, &str) {
        (&self.time_header, &self.time.leaf.kind)
    }

    fn column(&self, place: &Place) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        for table in self.tables() {
            let rows = table?.numbers(&place.leaf)?;
            values.extend((0..rows.len()).map(|row| rows.value(row, place.element.unwrap_or(0))));
        }
        Ok(values)
    }

    /// The rows of each run in order.
    fn runs(&self, count: usize) -> Result<Vec<(String, Vec<usize>)>> {
        let Some(place) = self.run_place() else { return Ok(vec![(String::new(), (0..count).collect())]) };
        let mut names: Vec<String> = Vec::with_capacity(count);
        for table in self.tables() {
            names.extend(table?.texts(&place.leaf)?);
        }
        let mut order: HashMap<String, usize> = HashMap::new();
        let mut runs: Vec<(String, Vec<usize>)> = Vec::new();
        for (row, name) in names.into_iter().enumerate() {
            let at = *order.entry(name).or_insert_with_key(|name| {
                runs.push((name.clone(), Vec::new()));
                runs.len() - 1
            });
            runs[at].1.push(row);
        }
        Ok(runs)
    }
}

impl Source for ParquetLog {
    fn columns(&self) -> &[Header] {
        &self.headers
    }

    fn is_numeric(&self, column: usize) -> bool {
        self.place(column).leaf.number
    }

    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        let gathered = self.gather(columns, progress, true)?;
        Ok(Reading { topics: gathered.topics, notes: gathered.notes })
    }

    fn lacks(&self, name: &str) -> Error {
        let found = hint(name, self.headers.iter().map(|h| h.name.as_str()));
        Error::file(&self.file, format!("column `{name}` is not in the table{found}"))
    }

    fn time_header(&self) -> Option<&Header> {
        let leaf = &self.time.leaf;
        (leaf.seconds.is_none() && leaf.kind != TEXT).then_some(&self.time_header)
    }
}

/// Columns that were read.
pub(crate) struct Gathered {
    pub(crate) topics: Vec<Topic>,
    /// The stamp from which times are counted, s.
    pub(crate) origin: f64,
    pub(crate) notes: Vec<String>,
}

impl ParquetLog {
    /// Whether two columns are elements of one list.
    pub(crate) fn same_list(&self, a: usize, b: usize) -> bool {
        let (a, b) = (self.place(a), self.place(b));
        a.leaf.listed && a.leaf == b.leaf
    }

    /// Reads columns, with a look at the order of the times where asked for.
    pub(crate) fn gather(&self, columns: &[usize], progress: &dyn Progress, check: bool) -> Result<Gathered> {
        let Times { stamps: times, origin, mut notes } = self.times()?;
        let runs = self.runs(times.len())?;
        notes.extend(self.episodes.missing(&self.file, &runs));
        for (run, rows) in runs.iter().filter(|_| check) {
            self.check_times(&times, run, rows)?;
        }
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
        // A list is read once for all of its elements.
        let mut done = vec![false; columns.len()];
        for (i, &column) in columns.iter().enumerate() {
            if done[i] {
                continue;
            }
            if !progress.report("reading", i, columns.len()) {
                return Err(gpsindy_core::Error::Cancelled.into());
            }
            let leaf = &self.place(column).leaf;
            if !leaf.number {
                let (name, kind) = (&self.headers[column].name, &leaf.kind);
                return Err(Error::file(&self.file, format!("column `{name}` holds {kind}, not numbers")));
            }
            for table in self.tables() {
                let rows: Rows = table?.numbers(leaf)?;
                for (j, &other) in columns.iter().enumerate().filter(|(_, other)| self.place(**other).leaf == *leaf) {
                    let element = self.place(other).element.unwrap_or(0);
                    values[j].extend((0..rows.len()).map(|row| {
                        let value = rows.value(row, element);
                        if value.is_infinite() { f64::NAN } else { value }
                    }));
                    done[j] = true;
                }
            }
            if values[i].len() != times.len() {
                let (name, count) = (&self.headers[column].name, values[i].len());
                let message = format!("column `{name}` has {count} rows where the time column has {}", times.len());
                return Err(Error::file(&self.file, message));
            }
        }
        let topic = |(run, rows): (String, Vec<usize>)| Topic {
            name: String::new(),
            run,
            stamps: rows.iter().map(|&i| times[i]).collect(),
            columns: values.iter().enumerate().map(|(j, v)| (j, rows.iter().map(|&i| v[i]).collect())).collect(),
        };
        Ok(Gathered { topics: runs.into_iter().map(topic).collect(), origin, notes })
    }
}

#[cfg(test)]
pub(crate) mod tests;
