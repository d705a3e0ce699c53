//! What all steps of one diagnosis share: who listens, when time is up, and what the reader must know.

use crate::diagnose::notes::{Note, Notes};
use crate::error::Result;
use crate::progress::{Progress, step};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// One diagnosis under way.
pub(crate) struct Run<'a> {
    progress: &'a dyn Progress,
    /// Seconds on the listener's clock at which the search ends.
    time_limit: Option<f64>,
    /// Whether something was left out because time was up.
    is_cut: AtomicBool,
    pub(crate) notes: Notes,
}

impl<'a> Run<'a> {
    pub(crate) fn new(progress: &'a dyn Progress, time_limit: Option<f64>) -> Self {
        Self { progress, time_limit, is_cut: AtomicBool::new(false), notes: Notes::default() }
    }

    /// Whether the search must end with what it has. Asked before a piece of work that is then left out.
    pub(crate) fn is_out_of_time(&self) -> bool {
        let is_over = self.time_limit.zip(self.progress.seconds()).is_some_and(|(limit, now)| now >= limit);
        if is_over {
            self.is_cut.store(true, Ordering::Relaxed);
        }
        is_over
    }

    /// Whether time was up before the search came to its end.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    /// Says that the search was cut, where it was.
    pub(crate) fn say_if_cut(&self) {
        if let Some(seconds) = self.time_limit.filter(|_| self.is_cut()) {
            self.notes.say(Note::TimeUp { seconds });
        }
    }

    /// A stage of `total` parts, reported part by part from whatever thread.
    pub(crate) fn stage<'b>(&'b self, name: &'b str, total: usize) -> Result<Stage<'b>> {
        let stage = Stage { progress: self.progress, name, done: AtomicUsize::new(0), total };
        step(self.progress, name, 0, total)?;
        Ok(stage)
    }
}

/// A stage under way.
pub(crate) struct Stage<'a> {
    progress: &'a dyn Progress,
    name: &'a str,
    done: AtomicUsize,
    total: usize,
}

impl Stage<'_> {
    /// One more part is through.
    ///
    /// # Errors
    /// A request to stop.
    pub(crate) fn advance(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        step(self.progress, self.name, done.min(self.total), self.total)
    }

    /// So many parts are through.
    ///
    /// # Errors
    /// A request to stop.
    pub(crate) fn reach(&self, done: usize) -> Result<()> {
        step(self.progress, self.name, done.min(self.total), self.total)
    }
}
