//! Records: their frames, and their contents, which are checked before the `mcap` crate reads them.
//!
//! The crate (0.26.0) reserves memory for as many bytes as a text says that it has, up to 4 GB, before it looks whether they
//! are there; and its own reader of summaries hands such records on. Its reader of whole files asks for each record twice,
//! unpacks and checks each on its own, with which reading took half as long again; so frames and chunks are read here.

use super::channel::Channel;
use super::window::Window;
use crate::input::Input;
use mcap::records::{MessageHeader, Record, op};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

/// Bytes before the length of a footer's fields, of these, and of the mark behind them.
const RECORD: usize = 9;
const FOOTER: usize = 20;
const MAGIC: usize = 8;

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// A record of a kind that matters here, and its bytes, all at hand.
    Record(u8, usize),
    /// Another one and its bytes, not yet read.
    Other(u8, u64),
    End,
}

/// The next record in a window that can still hold `left` bytes, of which a record takes at most `most`.
///
/// # Errors
/// A record that breaks off, or that is longer than it may be.
pub(super) fn next<R: Read>(window: &mut Window<R>, left: &mut u64, most: u64) -> mcap::McapResult<Found> {
    if !window.load(RECORD).map_err(broken)? {
        return if window.at_hand().is_empty() { Ok(Found::End) } else { Err(mcap::McapError::UnexpectedEof) };
    }
    let head = window.cut(RECORD);
    let (opcode, mut length) = (head[0], [0; 8]);
    length.copy_from_slice(&head[1..]);
    let length = u64::from_le_bytes(length);
    *left = left.saturating_sub(RECORD as u64);
    if !matters(opcode) {
        *left = left.saturating_sub(length);
        return Ok(Found::Other(opcode, length));
    }
    // Nothing is read for a length that can't be.
    *left = left.checked_sub(length).ok_or(mcap::McapError::UnexpectedEof)?;
    let count = usize::try_from(length).ok().filter(|_| length <= most);
    let count = count.ok_or(mcap::McapError::RecordTooLarge { opcode, len: length })?;
    load(window, count)?;
    Ok(Found::Record(opcode, count))
}

/// Has `count` bytes at hand.
pub(super) fn load<R: Read>(window: &mut Window<R>, count: usize) -> mcap::McapResult<()> {
    if window.load(count).map_err(broken)? { Ok(()) } else { Err(mcap::McapError::UnexpectedEof) }
}

/// Goes on by `count` bytes.
pub(super) fn skip<R: Read>(window: &mut Window<R>, count: u64) -> mcap::McapResult<()> {
    if window.skip(count).map_err(broken)? { Ok(()) } else { Err(mcap::McapError::UnexpectedEof) }
}

/// A stream that breaks off or can't be unpacked.
pub(super) fn broken(error: io::Error) -> mcap::McapError {
    match error.kind() {
        ErrorKind::UnexpectedEof => mcap::McapError::UnexpectedEof,
        _ => mcap::McapError::DecompressionError(error.to_string()),
    }
}

fn matters(opcode: u8) -> bool {
    matches!(opcode, op::MESSAGE | op::SCHEMA | op::CHANNEL | op::DATA_END | op::FOOTER)
}

/// Reads a record of the kinds that matter here; `None` for all others.
///
/// # Errors
/// A record that is not whole.
pub(super) fn parse(opcode: u8, data: &[u8]) -> mcap::McapResult<Option<Record<'_>>> {
    let whole = match opcode {
        // Nearly all records are messages, and their heads are of one size.
        op::MESSAGE => {
            let (header, data) = message(data).ok_or(mcap::McapError::UnexpectedEof)?;
            return Ok(Some(Record::Message { header, data: Cow::Borrowed(data) }));
        }
        // Number; name, encoding, data.
        op::SCHEMA => texts(data, 2, 3),
        // Number and that of the schema; topic, encoding, notes.
        op::CHANNEL => texts(data, 4, 2).and_then(|rest| pairs(&data[rest..])),
        op::DATA_END | op::FOOTER => Some(0),
        _ => return Ok(None),
    };
    match whole {
        Some(_) => mcap::parse_record(opcode, data).map(Some),
        None => Err(mcap::McapError::UnexpectedEof),
    }
}

/// The head of a message, and what follows it.
fn message(data: &[u8]) -> Option<(MessageHeader, &[u8])> {
    let (channel, rest) = data.split_first_chunk()?;
    let (sequence, rest) = rest.split_first_chunk()?;
    let (log, rest) = rest.split_first_chunk()?;
    let (publish, rest) = rest.split_first_chunk()?;
    let header = MessageHeader {
        channel_id: u16::from_le_bytes(*channel),
        sequence: u32::from_le_bytes(*sequence),
        log_time: u64::from_le_bytes(*log),
        publish_time: u64::from_le_bytes(*publish),
    };
    Some((header, rest))
}

/// Where a text that begins at `at` with its length ends, if it is there.
fn text(data: &[u8], at: usize) -> Option<usize> {
    let length = data.get(at..at.checked_add(4)?)?;
    let length = u32::from_le_bytes(length.try_into().ok()?);
    let end = at.checked_add(4)?.checked_add(usize::try_from(length).ok()?)?;
    (end <= data.len()).then_some(end)
}

/// Where `count` texts from `at` on end.
fn texts(data: &[u8], at: usize, count: usize) -> Option<usize> {
    (0..count).try_fold(at, |at, _| text(data, at))
}

/// Where a list of pairs of texts ends, which says how many bytes it has.
fn pairs(data: &[u8]) -> Option<usize> {
    let end = text(data, 0)?;
    let mut at = 4;
    while at < end {
        at = texts(data, at, 2)?;
    }
    Some(at)
}

/// The channels in the summary at the end of a file; `None` where it has none, or none that can be read.
pub(super) fn summary(input: &Input) -> Option<Vec<Channel>> {
    let length = input.len().ok()?;
    let footer = length.checked_sub((RECORD + FOOTER + MAGIC) as u64)?;
    let mut bytes = input.open().ok()?;
    let mut end = [0; RECORD + FOOTER + MAGIC];
    bytes.seek(SeekFrom::Start(footer)).ok()?;
    bytes.read_exact(&mut end).ok()?;
    let start = u64::from_le_bytes(end[RECORD..RECORD + 8].try_into().ok()?);
    if end[0] != op::FOOTER || !end.ends_with(mcap::MAGIC) || start == 0 || start > footer {
        return None;
    }
    let mut data = vec![0; usize::try_from(footer - start).ok()?];
    bytes.seek(SeekFrom::Start(start)).ok()?;
    bytes.read_exact(&mut data).ok()?;
    let mut schemas: HashMap<u16, (String, String, Vec<u8>)> = HashMap::new();
    let mut found: Vec<(u16, Channel)> = Vec::new();
    let mut rest = data.as_slice();
    while let Some((head, behind)) = rest.split_at_checked(RECORD) {
        let size = usize::try_from(u64::from_le_bytes(head[1..].try_into().ok()?)).ok()?;
        let (body, next) = behind.split_at_checked(size)?;
        match parse(head[0], body).ok()? {
            Some(Record::Schema { header, data }) => {
                schemas.insert(header.id, (header.name, header.encoding, data.into_owned()));
            }
            Some(Record::Channel(channel)) => {
                let schema = schemas.get(&channel.schema_id).cloned();
                found.push((channel.id, Channel { topic: channel.topic, encoding: channel.message_encoding, schema }));
            }
            _ => {}
        }
        rest = next;
    }
    found.sort_by_key(|(id, _)| *id);
    (!found.is_empty()).then(|| found.into_iter().map(|(_, channel)| channel).collect())
}
