//! ULog, the log of PX4: topics with their instances, stamps in microseconds since the start of the board.

use crate::error::{Error, Result};
use crate::formats::mapped::{self, Place};
use crate::formats::stamps::{self, Series};
use crate::header::Header;
use crate::input::Input;
use crate::near::hint;
use crate::options::{LogOptions, Offset};
use crate::topic::{Reading, Source};
use gpsindy_core::Progress;
use std::collections::HashMap;

pub(crate) mod container;

use container::{Field, parse};

/// A log of PX4.
#[derive(Debug)]
pub(crate) struct Ulog {
    input: Input,
    headers: Vec<Header>,
    places: Vec<Place>,
    offsets: Vec<(String, Offset)>,
}

impl Ulog {
    /// Opens a log and looks for the mapped topics and fields.
    ///
    /// # Errors
    /// No map, a topic or field that is not there, a file that is broken before its first message.
    pub(crate) fn open(input: Input, options: &LogOptions) -> Result<Self> {
        let mut fields: HashMap<String, Vec<String>> = HashMap::new();
        let mut order: Vec<String> = Vec::new();
        parse(&input, &gpsindy_core::Silent, &mut |message| {
            if !fields.contains_key(message.topic) {
                fields.insert(message.topic.into(), message.fields.iter().map(|f| f.name.clone()).collect());
                order.push(message.topic.into());
            }
        })?;
        order.sort_unstable();
        let names: Vec<&str> = order.iter().map(String::as_str).collect();
        let (headers, places) = mapped::columns(&input.file, options, &names, &mut |topic, path| {
            let own = fields.get(topic).map(Vec::as_slice).unwrap_or_default();
            if own.iter().any(|field| field == path) {
                return Ok(());
            }
            let found = hint(path, own.iter().map(String::as_str));
            Err(format!("there is no field `{path}` in {topic}{found}"))
        })?;
        Ok(Self { input, headers, places, offsets: options.offset.clone() })
    }
}

/// The series of a wanted subscription, and where each of its columns lies in a message.
type Wanted = (usize, Vec<Option<Field>>);

impl Source for Ulog {
    fn columns(&self) -> &[Header] {
        &self.headers
    }

    fn is_numeric(&self, _: usize) -> bool {
        true
    }

    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        let mut series: Vec<Series> = Vec::new();
        // The names of the wanted fields of each series.
        let mut wanted: Vec<Vec<String>> = Vec::new();
        for (output, &column) in columns.iter().enumerate() {
            let place = &self.places[column];
            let at = series.iter().position(|s| s.topic == place.topic).unwrap_or_else(|| {
                series.push(Series { topic: place.topic.clone(), ..Series::default() });
                wanted.push(Vec::new());
                series.len() - 1
            });
            series[at].columns.push((output, Vec::new()));
            wanted[at].push(place.path());
        }
        // By the number of the subscription: its series and the fields' places.
        let mut known: HashMap<u16, Option<Wanted>> = HashMap::new();
        let broken = parse(&self.input, progress, &mut |message| {
            let entry = known.entry(message.subscription).or_insert_with(|| {
                let at = series.iter().position(|s| s.topic == message.topic)?;
                let find = |name: &String| message.fields.iter().find(|f| f.name == *name).cloned();
                Some((at, wanted[at].iter().map(find).collect()))
            });
            let Some((at, fields)) = entry else { return };
            let Some(stamp) = message.stamp() else { return };
            series[*at].stamps.push(stamp);
            for ((_, values), field) in series[*at].columns.iter_mut().zip(fields.iter()) {
                values.push(field.as_ref().map_or(f64::NAN, |field| field.value(message.data)));
            }
        })?;
        let mut notes: Vec<String> = broken.into_iter().collect();
        let (topics, more) = stamps::topics(&self.input.file, series, &self.offsets, "")?;
        notes.extend(more);
        Ok(Reading { topics, notes })
    }

    fn lacks(&self, name: &str) -> Error {
        mapped::lacks(&self.input.file, &self.headers, name)
    }
}

#[cfg(test)]
pub(crate) mod tests;
