//! Tests of the Parquet reader with files that the `parquet` crate writes.

use super::*;
use crate::logs::{Logs, Task};
use gpsindy_core::Silent;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, FixedLenByteArray, FixedLenByteArrayType, FloatType};
use parquet::data_type::{Int32Type, Int64Type, Int96, Int96Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::path::PathBuf;
use std::sync::Arc;

/// A column to write: values, and for optional and listed ones their levels.
pub(crate) enum Cells {
    Double(Vec<f64>),
    Optional(Vec<Option<f64>>),
    /// Lists of so many elements each.
    Singles(Vec<f32>, usize),
    Single(Vec<f32>),
    Integer(Vec<i64>),
    Short(Vec<i32>),
    Half(Vec<f32>),
    Wide(Vec<Int96>),
    Text(Vec<&'static str>),
}

pub(crate) fn written(schema: &str, columns: &[Cells], groups: usize) -> Vec<u8> {
    written_beside(schema, columns, groups, None)
}

/// A table with a note among the metadata of its file.
fn written_beside(schema: &str, columns: &[Cells], groups: usize, note: Option<KeyValue>) -> Vec<u8> {
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let settings = WriterProperties::builder().set_compression(Compression::SNAPPY);
    let settings = Arc::new(settings.set_key_value_metadata(note.map(|note| vec![note])).build());
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, settings).unwrap();
    for group in 0..groups {
        fn part<T>(values: &[T], group: usize, groups: usize) -> &[T] {
            let size = values.len() / groups;
            &values[group * size..(group + 1) * size]
        }
        let mut rows = file.next_row_group().unwrap();
        for cells in columns {
            let mut column = rows.next_column().unwrap().unwrap();
            match cells {
                Cells::Double(v) => {
                    column.typed::<DoubleType>().write_batch(part(v, group, groups), None, None).unwrap();
                }
                Cells::Single(v) => {
                    column.typed::<FloatType>().write_batch(part(v, group, groups), None, None).unwrap();
                }
                Cells::Integer(v) => {
                    column.typed::<Int64Type>().write_batch(part(v, group, groups), None, None).unwrap();
                }
                Cells::Short(v) => {
                    column.typed::<Int32Type>().write_batch(part(v, group, groups), None, None).unwrap();
                }
                Cells::Half(v) => {
                    let half = |v: &f32| ByteArray::from(half::f16::from_f32(*v).to_le_bytes().to_vec()).into();
                    let halves: Vec<FixedLenByteArray> = part(v, group, groups).iter().map(half).collect();
                    column.typed::<FixedLenByteArrayType>().write_batch(&halves, None, None).unwrap();
                }
                Cells::Wide(v) => {
                    column.typed::<Int96Type>().write_batch(part(v, group, groups), None, None).unwrap();
                }
                Cells::Text(v) => {
                    let texts: Vec<ByteArray> = part(v, group, groups).iter().map(|t| ByteArray::from(*t)).collect();
                    column.typed::<ByteArrayType>().write_batch(&texts, None, None).unwrap();
                }
                Cells::Optional(v) => {
                    let v = part(v, group, groups);
                    let defined: Vec<i16> = v.iter().map(|v| i16::from(v.is_some())).collect();
                    let values: Vec<f64> = v.iter().flatten().copied().collect();
                    column.typed::<DoubleType>().write_batch(&values, Some(&defined), None).unwrap();
                }
                Cells::Singles(v, width) => {
                    let v = part(v, group, groups);
                    let repeated: Vec<i16> = (0..v.len()).map(|i| i16::from(i % width != 0)).collect();
                    column.typed::<FloatType>().write_batch(v, Some(&vec![3; v.len()]), Some(&repeated)).unwrap();
                }
            }
            column.close().unwrap();
        }
        rows.close().unwrap();
    }
    file.close().unwrap();
    bytes
}

fn table(groups: usize) -> Vec<u8> {
    let schema = "message schema { REQUIRED DOUBLE t; OPTIONAL DOUBLE x; REQUIRED INT64 n; REQUIRED BYTE_ARRAY remark (UTF8); REQUIRED INT64 trial; }";
    let columns = [
        Cells::Double(vec![0.0, 0.1, 0.2, 0.0, 0.1, 0.2]),
        Cells::Optional(vec![Some(1.0), None, Some(3.0), Some(4.0), Some(f64::NAN), Some(6.0)]),
        Cells::Integer(vec![1, 2, 3, 4, 5, i64::MAX]),
        Cells::Text(vec!["a", "b", "c", "d", "e", "f"]),
        Cells::Integer(vec![7, 7, 7, 8, 8, 8]),
    ];
    written(schema, &columns, groups)
}

fn options(run: Option<&str>) -> LogOptions {
    LogOptions { run: run.map(Into::into), ..LogOptions::default() }
}

#[test]
fn a_table_reads_as_the_same_table_in_csv_does() {
    let csv = b"t,x,n,remark,trial\n0,1,1,a,7\n0.1,,2,b,7\n0.2,3,3,c,7\n0,4,4,d,8\n0.1,,5,e,8\n0.2,6,9223372036854775807,f,8\n";
    let csv = Logs::parse("a.parquet", csv, &options(Some("trial"))).unwrap();
    for groups in [1, 2, 3] {
        let found = Logs::parse("a.parquet", &table(groups), &options(Some("trial"))).unwrap();
        assert_eq!(found.columns(), csv.columns());
        assert_eq!(found.numeric_columns(), csv.numeric_columns());
        let (a, b) = (found.dataset(&["x", "n"], &[]).unwrap(), csv.dataset(&["x", "n"], &[]).unwrap());
        for (a, b) in a.runs().iter().zip(b.runs()) {
            assert_eq!((&a.name, &a.time), (&b.name, &b.time));
            for j in 0..2 {
                let bits =
                    |run: &gpsindy_core::Run| run.column(j).iter().map(|v| v.is_nan() || *v == 0.0).collect::<Vec<_>>();
                assert_eq!(bits(a), bits(b));
                assert!(a.column(j).iter().zip(b.column(j)).all(|(a, b)| a == b || a.is_nan()));
            }
        }
    }
}

#[test]
fn errors_name_the_row_and_the_column() {
    let message = |options: &LogOptions, column: &str| {
        let read = Logs::parse("a.parquet", &table(1), options).and_then(|logs| logs.dataset(&[column], &[]));
        read.unwrap_err().to_string()
    };
    let found = message(&options(None), "x");
    assert_eq!(
        found,
        "a.parquet: row 4, column `t`: time goes back, from 0.2 to 0; sort the rows, or name the column of the runs with --run"
    );
    assert!(message(&options(Some("trail")), "x").contains("did you mean `trial`?"));
    assert_eq!(message(&options(Some("trial")), "remark"), "a.parquet: column `remark` holds text, not numbers");
    assert!(message(&options(Some("trial")), "y").starts_with("a.parquet: column `y` is not in the table"));
    let time = LogOptions { time: Some("clock".into()), ..LogOptions::default() };
    assert!(message(&time, "x").starts_with("a.parquet: time column `clock` is not in the table"));
}

#[test]
fn stamps_of_a_calendar_keep_their_nanoseconds() {
    let schema = "message schema { REQUIRED INT64 time (TIMESTAMP(NANOS,true)); REQUIRED DOUBLE x; }";
    let begin = 1_763_000_000_123_456_789;
    let columns = [Cells::Integer(vec![begin, begin + 1, begin + 10_000_000]), Cells::Double(vec![1.0, 2.0, 3.0])];
    let logs = Logs::parse("a.parquet", &written(schema, &columns, 1), &LogOptions::default()).unwrap();
    assert_eq!(logs.dataset(&["x"], &[]).unwrap().runs()[0].time, [0.0, 1e-9, 0.01]);
}

/// Writes a data set of two episodes in two files into a folder of its own.
pub(crate) fn lerobot(stamp: impl Fn(usize) -> f32) -> PathBuf {
    use std::sync::atomic::{AtomicUsize, Ordering};
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let folder = std::env::temp_dir().join(format!(
        "gpsindy-lerobot-{}-{}",
        std::process::id(),
        COUNT.fetch_add(1, Ordering::Relaxed)
    ));
    std::fs::create_dir_all(folder.join("meta")).unwrap();
    std::fs::create_dir_all(folder.join("data/chunk-000")).unwrap();
    let info = r#"{"codebase_version":"v3.0","fps":30,"features":{
        "observation.state":{"dtype":"float32","shape":[2],"names":["shoulder_pan.pos","elbow.pos"]},
        "action":{"dtype":"float32","shape":[2],"names":{"motors":["shoulder_pan.pos","elbow.pos"]}}}}"#;
    std::fs::write(folder.join("meta/info.json"), info).unwrap();
    let list =
        |name: &str| format!("OPTIONAL group {name} (LIST) {{ REPEATED group list {{ OPTIONAL FLOAT element; }} }}");
    let schema = format!(
        "message schema {{ {} {} REQUIRED FLOAT timestamp; REQUIRED INT64 frame_index; REQUIRED INT64 episode_index; }}",
        list("observation.state"),
        list("action")
    );
    for episode in 0..2_i64 {
        let frames = 40_usize;
        let columns = [
            Cells::Singles((0..2 * frames).map(|i| i as f32 + 100.0 * episode as f32).collect(), 2),
            Cells::Singles((0..2 * frames).map(|i| -(i as f32)).collect(), 2),
            Cells::Single((0..frames).map(&stamp).collect()),
            Cells::Integer((0..frames as i64).collect()),
            Cells::Integer(vec![episode; frames]),
        ];
        let path = folder.join(format!("data/chunk-000/file-00{episode}.parquet"));
        std::fs::write(path, written(&schema, &columns, 2)).unwrap();
    }
    folder
}

#[test]
fn a_data_set_of_episodes_is_runs_with_named_elements() {
    let folder = lerobot(|frame| frame as f32 / 30.0);
    let map = vec![
        ("q".to_string(), "observation.state[elbow.pos]".to_string()),
        ("u".into(), "action[shoulder_pan.pos]".into()),
    ];
    let logs = Logs::read(&[&folder], &LogOptions { map, ..LogOptions::default() }).unwrap();
    let task = Task { needed: vec!["q".into(), "u".into()], controls: vec!["u".into()], ..Task::default() };
    let found = logs.assemble(&task, &Silent).unwrap();
    assert_eq!(found.data.runs().len(), 2);
    let run = &found.data.runs()[1];
    assert!(run.name.ends_with(":1"), "{}", run.name);
    assert_eq!(run.column(0)[..3], [101.0, 103.0, 105.0]);
    assert_eq!(run.column(1)[..3], [0.0, -2.0, -4.0]);
    // By their numbers.
    let map = vec![("q".to_string(), "observation.state[1]".to_string()), ("u".into(), "action[0]".into())];
    let numbered = Logs::read(&[&folder], &LogOptions { map, ..LogOptions::default() }).unwrap();
    let numbered = numbered.dataset(&["q", "u"], &[]).unwrap();
    assert!((0..2).all(|j| numbered.runs()[1].column(j) == run.column(j)));
    // Not the float32 0.033333335.
    assert_eq!(run.time[..3], [0.0, 1.0 / 30.0, 2.0 / 30.0]);
    assert!(found.notes[0].contains("made again as frame_index / 30 Hz"), "{:?}", found.notes);
    std::fs::remove_dir_all(folder).unwrap();
}

/// Writes what a data set of version 3 says of its episodes: number, frames, chunk and file.
fn tell_episodes(folder: &std::path::Path, episodes: &[[i64; 4]]) {
    let schema = "message schema { REQUIRED INT64 episode_index; REQUIRED INT64 length; REQUIRED INT64 data/chunk_index; REQUIRED INT64 data/file_index; }";
    let columns: Vec<Cells> = (0..4).map(|c| Cells::Integer(episodes.iter().map(|e| e[c]).collect())).collect();
    let place = folder.join("meta/episodes/chunk-000");
    std::fs::create_dir_all(&place).unwrap();
    std::fs::write(place.join("file-000.parquet"), written(schema, &columns, 1)).unwrap();
}

#[test]
fn episodes_that_are_not_as_the_data_set_tells_them_are_stated() {
    let folder = lerobot(|frame| frame as f32 / 30.0);
    let notes = || {
        let logs = Logs::read(&[&folder], &LogOptions::default()).unwrap();
        let task = Task { needed: vec!["action_elbow_pos".into()], ..Task::default() };
        let found = logs.assemble(&task, &Silent).unwrap();
        assert_eq!(found.data.runs().len(), 2);
        found.notes[1..].to_vec()
    };
    tell_episodes(&folder, &[[0, 40, 0, 0], [1, 40, 0, 1]]);
    assert_eq!(notes(), [""; 0]);
    tell_episodes(&folder, &[[0, 40, 0, 0], [1, 50, 0, 1], [2, 40, 0, 7], [3, 40, 0, 7]]);
    let found = notes();
    assert!(
        found[0].ends_with("episode 1 has 40 frames, where meta/episodes says 50; what is there was read"),
        "{found:?}"
    );
    let lost =
        "episodes that meta/episodes names and no file holds: 2, 3; data/chunk-000/file-007.parquet is not there";
    assert!(found[1].ends_with(lost), "{found:?}");
    std::fs::remove_dir_all(folder.join("meta/episodes")).unwrap();
    // Version 2.
    std::fs::write(folder.join("meta/episodes.jsonl"), "{\"episode_index\": 0, \"length\": 40}\n\n").unwrap();
    assert!(notes()[0].ends_with("meta/episodes does not name 1 of the episodes that were read"));
    std::fs::write(folder.join("meta/episodes.jsonl"), "{\"episode_index\": 0}\n").unwrap();
    let error = Logs::read(&[&folder], &LogOptions::default()).unwrap_err().to_string();
    assert!(error.ends_with("episodes.jsonl:1: an episode without `episode_index` and `length`"), "{error}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn stamps_that_disagree_with_the_frames_are_left_and_stated() {
    let folder = lerobot(|frame| frame as f32 / 29.0);
    let logs = Logs::read(&[&folder], &LogOptions::default()).unwrap();
    let task = Task { needed: vec!["action_elbow_pos".into()], ..Task::default() };
    let found = logs.assemble(&task, &Silent).unwrap();
    assert_eq!(found.data.runs()[0].time[1], f64::from(1.0_f32 / 29.0));
    assert!(found.notes[0].contains("do not agree"), "{:?}", found.notes);
    std::fs::remove_dir_all(folder).unwrap();
}

/// Times and notes of a table with a time column of this kind.
fn timed(time: &str, stamps: Cells, name: &str) -> crate::Result<(Vec<f64>, Vec<String>)> {
    let schema = format!("message schema {{ REQUIRED {time}; REQUIRED DOUBLE x; }}");
    let bytes = written(&schema, &[stamps, Cells::Double(vec![1.0, 2.0, 3.0])], 1);
    let options = LogOptions { time: Some(name.into()), ..LogOptions::default() };
    let logs = Logs::parse("a.parquet", &bytes, &options)?;
    let task = Task { needed: vec!["x".into()], ..Task::default() };
    let read = logs.assemble(&task, &Silent)?;
    Ok((read.data.runs()[0].time.clone(), read.notes))
}

#[test]
fn times_of_the_day_and_dates_are_seconds() {
    for (time, stamps, seconds) in [
        (
            "INT32 t (TIME(MILLIS,false))",
            Cells::Short(vec![43_200_000, 43_200_010, 43_200_020]),
            [43_200.0, 43_200.01, 43_200.02],
        ),
        ("INT64 t (TIME(MICROS,false))", Cells::Integer(vec![0, 10_000, 20_000]), [0.0, 0.01, 0.02]),
        ("INT64 t (TIME(NANOS,false))", Cells::Integer(vec![0, 10_000_000, 20_000_000]), [0.0, 0.01, 0.02]),
        ("INT32 t (TIME_MILLIS)", Cells::Short(vec![0, 10, 20]), [0.0, 0.01, 0.02]),
        ("INT32 t (DATE)", Cells::Short(vec![20_000, 20_001, 20_003]), [0.0, 86_400.0, 259_200.0]),
    ] {
        assert_eq!(timed(time, stamps, "t").unwrap(), (seconds.to_vec(), vec![]), "{time}");
    }
}

#[test]
fn durations_of_arrow_are_times() {
    let columns = [Cells::Integer(vec![0, 10, 20]), Cells::Double(vec![1.0, 2.0, 3.0])];
    let note = KeyValue::new(arrow::KEY.into(), arrow::tests::MILLISECONDS.to_string());
    let bytes = written_beside("message schema { REQUIRED INT64 t; REQUIRED DOUBLE x; }", &columns, 1, Some(note));
    let logs = Logs::parse("a.parquet", &bytes, &LogOptions::default()).unwrap();
    let read = logs.assemble(&Task { needed: vec!["x".into()], ..Task::default() }, &Silent).unwrap();
    assert_eq!((read.data.runs()[0].time.as_slice(), read.notes), (&[0.0, 0.01, 0.02][..], vec![]));
}

#[test]
fn stamps_of_96_bits_are_times() {
    // Nanoseconds of the day and its Julian number, here that of the first of 1970.
    let day = |ns: u32| Int96::from(vec![ns, 0, 2_440_588]);
    let stamps = Cells::Wide(vec![day(0), day(10_000_000), day(20_000_000)]);
    assert_eq!(timed("INT96 t", stamps, "t").unwrap(), (vec![0.0, 0.01, 0.02], vec![]));
}

#[test]
fn dates_in_words_are_times() {
    let dates = Cells::Text(vec!["2024-02-28T23:59:59.5", "2024-02-29T00:00:00", "2024-02-29T00:00:00.25"]);
    let (times, notes) = timed("BYTE_ARRAY t (UTF8)", dates, "t").unwrap();
    assert_eq!(times, [0.0, 0.5, 0.75]);
    assert_eq!(notes, ["a.parquet: times are counted from the first stamp, 2024-02-28T23:59:59.5"]);
    for (texts, stated) in [
        (
            vec!["soon", "now", "later"],
            "row 1, column `t`: not a time: \"soon\"; write it as 2024-05-01T12:00:00 or as a number of seconds",
        ),
        (
            vec!["2024-02-28T23:59:59", "later", ""],
            "row 2, column `t`: not a time: \"later\"; write it as in the first row",
        ),
    ] {
        let error = timed("BYTE_ARRAY t (UTF8)", Cells::Text(texts), "t").unwrap_err();
        assert_eq!(error.to_string(), format!("a.parquet: {stated}"));
    }
}

#[test]
fn whole_numbers_since_1970_are_told_by_their_size() {
    let begin = 1_763_000_000_123_456_789;
    for (stamps, word) in [
        (Cells::Integer(vec![begin, begin + 10_000_000, begin + 20_000_000]), "nanoseconds"),
        (Cells::Integer(vec![begin / 1000, begin / 1000 + 10_000, begin / 1000 + 20_000]), "microseconds"),
    ] {
        let (times, notes) = timed("INT64 t", stamps, "t").unwrap();
        assert_eq!(times, [0.0, 0.01, 0.02]);
        assert!(notes[0].contains(&format!("the stamps of `t` are taken for {word} since 1970")), "{notes:?}");
    }
    let (times, notes) = timed("INT64 t", Cells::Integer(vec![0, 10_000_000, 20_000_000]), "t").unwrap();
    assert_eq!(times, [0.0, 1e7, 2e7]);
    assert!(notes[0].contains("were taken for seconds; if they count milli-, micro- or nanoseconds"), "{notes:?}");
}

#[test]
fn numbers_of_half_precision_are_numbers() {
    let schema = "message schema { REQUIRED DOUBLE t; REQUIRED FIXED_LEN_BYTE_ARRAY(2) x (FLOAT16); }";
    let columns = [Cells::Double(vec![0.0, 0.1, 0.2]), Cells::Half(vec![1.5, -0.25, 65_504.0])];
    let logs = Logs::parse("a.parquet", &written(schema, &columns, 1), &LogOptions::default()).unwrap();
    assert_eq!(logs.numeric_columns(), ["x"]);
    assert_eq!(logs.dataset(&["x"], &[]).unwrap().runs()[0].column(0), [1.5, -0.25, 65_504.0]);
}

#[test]
fn a_data_set_without_a_rate_says_that_its_stamps_stay_single() {
    let folder = lerobot(|frame| frame as f32 / 30.0);
    let info = std::fs::read_to_string(folder.join("meta/info.json")).unwrap();
    std::fs::write(folder.join("meta/info.json"), info.replace("\"fps\":30", "\"fps\":0")).unwrap();
    let logs = Logs::read(&[&folder], &LogOptions::default()).unwrap();
    let found = logs.assemble(&Task { needed: vec!["action_elbow_pos".into()], ..Task::default() }, &Silent).unwrap();
    assert_eq!(found.data.runs()[0].time[1], f64::from(1.0_f32 / 30.0));
    assert!(
        found.notes[0].contains("meta/info.json has no `fps` above 0; the stamps were used unchanged, as float32"),
        "{:?}",
        found.notes
    );
    std::fs::remove_dir_all(folder).unwrap();
}
