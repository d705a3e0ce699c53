//! The common form of all log formats: topics, each with columns on its own clock.

use crate::error::Result;
use crate::header::Header;
use gpsindy_core::Progress;
use std::fmt::Debug;

/// Samples of one source, or of one of its runs: columns that share their stamps.
#[derive(Debug, Clone)]
pub(crate) struct Topic {
    /// As the log names it; empty where the log is one table.
    pub(crate) name: String,
    /// The run; empty where the log is one run.
    pub(crate) run: String,
    /// s, strictly increasing, r of them.
    pub(crate) stamps: Vec<f64>,
    /// Place among the columns that were asked for, and the r values; NaN is missing.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

impl Topic {
    /// Adds seconds to the stamps.
    pub(crate) fn shift(&mut self, seconds: f64) {
        // Whole nanoseconds, as stamps are: else two that are the same would differ in their last digit.
        self.stamps.iter_mut().for_each(|t| *t = ((*t + seconds) * 1e9).round() / 1e9);
    }
}

/// What came of reading columns.
#[derive(Debug, Default)]
pub(crate) struct Reading {
    /// Runs in their order; the topics of a run share its name.
    pub(crate) topics: Vec<Topic>,
    /// What the user should know: one sentence each.
    pub(crate) notes: Vec<String>,
}

/// A log of one format, opened and not yet read.
pub(crate) trait Source: Debug + Send + Sync {
    /// The columns besides time and run, under the names that the options gave them.
    fn columns(&self) -> &[Header];

    /// Whether a column holds nothing but numbers and missing values.
    fn is_numeric(&self, column: usize) -> bool;

    /// Reads columns, by their places in [`Source::columns`].
    fn read(&self, columns: &[usize], progress: &dyn Progress) -> Result<Reading>;

    /// The error that says that a column `name` is not there, and what is.
    fn lacks(&self, name: &str) -> crate::Error;

    /// The header of a time column whose numbers are read as they are; `None` where the format counts in seconds.
    fn time_header(&self) -> Option<&Header> {
        None
    }
}
