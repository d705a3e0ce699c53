//! Where a result goes, and what it must not replace.

use crate::args::{Columns, Output};
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use same_file::Handle;
use std::path::{Path, PathBuf};

/// What the folder of a data set or a bag is read from.
const READ_IN_FOLDERS: &[&str] = &["json", "jsonl", "mcap", "parquet"];

/// Writes a result to the file of `--out`, else to stdout.
pub(super) fn deliver(output: &Output, text: &str, screen: &Screen) -> Outcome {
    match &output.out {
        None => screen.out(text),
        Some(path) => Ok(gpsindy_files::write_whole(path, text.as_bytes())?),
    }
}

/// Refuses, before the work begins, an output whose folder is not there, that is a folder, or that is one of the `inputs`.
pub(super) fn check_out<'a>(out: Option<&Path>, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Outcome {
    let Some(out) = out else { return Ok(()) };
    if let Some(parent) = out.parent().filter(|parent| !parent.as_os_str().is_empty() && !parent.is_dir()) {
        return Err(Failure::input(format!("--out: folder {} does not exist; create it first", parent.display())));
    }
    if out.is_dir() {
        return Err(Failure::input(format!("--out: {} is a folder; name a file", out.display())));
    }
    refuse_input(out, inputs)
}

/// Refuses an output that is a file which the command reads.
pub(super) fn refuse_input<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Outcome {
    // What is no regular file, such as a terminal, may be both.
    if !out.is_file() {
        return Ok(());
    }
    let Ok(target) = Handle::from_path(out) else { return Ok(()) };
    for input in inputs {
        let is_same = match input.as_os_str() == "-" {
            true => Handle::stdin().is_ok_and(|stdin| stdin == target),
            false => Handle::from_path(input).is_ok_and(|input| input == target) || is_read_in(input, out),
        };
        if is_same {
            return Err(Failure::input(format!("--out: {} is an input; name another file", out.display())));
        }
    }
    Ok(())
}

/// Whether a file is part of a data set that is read as a folder.
fn is_read_in(folder: &Path, file: &Path) -> bool {
    folder.is_dir()
        && file.extension().is_some_and(|extension| READ_IN_FOLDERS.iter().any(|read| extension == *read))
        && folder.canonicalize().is_ok_and(|folder| file.canonicalize().is_ok_and(|file| file.starts_with(folder)))
}

impl Columns {
    /// The files that these options read.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.map_file.iter()
    }
}
