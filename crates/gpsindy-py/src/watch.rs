//! Runs a computation without the interpreter lock, while the calling thread handles signals and progress.
//!
//! Only the main thread of Python receives Ctrl-C, and only while it runs Python code. So the computation runs in its own
//! thread, and the calling thread wakes up from time to time to check for signals.

use crate::convert::error;
use gpsindy_core::{Progress, Result};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often the calling thread looks for signals.
const PERIOD: Duration = Duration::from_millis(50);

/// Periods for which a computation that was asked to stop is waited for.
const PATIENCE: usize = 5;

/// Stack of the working thread, as generous as that of a main thread.
const STACK: usize = 8 << 20;

/// What the working and the watching thread exchange.
pub(crate) struct Watch {
    begun: Instant,
    stop: AtomicBool,
    /// The first error of the user's own code, or of a signal.
    failure: Mutex<Option<PyErr>>,
    /// The latest report that was not passed on yet.
    news: Mutex<Option<(String, usize, usize)>>,
}

impl Default for Watch {
    fn default() -> Self {
        Self { begun: Instant::now(), stop: AtomicBool::default(), failure: Mutex::default(), news: Mutex::default() }
    }
}

/// The content of a lock, also where a thread panicked while it held it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A pool of so many threads, which the interpreter knows all the while; 0: one a processor.
pub(crate) fn calling_pool(threads: usize) -> PyResult<rayon::ThreadPool> {
    let known = |worker: rayon::ThreadBuilder| {
        let task = move || Python::attach(|py| py.detach(|| worker.run()));
        thread::Builder::new().stack_size(STACK).spawn(task).map(|_| ())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).spawn_handler(known).build();
    pool.map_err(|e| PyRuntimeError::new_err(format!("no thread for the simulator: {e}")))
}

impl Watch {
    /// Takes the first error of the user's own code.
    pub(crate) fn failure(&self) -> Option<PyErr> {
        lock(&self.failure).take()
    }

    /// Whether somebody asked to stop.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Keeps the first error and asks the computation to stop.
    pub(crate) fn fail(&self, failure: PyErr) {
        lock(&self.failure).get_or_insert(failure);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Runs `work` with a callable of Python's in it, on so many `threads` that the interpreter knows all the while (0: one a
    /// processor).
    ///
    /// A thread that the interpreter does not know is registered and forgotten at every call. Calls of the simulator wait
    /// for each other, so that one thread is enough where hardly anything is done between them.
    ///
    /// # Errors
    /// As [`Watch::run`].
    pub(crate) fn run_calling<T: Send + 'static>(
        self: &Arc<Self>,
        py: Python<'_>,
        threads: usize,
        listener: Option<&Py<PyAny>>,
        work: impl FnOnce() -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let pool = calling_pool(threads)?;
        self.run(py, listener, move || pool.install(work))
    }

    /// Runs `work` on a thread of its own; `listener` is called with (stage, done, total).
    ///
    /// After Ctrl-C the caller does not wait for the next place where the computation can stop: it ends on its own there.
    ///
    /// # Errors
    /// What the user's own code raised, unchanged; else what `work` returned.
    pub(crate) fn run<T: Send + 'static>(
        self: &Arc<Self>,
        py: Python<'_>,
        listener: Option<&Py<PyAny>>,
        work: impl FnOnce() -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let (sender, receiver) = channel();
        let working = move || {
            // Nobody listens any more after Ctrl-C.
            let _ = sender.send(work());
        };
        thread::Builder::new().stack_size(STACK).spawn(working)?;
        let outcome = py.detach(move || self.wait(receiver, listener));
        // The last report may have come just before the end.
        self.look(py, listener);
        if let Some(failure) = lock(&self.failure).take() {
            return Err(failure);
        }
        match outcome {
            Some(result) => result.map_err(error),
            None => Err(PyRuntimeError::new_err("internal error of gpsindy; please report it with the data")),
        }
    }

    /// The result; None where the working thread panicked, or did not end soon after it was asked to.
    fn wait<T>(&self, receiver: Receiver<Result<T>>, listener: Option<&Py<PyAny>>) -> Option<Result<T>> {
        let mut patience = PATIENCE;
        loop {
            match receiver.recv_timeout(PERIOD) {
                Ok(result) => return Some(result),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) if !self.stopped() => Python::attach(|py| self.look(py, listener)),
                Err(RecvTimeoutError::Timeout) if patience == 0 => return None,
                Err(RecvTimeoutError::Timeout) => patience -= 1,
            }
        }
    }

    fn look(&self, py: Python<'_>, listener: Option<&Py<PyAny>>) {
        let heard = py.check_signals().and_then(|()| {
            let news = lock(&self.news).take();
            if let (Some(listener), Some(news)) = (listener, news) {
                listener.call1(py, news)?;
            }
            Ok(())
        });
        if let Err(failure) = heard {
            self.fail(failure);
        }
    }
}

impl Progress for Watch {
    fn report(&self, stage: &str, done: usize, total: usize) -> bool {
        *lock(&self.news) = Some((stage.into(), done, total));
        !self.stopped()
    }

    fn seconds(&self) -> Option<f64> {
        Some(self.begun.elapsed().as_secs_f64())
    }
}
