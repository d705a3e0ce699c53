//! Parquet: plain tables, a column or an element of a list a channel.
//!
//! Read by the `parquet` crate without arrow: columns are wanted one by one, as numbers.

use crate::error::{Error, Result};
use crate::header::Header;
use crate::input::Input;
use crate::near::hint;
use crate::options::LogOptions;
use crate::time::{self, Clock, EPOCH, Tick};
use crate::topic::{Reading, Source, Topic};
use gpsindy_core::Progress;
use std::collections::HashMap;

mod episodes;
mod footer;
mod guard;
mod leaf;
pub(crate) mod lerobot;

use episodes::Episodes;
use leaf::{Leaf, Rows, TEXT, Table};

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
    /// Frames per second, and the column that counts them, where stamps can be made again from both.
    frames: Option<(f64, usize)>,
    /// Whether it is a data set that should tell its frames per second and does not.
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

    /// Stamps in single precision can't be made again: that is told.
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
    pub(crate) fn told(&self, column: usize) -> &str {
        &self.place(column).leaf.told
    }

    /// The name and type of the time column.
    pub(crate) fn clock(&self) -> (&Header, &str) {
        (&self.time_header, &self.time.leaf.told)
    }

    /// The times, s, and what to say about them.
    fn times(&self) -> Result<Times> {
        let mut notes = Vec::new();
        let leaf = &self.time.leaf;
        if leaf.told == TEXT && !leaf.listed {
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
                    self.file, leaf.told
                ));
                stamps = frames.iter().map(|frame| frame / rate).collect();
            } else {
                notes.push(format!(
                    "{}: the stamps do not agree with frame_index / {rate} Hz; they were taken as they stand, {}",
                    self.file, leaf.told
                ));
            }
        }
        if self.lacks_rate && leaf.told == "float32" {
            notes.push(format!(
                "{}: meta/info.json tells no `fps` above 0; the stamps were taken as they stand, float32, and not made again from frame_index",
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

    fn check_times(&self, times: &[f64], run: &str, rows: &[usize]) -> Result<()> {
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
                    "sort the rows, or tell the runs apart with --run"
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
        (leaf.seconds.is_none() && leaf.told != TEXT).then_some(&self.time_header)
    }
}

/// The times of all rows.
struct Times {
    stamps: Vec<f64>,
    origin: f64,
    notes: Vec<String>,
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
                let (name, told) = (&self.headers[column].name, &leaf.told);
                return Err(Error::file(&self.file, format!("column `{name}` holds {told}, not numbers")));
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

/// The columns of a leaf: itself, or the elements of a list by name or number.
fn columns(leaf: &Leaf, width: usize, names: Option<&Vec<String>>) -> Vec<(Header, Option<usize>)> {
    if !leaf.listed {
        return vec![(Header::parse(&leaf.name), None)];
    }
    let plain =
        |text: &str| text.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' }).collect::<String>();
    let element = |i: usize| {
        let item = names.and_then(|n| n.get(i)).cloned().unwrap_or_else(|| i.to_string());
        let name = format!("{}_{}", plain(&leaf.name), plain(&item));
        (Header { text: format!("{}[{item}]", leaf.name), name, unit: String::new() }, Some(i))
    };
    (0..width).map(element).collect()
}

/// Renames and maps the columns of a table; each name once.
fn names(file: &str, headers: &mut [Header], places: &[Place], options: &LogOptions) -> Result<()> {
    let known: Vec<String> = headers.iter().map(|h| h.text.clone()).collect();
    let renames = options.rename.iter().map(|(old, new)| (old, new, false));
    let maps = options.map.iter().map(|(new, old)| (old, new, true));
    for (old, new, mapped) in renames.chain(maps) {
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        // An element may be named by its number where it has a name, too.
        let at = at.or_else(|| {
            let (list, number) = old.trim().strip_suffix(']')?.rsplit_once('[')?;
            let element = number.parse().ok()?;
            places.iter().position(|p| p.leaf.name == list && p.element == Some(element))
        });
        match at {
            Some(at) => headers[at].name.clone_from(new),
            None if mapped && headers.iter().any(|h| h.name == *new) => {}
            None => {
                let option = if mapped { format!("--map {new}={old}") } else { format!("--rename {old}={new}") };
                let found = hint(old, known.iter().map(String::as_str));
                return Err(Error::file(file, format!("{option}: there is no column `{old}`{found}")));
            }
        }
    }
    for (name, unit) in &options.unit {
        headers.iter_mut().filter(|h| h.name == *name).for_each(|h| h.unit.clone_from(unit));
    }
    let mut seen: HashMap<&str, &Header> = HashMap::with_capacity(headers.len());
    for header in headers.iter() {
        if let Some(other) = seen.insert(&header.name, header) {
            let message = format!(
                "the columns `{}` and `{}` have the same name, `{}`; name one otherwise with --rename '{}=...'",
                other.text, header.text, header.name, header.text
            );
            return Err(Error::file(file, message));
        }
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests;
