//! The command line of gpsindy as a library: one program, which the binary and the Python package both start.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod engine;
mod failure;
mod screen;
mod stop;
mod text;

pub use engine::{Base, Corrected, Driver, Engine, Engines, FileKind, Force, Lock, NoEngines, Setup};

use args::Arguments;
use clap::Parser;
use clap::error::ErrorKind;
use commands::Session;
use failure::Failure;
use screen::Screen;
use std::ffi::OsString;

/// Runs one command line, the program's name first, and gives its exit status: 0 done, 1 the work failed, 2 bad input or
/// usage, 3 a verdict that was asked to fail, 4 some units of a fleet failed.
///
/// Prints results to stdout and the rest to stderr, listens to Ctrl-C, and sets the number of threads of the whole process where
/// the line says one. `engines` opens simulators that are no equations; [`NoEngines`] has none.
///
/// ```no_run
/// let status = gpsindy_cli::run(std::env::args_os(), &gpsindy_cli::NoEngines);
/// assert_eq!(status, 0);
/// ```
pub fn run(line: impl IntoIterator<Item = OsString>, engines: &dyn Engines) -> u8 {
    let line: Vec<OsString> = line.into_iter().collect();
    let arguments = match Arguments::try_parse_from(&line) {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    let screen = Screen::new(&arguments.global);
    let first_request = stop::FirstRequest::default();
    let seed = arguments.global.seed.unwrap_or(0);
    let session = Session { screen, engines, line: &line, seed, first_request: first_request.clone() };
    stop::outlive_size_limits();
    if !commands::ends_by_itself(&arguments.command) {
        stop::listen(screen, first_request);
    }
    match commands::run(&arguments, &session) {
        // Whoever read the output has seen enough.
        Ok(()) | Err(Failure::ClosedPipe) => 0,
        Err(Failure::Exited(status)) => status,
        Err(failure) => {
            screen.error(&failure.to_string());
            failure.status()
        }
    }
}

/// Help and version go to stdout and are no error; a wrong usage is one line.
fn refuse(error: &clap::Error) -> u8 {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            screen::flush();
            u8::from(error.use_stderr()) * 2
        }
        _ => {
            let text = error.render().to_string();
            let lines = text.lines().map(str::trim);
            let stated: Vec<&str> = lines
                .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
                .filter(|line| !line.is_empty())
                .collect();
            let message = stated.join(" ").replace(" tip: ", "; ");
            Screen::plain().error(&format!("{}; see --help", message.trim_start_matches("error: ")));
            2
        }
    }
}
