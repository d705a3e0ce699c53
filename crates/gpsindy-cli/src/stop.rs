//! Ctrl-C: the program ends at once, says so, and leaves no file half-written.

use crate::screen::Screen;
use signal_hook::consts::SIGINT;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often the listener looks; nobody notices a delay that short.
const LOOK: Duration = Duration::from_millis(20);

/// Listens to Ctrl-C until the process ends. Work that is under way is not asked to stop: it may be within a long step.
///
/// Where the system lets nobody listen, Ctrl-C ends the process as it always does, without a word.
pub(crate) fn listen(screen: Screen) {
    let pressed = Arc::new(AtomicBool::new(false));
    if signal_hook::flag::register(SIGINT, Arc::clone(&pressed)).is_err() {
        return;
    }
    std::thread::spawn(move || {
        while !pressed.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK);
        }
        gpsindy_files::finish_writing();
        screen.interrupted("stopped by Ctrl-C; no file was left half-written");
        // The shell sees that a signal ended the program.
        if signal_hook::low_level::emulate_default_handler(SIGINT).is_err() {
            std::process::exit(130);
        }
    });
}
