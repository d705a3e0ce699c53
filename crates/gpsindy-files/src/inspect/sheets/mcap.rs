//! Every topic of an MCAP log, its fields as some of the messages have them: lists of the first one may be empty.

use super::super::Sheet;
use super::super::column::Column;
use super::Looked;
use crate::error::Result;
use crate::formats::mcap_log::channel::Channel;
use crate::formats::mcap_log::container::{Event, scan};
use crate::formats::mcap_log::{json_stamp, stamp_of};
use crate::formats::message::cdr::Leaf;
use crate::formats::message::path::{self, Step};
use crate::formats::message::schema::Schema;
use crate::formats::message::want::Wants;
use crate::formats::message::{cdr, json};
use crate::formats::stamps::apart;
use crate::input::Input;
use crate::options::Stamp;
use gpsindy_core::Progress;
use std::collections::HashMap;

/// A topic as it is read.
struct Topic {
    sheet: Sheet,
    log: Vec<i64>,
    header: Vec<Option<i64>>,
    /// Paths to the columns, in their order.
    paths: Vec<Vec<Step>>,
}

enum Reader {
    Cdr { schema: Schema, wants: Box<Wants>, stamped: bool },
    Json,
    None,
}

pub(crate) fn look(inputs: Vec<Input>, file: String, stamp: Stamp, progress: &dyn Progress) -> Result<Looked> {
    let mut topics: Vec<Topic> = Vec::new();
    let mut channels: HashMap<(usize, u16), Channel> = HashMap::new();
    let mut readers: HashMap<(usize, u16), (usize, Reader)> = HashMap::new();
    let mut outputs: Vec<f64> = Vec::new();
    let broken = scan(&inputs, progress, &mut |part, event| {
        match event {
            Event::Channel(id, channel) => {
                place(&mut topics, &channel);
                channels.insert((part, id), channel);
            }
            Event::Message { channel, time, data } => {
                let key = (part, channel);
                let Some(known) = channels.get(&key) else { return Ok(()) };
                let (at, reader) = readers.entry(key).or_insert_with(|| {
                    let at = place(&mut topics, known);
                    (at, reader(known, data, &mut topics[at]))
                });
                topics[*at].grow(reader, data);
                topics[*at].take(reader, time, data, &mut outputs);
            }
        }
        Ok(())
    })?;
    topics.sort_by(|a, b| a.sheet.topic.cmp(&b.sheet.topic));
    let sheets = topics.into_iter().map(|topic| topic.finish(stamp)).collect();
    Ok((file, "MCAP", sheets, broken.into_iter().collect()))
}

fn place(topics: &mut Vec<Topic>, channel: &Channel) -> usize {
    if let Some(at) = topics.iter().position(|t| t.sheet.topic == channel.topic) {
        return at;
    }
    let kind = channel.schema.as_ref().map_or(String::new(), |(name, ..)| format!("{name}, "));
    let sheet = Sheet {
        topic: channel.topic.clone(),
        kind: format!("{kind}{}", channel.encoding),
        runs: vec![0],
        unread: channel.schema().err(),
        ..Sheet::default()
    };
    topics.push(Topic { sheet, log: Vec::new(), header: Vec::new(), paths: Vec::new() });
    topics.len() - 1
}

/// What reads a channel; its first message says which elements its arrays have, later ones may add some.
fn reader(channel: &Channel, data: &[u8], topic: &mut Topic) -> Reader {
    let schema = match channel.schema() {
        Ok(schema) => schema,
        Err(_) => return Reader::None,
    };
    let leaves: Vec<Leaf> = match &schema {
        Some(schema) => cdr::leaves(schema, data).unwrap_or_else(|why| {
            topic.sheet.unread = Some(format!("its first message can't be read: {why}"));
            Vec::new()
        }),
        None => serde_json::from_slice(data).map(|m| json::leaves(&m)).unwrap_or_default(),
    };
    if topic.sheet.columns.is_empty() {
        topic.add(leaves, schema.as_ref());
    }
    schema.map_or(Reader::Json, |schema| topic.of_cdr(schema))
}

impl Topic {
    /// Columns for leaves that have none; what was read before holds no value of theirs.
    fn add(&mut self, leaves: Vec<Leaf>, schema: Option<&Schema>) {
        let stamp = schema.and_then(stamp_of);
        for leaf in leaves {
            let is_stamp = stamp.as_ref().is_some_and(|paths| paths.contains(&leaf.path));
            let name = path::shown(&leaf.path);
            if self.sheet.columns.iter().any(|column| column.name == name) {
                continue;
            }
            let number = leaf.number && !is_stamp;
            let mut column = Column::new(&name, &name, &leaf.type_name, "", number);
            if number {
                self.log.iter().for_each(|_| column.push(f64::NAN));
                self.paths.push(leaf.path);
            }
            self.sheet.columns.push(column);
        }
    }

    fn of_cdr(&self, schema: Schema) -> Reader {
        let mut paths = self.paths.clone();
        let stamp = stamp_of(&schema);
        paths.extend(stamp.iter().flatten().cloned());
        match Wants::of(&schema, &paths) {
            Ok(wants) => Reader::Cdr { schema, wants: Box::new(wants), stamped: stamp.is_some() },
            Err(_) => Reader::None,
        }
    }

    /// Looks in few of the messages for fields that none before them had.
    fn grow(&mut self, reader: &mut Reader, data: &[u8]) {
        if self.log.is_empty() || !(self.log.len() + 1).is_power_of_two() {
            return;
        }
        let known = self.paths.len();
        match reader {
            Reader::None => {}
            Reader::Json => {
                self.add(serde_json::from_slice(data).map(|m| json::leaves(&m)).unwrap_or_default(), None);
            }
            Reader::Cdr { schema, .. } => {
                self.add(cdr::leaves(schema, data).unwrap_or_default(), Some(schema));
                if self.paths.len() > known {
                    *reader = self.of_cdr(schema.clone());
                }
            }
        }
    }

    fn take(&mut self, reader: &mut Reader, time: u64, data: &[u8], outputs: &mut Vec<f64>) {
        outputs.clear();
        let mut stamp = None;
        match reader {
            Reader::None => {}
            Reader::Cdr { schema, wants, stamped } => {
                outputs.resize(wants.count, f64::NAN);
                if cdr::take(schema, wants, data, outputs).is_err() {
                    outputs.fill(f64::NAN);
                } else if *stamped {
                    let (sec, nanosec) = (outputs[wants.count - 2], outputs[wants.count - 1]);
                    stamp = Some(sec as i64 * 1_000_000_000 + nanosec as i64);
                    // Another channel of the topic may have added columns that this one does not read.
                    outputs.truncate(wants.count - 2);
                }
            }
            Reader::Json => {
                if let Ok(message) = serde_json::from_slice(data) {
                    outputs.extend(self.paths.iter().map(|path| json::number(&message, path).unwrap_or(f64::NAN)));
                    stamp = json_stamp(&message);
                }
            }
        }
        self.log.push(i64::try_from(time).unwrap_or(i64::MAX));
        self.header.push(stamp);
        let numbers = self.sheet.columns.iter_mut().filter(|c| c.numeric);
        for (i, column) in numbers.enumerate() {
            column.push(outputs.get(i).copied().filter(|v| v.is_finite()).unwrap_or(f64::NAN));
        }
    }

    fn finish(mut self, stamp: Stamp) -> Sheet {
        let every = !self.header.is_empty() && self.header.iter().all(Option::is_some);
        let moves = self.header.iter().any(|s| *s != self.header[0]);
        let by_header = every && (moves || self.log.len() == 1) && stamp != Stamp::Log;
        let header: Vec<i64> = self.header.into_iter().flatten().collect();
        let chosen = if by_header { &header } else { &self.log };
        let first = chosen.first().copied().unwrap_or(0);
        self.sheet.clock = if by_header { "header" } else { "log" }.into();
        self.sheet.stamps = chosen.iter().map(|t| apart(*t, first)).collect();
        self.sheet.origin = first as f64 / 1e9;
        if every && moves {
            self.sheet.latency = self.log.iter().zip(&header).map(|(log, header)| apart(*log, *header)).collect();
        }
        self.sheet
    }
}
