//! Progress and cancellation of long computations.

use crate::error::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Receives progress; the answer `false` asks the computation to stop with [`Error::Cancelled`].
///
/// Called from the thread that started the computation and from workers, so it must be `Sync`.
pub trait Progress: Sync {
    /// `done` of `total` parts of `stage` are finished. Returns whether to go on.
    fn report(&self, stage: &str, done: usize, total: usize) -> bool;

    /// Seconds since the computation began; none where nobody keeps the time, and then no time limit is kept either.
    ///
    /// The library has no clock of its own: results then depend on nothing but the input. A computation with a time limit
    /// asks here, and when its time is up ends with the best that it has, which is no [`Error::Cancelled`].
    fn seconds(&self) -> Option<f64> {
        None
    }

    /// A flag that somebody sets who has waited long enough; none where nobody can. A diagnosis then ends with the best that it has, as
    /// where its time is up, which is no [`Error::Cancelled`].
    fn enough(&self) -> Option<Arc<AtomicBool>> {
        None
    }
}

/// Says nothing and never stops.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn report(&self, _stage: &str, _done: usize, _total: usize) -> bool {
        true
    }
}

/// Reports and turns a request to stop into the error.
pub(crate) fn step(progress: &dyn Progress, stage: &str, done: usize, total: usize) -> Result<()> {
    if progress.report(stage, done, total) { Ok(()) } else { Err(Error::Cancelled) }
}
