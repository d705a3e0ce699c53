//! The command line of gpsindy: parses, runs, prints the error.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod failure;
mod screen;
mod text;

use args::Arguments;
use clap::Parser;
use clap::error::ErrorKind;
use failure::Failure;
use screen::Screen;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    let screen = Screen::new(&arguments.global);
    match commands::run(&arguments, &screen) {
        // Whoever read the output has seen enough.
        Ok(()) | Err(Failure::ClosedPipe) => ExitCode::SUCCESS,
        Err(failure) => {
            screen.error(&failure.to_string());
            ExitCode::from(failure.status())
        }
    }
}

/// Help and version go to stdout and are no error; a wrong usage is one line.
fn refuse(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            ExitCode::from(u8::from(error.use_stderr()) * 2)
        }
        _ => {
            let text = error.render().to_string();
            let lines = text.lines().map(str::trim);
            let told: Vec<&str> = lines
                .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
                .filter(|line| !line.is_empty())
                .collect();
            let message = told.join(" ").replace(" tip: ", "; ");
            Screen::plain().error(&format!("{}; see --help", message.trim_start_matches("error: ")));
            ExitCode::from(2)
        }
    }
}
