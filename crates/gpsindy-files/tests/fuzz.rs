//! Broken logs of every format: no panic, no hang, and no memory beyond four times the file.
//!
//! A short run is part of every test. The long one, 100,000 files a format:
//! `cargo test --release --workspace --exclude gpsindy-py --test fuzz -- --ignored --nocapture`
#![allow(clippy::unwrap_used, unsafe_code, clippy::print_stdout)]
#![cfg(all(feature = "mcap", feature = "parquet", feature = "ulog"))]

use gpsindy_core::Silent;
use gpsindy_files::{LogOptions, Logs, inspect};
use mcap::records::MessageHeader;
use parquet::data_type::{DoubleType, Int64Type};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Files of each format in the ordinary run, and in the long one.
const ROUNDS: usize = 1_500;
const LONG_ROUNDS: usize = 100_000;

/// Memory that a log may take: this many times its file, and what reading may take however short a file is. That is buffers,
/// and one message of 16 MB: so large a one is read where it packs well, and a broken length may claim it.
const TIMES: usize = 4;
const ALWAYS: usize = 20 << 20;

/// Counts what this thread holds.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(change: isize) {
    let _ = HELD.try_with(|held| {
        held.set(held.get() + change);
        let _ = MOST.try_with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call goes on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as the caller promises.
        unsafe { System.realloc(place, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Random numbers, the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n.max(1)
    }
}

/// A file with a few faults: bits, bytes and words changed, pieces cut out, doubled, put elsewhere, the end missing.
fn broken(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(6) {
        if bytes.is_empty() {
            break;
        }
        // Heads and ends hold most of what is structure.
        let at = match random.below(3) {
            0 => random.below(bytes.len().min(400)),
            1 => bytes.len() - 1 - random.below(bytes.len().min(400)),
            _ => random.below(bytes.len()),
        };
        let end = (at + 1 + random.below(64)).min(bytes.len());
        match random.below(9) {
            0 => bytes[at] = random.below(256) as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 => {
                let (piece, to) = (bytes[at..end].to_vec(), random.below(bytes.len()));
                let end = (to + piece.len()).min(bytes.len());
                let length = end - to;
                bytes[to..end].copy_from_slice(&piece[..length]);
            }
            6 => {
                let value =
                    [0, 1, 0x7fff_ffff_ffff_ffff, u64::MAX, 0x8000_0000, random.below(1 << 20) as u64][random.below(6)];
                let size = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
                bytes[at..at + size].copy_from_slice(&value.to_le_bytes()[..size]);
            }
            7 => bytes[at] = bytes[at].wrapping_add([1, 255, 16][random.below(3)]),
            _ => bytes[at..end].fill([0, 0x7f, 0xff, b'"', b'\n'][random.below(5)]),
        }
    }
    bytes
}

/// The first messages of the log in `data/`, packed in another way.
fn mcap(compression: Option<mcap::Compression>) -> Vec<u8> {
    let kept = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/pendulum.mcap")).unwrap();
    let options = mcap::WriteOptions::new().compression(compression).chunk_size(Some(4096));
    let mut writer = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    let mut known = std::collections::HashMap::new();
    for message in mcap::MessageStream::new(&kept).unwrap().take(200) {
        let message = message.unwrap();
        let channel = &message.channel;
        let id = *known.entry(channel.id).or_insert_with(|| {
            let schema = channel.schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata).unwrap()
        });
        let (sequence, log_time, publish_time) = (message.sequence, message.log_time, message.publish_time);
        let header = MessageHeader { channel_id: id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &message.data).unwrap();
        if message.sequence == 0 && message.log_time % 3 == 0 {
            let json = known
                .entry(u16::MAX)
                .or_insert_with(|| writer.add_channel(0, "/json", "json", &Default::default()).unwrap());
            let header = MessageHeader { channel_id: *json, ..header };
            writer
                .write_to_known_channel(&header, br#"{"stamp":{"sec":1,"nsec":2},"list":[1,2,[3]],"x":{"y":-1e5}}"#)
                .unwrap();
        }
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn parquet(compression: parquet::basic::Compression) -> Vec<u8> {
    let schema = "message schema { REQUIRED DOUBLE t; OPTIONAL DOUBLE x; REQUIRED INT64 trial; \
                  OPTIONAL group q (LIST) { REPEATED group list { OPTIONAL DOUBLE element; } } }";
    let schema = Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let settings = parquet::file::properties::WriterProperties::builder().set_compression(compression).build();
    let mut bytes = Vec::new();
    let mut file = parquet::file::writer::SerializedFileWriter::new(&mut bytes, schema, Arc::new(settings)).unwrap();
    for group in 0..2 {
        let mut rows = file.next_row_group().unwrap();
        let values: Vec<f64> = (0..300).map(|i| f64::from(i % 150) * 0.01).collect();
        let noise: Vec<f64> = values.iter().map(|v| (v * 1e4).sin()).collect();
        let mut column = rows.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&values, None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let defined: Vec<i16> = (0..300).map(|i| i16::from(i % 7 != 0)).collect();
        column.typed::<DoubleType>().write_batch(&noise, Some(&defined), None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let trials: Vec<i64> = (0..300).map(|i| 2 * group + i / 150).collect();
        column.typed::<Int64Type>().write_batch(&trials, None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let repeated: Vec<i16> = (0..600).map(|i| i16::from(i % 2 == 1)).collect();
        let both = [noise.clone(), noise].concat();
        column.typed::<DoubleType>().write_batch(&both, Some(&[3; 600]), Some(&repeated)).unwrap();
        column.close().unwrap();
        rows.close().unwrap();
    }
    file.close().unwrap();
    bytes
}

fn ulog() -> Vec<u8> {
    let record = |kind: u8, body: &[u8]| [&(body.len() as u16).to_le_bytes()[..], &[kind], body].concat();
    let mut bytes = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    bytes.extend(record(b'B', &[0; 40]));
    bytes.extend(record(b'F', b"inner:float a;int16_t[2] b;"));
    bytes.extend(record(b'F', b"rate:uint64_t timestamp;float[3] xyz;inner[2] deep;bool ok;uint8_t[3] _padding0;"));
    bytes.extend(record(b'I', b"\x07char[3] sysabc"));
    bytes.extend(record(b'A', b"\0\x03\0rate"));
    bytes.extend(record(b'A', b"\x01\x04\0rate"));
    for i in 0..150_u64 {
        let mut body = (3 + (i % 2) as u16).to_le_bytes().to_vec();
        body.extend((1_000_000 + 5_000 * i).to_le_bytes());
        body.extend((0..32).map(|k| (i as u8).wrapping_mul(37).wrapping_add(k)));
        bytes.extend(record(b'D', &body));
    }
    bytes
}

fn csv() -> Vec<u8> {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/pendulum.csv")).unwrap();
    text.lines().take(250).map(|line| format!("{line}\n")).collect::<String>().into_bytes()
}

/// What became of the files of a format.
#[derive(Default)]
struct Outcome {
    read: usize,
    inspected: usize,
    /// Largest memory beyond the file's own, as a share of what is allowed.
    most: f64,
    slowest: f64,
}

fn fuzz(format: &str, wholes: &[Vec<u8>], map: &[(&str, &str)], columns: &[&str], run: Option<&str>, rounds: usize) {
    let map = map.iter().map(|(a, b)| ((*a).to_string(), (*b).to_string())).collect();
    let options = LogOptions { map, run: run.map(Into::into), ..LogOptions::default() };
    let path: PathBuf = std::env::temp_dir().join(format!("gpsindy-fuzz-{}-{format}", std::process::id()));
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut found = Outcome::default();
    for round in 0..rounds {
        // The first round of each is the whole file.
        let whole = &wholes[round % wholes.len()];
        let bytes = if round < wholes.len() { whole.clone() } else { broken(whole, &mut random) };
        std::fs::write(&path, &bytes).unwrap();
        let begin = Instant::now();
        let before = HELD.get();
        MOST.set(before);
        let read = Logs::read(&[&path], &options).and_then(|logs| logs.dataset(columns, &[])).is_ok();
        let inspected = inspect(&path, &options, &Silent).map(|i| (i.text(100), i.json())).is_ok();
        let held = (MOST.get() - before) as f64;
        let allowed = (TIMES * bytes.len().max(whole.len()) + ALWAYS) as f64;
        assert!(held <= allowed, "{format}, round {round}: {held} bytes for a file of {}", bytes.len());
        assert!(round >= wholes.len() || (read && inspected), "{format}: the whole file is not read");
        found.read += usize::from(read);
        found.inspected += usize::from(inspected);
        found.most = found.most.max(held / allowed);
        found.slowest = found.slowest.max(begin.elapsed().as_secs_f64());
    }
    std::fs::remove_file(&path).unwrap();
    let Outcome { read, inspected, most, slowest } = found;
    println!(
        "{format}: {rounds} files, {read} read, {inspected} inspected, memory at most {most:.2} of what is allowed, slowest {slowest:.3} s"
    );
    assert!(read < rounds && inspected > 0);
}

fn all(rounds: usize) {
    let map = [("q", "/joint_states.position[hinge]"), ("u", "/joint_commands.effort[0]")];
    let bags = [None, Some(mcap::Compression::Zstd), Some(mcap::Compression::Lz4)].map(mcap);
    fuzz("mcap", &bags, &map, &["q", "u"], None, rounds);
    let kinds = [parquet::basic::Compression::UNCOMPRESSED, parquet::basic::Compression::SNAPPY];
    fuzz("parquet", &kinds.map(parquet), &[], &["x", "q_1"], Some("trial"), rounds);
    fuzz("ulog", &[ulog()], &[("a", "rate.xyz[1]"), ("b", "rate:1.deep[1].b[0]")], &["a", "b"], None, rounds);
    fuzz("csv", &[csv()], &[], &["phi", "u"], Some("run"), rounds);
}

#[test]
fn broken_logs_of_every_format_neither_panic_nor_swell() {
    all(ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_logs_neither_panic_nor_swell_in_the_long_run() {
    all(LONG_ROUNDS);
}
