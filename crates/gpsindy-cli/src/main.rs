//! The program `gpsindy`: the library's command line without engines.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(gpsindy_cli::run(std::env::args_os(), &gpsindy_cli::NoEngines))
}
