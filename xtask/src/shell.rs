//! Runs programs from the root of the repository and says which, so that a failure can be repeated by hand.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Runs a program to its end; anything but success is an error that names the command.
pub(crate) fn run<S: AsRef<OsStr>>(
    program: impl AsRef<OsStr>,
    arguments: impl IntoIterator<Item = S>,
    environment: &[(&str, &str)],
) -> Result<(), String> {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(root());
    let mut line = String::new();
    for (name, value) in environment {
        command.env(name, value);
        line += &format!("{name}='{value}' ");
    }
    line += &command.get_program().to_string_lossy();
    for argument in command.get_args() {
        line += " ";
        line += &argument.to_string_lossy();
    }
    complain(&format!("\n$ {line}"));
    let start = Instant::now();
    let status = command.status().map_err(|e| format!("`{line}` did not start: {e}"))?;
    if !status.success() {
        return Err(format!("`{line}` failed ({status})"));
    }
    complain(&format!("  done in {:.0} s", start.elapsed().as_secs_f64()));
    Ok(())
}

/// Writes to stdout; a closed pipe is not an error here.
pub(crate) fn say(text: &str) {
    let _ = std::io::stdout().write_all(text.as_bytes());
}

/// Writes a line to stderr.
pub(crate) fn complain(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}
