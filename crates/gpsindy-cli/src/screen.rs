//! Output to the user: results on stdout, progress and warnings on stderr.

use crate::args::Global;
use crate::failure::{Failure, Outcome};
use gpsindy_core::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::Mutex;
use std::time::Instant;

/// Where and how to print.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Screen {
    json: bool,
    quiet: bool,
    colour: bool,
}

impl Screen {
    pub(crate) fn new(global: &Global) -> Self {
        Self { json: global.json, quiet: global.quiet, ..Self::plain() }
    }

    /// A screen before any option is known.
    pub(crate) fn plain() -> Self {
        let wanted = std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        Self { json: false, quiet: false, colour: wanted && !dumb }
    }

    /// Whether the result is wanted as JSON.
    pub(crate) fn json(&self) -> bool {
        self.json
    }

    /// The same screen without notes.
    pub(crate) fn quietly(&self) -> Self {
        Self { quiet: true, ..*self }
    }

    /// Whether colours can be seen on stdout.
    pub(crate) fn colour(&self) -> bool {
        self.colour && std::io::stdout().is_terminal()
    }

    /// Width of the terminal in characters; 100 where stdout is none.
    pub(crate) fn width(&self) -> usize {
        let size = if std::io::stdout().is_terminal() { terminal_size::terminal_size() } else { None };
        size.map_or(100, |(width, _)| usize::from(width.0).clamp(40, 110))
    }

    /// Writes a result to stdout.
    pub(crate) fn out(&self, text: &str) -> Outcome {
        let mut stdout = std::io::stdout().lock();
        let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
        written.map_err(|e| match e.kind() {
            ErrorKind::BrokenPipe => Failure::ClosedPipe,
            _ => Failure::Work(format!("stdout: {e}")),
        })
    }

    /// Something to know, on stderr; `--quiet` drops it.
    pub(crate) fn note(&self, text: &str) {
        if !self.quiet {
            self.line(text);
        }
    }

    /// What was asked for besides the result, on stderr.
    pub(crate) fn say(&self, text: &str) {
        self.line(text);
    }

    /// Something that is likely wrong, on stderr.
    pub(crate) fn warn(&self, text: &str) {
        self.line(&format!("{} {text}", self.painted("33", "warning:", std::io::stderr().is_terminal())));
    }

    /// The cause of a failure, on stderr.
    pub(crate) fn error(&self, text: &str) {
        self.line(&format!("{} {text}", self.painted("1;31", "error:", std::io::stderr().is_terminal())));
    }

    /// The last word before the process ends in the middle of its work: in place of a progress bar, which may be there.
    pub(crate) fn interrupted(&self, text: &str) {
        if std::io::stderr().is_terminal() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
        self.error(text);
    }

    /// A progress bar on stderr, hidden with `--quiet` and where stderr is no terminal.
    pub(crate) fn progress(&self) -> Bar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
            bar.set_style(style);
        }
        Bar { bar, stage: Mutex::new(String::new()), begun: Instant::now() }
    }

    fn line(&self, text: &str) {
        // Nothing sensible can be done when stderr is closed.
        let _ = writeln!(std::io::stderr(), "{text}");
    }

    fn painted(&self, code: &str, text: &str, terminal: bool) -> String {
        if self.colour && terminal { format!("\x1b[{code}m{text}\x1b[0m") } else { text.into() }
    }
}

/// Writes out what was printed: a host that ends without Rust's own end of program would lose it.
pub(crate) fn flush() {
    let _ = std::io::stdout().flush();
}

/// A progress bar that the library reports to.
#[derive(Debug)]
pub(crate) struct Bar {
    bar: ProgressBar,
    stage: Mutex<String>,
    begun: Instant,
}

impl Progress for Bar {
    fn report(&self, stage: &str, done: usize, total: usize) -> bool {
        if let Ok(mut shown) = self.stage.lock()
            && *shown != stage
        {
            *shown = stage.into();
            self.bar.set_message(stage.to_string());
        }
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        true
    }

    fn seconds(&self) -> Option<f64> {
        Some(self.begun.elapsed().as_secs_f64())
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
