//! Ctrl-C and other requests to end: the program ends at once, says so, and leaves no file half-written. A search that can end with the
//! best that it has does so at the first request.

use crate::screen::Screen;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// How often the listener looks; nobody notices a delay that short.
const LOOK: Duration = Duration::from_millis(20);

/// The signals that ask for an end, and who sends them.
const REQUESTS: [(i32, &str); 2] = [(SIGINT, "Ctrl-C"), (SIGTERM, "the system or another program (SIGTERM)")];

/// The first request to end, where a command makes something of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct FirstRequest {
    is_heeded: Arc<AtomicBool>,
    came: Arc<AtomicBool>,
}

impl FirstRequest {
    /// From now on the first request sets this flag and ends nothing; the next one ends the program.
    pub(crate) fn heed(&self) -> Arc<AtomicBool> {
        self.is_heeded.store(true, Ordering::Relaxed);
        Arc::clone(&self.came)
    }

    /// Whether a request that has just come is the command's own.
    fn takes(&self) -> bool {
        self.is_heeded.load(Ordering::Relaxed) && !self.came.swap(true, Ordering::Relaxed)
    }
}

/// Listens to Ctrl-C and SIGTERM until the process ends. Work that is under way is not asked to stop: it may be within a long step.
///
/// Where the system lets nobody listen, they end the process as they always do, without a word.
pub(crate) fn listen(screen: Screen, first: FirstRequest) {
    // Position of the request and 1; 0 before there is one.
    let pressed = Arc::new(AtomicUsize::new(0));
    for (k, (signal, _)) in REQUESTS.iter().enumerate() {
        if signal_hook::flag::register_usize(*signal, Arc::clone(&pressed), k + 1).is_err() {
            return;
        }
    }
    std::thread::spawn(move || {
        let (signal, who) = loop {
            match pressed.swap(0, Ordering::Relaxed).checked_sub(1) {
                Some(k) if first.takes() => {
                    let again = if REQUESTS[k].0 == SIGINT { "Ctrl-C again" } else { "a second SIGTERM" };
                    screen.stopping(&format!("stopping with the best so far; {again} ends at once"));
                }
                Some(k) => break REQUESTS[k],
                None => std::thread::sleep(LOOK),
            }
        };
        gpsindy_files::finish_writing();
        screen.interrupted(&format!("stopped by {who}; no file was left half-written"));
        // The shell sees that a signal ended the program.
        if signal_hook::low_level::emulate_default_handler(signal).is_err() {
            std::process::exit(128 + signal);
        }
    });
}

/// A request to end that a command sees to itself: what follows a growing log.
///
/// # Errors
/// The system lets nobody listen.
pub(crate) fn requested() -> std::io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for (signal, _) in REQUESTS {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Lets a file beyond the size that the process may write be an error of that file, which names it; by default it ends the process.
pub(crate) fn outlive_size_limits() {
    #[cfg(unix)]
    // Without a handler the limit ends the process as it always does.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
}
