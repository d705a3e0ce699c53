//! Runs a computation away from the interpreter, while the calling thread looks after signals and progress.
//!
//! Only the main thread of Python hears Ctrl-C, and only while it runs Python. So the work goes to a thread of its own
//! without the interpreter, and the calling thread wakes up now and then to look.

use crate::convert::error;
use gpsindy_core::{Progress, Result};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// How often the calling thread looks for signals.
const PERIOD: Duration = Duration::from_millis(50);

/// Stack of the working thread, as generous as that of a main thread.
const STACK: usize = 8 << 20;

/// What the working and the watching thread tell each other.
#[derive(Default)]
pub(crate) struct Watch {
    stop: AtomicBool,
    /// The first error of the user's own code, or of a signal.
    failure: Mutex<Option<PyErr>>,
    /// The latest report that was not passed on yet.
    news: Mutex<Option<(String, usize, usize)>>,
}

/// The content of a lock, also where a thread panicked while it held it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Watch {
    /// Whether somebody asked to stop.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Keeps the first error and asks the computation to stop.
    pub(crate) fn fail(&self, failure: PyErr) {
        lock(&self.failure).get_or_insert(failure);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Runs `work` with a callable of Python's in it: on one thread only, which the interpreter knows all the while.
    ///
    /// Calls of the simulator wait for each other anyway, and a thread that the interpreter does not know is
    /// registered and forgotten at every call.
    ///
    /// # Errors
    /// As [`Watch::run`].
    pub(crate) fn run_calling<T: Send>(
        &self,
        py: Python<'_>,
        listener: Option<&Py<PyAny>>,
        work: impl FnOnce() -> Result<T> + Send,
    ) -> PyResult<T> {
        let known = |worker: rayon::ThreadBuilder| {
            let task = move || Python::attach(|py| py.detach(|| worker.run()));
            thread::Builder::new().stack_size(STACK).spawn(task).map(|_| ())
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).spawn_handler(known).build();
        let pool = pool.map_err(|e| PyRuntimeError::new_err(format!("no thread for the simulator: {e}")))?;
        self.run(py, listener, || pool.install(work))
    }

    /// Runs `work` on a thread of its own; `listener` is called with (stage, done, total).
    ///
    /// # Errors
    /// What the user's own code raised, unchanged; else what `work` returned.
    pub(crate) fn run<T: Send>(
        &self,
        py: Python<'_>,
        listener: Option<&Py<PyAny>>,
        work: impl FnOnce() -> Result<T> + Send,
    ) -> PyResult<T> {
        let outcome = py.detach(|| {
            thread::scope(|scope| {
                let (alive, finished) = channel::<()>();
                let working = move || {
                    let _alive = alive;
                    work()
                };
                let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, working)?;
                while finished.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    Python::attach(|py| self.look(py, listener));
                }
                Ok::<_, std::io::Error>(worker.join())
            })
        })?;
        if let Some(failure) = lock(&self.failure).take() {
            return Err(failure);
        }
        match outcome {
            Ok(result) => result.map_err(error),
            Err(_) => Err(PyRuntimeError::new_err("internal error of gpsindy; please report it with the data")),
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
}
