//! The container: channels, schemas and messages in the order of the file, up to a break.

use super::channel::Channel;
use super::chunk::{self, Tools};
use super::records::{self, Found};
use super::window::Window;
use crate::error::{Error, Result};
use crate::input::{Bytes, Input};
use gpsindy_core::Progress;
use mcap::McapError;
use mcap::records::{Record, op};
use std::cell::Cell;
use std::collections::HashMap;
use std::io::{ErrorKind, Read};

/// Longest record of a chunk, bytes: this many times the file, for what is packed.
const PACKED: u64 = 4;

/// And this many at least.
const LEAST: u64 = 16 << 20;

/// Bytes of a file that are read at a time, and unpacked: both fit into the caches of a processor.
const AHEAD: usize = 64 << 10;
const UNPACKED: usize = 256 << 10;

/// Messages between two reports of progress.
const REPORT: u64 = 10_000;

/// What stands in the file.
pub(crate) enum Event<'a> {
    Channel(u16, Channel),
    Message {
        channel: u16,
        /// Time of recording, ns.
        time: u64,
        data: &'a [u8],
    },
}

/// Reads the parts of a log; `take` gets the number of the part and what stands there. Returns what to say of a break.
///
/// # Errors
/// What `take` returns, a file that can't be read, or that breaks before its first record; a request to stop.
pub(crate) fn scan(
    inputs: &[Input],
    progress: &dyn Progress,
    take: &mut dyn FnMut(usize, Event<'_>) -> Result<()>,
) -> Result<Option<String>> {
    let mut stated = None;
    for (number, input) in inputs.iter().enumerate() {
        let length = input.len()?;
        let size = |most: usize| usize::try_from(length).unwrap_or(most).clamp(1, most);
        let at = Cell::new(0);
        let source = Counted { bytes: input.open()?, count: &at, failure: None };
        let mut file = Window::new(source, vec![0; size(AHEAD)], None);
        let mut tools = Tools::new(size(UNPACKED));
        let report = |at: u64| progress.report("reading", at as usize, length as usize);
        let mut part = Part { number, schemas: HashMap::new(), records: 0, messages: 0, ended: false, take };
        let stop = part.read(&mut file, length, &mut tools, &|| report(at.get())).err();
        let (records, messages, ended) = (part.records, part.messages, part.ended);
        if let Some(failure) = file.source.failure {
            return Err(input.failed(failure));
        }
        match stop {
            Some(Stop::Own(error)) => return Err(error),
            Some(Stop::Broken(error)) if records == 0 => {
                let message = format!("the MCAP file is broken from its begin on: {}", words(&error));
                return Err(Error::file(&input.file, message));
            }
            Some(Stop::Broken(error)) => stated = Some(broken(&input.file, messages, &error)),
            // A recorder that was killed between two records leaves a file in which nothing but the end is missing.
            None if !ended => {
                stated = Some(format!("{}: the log was never closed; its {messages} messages were read", input.file));
            }
            None => {}
        }
    }
    Ok(stated)
}

/// A part of a log that is being read.
struct Part<'a> {
    number: usize,
    schemas: HashMap<u16, (String, String, Vec<u8>)>,
    records: u64,
    messages: u64,
    /// Whether the footer was seen, with which every log that was closed ends.
    ended: bool,
    take: &'a mut dyn FnMut(usize, Event<'_>) -> Result<()>,
}

impl Part<'_> {
    fn read<R: Read>(
        &mut self,
        file: &mut Window<R>,
        length: u64,
        tools: &mut Tools,
        report: &dyn Fn() -> bool,
    ) -> std::result::Result<(), Stop> {
        records::load(file, mcap::MAGIC.len())?;
        if file.cut(mcap::MAGIC.len()) != mcap::MAGIC {
            return Err(McapError::BadMagic.into());
        }
        let mut left = length.saturating_sub(mcap::MAGIC.len() as u64);
        let most = length.saturating_mul(PACKED).saturating_add(LEAST);
        loop {
            match records::next(file, &mut left, u64::MAX)? {
                Found::End => return Ok(()),
                Found::Record(opcode, count) => {
                    self.record(opcode, file.cut(count), report)?;
                    if opcode == op::FOOTER {
                        // The mark is there once more, behind everything.
                        records::load(file, mcap::MAGIC.len())?;
                        let is_whole = file.cut(mcap::MAGIC.len()) == mcap::MAGIC;
                        return if is_whole { Ok(()) } else { Err(McapError::UnexpectedEof.into()) };
                    }
                }
                Found::Other(op::CHUNK, count) => {
                    self.records += 1;
                    chunk::read(file, count, most, tools, |opcode, data| self.record(opcode, data, report))?;
                }
                Found::Other(_, count) => {
                    records::skip(file, count)?;
                    self.records += 1;
                }
            }
        }
    }

    fn record(&mut self, opcode: u8, data: &[u8], report: &dyn Fn() -> bool) -> std::result::Result<(), Stop> {
        self.records += 1;
        match records::parse(opcode, data)? {
            Some(Record::Message { header, data }) => {
                self.messages += 1;
                if self.messages.is_multiple_of(REPORT) && !report() {
                    return Err(Stop::Own(gpsindy_core::Error::Cancelled.into()));
                }
                let event = Event::Message { channel: header.channel_id, time: header.log_time, data: &data };
                (self.take)(self.number, event)?;
            }
            Some(Record::Schema { header, data }) => {
                self.schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Some(Record::Channel(found)) => {
                let schema = self.schemas.get(&found.schema_id).cloned();
                let channel = Channel { topic: found.topic, encoding: found.message_encoding, schema };
                (self.take)(self.number, Event::Channel(found.id, channel))?;
            }
            Some(Record::Footer(_)) => self.ended = true,
            _ => {}
        }
        Ok(())
    }
}

/// Why the reading of a part ends before its end.
enum Stop {
    Broken(McapError),
    Own(Error),
}

impl From<McapError> for Stop {
    fn from(error: McapError) -> Self {
        Self::Broken(error)
    }
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Own(error)
    }
}

/// Bytes of a file that are counted; a failure to read them is kept, for behind what unpacks them it looks like a break.
struct Counted<'a> {
    bytes: Box<dyn Bytes>,
    count: &'a Cell<u64>,
    failure: Option<std::io::Error>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.bytes.read(buffer) {
            Ok(count) => {
                self.count.set(self.count.get() + count as u64);
                Ok(count)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Err(error),
            Err(error) => Err(self.failure.insert(error).kind().into()),
        }
    }
}

fn broken(file: &str, messages: u64, error: &mcap::McapError) -> String {
    format!(
        "{file}: the file breaks off behind {messages} messages ({}); everything before that was read",
        words(error)
    )
}

/// The cause on one line.
fn words(error: &mcap::McapError) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The channels of a log: from its summary where it has one, else by reading it.
///
/// # Errors
/// As [`scan`], and a file that breaks off before its first channel.
pub(crate) fn channels(file: &str, inputs: &[Input], progress: &dyn Progress) -> Result<Vec<Channel>> {
    let mut broken = None;
    let mut channels: Vec<Channel> = Vec::new();
    let mut add = |channel: Channel| {
        if !channels.contains(&channel) {
            channels.push(channel);
        }
    };
    for input in inputs {
        if let Some(found) = records::summary(input) {
            found.into_iter().for_each(&mut add);
            continue;
        }
        let stated = scan(std::slice::from_ref(input), progress, &mut |_, event| {
            if let Event::Channel(_, channel) = event {
                add(channel);
            }
            Ok(())
        })?;
        broken = broken.or(stated);
    }
    match broken {
        // The message begins with the name of the file.
        Some(stated) if channels.is_empty() => Err(Error::file(file, stated.trim_start_matches(&format!("{file}: ")))),
        _ => Ok(channels),
    }
}
