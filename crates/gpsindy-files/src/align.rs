//! Clocks of topics whose offset is to be estimated, one topic after the other, before the topics become runs.

use crate::error::{Error, Result};
use crate::log::Log;
use crate::topic::Topic;
use gpsindy_core::{ClockOffset, Progress, Signal, clock_offset};
use std::fmt;

/// Confidence of the intervals.
const LEVEL: f64 = 0.95;

/// What was added to the stamps of a topic; displays as one sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct TopicOffset {
    /// The log, as the user named it.
    pub file: String,
    /// The topic.
    pub topic: String,
    /// The offset with its interval, and the columns that gave it.
    pub offset: ClockOffset,
}

impl TopicOffset {
    /// The same for programs: seconds, and the limits of the interval.
    pub fn json(&self) -> serde_json::Value {
        let ClockOffset { seconds, low, high, level, column, other, driven } = &self.offset;
        serde_json::json!({
            "file": self.file, "topic": self.topic, "seconds": seconds, "low": low, "high": high, "level": level,
            "column": column, "other": other, "driven": driven,
        })
    }
}

impl fmt::Display for TopicOffset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ClockOffset { seconds, low, high, level, column, other, driven } = &self.offset;
        write!(
            f,
            "{}: {seconds:.6} s were added to the stamps of `{}` ({low:.6} to {high:.6} at {:.0} %), estimated from `{column}` and `{other}`",
            self.file,
            self.topic,
            100.0 * level
        )?;
        if *driven { write!(f, "; a delay between a command and the machine counts in it") } else { Ok(()) }
    }
}

/// Estimates the offsets that a log's options leave open, and shifts its topics by them. `names` and `controls` go by the
/// places of the columns.
///
/// # Errors
/// A topic that no column comes from, one that is alone, columns that do not determine the offset, a request to stop.
pub(crate) fn align(
    log: &Log,
    topics: &mut [Topic],
    names: &[&str],
    controls: &[bool],
    progress: &dyn Progress,
) -> Result<Vec<TopicOffset>> {
    let mut open: Vec<&String> = log.unaligned().iter().collect();
    let mut found = Vec::new();
    while let Some(topic) = open.pop() {
        let wrong = |message: String| Error::file(&log.file, format!("--offset {topic}=auto: {message}"));
        let Some(at) = topics.iter().position(|t| t.name == *topic) else {
            return Err(wrong("no column of this task comes from a topic of that name; a table has one clock".into()));
        };
        // A clock that is still open itself says nothing.
        let settled = |t: &&Topic| t.name != *topic && !open.iter().any(|other| **other == t.name);
        let own = columns(&topics[at], names, controls);
        let others: Vec<Signal<'_>> = topics.iter().filter(settled).flat_map(|t| columns(t, names, controls)).collect();
        if others.is_empty() {
            return Err(wrong("no column of this task comes from another topic whose clock is known".into()));
        }
        let offset = clock_offset(&own, &others, LEVEL, progress).map_err(|e| match e {
            gpsindy_core::Error::Cancelled => e.into(),
            e => wrong(e.to_string()),
        })?;
        topics[at].shift(offset.seconds);
        found.push(TopicOffset { file: log.file.clone(), topic: topic.clone(), offset });
    }
    Ok(found)
}

fn columns<'a>(topic: &'a Topic, names: &[&'a str], controls: &[bool]) -> Vec<Signal<'a>> {
    let signal = |(place, values): &'a (usize, Vec<f64>)| Signal {
        name: names[*place],
        times: &topic.stamps,
        values,
        control: controls[*place],
    };
    topic.columns.iter().map(signal).collect()
}
