//! Tests of the ULog reader with files that a writer of the test's own makes.

use super::*;
use crate::logs::Logs;
use gpsindy_core::Silent;

fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = (body.len() as u16).to_le_bytes().to_vec();
    bytes.push(kind);
    bytes.extend(body);
    bytes
}

/// A rate at 100 Hz with two instances, and a motor command at 50 Hz.
pub(crate) fn flight() -> Vec<u8> {
    let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
    bytes.extend(0_u64.to_le_bytes());
    bytes.extend(record(b'B', &[0; 40]));
    bytes.extend(record(b'F', b"rate:uint64_t timestamp;float[3] xyz;bool ok;uint8_t[3] _padding0;int16_t raw;"));
    bytes.extend(record(b'F', b"motor:uint64_t timestamp;double u;"));
    let subscribe = |instance: u8, id: u16, name: &str| {
        let mut body = vec![instance];
        body.extend(id.to_le_bytes());
        body.extend(name.as_bytes());
        record(b'A', &body)
    };
    bytes.extend(subscribe(0, 3, "rate"));
    bytes.extend(subscribe(1, 4, "rate"));
    bytes.extend(subscribe(0, 5, "motor"));
    for i in 0..100_u64 {
        for id in [3_u16, 4] {
            let mut body = id.to_le_bytes().to_vec();
            body.extend((1_000_000 + i * 10_000).to_le_bytes());
            for k in 0..3 {
                body.extend((i as f32 * 0.1 + f32::from(id as u8) + k as f32).to_le_bytes());
            }
            body.push(1);
            body.extend([0; 3]);
            body.extend((-(i as i16)).to_le_bytes());
            bytes.extend(record(b'D', &body));
        }
        if i % 2 == 0 {
            let mut body = 5_u16.to_le_bytes().to_vec();
            body.extend((1_003_000 + i * 10_000).to_le_bytes());
            body.extend((i as f64).to_le_bytes());
            bytes.extend(record(b'D', &body));
        }
    }
    bytes
}

fn options(map: &[(&str, &str)]) -> LogOptions {
    let map = map.iter().map(|(a, b)| ((*a).to_string(), (*b).to_string())).collect();
    LogOptions { map, ..LogOptions::default() }
}

const MAP: &[(&str, &str)] = &[("q", "rate.xyz[2]"), ("p", "rate:1.raw"), ("u", "motor.u")];

#[test]
fn topics_instances_and_elements_are_read_on_their_own_stamps() {
    let logs = Logs::parse("flight.ulg", &flight(), &options(MAP)).unwrap();
    let data = logs.dataset(&["q", "p", "u"], &[]).unwrap();
    let run = &data.runs()[0];
    assert_eq!(run.time[..3], [1.0, 1.003, 1.01]);
    assert_eq!(run.column(0)[0], f64::from(3.0_f32 + 2.0));
    assert!(run.column(0)[1].is_nan() && run.column(2)[0].is_nan());
    assert_eq!((run.column(1)[2], run.column(2)[1]), (-1.0, 0.0));
}

#[test]
fn wrong_names_suggest_the_right_ones() {
    for (path, expected) in [
        ("rat.xyz[0]", "there is no topic `rat`; did you mean `rate`"),
        ("rate.xzy[0]", "there is no field `xzy[0]` in rate; did you mean `xyz[0]`"),
        ("motor", "`motor` is a whole topic"),
    ] {
        let error = Logs::parse("flight.ulg", &flight(), &options(&[("q", path)])).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn a_cut_log_gives_what_stands_before_the_cut() {
    let whole = flight();
    let mut noted = 0;
    for length in (0..whole.len()).step_by(7) {
        let Ok(logs) = Logs::parse("cut.ulg", &whole[..length], &options(&MAP[..1])) else { continue };
        let task = crate::Task { needed: vec!["q".into()], ..crate::Task::default() };
        let Ok(found) = logs.assemble(&task, &Silent) else { continue };
        let run = &found.data.runs()[0];
        assert!((0..run.n_samples()).all(|i| run.column(0)[i] == f64::from(i as f32 * 0.1 + 3.0 + 2.0)));
        noted += usize::from(found.notes.iter().any(|n| n.contains("breaks off")));
    }
    assert!(noted > 100, "{noted}");
}
