//! A small MCAP log of ROS 2 joint states, as a recorder writes it.

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;

/// The joint of the log.
const JOINT: &str = "hinge";

/// The definition of `sensor_msgs/msg/JointState` with what it is made of.
const SCHEMA: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort
================================================================================
MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id
================================================================================
MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// A log under way.
pub(crate) struct Bag(Writer<Cursor<Vec<u8>>>);

fn words(error: mcap::McapError) -> String {
    format!("mcap: {error}")
}

impl Bag {
    pub(crate) fn new() -> Result<Self, String> {
        let options =
            WriteOptions::new().compression(Some(Compression::Zstd)).profile("ros2").library("cargo xtask data");
        Writer::with_options(Cursor::new(Vec::new()), options).map(Self).map_err(words)
    }

    pub(crate) fn channel(&mut self, topic: &str) -> Result<u16, String> {
        let schema = self.0.add_schema("sensor_msgs/msg/JointState", "ros2msg", SCHEMA.as_bytes()).map_err(words)?;
        self.0.add_channel(schema, topic, "cdr", &BTreeMap::new()).map_err(words)
    }

    /// A message stamped at `stamp` and recorded at `recorded` (ns): position, velocity and effort, where there are any.
    pub(crate) fn write(
        &mut self,
        channel_id: u16,
        stamp: i64,
        recorded: i64,
        values: [Option<f64>; 3],
    ) -> Result<(), String> {
        // Little-endian, aligned from behind the four bytes that say so.
        let mut data = vec![0, 1, 0, 0];
        let time = [stamp / 1_000_000_000, stamp % 1_000_000_000];
        time.iter().for_each(|part| data.extend((*part as u32).to_le_bytes()));
        text(&mut data, "");
        count(&mut data, 1);
        text(&mut data, JOINT);
        for value in values {
            count(&mut data, u32::from(value.is_some()));
            if let Some(value) = value {
                align(&mut data, 8);
                data.extend(value.to_le_bytes());
            }
        }
        let recorded = recorded as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time: recorded, publish_time: recorded };
        self.0.write_to_known_channel(&header, &data).map_err(words)
    }

    pub(crate) fn done(mut self) -> Result<Vec<u8>, String> {
        self.0.finish().map_err(words)?;
        Ok(self.0.into_inner().into_inner())
    }
}

fn align(data: &mut Vec<u8>, size: usize) {
    while !(data.len() - 4).is_multiple_of(size) {
        data.push(0);
    }
}

fn count(data: &mut Vec<u8>, count: u32) {
    align(data, 4);
    data.extend(count.to_le_bytes());
}

fn text(data: &mut Vec<u8>, text: &str) {
    count(data, text.len() as u32 + 1);
    data.extend(text.as_bytes());
    data.push(0);
}

/// Time of recording and numbers of each message, for comparison.
#[cfg(test)]
pub(crate) fn numbers(bytes: &[u8]) -> Vec<(u64, Vec<f64>)> {
    let messages = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
    let values = |data: &[u8]| {
        // Behind the stamp, an empty text and the one name come three lists of at most one number.
        let (mut at, mut found) = (4 + 8 + 8 + 4 + 4 + JOINT.len() + 1, Vec::new());
        for _ in 0..3 {
            at += (4 - at % 4) % 4;
            let count = u32::from_le_bytes(data[at..at + 4].try_into().unwrap());
            at += 4;
            if count > 0 {
                at += (8 - (at - 4) % 8) % 8;
                found.push(f64::from_le_bytes(data[at..at + 8].try_into().unwrap()));
                at += 8;
            }
        }
        found
    };
    messages.map(|m| (m.log_time, values(&m.data))).collect()
}
