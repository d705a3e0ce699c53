//! Output to the user: results on stdout, progress and warnings on stderr.

use crate::args::Global;
use crate::failure::{Failure, Outcome};
use gpsindy_core::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Seconds between two lines of progress where stderr is no terminal.
const BETWEEN_LINES: f64 = 10.0;

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
        self.clear();
        self.error(text);
    }

    /// What becomes of work that is under way, in place of a progress bar.
    pub(crate) fn stopping(&self, text: &str) {
        self.clear();
        self.line(text);
    }

    /// Takes out the line of a progress bar, where one may be there.
    fn clear(&self) {
        if std::io::stderr().is_terminal() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }

    /// A progress bar on stderr; lines from time to time where stderr is no terminal; nothing with `--quiet`.
    pub(crate) fn progress(&self) -> Bar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
            bar.set_style(style);
        }
        let lines = (!self.quiet && !std::io::stderr().is_terminal()).then(|| Mutex::new(Lines::default()));
        Bar { bar, stage: Mutex::new(String::new()), begun: Instant::now(), lines, enough: None }
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
    /// In place of the bar where stderr is no terminal.
    lines: Option<Mutex<Lines>>,
    enough: Option<Arc<AtomicBool>>,
}

impl Bar {
    /// The work ends with the best that it has as soon as somebody sets this flag.
    pub(crate) fn ending_with(mut self, enough: Arc<AtomicBool>) -> Self {
        self.enough = Some(enough);
        self
    }
}

/// Lines of progress, for logs of a pipeline.
#[derive(Debug, Default)]
struct Lines {
    /// Seconds at the last one.
    last: f64,
}

impl Lines {
    /// The line that is due, if one is.
    fn due(&mut self, stage: &str, done: usize, total: usize, now: f64) -> Option<String> {
        if now < self.last + BETWEEN_LINES {
            return None;
        }
        self.last = now;
        Some(format!("{now:.0} s: {stage}, {done} of {total}"))
    }
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
        let due = |lines: &Mutex<Lines>| {
            let now = self.begun.elapsed().as_secs_f64();
            lines.lock().ok().and_then(|mut lines| lines.due(stage, done, total, now))
        };
        if let Some(line) = self.lines.as_ref().and_then(due) {
            let _ = writeln!(std::io::stderr(), "{line}");
        }
        true
    }

    fn enough(&self) -> Option<Arc<AtomicBool>> {
        self.enough.clone()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_progress_come_from_time_to_time() {
        let mut lines = Lines::default();
        let stated: Vec<Option<String>> =
            [3.0, 12.0, 15.0, 23.0].into_iter().map(|now| lines.due("suspects: fitting", 4, 40, now)).collect();
        let line = |seconds: u32| Some(format!("{seconds} s: suspects: fitting, 4 of 40"));
        assert_eq!(stated, [None, line(12), None, line(23)]);
    }
}
