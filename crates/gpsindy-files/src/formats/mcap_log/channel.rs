//! A channel of a log, and the schema of its messages.

use crate::formats::message::schema::Schema;

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
