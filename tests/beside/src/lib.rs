//! What tests share: random numbers, and what they need outside the repository: logs of real machines, compilers and interpreters.
//!
//! If something is missing, the test prints a line `skipped: ...` that no test runner hides, and `cargo xtask test` counts these
//! lines at its end. So a passing run reports what it did not test.
#![forbid(unsafe_code)]

pub mod random;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Names the file that collects the skipped tests of a run, one a line.
pub const SKIPPED: &str = "GPSINDY_SKIPPED";

/// Asks the tests of a level for all of their draws; `cargo xtask long levels` sets it.
pub const LEVELS: &str = "GPSINDY_LEVELS";

/// How many seeds a test of a level draws: `few`, or `all` where [`LEVELS`] is set.
pub fn draws(few: u64, all: u64) -> u64 {
    if std::env::var_os(LEVELS).is_some() { all } else { few }
}

/// Most of `count` draws in which what has a chance of `rate` may happen: the mean and two and a half deviations, beyond which one test in a
/// hundred is by chance.
pub fn at_most(rate: f64, count: u64) -> usize {
    let mean = rate * count as f64;
    (mean + 2.5 * (mean * (1.0 - rate)).sqrt()) as usize
}

/// A file or folder of the data next to the repository (`../shared`), by its path there.
///
/// `None` where it is not there: the test is then skipped, and this says so.
pub fn shared(path: &str) -> Option<PathBuf> {
    let found = find(path);
    if found.is_none() {
        skip(&format!("../shared/{path} is not there"));
    }
    found
}

fn find(path: &str) -> Option<PathBuf> {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(path);
    found.exists().then_some(found)
}

/// Whether a program can be started with these arguments (`--version`, say); where not, the test is skipped, and this says so.
pub fn program(name: &str, arguments: &[&str]) -> bool {
    let found = starts(name, arguments);
    if !found {
        skip(&format!("`{name} {}` does not run here", arguments.join(" ")));
    }
    found
}

fn starts(name: &str, arguments: &[&str]) -> bool {
    let started = Command::new(name).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    started.is_ok_and(|status| status.success())
}

/// Says that the test of this thread is skipped.
fn skip(why: &str) {
    let thread = std::thread::current();
    let line = format!("skipped: {why}: {}", thread.name().unwrap_or("a test"));
    // Written past the macros, whose output the runner hides for tests that pass.
    let _ = writeln!(std::io::stderr(), "{line}");
    let Some(path) = std::env::var_os(SKIPPED) else { return };
    let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
    // One write a line, so that lines of several processes do not mix.
    let _ = file.and_then(|mut file| file.write_all(format!("{line}\n").as_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_none_and_no_program() {
        assert_eq!(find("no/such/file"), None);
        assert!(!starts("gpsindy-no-such-program", &["--version"]));
    }

    #[test]
    fn a_program_that_is_there_is_found() {
        assert!(starts("cargo", &["--version"]));
    }
}
