//! What a log holds, and which of its flaws would harm an identification.

use crate::error::Result;
use crate::options::LogOptions;
use gpsindy_core::Progress;
use serde::Serialize;
use std::path::Path;

mod column;
mod difference;
mod findings;
mod lulls;
mod sheets;
mod stamps;
mod text;

pub use column::ColumnReport;
pub use findings::Finding;
pub use stamps::ClockReport;

use column::Column;

/// What one log holds.
#[derive(Debug, Clone, Serialize)]
pub struct Inspection {
    /// As the user named it.
    pub file: String,
    /// `CSV`, `MCAP`, `Parquet`, `LeRobot` or `ULog`.
    pub format: String,
    /// Its topics; a table is one without a name.
    pub topics: Vec<TopicReport>,
    /// What would harm an identification, in the order of the topics.
    pub findings: Vec<Finding>,
    /// What the reading itself has to say: a break, stamps that were made again.
    pub notes: Vec<String>,
}

/// Samples that share their stamps.
#[derive(Debug, Clone, Serialize)]
pub struct TopicReport {
    /// As the log names it; empty where the log is one table.
    pub topic: String,
    /// Type of the messages, and their encoding; empty for a table.
    pub kind: String,
    /// Samples.
    pub count: usize,
    /// Runs that a column distinguishes.
    pub runs: usize,
    /// Its clock and steps.
    pub clock: ClockReport,
    /// Its fields or columns.
    pub columns: Vec<ColumnReport>,
    /// Why its fields are not read, where they are not.
    pub unread: Option<String>,
}

/// Samples under inspection.
#[derive(Debug, Default)]
pub(crate) struct Sheet {
    pub(crate) topic: String,
    pub(crate) kind: String,
    /// What gives the stamps: `t`, `header`, `log`.
    pub(crate) clock: String,
    /// s; of several runs one after the other.
    pub(crate) stamps: Vec<f64>,
    /// Where runs begin among the stamps, the first at 0.
    pub(crate) runs: Vec<usize>,
    /// What is added to a stamp to have it as the log says it, s.
    pub(crate) origin: f64,
    /// Time of recording less the stamp, s, where both are known.
    pub(crate) latency: Vec<f64>,
    pub(crate) columns: Vec<Column>,
    pub(crate) unread: Option<String>,
    /// Whether stamps are written as float32.
    pub(crate) single: bool,
    /// What speaks against stamps in seconds.
    pub(crate) doubt: Option<String>,
    /// Whether stamps are numbers whose unit nobody stated.
    pub(crate) has_plain_time: bool,
}

/// Looks through a log of any format.
///
/// # Errors
/// A file that can't be read or is broken from its begin; of the options only the time and run column and names count.
pub fn inspect(path: &Path, options: &LogOptions, progress: &dyn Progress) -> Result<Inspection> {
    let (file, format, sheets, notes) = sheets::of(path, options, progress)?;
    let mut topics = Vec::with_capacity(sheets.len());
    let mut found = Vec::new();
    for sheet in &sheets {
        let report = TopicReport {
            topic: sheet.topic.clone(),
            kind: sheet.kind.clone(),
            count: sheet.stamps.len(),
            runs: sheet.runs.len(),
            clock: ClockReport::of(sheet),
            columns: sheet.columns.iter().map(Column::report).collect(),
            unread: sheet.unread.clone(),
        };
        findings::of(sheet, &report, &mut found);
        topics.push(report);
    }
    findings::between(&sheets, &mut found);
    Ok(Inspection { file, format: format.into(), topics, findings: found, notes })
}

impl Inspection {
    /// One screen for people, lines of at most `width` characters.
    pub fn text(&self, width: usize) -> String {
        text::of(self, width)
    }

    /// The same for programs.
    pub fn json(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests;
