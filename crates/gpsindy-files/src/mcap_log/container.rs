//! The container: channels, schemas and messages in the order of the file, up to a break.

use super::records;
use crate::error::{Error, Result};
use crate::input::Input;
use crate::message::schema::Schema;
use gpsindy_core::Progress;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::HashMap;
use std::io::{BufReader, Read};

/// Longest record, bytes: this many times the file, for what is packed.
const PACKED: u64 = 4;

/// And this many at least.
const LEAST: u64 = 16 << 20;

/// Messages between two reports of progress.
const REPORT: u64 = 10_000;

/// A source of messages of one kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Of the messages: `cdr`, `json`.
    pub(crate) encoding: String,
    /// Name, encoding and text of the schema.
    pub(crate) schema: Option<(String, String, Vec<u8>)>,
}

impl Channel {
    /// The schema of its messages; `None` where they are JSON.
    ///
    /// # Errors
    /// A channel that is not read, for the user.
    pub(crate) fn schema(&self) -> std::result::Result<Option<Schema>, String> {
        match (self.encoding.as_str(), &self.schema) {
            ("json", _) => Ok(None),
            ("cdr", Some((name, encoding, data))) if encoding == "ros2msg" => {
                let text = std::str::from_utf8(data).map_err(|_| format!("the schema of {name} is not UTF-8"))?;
                Schema::parse(name, text).map(Some)
            }
            ("cdr", Some((_, encoding, _))) => {
                Err(format!("its messages are CDR with a schema in `{encoding}`, and only `ros2msg` is read"))
            }
            ("cdr", None) => Err("its messages are CDR without a schema, which says nothing about their fields".into()),
            (other, _) => Err(format!(
                "its messages are `{other}`, which is not read, only `cdr` (ROS 2) and `json`; convert it first"
            )),
        }
    }
}

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
    file: &str,
    inputs: &[Input],
    progress: &dyn Progress,
    take: &mut dyn FnMut(usize, Event<'_>) -> Result<()>,
) -> Result<Option<String>> {
    let mut told = None;
    for (part, input) in inputs.iter().enumerate() {
        let length = input.len()?;
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(usize::try_from(length * PACKED + LEAST).unwrap_or(usize::MAX));
        let mut reader = LinearReader::new_with_options(options);
        let mut bytes = BufReader::with_capacity(1 << 20, input.open()?);
        let mut schemas: HashMap<u16, (String, String, Vec<u8>)> = HashMap::new();
        let (mut records, mut messages, mut at) = (0_u64, 0_u64, 0_u64);
        let mut ended = false;
        while let Some(event) = reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    // No more than what the file can still hold.
                    let wanted = wanted.min(usize::try_from(length.saturating_sub(at)).unwrap_or(usize::MAX)).max(1);
                    let buffer = reader.insert(wanted);
                    let count = bytes.read(&mut buffer[..wanted]).map_err(|e| input.failed(e))?;
                    at += count as u64;
                    reader.notify_read(count);
                }
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    records += 1;
                    match records::parse(opcode, data) {
                        Ok(Some(Record::Schema { header, data })) => {
                            schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
                        }
                        Ok(Some(Record::Channel(found))) => {
                            let schema = schemas.get(&found.schema_id).cloned();
                            let channel = Channel { topic: found.topic, encoding: found.message_encoding, schema };
                            take(part, Event::Channel(found.id, channel))?;
                        }
                        Ok(Some(Record::Message { header, data })) => {
                            messages += 1;
                            if messages % REPORT == 0 && !progress.report("reading", at as usize, length as usize) {
                                return Err(gpsindy_core::Error::Cancelled.into());
                            }
                            let event =
                                Event::Message { channel: header.channel_id, time: header.log_time, data: &data };
                            take(part, event)?;
                        }
                        Ok(Some(Record::DataEnd(_) | Record::Footer(_))) => ended = true,
                        Ok(_) => {}
                        Err(error) => {
                            ended = true;
                            told = Some(broken(&input.file, messages, &error));
                            break;
                        }
                    }
                }
                Err(error) if records == 0 => {
                    return Err(Error::file(
                        &input.file,
                        format!("the MCAP file is broken from its begin on: {}", words(&error)),
                    ));
                }
                Err(error) => {
                    ended = true;
                    told = Some(broken(&input.file, messages, &error));
                    break;
                }
            }
        }
        // A recorder that was killed between two records leaves a file in which nothing but the end is missing.
        if !ended {
            told = Some(format!("{}: the log was never closed; its {messages} messages were read", input.file));
        }
    }
    let _ = file;
    Ok(told)
}

fn broken(file: &str, messages: u64, error: &mcap::McapError) -> String {
    format!("{file}: the file breaks off behind {messages} messages ({}); what stands before was read", words(error))
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
        let told = scan(file, std::slice::from_ref(input), progress, &mut |_, event| {
            if let Event::Channel(_, channel) = event {
                add(channel);
            }
            Ok(())
        })?;
        broken = broken.or(told);
    }
    match broken {
        // What is told begins with the name of the file.
        Some(told) if channels.is_empty() => Err(Error::file(file, told.trim_start_matches(&format!("{file}: ")))),
        _ => Ok(channels),
    }
}
