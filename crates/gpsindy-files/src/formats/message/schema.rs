//! Schemas of ROS 2 messages, `ros2msg`: the text of the .msg file and of each message that it uses.
//!
//! Written by hand: the crates that read it build on the arrow crate or need a newer compiler than the workspace's.
//! Source: docs.ros.org, "About ROS 2 interfaces"; mcap.dev, registry of well-known schema encodings.

use crate::formats::message::kind::Kind;
use std::collections::HashMap;

/// Messages that use each other, the first one is that of the topic.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Schema {
    pub(crate) messages: Vec<Message>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    /// As in the schema: `sensor_msgs/JointState`.
    pub(crate) name: String,
    pub(crate) fields: Vec<Field>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) many: Many,
}

/// How many values a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Many {
    One,
    /// As many in every message.
    Fixed(usize),
    /// The message says how many.
    Listed,
}

/// Deepest nesting of messages.
const DEEPEST: usize = 32;

impl Kind {
    fn of(word: &str) -> Option<Self> {
        let text =
            |word: &str, name: &str| word.strip_prefix(name).is_some_and(|r| r.is_empty() || r.starts_with("<="));
        Some(match word {
            "bool" => Self::Bool,
            "int8" => Self::I8,
            "uint8" | "byte" | "char" => Self::U8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            _ if text(word, "string") => Self::Text,
            _ if text(word, "wstring") => Self::WideText,
            _ => return None,
        })
    }
}

impl Schema {
    /// Reads the text of a schema whose topic's message is `name`.
    ///
    /// # Errors
    /// What is wrong with it, for the user.
    pub(crate) fn parse(name: &str, text: &str) -> Result<Self, String> {
        let parts = parts(name, text);
        let place: HashMap<String, usize> =
            parts.iter().enumerate().rev().map(|(i, (name, _))| (short(name), i)).collect();
        let mut messages = Vec::with_capacity(parts.len());
        for (name, lines) in &parts {
            let mut fields = Vec::new();
            for line in lines {
                if let Some(field) = field(line, name, &place).map_err(|e| format!("schema of {name}: {e}"))? {
                    fields.push(field);
                }
            }
            messages.push(Message { name: short(name), fields });
        }
        let schema = Self { messages };
        schema.check_depth(0, 0)?;
        Ok(schema)
    }

    /// A message within itself has no end, and no message is this deep.
    fn check_depth(&self, message: usize, depth: usize) -> Result<(), String> {
        // Each message once a level would suffice; deep and broad schemas are small, but not those made to hurt.
        let mut level: Vec<usize> = vec![message];
        for _ in depth..DEEPEST {
            let mut next: Vec<usize> = Vec::new();
            for &m in &level {
                for field in &self.messages[m].fields {
                    if let Kind::Message(inner) = field.kind
                        && !next.contains(&inner)
                    {
                        next.push(inner);
                    }
                }
            }
            if next.is_empty() {
                return Ok(());
            }
            level = next;
        }
        Err(format!("{} is nested deeper than {DEEPEST} messages, or within itself", self.messages[message].name))
    }

    /// The type of a field as the schema writes it: `float64[]`, `geometry_msgs/Point`.
    pub(crate) fn type_name(&self, field: &Field) -> String {
        let kind = match field.kind {
            Kind::Bool => "bool",
            Kind::I8 => "int8",
            Kind::U8 => "uint8",
            Kind::I16 => "int16",
            Kind::U16 => "uint16",
            Kind::I32 => "int32",
            Kind::U32 => "uint32",
            Kind::I64 => "int64",
            Kind::U64 => "uint64",
            Kind::F32 => "float32",
            Kind::F64 => "float64",
            Kind::Text => "string",
            Kind::WideText => "wstring",
            Kind::Message(m) => &self.messages[m].name,
        };
        match field.many {
            Many::One => kind.into(),
            Many::Fixed(n) => format!("{kind}[{n}]"),
            Many::Listed => format!("{kind}[]"),
        }
    }
}

/// The messages of a schema and their lines, the topic's first. The two times are known to everybody.
fn parts<'a>(name: &str, text: &'a str) -> Vec<(String, Vec<&'a str>)> {
    let mut parts: Vec<(String, Vec<&str>)> = vec![(name.to_string(), Vec::new())];
    let mut named = true;
    for line in text.lines() {
        let line = line.trim();
        if line.len() >= 3 && line.bytes().all(|b| b == b'=') {
            named = false;
            continue;
        }
        if let Some(other) = line.strip_prefix("MSG:").filter(|_| !named) {
            parts.push((other.trim().into(), Vec::new()));
            named = true;
            continue;
        }
        if named && let Some(last) = parts.last_mut() {
            last.1.push(line);
        }
    }
    for time in ["Time", "Duration"] {
        parts.push((format!("builtin_interfaces/{time}"), vec!["int32 sec", "uint32 nanosec"]));
    }
    parts
}

/// `sensor_msgs/msg/JointState` and `sensor_msgs/JointState` are one.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// A line of a message; `None` for constants, comments and empty lines.
fn field(line: &str, message: &str, place: &HashMap<String, usize>) -> Result<Option<Field>, String> {
    let line = without_comment(line);
    let mut words = line.split_whitespace();
    let Some(word) = words.next() else { return Ok(None) };
    let Some(name) = words.next() else { return Err(format!("`{line}` has no name")) };
    // `int32 X=1` and `int32 X = 1` are constants; what else follows a name is a default.
    if name.contains('=') || words.next().is_some_and(|w| w.starts_with('=')) {
        return Ok(None);
    }
    // `string<=10[<=5]`: the array's brackets are the last ones.
    let (base, many) = match word.strip_suffix(']').and_then(|w| w.rsplit_once('[')) {
        None => (word, Many::One),
        Some((base, "")) => (base, Many::Listed),
        Some((base, most)) if most.starts_with("<=") => (base, Many::Listed),
        Some((base, count)) => match count.parse() {
            Ok(count) if count > 0 => (base, Many::Fixed(count)),
            _ => return Err(format!("`{word}` is no array of a fixed size")),
        },
    };
    let kind = match Kind::of(base) {
        Some(kind) => kind,
        None => Kind::Message(find(base, message, place).ok_or_else(|| format!("`{base}` is not defined in it"))?),
    };
    Ok(Some(Field { name: name.into(), kind, many }))
}

/// A message by its full name, or by its own in the same package; `Header` is known everywhere.
fn find(base: &str, message: &str, place: &HashMap<String, usize>) -> Option<usize> {
    let base = short(base);
    if base.contains('/') {
        return place.get(&base).copied();
    }
    let package = message.split('/').next().unwrap_or_default();
    let own = place.get(&format!("{package}/{base}")).copied();
    let known = match base.as_str() {
        "Header" => "std_msgs/Header",
        "time" | "Time" => "builtin_interfaces/Time",
        "duration" | "Duration" => "builtin_interfaces/Duration",
        _ => "",
    };
    own.or_else(|| place.get(&base).copied()).or_else(|| place.get(known).copied())
}

/// A `#` in the quotes of a default is none.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    for (i, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') => return &line[..i],
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if open == c => quote = None,
            _ => {}
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT_STATE: &str = "# a state\nstd_msgs/Header header\n\nstring[] name\nfloat64[] position  # rad\nfloat64[3] fixed\nfloat64[<=4] bounded 
string<=10[<=5] words\nint32 X=1\nstring NAME = \"a # b\"\nint32 with_default 5\nstring text \"# no comment\"
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

    #[test]
    fn a_schema_lists_fields_in_their_order() {
        let schema = Schema::parse("sensor_msgs/msg/JointState", JOINT_STATE).unwrap();
        let type_name: Vec<String> =
            schema.messages[0].fields.iter().map(|f| format!("{} {}", schema.type_name(f), f.name)).collect();
        assert_eq!(
            type_name,
            [
                "std_msgs/Header header",
                "string[] name",
                "float64[] position",
                "float64[3] fixed",
                "float64[] bounded",
                "string[] words",
                "int32 with_default",
                "string text"
            ]
        );
        let Kind::Message(header) = schema.messages[0].fields[0].kind else { panic!() };
        assert_eq!(schema.type_name(&schema.messages[header].fields[0]), "builtin_interfaces/Time");
    }

    #[test]
    fn a_bad_schema_says_what_is_wrong() {
        for (text, expected) in [
            ("other/Thing thing\n", "schema of a/B: `other/Thing` is not defined in it"),
            ("float64\n", "schema of a/B: `float64` has no name"),
            ("float64[0] x\n", "schema of a/B: `float64[0]` is no array of a fixed size"),
            ("B within\n", "a/B is nested deeper than 32 messages, or within itself"),
        ] {
            assert_eq!(Schema::parse("a/B", text).unwrap_err(), expected);
        }
    }
}
