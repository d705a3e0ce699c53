//! Tests of the MCAP reader with files that the `mcap` crate writes and messages that a writer of the test's own encodes.

use super::*;
use crate::logs::{Logs, Task};
use gpsindy_core::{Hold, Silent};
use mcap::Compression;

mod bag;
mod chunks;

use bag::robot_after;
pub(crate) use bag::{Bag, Cdr, JOINT_STATE, joint_state, robot};

fn options(map: &[(&str, &str)]) -> LogOptions {
    let map = map.iter().map(|(a, b)| ((*a).to_string(), (*b).to_string())).collect();
    LogOptions { map, ..LogOptions::default() }
}

fn assembled(bytes: &[u8], map: &[(&str, &str)], controls: &[&str]) -> crate::Assembled {
    let logs = Logs::parse("robot.mcap", bytes, &options(map)).unwrap();
    let own = |list: &[&str]| list.iter().map(|s| (*s).to_string()).collect::<Vec<_>>();
    let needed = map.iter().map(|(name, _)| (*name).to_string()).collect();
    let task = Task { needed, controls: own(controls), hold: Hold::Zero, ..Task::default() };
    logs.assemble(&task, &Silent).unwrap()
}

const MAP: &[(&str, &str)] = &[("q", "/joint_states.position[pan]"), ("u", "/command.data[1]")];

#[test]
fn topics_keep_their_clocks_and_joints_are_found_by_name() {
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let found = assembled(&robot(compression), MAP, &["u"]);
        assert_eq!(found.notes, [""; 0]);
        let run = &found.data.runs()[0];
        // Joints by their header's stamp; the command has no header, so by the time of recording, 1 ms later.
        assert_eq!(run.time[..4], [0.0, 0.001, 0.01, 0.02]);
        assert!(run.column(0)[1].is_nan());
        assert_eq!((run.column(0)[2], run.column(0)[3]), (0.1, 0.2));
        assert_eq!(run.column(1)[1..5], [0.0, 0.0, 0.0, 2.0]);
        assert_eq!(run.n_samples(), 300);
    }
}

#[test]
fn a_log_in_two_topics_gives_what_the_same_log_in_one_table_gives() {
    for early in [0, 7] {
        let found = assembled(&robot_after(early, None), MAP, &["u"]);
        // Times count from the first stamp, which is a command's where one comes before the joints.
        let first = if early == 0 { 0 } else { 1_000_000 - early * 10_000_000 };
        let at = |ns: i64| (ns - first) as f64 / 1e9;
        let mut csv = String::from("t,q,u\n");
        for k in 0..early {
            csv += &format!("{:?},,{:?}\n", at((k - early) * 10_000_000 + 1_000_000), -1.0 - k as f64);
        }
        for i in 0..200_i64 {
            csv += &format!("{:?},{:?},\n", at(i * 10_000_000), i as f64 * 0.1);
            if i % 2 == 0 {
                csv += &format!("{:?},,{i}\n", at(i * 10_000_000 + 1_000_000));
            }
        }
        let logs = Logs::parse("robot.csv", csv.as_bytes(), &LogOptions::default()).unwrap();
        let task = Task { needed: vec!["q".into(), "u".into()], controls: vec!["u".into()], ..Task::default() };
        let table = logs.assemble(&task, &Silent).unwrap();
        let bits = |data: &gpsindy_core::Dataset| {
            let run = &data.runs()[0];
            let columns = [run.time.as_slice(), run.column(0), run.column(1)];
            columns.map(|values| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
        };
        assert_eq!(bits(&found.data), bits(&table.data), "{early} commands before the first joint");
    }
}

#[test]
fn the_time_of_recording_is_taken_where_asked() {
    let logs = LogOptions { stamp: Stamp::Log, ..options(&MAP[..1]) };
    let logs = Logs::parse("robot.mcap", &robot(None), &logs).unwrap();
    let data = logs.dataset(&["q"], &[]).unwrap();
    assert_eq!(data.runs()[0].time[..2], [0.0, 0.01]);
    let logs = LogOptions { stamp: Stamp::Header, ..options(&MAP[1..]) };
    let logs = Logs::parse("robot.mcap", &robot(None), &logs).unwrap();
    let error = logs.dataset(&["u"], &[]).unwrap_err().to_string();
    assert_eq!(error, "robot.mcap: topic `/command` has messages without a stamp in a header; choose --stamp log");
}

#[test]
fn wrong_names_suggest_the_right_ones() {
    let bytes = robot(None);
    let message = |map: &[(&str, &str)]| match Logs::parse("robot.mcap", &bytes, &options(map)) {
        Err(error) => error.to_string(),
        Ok(logs) => logs.dataset(&["q"], &[]).unwrap_err().to_string(),
    };
    for (path, expected) in [
        (
            "/joint_state.position[pan]",
            "there is no topic `/joint_state`; did you mean `/joint_states`?; found: /command, /joint_states",
        ),
        (
            "/joint_states.positon[pan]",
            "there is no field `positon` in sensor_msgs/JointState; did you mean `position`?; found: header, name, position, velocity, effort",
        ),
        (
            "/joint_states.position",
            "`position` is float64[]; name an element, `position[0]`, or `position[NAME]` by its list of names",
        ),
        ("/joint_states.header", "`header` is a message, std_msgs/Header; name a field of it: stamp, frame_id"),
        ("/joint_states.name[0]", "`name` is text, not a number"),
        ("/joint_states.header.stamp.sec.x", "`header.stamp.sec` is int32; it has no fields"),
        ("/joint_states.header.stamp.sec[0]", "`header.stamp.sec` is one int32, not an array; remove the brackets"),
        ("/command.data[pan]", "no list of names goes with `data`; name the element by its index, `data[0]`"),
    ] {
        let found = message(&[("q", path)]);
        assert!(found.ends_with(expected), "{path}\n   found: {found}\nexpected: {expected}");
        assert!(found.starts_with(&format!("robot.mcap: --map q={path}: ")), "{found}");
    }
    let found = message(&[("q", "/joint_states.position[pen]")]);
    assert!(found.contains("has no number at `position[pen]` in any message; did you mean `position[pan]`"), "{found}");
    assert!(message(&[]).contains("--map NAME=TOPIC.FIELD"), "{}", message(&[]));
}

#[test]
fn a_truncated_log_gives_what_comes_before_the_break() {
    let whole = robot(Some(Compression::Lz4));
    let (mut noted, mut most) = (0, 0);
    for length in (0..whole.len()).step_by(7) {
        let Ok(logs) = Logs::parse("cut.mcap", &whole[..length], &options(&MAP[..1])) else { continue };
        let task = Task { needed: vec!["q".into()], ..Task::default() };
        let Ok(found) = logs.assemble(&task, &Silent) else { continue };
        let run = &found.data.runs()[0];
        assert!((0..run.n_samples()).all(|i| run.column(0)[i] == i as f64 * 0.1), "{length}");
        assert!(run.n_samples() == 200 || !found.notes.is_empty(), "{length}: a loss without a note");
        noted += usize::from(found.notes.iter().any(|n| n.contains("breaks off behind")));
        most = most.max(run.n_samples());
    }
    assert!(noted > 20 && most == 200, "{noted} {most}");
}

#[test]
fn every_kind_of_number_is_read_in_both_byte_orders() {
    let text = "bool a\nint8 b\nuint8 c\nint16 d\nuint16 e\nint32 f\nuint32 g\nint64 h\nuint64 i\nfloat32 j\nfloat64 k\nbyte l\nchar m
string s\nint16[3] n\nPoint[] p\nEmpty o\nfloat64 z
===\nMSG: my/Point\nfloat32 x\nfloat64[2] y\n===\nMSG: my/Empty\n";
    let schema = Schema::parse("my/Everything", text).unwrap();
    for big in [false, true] {
        let mut cdr = Cdr::new(big).u8(1).u8(0xfe).u8(200).u16(0x8001).u16(40_000).u32(0xffff_fff6).u32(4_000_000_000);
        cdr = cdr.i64(-5_000_000_000).i64(-1).f32(0.1).f64(0.1).u8(255).u8(7).text("word").u16(1).u16(2).u16(0xfffd);
        cdr = cdr.u32(2).f32(1.5).f64(2.5).f64(3.5).f32(-1.5).f64(-2.5).f64(-3.5).u8(0).f64(42.0);
        let bytes = cdr.done();
        let paths: Vec<Vec<Step>> = [
            "a",
            "b",
            "c",
            "d",
            "e",
            "f",
            "g",
            "h",
            "i",
            "j",
            "k",
            "l",
            "m",
            "n[2]",
            "p[1].x",
            "p[0].y[1]",
            "p[1].y[0]",
            "z",
            "p[2].x",
        ]
        .iter()
        .map(|p| path::steps(p).unwrap())
        .collect();
        let mut wants = Wants::of(&schema, &paths).unwrap();
        let mut found = vec![0.0; paths.len()];
        cdr::take(&schema, &mut wants, &bytes, &mut found).unwrap();
        let expected = [
            1.0,
            -2.0,
            200.0,
            -32_767.0,
            40_000.0,
            -10.0,
            4e9,
            -5e9,
            18_446_744_073_709_551_615.0,
            f64::from(0.1_f32),
            0.1,
            255.0,
            7.0,
            -3.0,
            -1.5,
            3.5,
            -2.5,
            42.0,
        ];
        assert_eq!(found[..18], expected);
        assert!(found[18].is_nan());
        for length in 0..bytes.len() {
            assert!(cdr::take(&schema, &mut wants, &bytes[..length], &mut found).is_err(), "{length}");
        }
        let leaves = cdr::leaves(&schema, &bytes).unwrap();
        assert_eq!(leaves.iter().filter(|l| l.number).count(), 13 + 3 + 6 + 1);
    }
}

#[test]
fn json_messages_have_the_same_paths() {
    let mut bag = Bag::new(None);
    let joints = bag.json("/joints");
    for i in 0..3_i64 {
        let text = format!(
            r#"{{"header":{{"stamp":{{"sec":{i},"nanosec":5}}}},"name":["a","b"],"position":[{i}.5,-{i}],"on":true,"w":"NaN"}}"#
        );
        bag.write(joints, 100 + i, text.as_bytes());
    }
    let bytes = bag.done();
    let map = [("q", "/joints.position[b]"), ("p", "/joints.position[0]"), ("on", "/joints.on")];
    let found = assembled(&bytes, &map, &[]);
    let run = &found.data.runs()[0];
    assert_eq!(run.time, [5e-9, 1.000_000_005, 2.000_000_005]);
    assert_eq!(
        (run.column(0), run.column(1), run.column(2)),
        (&[-0.0, -1.0, -2.0][..], &[0.5, 1.5, 2.5][..], &[1.0; 3][..])
    );
    let logs = Logs::parse("j.mcap", &bytes, &options(&[("q", "/joints.positon[0]")])).unwrap();
    let error = logs.dataset(&["q"], &[]).unwrap_err().to_string();
    assert!(error.contains("did you mean `position"), "{error}");
}

#[test]
fn a_header_that_nobody_filled_in_is_not_a_clock() {
    let mut bag = Bag::new(None);
    let joints = bag.channel("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE);
    for i in 0..3_i64 {
        bag.write(joints, i * 10_000_000, &joint_state(0, &["pan"], &[i as f64]));
    }
    let found = assembled(&bag.done(), &MAP[..1], &[]);
    assert_eq!(found.data.runs()[0].time, [0.0, 0.01, 0.02]);
    assert!(found.notes[0].contains("never changes"), "{:?}", found.notes);
}

#[test]
fn a_log_without_its_last_bytes_is_stated() {
    let whole = robot(Some(Compression::Lz4));
    for lost in 0..=40 {
        let logs = Logs::parse("cut.mcap", &whole[..whole.len() - lost], &options(&MAP[..1])).unwrap();
        let task = Task { needed: vec!["q".into()], ..Task::default() };
        let found = logs.assemble(&task, &Silent).unwrap();
        assert_eq!(found.data.runs()[0].n_samples(), 200, "{lost}");
        assert_eq!(
            found.notes.iter().any(|note| note.contains("breaks off") || note.contains("never closed")),
            lost > 0,
            "{lost}"
        );
    }
}

#[test]
fn fields_that_the_first_message_leaves_empty_are_listed() {
    let mut bag = Bag::new(None);
    let joints = bag.json("/joints");
    for i in 0..10_i64 {
        let text = if i == 0 {
            r#"{"position":[],"on":true}"#.to_string()
        } else {
            format!(r#"{{"position":[{i}.5],"on":true}}"#)
        };
        bag.write(joints, 100 + i, text.as_bytes());
    }
    let read = Logs::parse("a.mcap", &bag.done(), &options(&[("q", "/joints.positon[0]")]));
    let error = read.and_then(|logs| logs.dataset(&["q"], &[])).unwrap_err().to_string();
    assert!(error.contains("did you mean `position[0]`") && error.contains("found: on, position[0]"), "{error}");
}
