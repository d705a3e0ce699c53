//! The container: formats, subscriptions and messages in the order of the file, up to a break.
//!
//! Written by hand: the crate `px4-ulog` 0.6.1 panics on records that a broken file holds, such as one without bytes.
//! Source: docs.px4.io, "ULog File Format".

use crate::error::{Error, Result};
use crate::formats::message::kind::{Kind, number};
use crate::input::Input;
use gpsindy_core::Progress;
use std::collections::HashMap;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Bytes of the head of a file and of a record.
const HEAD: usize = 16;
const RECORD: usize = 3;

/// Deepest nesting of formats, and most fields of one.
const DEEPEST: usize = 16;
const MOST_FIELDS: usize = 20_000;

/// Messages between two reports of progress.
const REPORT: u64 = 10_000;

/// A number in a message.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Field {
    /// Its path: `xyz[2]`, `esc[0].rpm`.
    pub(crate) name: String,
    pub(crate) type_name: &'static str,
    kind: Kind,
    at: usize,
}

/// A message and what is known about it.
pub(crate) struct Message<'a> {
    pub(crate) subscription: u16,
    /// `sensor_accel`, and `sensor_accel:1` for its second instance.
    pub(crate) topic: &'a str,
    /// Without the stamp and what only fills.
    pub(crate) fields: &'a [Field],
    stamp: Option<&'a Field>,
    pub(crate) data: &'a [u8],
}

impl Message<'_> {
    /// ns since the start of the board; `None` where the message has no stamp.
    pub(crate) fn stamp(&self) -> Option<i64> {
        let at = self.stamp?.at;
        let bytes: [u8; 8] = self.data.get(at..at + 8)?.try_into().ok()?;
        i64::try_from(u64::from_le_bytes(bytes)).ok()?.checked_mul(1_000)
    }
}

impl Field {
    /// Its number in the bytes of a message, NaN where that is too short or it is infinite.
    pub(crate) fn value(&self, data: &[u8]) -> f64 {
        let size = self.kind.size().unwrap_or(1);
        let value = data.get(self.at..self.at + size).map_or(f64::NAN, |bytes| number(self.kind, bytes, false));
        if value.is_finite() { value } else { f64::NAN }
    }
}

/// A topic's subscription: its name, fields and stamp.
struct Subscription {
    topic: String,
    fields: Vec<Field>,
    stamp: Option<Field>,
}

/// Reads a log; returns what to say of a break.
///
/// # Errors
/// A file that can't be read, that breaks before its first message, a request to stop.
pub(crate) fn parse(
    input: &Input,
    progress: &dyn Progress,
    take: &mut dyn FnMut(&Message<'_>),
) -> Result<Option<String>> {
    let length = input.len()?;
    let mut bytes = BufReader::with_capacity(1 << 16, input.open()?);
    let mut formats: HashMap<String, String> = HashMap::new();
    let mut subscriptions: HashMap<u16, Subscription> = HashMap::new();
    let mut appended: Vec<u64> = Vec::new();
    let (mut at, mut count) = (HEAD as u64, 0_u64);
    let mut body = Vec::new();
    let cause = loop {
        if at == HEAD as u64 && bytes.seek(SeekFrom::Start(at)).is_err() || at >= length {
            break (length < HEAD as u64).then(|| "its head is cut".to_string());
        }
        let mut head = [0; RECORD];
        let cut = at + RECORD as u64 > length;
        let size = if cut {
            0
        } else {
            bytes.read_exact(&mut head).map_err(|e| input.failed(e))?;
            u64::from(u16::from_le_bytes([head[0], head[1]]))
        };
        let end = at + RECORD as u64 + size;
        // Sections that were appended begin where the head says, whatever comes before them.
        if let Some(next) = appended.iter().copied().filter(|next| *next > at && *next < end).min() {
            bytes.seek(SeekFrom::Start(next)).map_err(|e| input.failed(e))?;
            at = next;
            continue;
        }
        if cut || end > length {
            break Some("its last record is cut".to_string());
        }
        at = end;
        body.resize(size as usize, 0);
        bytes.read_exact(&mut body).map_err(|e| input.failed(e))?;
        match head[2] {
            b'B' => match flags(&body, length) {
                Ok(found) => appended = found,
                Err(cause) => break Some(cause),
            },
            b'F' => {
                if let Some((name, fields)) = text(&body).split_once(':') {
                    formats.insert(name.into(), fields.into());
                }
            }
            b'A' => {
                let Some((head, name)) = body.split_at_checked(3) else {
                    break Some("a subscription is cut".to_string());
                };
                let (instance, id) = (head[0], u16::from_le_bytes([head[1], head[2]]));
                match Subscription::of(&formats, &text(name), instance) {
                    Ok(subscription) => drop(subscriptions.insert(id, subscription)),
                    Err(cause) => break Some(cause),
                }
            }
            b'D' => {
                let Some((head, data)) = body.split_at_checked(2) else { break Some("a message is cut".to_string()) };
                let id = u16::from_le_bytes([head[0], head[1]]);
                let Some(found) = subscriptions.get(&id) else { continue };
                count += 1;
                let (topic, fields, stamp) = (found.topic.as_str(), found.fields.as_slice(), found.stamp.as_ref());
                take(&Message { subscription: id, topic, fields, stamp, data });
                if count % REPORT == 0 && !progress.report("reading", at as usize, length as usize) {
                    return Err(gpsindy_core::Error::Cancelled.into());
                }
            }
            // Parameters, texts, marks: nothing to identify from.
            _ => {}
        }
    };
    match cause {
        Some(cause) if count == 0 => {
            Err(Error::file(&input.file, format!("the ULog file is broken before its first message: {cause}")))
        }
        None if count == 0 => Err(Error::file(&input.file, "the log holds no message")),
        Some(cause) => Ok(Some(format!(
            "{}: the file breaks off behind {count} messages ({cause}); what came before was read",
            input.file
        ))),
        None => Ok(None),
    }
}

/// Where appended sections begin.
fn flags(body: &[u8], length: u64) -> std::result::Result<Vec<u64>, String> {
    let Some(incompatible) = body.get(8..16) else { return Ok(Vec::new()) };
    if incompatible[0] & !1 != 0 || incompatible[1..].iter().any(|b| *b != 0) {
        return Err("it uses features of ULog that are not known here".into());
    }
    let offsets = body[16..].chunks_exact(8).take(3).filter_map(|b| b.try_into().ok().map(u64::from_le_bytes));
    Ok(offsets.filter(|offset| *offset >= HEAD as u64 && *offset < length).collect())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

impl Subscription {
    fn of(formats: &HashMap<String, String>, name: &str, instance: u8) -> std::result::Result<Self, String> {
        let mut fields = Vec::new();
        flatten(formats, name, "", &mut 0, 0, &mut fields)?;
        let is_stamp = |f: &Field| f.name == "timestamp" && f.kind == Kind::U64;
        let stamp = fields.iter().find(|f| is_stamp(f)).cloned();
        fields.retain(|f| !is_stamp(f) && !f.name.split('.').any(|part| part.starts_with("_padding")));
        let topic = if instance == 0 { name.to_string() } else { format!("{name}:{instance}") };
        Ok(Self { topic, fields, stamp })
    }
}

/// The numbers of a format and of those in it, one after the other; text is left out.
fn flatten(
    formats: &HashMap<String, String>,
    name: &str,
    prefix: &str,
    at: &mut usize,
    depth: usize,
    fields: &mut Vec<Field>,
) -> std::result::Result<(), String> {
    let Some(format) = formats.get(name) else { return Err(format!("the format `{name}` is not in it")) };
    if depth > DEEPEST {
        return Err(format!("the format `{name}` is nested too deep, or within itself"));
    }
    for field in format.split(';').filter(|f| !f.trim().is_empty()) {
        let Some((kind, own)) = field.trim().split_once(' ') else {
            return Err(format!("the field `{field}` of `{name}`"));
        };
        let (kind, count) = match kind.strip_suffix(']').and_then(|k| k.split_once('[')) {
            None => (kind, None),
            Some((kind, count)) => {
                let count = count.parse::<usize>().ok().filter(|n| *n <= usize::from(u16::MAX));
                (kind, Some(count.ok_or_else(|| format!("the field `{field}` of `{name}`"))?))
            }
        };
        for i in 0..count.unwrap_or(1) {
            let path = if count.is_some() { format!("{prefix}{own}[{i}]") } else { format!("{prefix}{own}") };
            match number_of(kind) {
                Some((type_name, number)) => {
                    let size = number.size().unwrap_or(1);
                    if kind != "char" {
                        fields.push(Field { name: path, type_name, kind: number, at: *at });
                    }
                    *at += size;
                }
                None => flatten(formats, kind, &format!("{path}."), at, depth + 1, fields)?,
            }
            if fields.len() > MOST_FIELDS || *at > usize::from(u16::MAX) {
                return Err(format!("the format `{name}` is larger than a message can be"));
            }
        }
    }
    Ok(())
}

fn number_of(kind: &str) -> Option<(&'static str, Kind)> {
    Some(match kind {
        "int8_t" => ("int8_t", Kind::I8),
        "uint8_t" => ("uint8_t", Kind::U8),
        "char" => ("char", Kind::U8),
        "bool" => ("bool", Kind::Bool),
        "int16_t" => ("int16_t", Kind::I16),
        "uint16_t" => ("uint16_t", Kind::U16),
        "int32_t" => ("int32_t", Kind::I32),
        "uint32_t" => ("uint32_t", Kind::U32),
        "int64_t" => ("int64_t", Kind::I64),
        "uint64_t" => ("uint64_t", Kind::U64),
        "float" => ("float", Kind::F32),
        "double" => ("double", Kind::F64),
        _ => return None,
    })
}
