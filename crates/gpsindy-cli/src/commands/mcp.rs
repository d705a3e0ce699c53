//! `gpsindy mcp`: hands over to the server of the Python package.
//!
//! The protocol and its library live there, so that the program stays lean; assistants still find the server under one name.

use crate::failure::{Failure, Outcome};
use clap::Args;
use std::process::Command;

/// The program that `pip install 'gpsindy[mcp]'` brings.
const SERVER: &str = "gpsindy-mcp";

/// Serve assistants (Model Context Protocol) over standard input and output
///
/// Its tools: inspect, diagnose, explain. It is part of the Python package; this command starts it.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy mcp")]
pub(crate) struct Mcp {}

pub(crate) fn run() -> Outcome {
    let status = Command::new(SERVER).status().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Failure::input(format!(
            "the program {SERVER} was not found; install it with pip install 'gpsindy[mcp]' and put it on the PATH"
        )),
        _ => Failure::Work(format!("{SERVER}: {e}")),
    })?;
    if status.success() { Ok(()) } else { Err(Failure::Work(format!("{SERVER} ended with {status}"))) }
}
