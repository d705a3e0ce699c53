//! Whole logs of every format, `times` as long as the short ones.

use gpsindy_files::LogOptions;
use mcap::records::MessageHeader;
use parquet::basic::{BrotliLevel, Compression, GzipLevel, ZstdLevel};
use parquet::data_type::{DoubleType, FloatType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use std::collections::HashMap;
use std::io::{Cursor, Write};
use std::sync::Arc;

/// A log: one file without a name, or a folder of files.
pub(crate) type Whole = Vec<(&'static str, Vec<u8>)>;

/// Logs of a format, and what a task reads of them.
pub(crate) struct Format {
    pub(crate) name: &'static str,
    pub(crate) wholes: Vec<Whole>,
    pub(crate) options: LogOptions,
    pub(crate) columns: &'static [&'static str],
}

/// Every format; those that pack, in every way of packing.
pub(crate) fn formats(times: usize) -> Vec<Format> {
    let map = [("q", "/joint_states.position[hinge]"), ("u", "/joint_commands.effort[0]")];
    let bag = |name, settings: mcap::WriteOptions| Format {
        name,
        wholes: vec![file(mcap(settings, times))],
        options: mapped(&map),
        columns: &["q", "u"],
    };
    let chunks = || mcap::WriteOptions::new().chunk_size(Some(4096 * times as u64));
    let packings = [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::GZIP(GzipLevel::default()),
        Compression::BROTLI(BrotliLevel::default()),
        Compression::ZSTD(ZstdLevel::default()),
        Compression::LZ4_RAW,
    ];
    vec![
        bag("mcap without chunks", mcap::WriteOptions::new().use_chunks(false)),
        bag("mcap not packed", chunks().compression(None)),
        bag("mcap, zstd", chunks().compression(Some(mcap::Compression::Zstd))),
        bag("mcap, lz4", chunks().compression(Some(mcap::Compression::Lz4))),
        Format {
            name: "parquet",
            wholes: packings.map(|packing| file(parquet(packing, times))).into(),
            options: LogOptions { run: Some("trial".into()), ..LogOptions::default() },
            columns: &["x", "q_1"],
        },
        Format {
            name: "lerobot",
            wholes: vec![lerobot(3, times), lerobot(2, times)],
            options: mapped(&[("q", "observation.state[elbow.pos]"), ("u", "action[1]")]),
            columns: &["q", "u"],
        },
        Format {
            name: "ulog",
            wholes: vec![file(ulog(times))],
            options: mapped(&[("a", "rate.xyz[1]"), ("b", "rate:1.deep[1].b[0]")]),
            columns: &["a", "b"],
        },
        Format {
            name: "csv",
            wholes: vec![file(csv(times)), file(dated(times))],
            options: LogOptions { run: Some("run".into()), ..LogOptions::default() },
            columns: &["phi", "u"],
        },
    ]
}

fn file(bytes: Vec<u8>) -> Whole {
    vec![("", bytes)]
}

fn mapped(map: &[(&str, &str)]) -> LogOptions {
    LogOptions { map: map.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect(), ..LogOptions::default() }
}

/// The first messages of the log in `data/`, packed in another way, and some in JSON; again and again, one time after another.
fn mcap(settings: mcap::WriteOptions, times: usize) -> Vec<u8> {
    const PASS: u64 = 5_000_000_000;
    let kept = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/pendulum.mcap")).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&kept).unwrap().take(200).map(Result::unwrap).collect();
    let mut writer = settings.create(Cursor::new(Vec::new())).unwrap();
    let json = writer.add_channel(0, "/json", "json", &Default::default()).unwrap();
    let mut known = HashMap::new();
    for pass in 0..times as u64 {
        for message in &messages {
            let channel = &message.channel;
            let id = *known.entry(channel.id).or_insert_with(|| {
                let schema = channel.schema.as_ref().unwrap();
                let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
                writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata).unwrap()
            });
            let time = message.log_time + pass * PASS;
            let header =
                MessageHeader { channel_id: id, sequence: message.sequence, log_time: time, publish_time: time };
            let mut data = message.data.to_vec();
            // The header's stamp stands behind the four bytes of the encoding.
            let sec = i32::from_le_bytes(data[4..8].try_into().unwrap()) + (pass * PASS / 1_000_000_000) as i32;
            data[4..8].copy_from_slice(&sec.to_le_bytes());
            writer.write_to_known_channel(&header, &data).unwrap();
            if message.log_time % 3 == 0 {
                let header = MessageHeader { channel_id: json, ..header };
                let text = br#"{"stamp":{"sec":1,"nsec":2},"list":[1,2,[3]],"x":{"y":-1e5}}"#;
                writer.write_to_known_channel(&header, text).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A table of one group of rows a list of columns, by the columns' writers.
struct Rows<'a, W: Write + Send>(parquet::file::writer::SerializedRowGroupWriter<'a, W>);

impl<W: Write + Send> Rows<'_, W> {
    fn doubles(&mut self, values: &[f64], defined: Option<&[i16]>, repeated: Option<&[i16]>) {
        let mut column = self.0.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(values, defined, repeated).unwrap();
        column.close().unwrap();
    }

    fn singles(&mut self, values: &[f32], defined: Option<&[i16]>, repeated: Option<&[i16]>) {
        let mut column = self.0.next_column().unwrap().unwrap();
        column.typed::<FloatType>().write_batch(values, defined, repeated).unwrap();
        column.close().unwrap();
    }

    fn integers(&mut self, values: &[i64]) {
        let mut column = self.0.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(values, None, None).unwrap();
        column.close().unwrap();
    }
}

type Table<'a> = SerializedFileWriter<&'a mut Vec<u8>>;

fn table(schema: &str, packing: Compression, write: impl FnOnce(&mut Table<'_>)) -> Vec<u8> {
    let schema = Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let settings = Arc::new(WriterProperties::builder().set_compression(packing).build());
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, settings).unwrap();
    write(&mut file);
    file.close().unwrap();
    bytes
}

/// Two groups of 300 rows: a number, one that may be missing, a run, a list of two.
fn parquet(packing: Compression, times: usize) -> Vec<u8> {
    let schema = "message schema { REQUIRED DOUBLE t; OPTIONAL DOUBLE x; REQUIRED INT64 trial; \
                  OPTIONAL group q (LIST) { REPEATED group list { OPTIONAL DOUBLE element; } } }";
    let half = 150 * times;
    table(schema, packing, |file| {
        for group in 0..2 {
            let mut rows = Rows(file.next_row_group().unwrap());
            let values: Vec<f64> = (0..2 * half).map(|i| (i % half) as f64 * 0.01).collect();
            let noise: Vec<f64> = (0..2 * half).map(|i| (i as f64 * 1e4).sin()).collect();
            let defined: Vec<i16> = (0..2 * half).map(|i| i16::from(i % 7 != 0)).collect();
            let there: Vec<f64> = noise.iter().zip(&defined).filter(|(_, d)| **d == 1).map(|(v, _)| *v).collect();
            let trials: Vec<i64> = (0..2 * half).map(|i| 2 * group + i64::from(i >= half)).collect();
            let repeated: Vec<i16> = (0..4 * half).map(|i| i16::from(i % 2 == 1)).collect();
            rows.doubles(&values, None, None);
            rows.doubles(&there, Some(&defined), None);
            rows.integers(&trials);
            rows.doubles(&[noise.clone(), noise].concat(), Some(&vec![3; 4 * half]), Some(&repeated));
            rows.0.close().unwrap();
        }
    })
}

/// Two episodes of 100 frames with two joints each, and what the data set says of them.
fn lerobot(version: u8, times: usize) -> Whole {
    let frames = 100 * times;
    let list = |name| format!("OPTIONAL group {name} (LIST) {{ REPEATED group list {{ OPTIONAL FLOAT element; }} }}");
    let schema = format!(
        "message schema {{ {} {} REQUIRED FLOAT timestamp; REQUIRED INT64 frame_index; REQUIRED INT64 episode_index; }}",
        list("observation.state"),
        list("action")
    );
    let data = |episodes: std::ops::Range<i64>| {
        table(&schema, Compression::SNAPPY, |file| {
            for episode in episodes {
                let mut rows = Rows(file.next_row_group().unwrap());
                let repeated: Vec<i16> = (0..2 * frames).map(|i| i16::from(i % 2 == 1)).collect();
                let values: Vec<f32> = (0..2 * frames).map(|i| (i as f32 * 0.01).sin()).collect();
                rows.singles(&values, Some(&vec![3; 2 * frames]), Some(&repeated));
                rows.singles(&values, Some(&vec![3; 2 * frames]), Some(&repeated));
                rows.singles(&(0..frames).map(|i| i as f32 / 30.0).collect::<Vec<_>>(), None, None);
                rows.integers(&(0..frames as i64).collect::<Vec<_>>());
                rows.integers(&vec![episode; frames]);
                rows.0.close().unwrap();
            }
        })
    };
    let vector = r#"{"dtype": "float32", "shape": [2], "names": {"motors": ["shoulder.pos", "elbow.pos"]}}"#;
    let info = format!(
        r#"{{"codebase_version": "v{version}.0", "fps": 30, "features": {{"observation.state": {vector}, "action": {vector}}}}}"#
    );
    let mut files = vec![("meta/info.json", info.into_bytes())];
    if version == 2 {
        let line = |episode| format!("{{\"episode_index\": {episode}, \"length\": {frames}, \"tasks\": []}}\n");
        files.push(("meta/episodes.jsonl", (0..2).map(line).collect::<String>().into_bytes()));
        files.push(("data/chunk-000/episode_000000.parquet", data(0..1)));
        files.push(("data/chunk-000/episode_000001.parquet", data(1..2)));
        return files;
    }
    let schema = "message schema { REQUIRED INT64 episode_index; REQUIRED INT64 length; \
                  REQUIRED INT64 data/chunk_index; REQUIRED INT64 data/file_index; }";
    let episodes = table(schema, Compression::SNAPPY, |file| {
        let mut rows = Rows(file.next_row_group().unwrap());
        rows.integers(&[0, 1]);
        rows.integers(&[frames as i64; 2]);
        rows.integers(&[0, 0]);
        rows.integers(&[0, 0]);
        rows.0.close().unwrap();
    });
    files.push(("meta/episodes/chunk-000/file-000.parquet", episodes));
    files.push(("data/chunk-000/file-000.parquet", data(0..2)));
    files
}

fn ulog(times: usize) -> Vec<u8> {
    let record = |kind: u8, body: &[u8]| [&(body.len() as u16).to_le_bytes()[..], &[kind], body].concat();
    let mut bytes = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    bytes.extend(record(b'B', &[0; 40]));
    bytes.extend(record(b'F', b"inner:float a;int16_t[2] b;"));
    bytes.extend(record(b'F', b"rate:uint64_t timestamp;float[3] xyz;inner[2] deep;bool ok;uint8_t[3] _padding0;"));
    bytes.extend(record(b'I', b"\x07char[3] sysabc"));
    bytes.extend(record(b'A', b"\0\x03\0rate"));
    bytes.extend(record(b'A', b"\x01\x04\0rate"));
    for i in 0..150 * times as u64 {
        let mut body = (3 + (i % 2) as u16).to_le_bytes().to_vec();
        body.extend((1_000_000 + 5_000 * i).to_le_bytes());
        body.extend((0..32).map(|k| (i as u8).wrapping_mul(37).wrapping_add(k)));
        bytes.extend(record(b'D', &body));
    }
    bytes
}

/// The first rows of the log in `data/`; again and again as other runs.
fn csv(times: usize) -> Vec<u8> {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/pendulum.csv")).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let mut long = format!("{}\n", lines.next().unwrap());
    let rows: Vec<&str> = lines.take(250).collect();
    for pass in 0..times {
        for row in &rows {
            let (run, rest) = row.split_once(',').unwrap();
            long += &format!("{run}_{pass},{rest}\n");
        }
    }
    long.into_bytes()
}

/// Quotes, semicolons, dates, comments, Windows line ends, empty cells, text.
fn dated(times: usize) -> Vec<u8> {
    let mut text = "\u{feff}# a remark\r\ntime;\"phi [rad]\";u;run;\"note; with a \"\"mark\"\"\"\r\n".to_string();
    for i in 0..250 * times {
        let (minute, second, part) = (i / 6000 % 60, i / 100 % 60, i % 100);
        let (day, hour) = (1 + i / 8_640_000, i / 360_000 % 24);
        let phi = if i % 5 == 0 { String::new() } else { format!("{}", (i as f64 * 0.01).sin()) };
        text += &format!(
            "2024-05-{day:02}T{hour:02}:{minute:02}:{second:02}.{part:02}Z;{phi};{};a;\"it said \"\"no;\"\"\"\r\n",
            i % 7
        );
    }
    text.into_bytes()
}
