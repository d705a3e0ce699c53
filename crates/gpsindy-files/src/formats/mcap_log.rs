//! MCAP: topics of messages in CDR with their `ros2msg` schemas, or in JSON.
//!
//! The container is read from front to back, so that a file that breaks off gives what comes before the break; a message is
//! kept only for as long as its wanted numbers take to be read.

use crate::error::{Error, Result};
use crate::formats::mapped::{self, Place};
use crate::formats::message::kind::Kind;
use crate::formats::message::path::{self, Step};
use crate::formats::message::schema::{Many, Schema};
use crate::formats::message::want::Wants;
use crate::formats::message::{cdr, json};
use crate::formats::stamps::{self, Series};
use crate::header::Header;
use crate::input::Input;
use crate::near::hint;
use crate::options::{LogOptions, Offset, Stamp};
use crate::topic::{Reading, Source};
use gpsindy_core::Progress;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

pub(crate) mod channel;
mod chunk;
pub(crate) mod container;
mod records;
mod window;

use channel::Channel;
use container::{Event, scan};

/// An MCAP log, or the parts of one in their order.
#[derive(Debug)]
pub(crate) struct McapLog {
    file: String,
    inputs: Vec<Input>,
    headers: Vec<Header>,
    /// Where each column comes from.
    places: Vec<Place>,
    stamp: Stamp,
    offsets: Vec<(String, Offset)>,
}

impl McapLog {
    /// Opens a log and looks for the mapped topics and fields.
    ///
    /// # Errors
    /// No map, a topic or field that is not there, a file that is broken before its first message.
    pub(crate) fn open(inputs: Vec<Input>, file: &str, options: &LogOptions, progress: &dyn Progress) -> Result<Self> {
        let channels = container::channels(file, &inputs, progress)?;
        let mut names: Vec<&str> = channels.iter().map(|c| c.topic.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let (headers, places) = mapped::columns(file, options, &names, &mut |topic, path| {
            let steps = path::steps(path)?;
            for channel in channels.iter().filter(|c| c.topic == topic) {
                if let Some(schema) = channel.schema()? {
                    Wants::of(&schema, std::slice::from_ref(&steps))?;
                }
            }
            Ok(())
        })?;
        let (stamp, offsets) = (options.stamp, options.offset.clone());
        Ok(Self { file: file.into(), inputs, headers, places, stamp, offsets })
    }
}

/// Reads the wanted numbers of one channel's messages.
enum Reader {
    Cdr { schema: Schema, wants: Box<Wants>, stamped: bool },
    Json(Vec<Vec<Step>>),
}

/// What is gathered of a topic.
struct Gathered {
    topic: String,
    /// Place among the columns asked for, and the path, in the order of the outputs.
    columns: Vec<(usize, Vec<Step>)>,
    log: Vec<i64>,
    /// The header's stamps, as long as every message has one.
    header: Option<Vec<i64>>,
    values: Vec<Vec<f64>>,
    broken: usize,
    /// The names of the fields in some of the messages, for suggestions.
    fields: Vec<String>,
}

impl Source for McapLog {
    fn columns(&self) -> &[Header] {
        &self.headers
    }

    fn is_numeric(&self, _: usize) -> bool {
        true
    }

    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading> {
        let mut gathered: Vec<Gathered> = Vec::new();
        for (output, &column) in columns.iter().enumerate() {
            let Place { topic, steps } = &self.places[column];
            let at = gathered.iter().position(|g| g.topic == *topic).unwrap_or_else(|| {
                gathered.push(Gathered::new(topic));
                gathered.len() - 1
            });
            gathered[at].columns.push((output, steps.clone()));
            gathered[at].values.push(Vec::new());
        }
        // By the part of the log and its number of the channel.
        let mut channels: HashMap<(usize, u16), Channel> = HashMap::new();
        let mut places: HashMap<(usize, u16), usize> = HashMap::new();
        let mut readers: Vec<Option<(usize, Reader)>> = Vec::new();
        // Messages of a channel often follow each other.
        let mut last = None;
        let mut outputs: Vec<f64> = Vec::new();
        let broken = scan(&self.inputs, progress, &mut |part, event| {
            match event {
                Event::Channel(id, channel) => {
                    channels.insert((part, id), channel);
                }
                Event::Message { channel, time, data } => {
                    let key = (part, channel);
                    let place = match last {
                        Some((known, place)) if known == key => place,
                        _ => match places.entry(key) {
                            Entry::Occupied(known) => *known.get(),
                            Entry::Vacant(free) => {
                                let channel = channels.get(&key);
                                readers.push(channel.map_or(Ok(None), |channel| self.reader(channel, &gathered))?);
                                *free.insert(readers.len() - 1)
                            }
                        },
                    };
                    last = Some((key, place));
                    if let Some((at, reader)) = &mut readers[place] {
                        gathered[*at].take(&self.file, reader, time, data, &mut outputs)?;
                    }
                }
            }
            Ok(())
        })?;
        let mut notes: Vec<String> = broken.into_iter().collect();
        let mut series = Vec::with_capacity(gathered.len());
        for one in gathered {
            series.push(self.finish(one, &mut notes)?);
        }
        let option = if self.stamp == Stamp::Log { "" } else { ", or take the time of recording with --stamp log" };
        let (topics, more) = stamps::topics(&self.file, series, &self.offsets, option)?;
        notes.extend(more);
        Ok(Reading { topics, notes })
    }

    fn lacks(&self, name: &str) -> Error {
        mapped::lacks(&self.file, &self.headers, name)
    }
}

impl McapLog {
    /// What reads a channel of a wanted topic, and the topic's place.
    fn reader(&self, channel: &Channel, gathered: &[Gathered]) -> Result<Option<(usize, Reader)>> {
        let Some(at) = gathered.iter().position(|g| g.topic == channel.topic) else { return Ok(None) };
        let wrong = |message: String| Error::file(&self.file, format!("topic `{}`: {message}", channel.topic));
        let mut paths: Vec<Vec<Step>> = gathered[at].columns.iter().map(|(_, steps)| steps.clone()).collect();
        let reader = match channel.schema().map_err(wrong)? {
            None => Reader::Json(paths),
            Some(schema) => {
                let stamp = stamp_of(&schema);
                let stamped = stamp.is_some();
                paths.extend(stamp.into_iter().flatten());
                let wants = Wants::of(&schema, &paths).map_err(wrong)?;
                Reader::Cdr { schema, wants: Box::new(wants), stamped }
            }
        };
        Ok(Some((at, reader)))
    }

    /// The series of a topic on the chosen clock.
    fn finish(&self, one: Gathered, notes: &mut Vec<String>) -> Result<Series> {
        let topic = &one.topic;
        let wrong = |message: String| Error::file(&self.file, message);
        if one.log.is_empty() {
            let why = notes.first().map_or(String::new(), |note| format!("; {note}"));
            return Err(wrong(format!("topic `{topic}` has no message{why}")));
        }
        if one.broken > 0 {
            notes.push(format!(
                "{}: topic `{topic}`: {} messages can't be read and were left out",
                self.file, one.broken
            ));
        }
        // A header that nobody filled in has the same stamp throughout, mostly zero.
        let moves = |header: &[i64]| header.iter().any(|stamp| *stamp != header[0]);
        let stamps = match (self.stamp, one.header) {
            (Stamp::Header, None) => {
                return Err(wrong(format!(
                    "topic `{topic}` has messages without a stamp in a header; choose --stamp log"
                )));
            }
            (Stamp::Header, Some(header)) => header,
            (Stamp::Auto, Some(header)) if moves(&header) || header.len() == 1 => header,
            (Stamp::Auto, Some(_)) => {
                notes.push(format!(
                    "{}: topic `{topic}`: the stamp in the header never changes; the time of recording was taken",
                    self.file
                ));
                one.log
            }
            (Stamp::Log, _) | (Stamp::Auto, None) => one.log,
        };
        for (values, (_, steps)) in one.values.iter().zip(&one.columns) {
            if values.iter().all(|v| v.is_nan()) {
                let wanted = path::shown(steps);
                let fields = one.fields.iter().map(String::as_str);
                let found = if one.fields.is_empty() { String::new() } else { hint(&wanted, fields) };
                return Err(wrong(format!("topic `{topic}` has no number at `{wanted}` in any message{found}")));
            }
        }
        Ok(Series {
            stamps,
            topic: one.topic,
            columns: one.columns.into_iter().map(|(output, _)| output).zip(one.values).collect(),
        })
    }
}

impl Gathered {
    fn new(topic: &str) -> Self {
        let topic = topic.to_string();
        Self {
            topic,
            columns: Vec::new(),
            log: Vec::new(),
            header: Some(Vec::new()),
            values: Vec::new(),
            broken: 0,
            fields: Vec::new(),
        }
    }

    /// Takes the numbers of a message. One that can't be read is counted, the first one refused.
    fn take(&mut self, file: &str, reader: &mut Reader, time: u64, data: &[u8], outputs: &mut Vec<f64>) -> Result<()> {
        let stamp = match reader.take(data, outputs) {
            Ok(stamp) => stamp,
            Err(_) if !self.log.is_empty() => {
                self.broken += 1;
                return Ok(());
            }
            Err(message) => {
                return Err(Error::file(file, format!("topic `{}`, first message: {message}", self.topic)));
            }
        };
        self.log.push(i64::try_from(time).unwrap_or(i64::MAX));
        match (&mut self.header, stamp) {
            (Some(header), Some(stamp)) => header.push(stamp),
            _ => self.header = None,
        }
        for (values, &output) in self.values.iter_mut().zip(outputs.iter()) {
            // A dataset holds no infinite value: one in a message is a sensor's "nothing".
            values.push(if output.is_finite() { output } else { f64::NAN });
        }
        // The names of the fields where a column has no number: of few messages, and not of the first alone, whose lists may be empty.
        if self.log.len().is_power_of_two() && outputs[..self.values.len()].iter().any(|v| v.is_nan()) {
            for field in reader.fields(data) {
                if !self.fields.contains(&field) {
                    self.fields.push(field);
                }
            }
        }
        Ok(())
    }
}

impl Reader {
    /// The numbers of a message, and its header's stamp, ns.
    fn take(&mut self, data: &[u8], outputs: &mut Vec<f64>) -> std::result::Result<Option<i64>, String> {
        match self {
            Self::Cdr { schema, wants, stamped } => {
                outputs.resize(wants.count, f64::NAN);
                cdr::take(schema, wants, data, outputs)?;
                if !*stamped {
                    return Ok(None);
                }
                let (sec, nanosec) = (outputs[wants.count - 2], outputs[wants.count - 1]);
                Ok(Some(sec as i64 * 1_000_000_000 + nanosec as i64))
            }
            Self::Json(paths) => {
                let message: serde_json::Value = serde_json::from_slice(data).map_err(|e| format!("not JSON: {e}"))?;
                outputs.clear();
                outputs.extend(paths.iter().map(|path| json::number(&message, path).unwrap_or(f64::NAN)));
                Ok(json_stamp(&message))
            }
        }
    }

    fn fields(&self, data: &[u8]) -> Vec<String> {
        let leaves = match self {
            Self::Cdr { schema, .. } => cdr::leaves(schema, data).unwrap_or_default(),
            Self::Json(_) => serde_json::from_slice(data).map(|m| json::leaves(&m)).unwrap_or_default(),
        };
        leaves.iter().filter(|leaf| leaf.number).map(|leaf| path::shown(&leaf.path)).collect()
    }
}

/// The paths to seconds and nanoseconds of the stamp that a message carries: its header's, else its own.
pub(crate) fn stamp_of(schema: &Schema) -> Option<[Vec<Step>; 2]> {
    let message = |index: usize, name: &str| {
        let field = schema.messages[index].fields.iter().find(|f| f.name == name && f.many == Many::One)?;
        if let Kind::Message(inner) = field.kind { Some(inner) } else { None }
    };
    let times = |index: usize| {
        let fields = &schema.messages[index].fields;
        let number = |f: &crate::formats::message::schema::Field| f.many == Many::One && f.kind.size() == Some(4);
        fields.len() == 2 && fields[0].name == "sec" && fields[1].name == "nanosec" && fields.iter().all(number)
    };
    let step = |names: &[&str]| names.iter().map(|n| Step::Field((*n).to_string())).collect::<Vec<_>>();
    if message(0, "header").and_then(|header| message(header, "stamp")).is_some_and(times) {
        return Some([step(&["header", "stamp", "sec"]), step(&["header", "stamp", "nanosec"])]);
    }
    let own = ["stamp", "timestamp"].into_iter().find(|name| message(0, name).is_some_and(times))?;
    Some([step(&[own, "sec"]), step(&[own, "nanosec"])])
}

/// The stamp in a JSON message: `header.stamp`, else `stamp` or `timestamp`, each of `sec` and `nanosec` or `nsec`.
pub(crate) fn json_stamp(message: &serde_json::Value) -> Option<i64> {
    let stamp = message.get("header").and_then(|h| h.get("stamp"));
    let stamp = stamp.or_else(|| message.get("stamp")).or_else(|| message.get("timestamp"))?;
    let sec = stamp.get("sec")?.as_i64()?;
    let nanosec = stamp.get("nanosec").or_else(|| stamp.get("nsec"))?.as_i64()?;
    sec.checked_mul(1_000_000_000)?.checked_add(nanosec)
}

#[cfg(test)]
pub(crate) mod tests;
