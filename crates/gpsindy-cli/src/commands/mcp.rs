//! `gpsindy mcp`: hands over to the server of the Python package.
//!
//! The protocol and its library live there, so that the program stays lean; assistants still find the server under one name.

use crate::failure::{Failure, Outcome};
use clap::Args;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program that `pip install 'gpsindy[mcp]'` brings.
const SERVER: &str = "gpsindy-mcp";

/// Serve assistants (Model Context Protocol) over standard input and output
///
/// Its tools: inspect, diagnose, explain. It reads and writes in the folders that are named here and nowhere else. It is part of the Python
/// package; this command starts it.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy mcp ~/robot/logs")]
pub(crate) struct Mcp {
    /// Folders that the server may read from and write to [default: the one it is started in]
    #[arg(value_name = "FOLDER")]
    folders: Vec<PathBuf>,
}

pub(crate) fn run(command: &Mcp, line: &[OsString]) -> Outcome {
    // The program's own place, as it was called and as the system knows it: a Python package's command is a script of an interpreter.
    let places = line.first().map(PathBuf::from).into_iter().chain(std::env::current_exe().ok());
    let program = places.filter_map(|place| beside(&place)).next().unwrap_or_else(|| SERVER.into());
    let status = Command::new(&program).args(&command.folders).status().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Failure::input(format!(
            "the program {SERVER} was not found; install it with pip install 'gpsindy[mcp]' and put it on the PATH"
        )),
        _ => Failure::Work(format!("{}: {e}", program.display())),
    })?;
    match status.code().and_then(|code| u8::try_from(code).ok()) {
        Some(0) => Ok(()),
        // It has said why.
        Some(code) => Err(Failure::Exited(code)),
        None => Err(Failure::Work(format!("{SERVER} ended with {status}"))),
    }
}

/// The server in the folder of a program; none where it is not there, or the program was called by its name alone.
fn beside(program: &Path) -> Option<PathBuf> {
    let folder = program.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    let server = folder.join(format!("{SERVER}{}", std::env::consts::EXE_SUFFIX));
    server.is_file().then_some(server)
}
