//! Tests of the inspection: a log with one fault each, and what must be said of it.

use super::*;
use gpsindy_core::Silent;

fn inspected(name: &str, bytes: &[u8]) -> Inspection {
    let path = std::env::temp_dir().join(format!("gpsindy-inspect-{}-{name}", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let found = inspect(&path, &LogOptions::default(), &Silent).unwrap();
    std::fs::remove_file(&path).unwrap();
    found
}

/// A table of 400 samples of which each column is a function of the row's number.
fn table(name: &str, t: impl Fn(usize) -> f64, columns: &[(&str, &dyn Fn(usize) -> f64)]) -> Inspection {
    let mut text = String::from("t");
    columns.iter().for_each(|(name, _)| text += &format!(",{name}"));
    text.push('\n');
    for i in 0..400 {
        text += &format!("{:?}", t(i));
        columns.iter().for_each(|(_, value)| text += &format!(",{:?}", value(i)));
        text.push('\n');
    }
    inspected(name, text.as_bytes())
}

fn kinds(found: &Inspection) -> Vec<&str> {
    found.findings.iter().map(|f| f.kind.as_str()).collect()
}

fn noise(i: usize) -> f64 {
    let mixed = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / (1_u64 << 24) as f64 - 0.5
}

fn smooth(i: usize) -> f64 {
    (i as f64 * 0.013).sin() + 1e-3 * noise(i)
}

fn even(i: usize) -> f64 {
    i as f64 * 0.01
}

#[test]
fn a_clean_log_has_no_findings() {
    let found =
        table("clean.csv", even, &[("x [m]", &smooth), ("v", &|i| (i as f64 * 0.013).cos() + 0.01 * noise(i + 1000))]);
    assert_eq!(kinds(&found), [""; 0]);
    let clock = &found.topics[0].clock;
    assert!((clock.rate.unwrap() - 100.0).abs() < 1e-6 && clock.jitter.unwrap() < 1e-6 && clock.gaps == 0);
    assert_eq!((found.topics[0].count, found.topics[0].columns[0].unit.as_str()), (400, "m"));
    assert!(found.text(100).contains("no flaw found that would harm an identification"));
}

#[test]
fn each_fault_is_named() {
    let x: (&str, &dyn Fn(usize) -> f64) = ("x", &smooth);
    let one = |name: &str, value: &dyn Fn(usize) -> f64| {
        let found = table(&format!("{name}.csv"), even, &[("y", value)]);
        kinds(&found).join(" ")
    };
    assert_eq!(one("constant", &|_| 2.0), "constant");
    assert_eq!(one("wrapped", &|i| (i as f64 * 0.05).sin().atan2((i as f64 * 0.05).cos())), "wrapped");
    assert_eq!(one("quantised", &|i| ((i as f64 * 0.01).sin() * 50.0).round() * 0.02), "quantised");
    assert_eq!(one("held", &|i| smooth(i / 4 * 4)), "held");
    assert_eq!(one("clipped", &|i| (1.5 * (i as f64 * 0.05).sin() + 1e-3 * noise(i)).clamp(-2.0, 1.0)), "clipped");
    assert_eq!(kinds(&table("ms.csv", |i| 10.0 * i as f64, &[x])), ["time_unit"]);
    // A product of seconds in binary is whole but for its last digit.
    assert_eq!(kinds(&table("products.csv", |i| even(i) * 1e3, &[x])), ["time_unit"]);
    assert_eq!(one("frozen", &|i| smooth(if (160..220).contains(&i) { 160 } else { i })), "frozen");
    let lost = table("lost.csv", even, &[("y", &|i| if (100..160).contains(&i) { f64::NAN } else { smooth(i) })]);
    assert_eq!(kinds(&lost), ["missing"]);
    assert!(lost.findings[0].text.starts_with("holds no value from 1.000 s to 1.590 s (60 samples)"), "{lost:?}");
    let short = inspected("short.csv", b"t,x\n0,0.1\n0.1,0.3\n0.2,0.2\n");
    assert_eq!(kinds(&short), ["short"]);
    let words = (0..40).map(|i| format!("{},{}\n", even(i), if i == 7 { "off".into() } else { smooth(i).to_string() }));
    let words = inspected("words.csv", format!("t,x\n{}", words.collect::<String>()).as_bytes());
    assert_eq!(kinds(&words), ["text"]);
    assert!(words.findings[0].text.starts_with("1 cell is no number among numbers, the first \"off\""), "{words:?}");
    assert_eq!(kinds(&table("jitter.csv", |i| even(i) + 0.004 * noise(i), &[x])), ["jitter"]);
    assert_eq!(kinds(&table("milliseconds.csv", |i| 1e3 * i as f64, &[x])), ["time_unit"]);
    assert_eq!(kinds(&table("gap.csv", |i| even(i) + if i > 200 { 0.5 } else { 0.0 }, &[x])), ["gaps"]);
    assert_eq!(kinds(&table("repeated.csv", |i| even(if i == 100 { 99 } else { i }), &[x])), ["repeated_stamps"]);
    assert_eq!(kinds(&table("backward.csv", |i| even(if i == 100 { 98 } else { i }), &[x]))[0], "backward_stamps");
    let single = table("single.csv", |i| f64::from((3_000.0 + even(i)) as f32), &[x]);
    assert!(kinds(&single).contains(&"float32_stamps"), "{single:?}");
    let made = table("made.csv", even, &[x, ("v", &|i| if i == 0 { 0.0 } else { (smooth(i) - smooth(i - 1)) / 0.01 })]);
    assert_eq!(kinds(&made), ["difference"]);
    assert!(made.findings[0].text.contains("difference of `x` from one sample to the next"), "{made:?}");
}

#[test]
fn what_only_looks_like_a_fault_is_left_alone() {
    let x: (&str, &dyn Fn(usize) -> f64) = ("x", &smooth);
    let none = [""; 0];
    let one = |name: &str, value: &dyn Fn(usize) -> f64| {
        let found = table(&format!("no-{name}.csv"), even, &[("y", value)]);
        kinds(&found).join(" ")
    };
    // A switch, an angle that turns on and on, one that swings widely, a fine resolution, a few repeats by chance.
    assert_eq!(one("constant", &|i| f64::from(u8::from(i > 200)) + smooth(i)), "");
    assert_eq!(one("turns", &|i| i as f64 * 0.05 + 1e-3 * noise(i)), "");
    assert_eq!(one("swings", &|i| 3.1 * (i as f64 * 0.05).sin() + 1e-3 * noise(i)), "");
    assert_eq!(one("fine", &|i| ((i as f64 * 0.05).sin() * 1e4).round() * 1e-4), "");
    assert_eq!(one("repeats", &|i| smooth(i - usize::from(i % 10 == 9))), "");
    // Rest at the ends of a travel, noise apart; one stop; a coarse sine.
    assert_eq!(one("rest", &|i| (1.5 * (i as f64 * 0.05).sin()).clamp(-1.0, 1.0) + 1e-3 * noise(i)), "");
    assert_eq!(one("stop", &|i| if (100..160).contains(&i) { 1.2 } else { smooth(i) }), "");
    assert_eq!(one("coarse", &|i| ((i as f64 * 0.05).sin() * 50.0).round() * 0.02), "");
    // Jitter of 2 %, one lost sample, whole numbers that float32 holds as well, an epoch.
    assert_eq!(kinds(&table("no-jitter.csv", |i| even(i) + 4e-4 * noise(i), &[x])), none);
    assert_eq!(kinds(&table("no-gap.csv", |i| even(i + usize::from(i > 200)), &[x])), none);
    assert_eq!(kinds(&table("no-single.csv", |i| i as f64 * 0.25, &[x])), none);
    for step in [1.0, 60.0, 600.0] {
        assert_eq!(kinds(&table("no-ms.csv", |i| step * i as f64, &[x])), none);
    }
    assert_eq!(kinds(&table("no-epoch.csv", |i| 1_763_000_000.0 + even(i), &[x])), none);
    // A speed by a sensor of its own.
    let speed = |i: usize| 1.3 * (i as f64 * 0.013).cos() + 0.01 * noise(i + 1000);
    assert_eq!(kinds(&table("no-difference.csv", even, &[x, ("v", &speed)])), none);
}

#[test]
fn the_difference_through_a_filter_is_found_in_a_log() {
    let mut low = vec![0.0; 400];
    for i in 1..400 {
        low[i] = 0.7 * low[i - 1] + 0.3 * (smooth(i) - smooth(i - 1)) / 0.01;
    }
    let found = table("low.csv", even, &[("x", &smooth), ("v", &|i| low[i])]);
    assert_eq!(kinds(&found), ["difference"]);
    assert!(found.findings[0].text.contains("difference of `x` through a low pass of 2.8 samples"), "{found:?}");
}

#[cfg(feature = "mcap")]
#[test]
fn clocks_that_meet_and_keep_step_are_left_alone_and_others_stated() {
    use crate::formats::mcap_log::tests::{Bag, JOINT_STATE, joint_state};
    // Stamps of two topics, ns, recorded late by a scatter that does not grow.
    let found = |name: &str, shift: i64| {
        let mut bag = Bag::new(None);
        for topic in ["/left", "/right"] {
            let joints = bag.channel(topic, "sensor_msgs/msg/JointState", JOINT_STATE);
            for i in 0..400_i64 {
                let t = 1_763_000_000_000_000_000 + i * 10_000_000 + if topic == "/right" { shift } else { 0 };
                let late = 2_000_000 + i * 7919 % 500 * 1_000;
                bag.write(joints, t + late, &joint_state(t, &["a"], &[smooth(i as usize + topic.len())]));
            }
        }
        inspected(name, &bag.done())
    };
    assert_eq!(kinds(&found("meet.mcap", 3_000_000)), [""; 0]);
    let apart = found("apart.mcap", 60_000_000_000);
    assert_eq!(kinds(&apart), ["clock_drift"]);
    assert!(apart.findings[0].text.contains("do not overlap with those of"), "{apart:?}");
}

#[test]
fn levels_are_measured() {
    let found = table("levels.csv", even, &[("y", &|i| ((i as f64 * 0.05).sin() * 300.0).round() * 0.088)]);
    let step = found.topics[0].columns[0].step.unwrap();
    assert!((step - 0.088).abs() < 1e-9, "{step}");
}

#[cfg(feature = "mcap")]
#[test]
fn topics_of_mcap_are_listed_with_their_joints_and_the_drift_of_their_clock() {
    use crate::formats::mcap_log::tests::{Bag, JOINT_STATE, joint_state};
    let mut bag = Bag::new(Some(mcap::Compression::Zstd));
    let joints = bag.channel("/joint_states", "sensor_msgs/msg/JointState", JOINT_STATE);
    for i in 0..500_i64 {
        let t = 1_763_000_000_000_000_000 + i * 10_000_000;
        // Recorded 2 ms late and by a clock that is 0.1 % fast.
        let log = t + 2_000_000 + i * 10_000 + i % 7 * 1_000;
        bag.write(
            joints,
            log,
            &joint_state(t, &["pan", "lift"], &[smooth(i as usize), -0.5 * smooth(i as usize + 77)]),
        );
    }
    let found = inspected("robot.mcap", &bag.done());
    let topic = &found.topics[0];
    assert_eq!((found.format.as_str(), topic.topic.as_str(), topic.count), ("MCAP", "/joint_states", 500));
    assert_eq!(topic.kind, "sensor_msgs/msg/JointState, cdr");
    let names: Vec<&str> = topic.columns.iter().filter(|c| c.numeric).map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["position[pan]", "position[lift]"]);
    assert_eq!(topic.clock.clock, "header");
    assert!((topic.clock.drift.unwrap() - 1e-3).abs() < 1e-5, "{:?}", topic.clock);
    assert_eq!(kinds(&found), ["clock_drift"]);
    let text = found.text(100);
    assert!(text.contains("position[lift]") && text.contains("100 Hz"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
}

#[cfg(feature = "parquet")]
#[test]
fn a_data_set_of_episodes_is_looked_through() {
    let folder = crate::formats::parquet_log::tests::lerobot(|frame| frame as f32 / 30.0);
    let found = inspect(&folder, &LogOptions::default(), &Silent).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    let topic = &found.topics[0];
    assert_eq!((found.format.as_str(), topic.count, topic.runs), ("LeRobot data set", 80, 2));
    assert!(topic.columns.iter().any(|c| c.name == "observation.state[elbow.pos]" && c.kind == "float32"));
    assert!(found.notes[0].contains("made again"));
}

#[cfg(feature = "ulog")]
#[test]
fn topics_of_ulog_are_listed_with_their_instances() {
    let found = inspected("flight.ulg", &crate::formats::ulog::tests::flight());
    let names: Vec<(&str, usize)> = found.topics.iter().map(|t| (t.topic.as_str(), t.count)).collect();
    assert_eq!(names, [("motor", 50), ("rate", 100), ("rate:1", 100)]);
    assert!(found.topics[1].columns.iter().any(|c| c.name == "xyz[2]" && c.kind == "float"));
}

#[test]
fn a_column_that_ends_or_begins_within_the_log_is_stated() {
    let early = |i: usize| if i < 5 { smooth(i) } else { f64::NAN };
    let late = |i: usize| if i < 300 { f64::NAN } else { smooth(i) };
    let rare = |i: usize| if i.is_multiple_of(10) { smooth(i) } else { f64::NAN };
    let found = table("ends.csv", even, &[("u", &early), ("w", &late), ("x", &rare)]);
    let shown: Vec<(&str, &str)> = found
        .findings
        .iter()
        .filter(|f| f.kind == "missing")
        .map(|f| (f.column.as_deref().unwrap(), f.text.as_str()))
        .collect();
    assert_eq!(shown.len(), 2, "{shown:?}");
    assert!(
        shown[0].0 == "u"
            && shown[0].1.starts_with("ends within the log: the last 98.8 % of the samples hold no value"),
        "{shown:?}"
    );
    assert!(shown[1].0 == "w" && shown[1].1.starts_with("begins within the log: the first 75.0 %"), "{shown:?}");
}

#[cfg(feature = "mcap")]
#[test]
fn fields_that_the_first_messages_leave_empty_are_listed() {
    use crate::formats::mcap_log::tests::{Bag, JOINT_STATE, joint_state};
    let mut bag = Bag::new(None);
    let joints = bag.channel("/joints", "sensor_msgs/msg/JointState", JOINT_STATE);
    let words = bag.json("/words");
    for i in 0..20_i64 {
        let time = i * 10_000_000;
        let (names, values): (&[&str], &[f64]) = if i < 3 { (&[], &[]) } else { (&["elbow"], &[i as f64]) };
        bag.write(joints, time, &joint_state(time, names, values));
        let text = if i == 0 { "{}".into() } else { format!("{{\"w\":[{i}]}}") };
        bag.write(words, time, text.as_bytes());
    }
    let found = inspected("late.mcap", &bag.done());
    let column = |topic: usize, name: &str| {
        let columns = &found.topics[topic].columns;
        columns.iter().find(|column| column.name == name).unwrap_or_else(|| panic!("{columns:?}")).clone()
    };
    // Some messages are looked through for new fields, the fourth among them.
    let (elbow, word) = (column(0, "position[elbow]"), column(1, "w[0]"));
    assert_eq!((elbow.count, elbow.min, elbow.max), (17, Some(3.0), Some(19.0)));
    assert_eq!((word.count, word.min, word.max), (19, Some(1.0), Some(19.0)));
    assert!((elbow.missing - 0.15).abs() < 1e-12, "{elbow:?}");
}
