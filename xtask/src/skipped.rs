//! Counts the tests that were skipped because a requirement is missing: see `tests/beside`.

use crate::shell;
use std::path::Path;

/// Runs tests with the environment that makes them note what they skip, and says at the end how many did.
pub(crate) fn counted(tests: impl FnOnce(&[(&str, &str)]) -> Result<(), String>) -> Result<(), String> {
    counted_in(&shell::root().join("target/skipped.txt"), tests)
}

fn counted_in(path: &Path, tests: impl FnOnce(&[(&str, &str)]) -> Result<(), String>) -> Result<(), String> {
    if path.exists() {
        std::fs::remove_file(path).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let outcome = tests(&[("GPSINDY_SKIPPED", &path.to_string_lossy())]);
    let noted = std::fs::read_to_string(path).unwrap_or_default();
    shell::complain(&summary(&noted));
    outcome
}

/// How many, and which.
fn summary(noted: &str) -> String {
    let mut lines: Vec<&str> = noted.lines().collect();
    lines.sort_unstable();
    lines.dedup();
    match lines.len() {
        0 => "  no test was skipped".into(),
        1 => format!("  1 test was skipped\n  {}", lines[0]),
        n => format!("  {n} tests were skipped\n  {}", lines.join("\n  ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_tests_are_told_once_each() {
        assert_eq!(summary(""), "  no test was skipped");
        assert_eq!(summary("skipped: a\nskipped: a\n"), "  1 test was skipped\n  skipped: a");
        assert_eq!(summary("skipped: b\nskipped: a\n"), "  2 tests were skipped\n  skipped: a\n  skipped: b");
    }

    #[test]
    fn what_a_test_notes_is_counted() {
        // A file of its own: this test runs among those that are counted.
        let path = std::env::temp_dir().join(format!("gpsindy-skipped-{}", std::process::id()));
        let outcome = counted_in(&path, |environment| {
            assert_eq!(environment, [("GPSINDY_SKIPPED", &*path.to_string_lossy())]);
            Err("failed".into())
        });
        assert_eq!(outcome, Err("failed".into()));
    }
}
