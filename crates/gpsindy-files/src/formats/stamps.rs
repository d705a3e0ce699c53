//! Stamps of messages: put in order, counted from the first where they are a calendar's, shifted where asked.

use crate::error::{Error, Result};
use crate::near::hint;
use crate::options::Offset;
use crate::time::EPOCH;
use crate::topic::Topic;

/// Samples of one topic as they were recorded.
#[derive(Debug, Clone, Default)]
pub(crate) struct Series {
    pub(crate) topic: String,
    /// ns, r of them, in the order of recording.
    pub(crate) stamps: Vec<i64>,
    /// Place among the columns that were asked for, and the r values.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// A clock that goes back by more than this was reset, ns; messages that overtook each other are nearer.
const LEAP: i64 = 1_000_000_000;

/// Orders and shifts the stamps of topics.
///
/// # Errors
/// A topic whose clock was reset, with fewer than two samples, or an offset for a topic that is not there.
pub(crate) fn topics(
    file: &str,
    mut series: Vec<Series>,
    offsets: &[(String, Offset)],
    clock_option: &str,
) -> Result<(Vec<Topic>, Vec<String>)> {
    let mut notes = Vec::new();
    for one in &mut series {
        order(file, one, clock_option, &mut notes)?;
    }
    for (topic, _) in offsets {
        if !series.iter().any(|s| s.topic == *topic) {
            let found = hint(topic, series.iter().map(|s| s.topic.as_str()));
            return Err(Error::file(file, format!("--offset: no column comes from a topic `{topic}`{found}")));
        }
    }
    let first = series.iter().filter_map(|s| s.stamps.first().copied()).min().unwrap_or(0);
    let origin = if first.unsigned_abs() as f64 >= EPOCH * 1e9 { first } else { 0 };
    let mut topics: Vec<Topic> = series
        .into_iter()
        .map(|s| Topic {
            stamps: s.stamps.into_iter().map(|t| apart(t, origin)).collect(),
            name: s.topic,
            run: String::new(),
            columns: s.columns,
        })
        .collect();
    for (topic, offset) in offsets {
        // An estimate needs the columns of all topics: it is made once they are read.
        let Offset::Seconds(seconds) = offset else { continue };
        for one in topics.iter_mut().filter(|t| t.name == *topic) {
            one.shift(*seconds);
        }
    }
    Ok((topics, notes))
}

/// Seconds from one stamp to another.
pub(crate) fn apart(stamp: i64, origin: i64) -> f64 {
    match stamp.checked_sub(origin) {
        Some(ns) => ns as f64 / 1e9,
        None => (i128::from(stamp) - i128::from(origin)) as f64 / 1e9,
    }
}

fn order(file: &str, one: &mut Series, clock_option: &str, notes: &mut Vec<String>) -> Result<()> {
    let topic = &one.topic;
    let mut latest = i64::MIN;
    let mut late = 0_usize;
    for (i, &stamp) in one.stamps.iter().enumerate() {
        if latest != i64::MIN && latest.saturating_sub(stamp) > LEAP {
            let back = latest.saturating_sub(stamp) as f64 / 1e9;
            let message = format!(
                "topic `{topic}`: time goes back by {back:.3} s at message {}, as after a reset of the clock; \
                 cut the log there{clock_option}",
                i + 1
            );
            return Err(Error::file(file, message));
        }
        late += usize::from(stamp < latest);
        latest = latest.max(stamp);
    }
    if late > 0 {
        notes.push(format!(
            "{file}: topic `{topic}`: {late} messages came out of order; they were sorted by their stamps"
        ));
    }
    if one.stamps.len() > 1 && one.stamps.windows(2).all(|pair| pair[0] < pair[1]) {
        return Ok(());
    }
    let mut rows: Vec<usize> = (0..one.stamps.len()).collect();
    rows.sort_by_key(|&i| one.stamps[i]);
    let all = rows.len();
    rows.dedup_by_key(|&mut i| one.stamps[i]);
    if rows.len() < all {
        let repeated = all - rows.len();
        notes.push(format!(
            "{file}: topic `{topic}`: {repeated} messages repeat the stamp of the one before; the first of each was taken"
        ));
    }
    if rows.len() < 2 {
        let count = rows.len();
        return Err(Error::file(
            file,
            format!("topic `{topic}` has {count} samples with different stamps; a run needs at least 2"),
        ));
    }
    one.stamps = rows.iter().map(|&i| one.stamps[i]).collect();
    for (_, values) in &mut one.columns {
        *values = rows.iter().map(|&i| values[i]).collect();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(stamps: &[i64]) -> Vec<Series> {
        let values = (0..stamps.len()).map(|i| i as f64).collect();
        vec![Series { topic: "/q".into(), stamps: stamps.into(), columns: vec![(0, values)] }]
    }

    #[test]
    fn calendar_stamps_are_counted_from_the_first_without_loss() {
        let begin = 1_763_000_000_123_456_789;
        let (topics, notes) = topics("log", series(&[begin, begin + 1, begin + 10_000_000]), &[], "").unwrap();
        assert_eq!(topics[0].stamps, [0.0, 1e-9, 0.01]);
        assert!(notes.is_empty());
        let (topics, _) = super::topics("log", series(&[5_000_000_000, 5_010_000_000]), &[], "").unwrap();
        assert_eq!(topics[0].stamps, [5.0, 5.01]);
    }

    #[test]
    fn messages_out_of_order_are_sorted_and_repeated_stamps_stated() {
        let (topics, notes) = topics("log", series(&[0, 20, 10, 30, 30]), &[], "").unwrap();
        assert_eq!(topics[0].columns[0].1, [0.0, 2.0, 1.0, 3.0]);
        assert_eq!(topics[0].stamps.len(), 4);
        assert_eq!(notes.len(), 2, "{notes:?}");
    }

    #[test]
    fn a_clock_that_was_reset_is_refused_with_its_place() {
        let error = topics("log", series(&[0, 5_000_000_000, 0, 10]), &[], "").unwrap_err().to_string();
        assert_eq!(
            error,
            "log: topic `/q`: time goes back by 5.000 s at message 3, as after a reset of the clock; cut the log there"
        );
    }

    #[test]
    fn an_offset_shifts_its_topic_alone() {
        let offsets = [("/q".to_string(), Offset::Seconds(-0.5))];
        assert_eq!(topics("log", series(&[0, 1_000_000_000]), &offsets, "").unwrap().0[0].stamps, [-0.5, 0.5]);
        let offsets = [("/joint".to_string(), Offset::Auto)];
        assert!(topics("log", series(&[0, 1]), &offsets, "").unwrap_err().to_string().contains("found: /q"));
    }
}
