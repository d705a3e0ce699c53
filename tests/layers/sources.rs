//! The sources of a crate as text.

use std::path::{Path, PathBuf};

/// All sources below a folder.
pub(crate) fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// What stands before the tests at the end of a file.
pub(crate) fn without_tests(text: &str) -> &str {
    text.split("mod tests {").next().unwrap_or_default()
}
