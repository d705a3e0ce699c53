//! Writes MCAP files with messages in CDR, for tests.

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Writes plain CDR, aligned from the begin of the body.
pub(crate) struct Cdr {
    bytes: Vec<u8>,
    big: bool,
}

impl Cdr {
    pub(crate) fn new(big: bool) -> Self {
        Self { bytes: vec![0, u8::from(!big), 0, 0], big }
    }

    fn put(mut self, bytes: &[u8]) -> Self {
        while !(self.bytes.len() - 4).is_multiple_of(bytes.len()) {
            self.bytes.push(0);
        }
        if self.big {
            self.bytes.extend(bytes.iter().rev());
        } else {
            self.bytes.extend(bytes);
        }
        self
    }

    pub(crate) fn u8(self, v: u8) -> Self {
        self.put(&[v])
    }

    pub(crate) fn u16(self, v: u16) -> Self {
        self.put(&v.to_le_bytes())
    }

    pub(crate) fn u32(self, v: u32) -> Self {
        self.put(&v.to_le_bytes())
    }

    pub(crate) fn i64(self, v: i64) -> Self {
        self.put(&v.to_le_bytes())
    }

    pub(crate) fn f32(self, v: f32) -> Self {
        self.put(&v.to_le_bytes())
    }

    pub(crate) fn f64(self, v: f64) -> Self {
        self.put(&v.to_le_bytes())
    }

    pub(crate) fn text(self, text: &str) -> Self {
        let mut next = self.u32(text.len() as u32 + 1);
        next.bytes.extend(text.as_bytes());
        next.bytes.push(0);
        next
    }

    pub(crate) fn stamp(self, ns: i64) -> Self {
        self.u32((ns / 1_000_000_000) as u32).u32((ns % 1_000_000_000) as u32)
    }

    pub(crate) fn done(self) -> Vec<u8> {
        self.bytes
    }
}

pub(crate) const JOINT_STATE: &str =
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort
================================================================================
MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id
================================================================================
MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

pub(crate) fn joint_state(ns: i64, names: &[&str], position: &[f64]) -> Vec<u8> {
    let mut cdr = Cdr::new(false).stamp(ns).text("base").u32(names.len() as u32);
    for name in names {
        cdr = cdr.text(name);
    }
    cdr = cdr.u32(position.len() as u32);
    for value in position {
        cdr = cdr.f64(*value);
    }
    cdr.u32(0).u32(0).done()
}

pub(super) fn array(values: &[f64]) -> Vec<u8> {
    // layout: no dimension, offset 0.
    let mut cdr = Cdr::new(false).u32(0).u32(0).u32(values.len() as u32);
    for value in values {
        cdr = cdr.f64(*value);
    }
    cdr.done()
}

pub(crate) const ARRAY: &str = "MultiArrayLayout layout\nfloat64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n";

/// A log under way.
pub(crate) struct Bag(Writer<Cursor<Vec<u8>>>);

impl Bag {
    pub(crate) fn new(compression: Option<Compression>) -> Self {
        let options = WriteOptions::new().compression(compression).chunk_size(Some(4096));
        Self(Writer::with_options(Cursor::new(Vec::new()), options).unwrap())
    }

    pub(crate) fn channel(&mut self, topic: &str, kind: &str, schema: &str) -> u16 {
        let schema = self.0.add_schema(kind, "ros2msg", schema.as_bytes()).unwrap();
        self.0.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
    }

    pub(crate) fn json(&mut self, topic: &str) -> u16 {
        self.0.add_channel(0, topic, "json", &BTreeMap::new()).unwrap()
    }

    pub(crate) fn write(&mut self, channel_id: u16, ns: i64, data: &[u8]) {
        let header = MessageHeader { channel_id, sequence: 0, log_time: ns as u64, publish_time: ns as u64 };
        self.0.write_to_known_channel(&header, data).unwrap();
    }

    pub(crate) fn done(mut self) -> Vec<u8> {
        self.0.finish().unwrap();
        self.0.into_inner().into_inner()
    }
}

pub(super) const BEGIN: i64 = 1_763_000_000_500_000_000;

/// 100 Hz of joints whose message reached the recorder 3 ms late, 50 Hz of commands.
pub(crate) fn robot(compression: Option<Compression>) -> Vec<u8> {
    robot_after(0, compression)
}

/// The same where so many commands, 10 ms apart, come before the first joint.
pub(super) fn robot_after(early: i64, compression: Option<Compression>) -> Vec<u8> {
    let mut bag = Bag::new(compression);
    let joints = bag.channel("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE);
    let command = bag.channel("/command", "std_msgs/msg/Float64MultiArray", ARRAY);
    for k in 0..early {
        bag.write(command, BEGIN + (k - early) * 10_000_000 + 1_000_000, &array(&[7.0, -1.0 - k as f64]));
    }
    for i in 0..200_i64 {
        let t = BEGIN + i * 10_000_000;
        let (pan, lift) = (i as f64 * 0.1, -(i as f64));
        // The order of the joints changes on the way.
        let message = if i % 2 == 0 {
            joint_state(t, &["pan", "lift"], &[pan, lift])
        } else {
            joint_state(t, &["lift", "pan"], &[lift, pan])
        };
        bag.write(joints, t + 3_000_000, &message);
        if i % 2 == 0 {
            bag.write(command, t + 1_000_000, &array(&[7.0, i as f64]));
        }
    }
    bag.done()
}
