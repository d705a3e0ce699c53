//! `gpsindy completions`: a script that completes commands and options in a shell.

use crate::args::Arguments;
use crate::failure::Outcome;
use crate::screen::Screen;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Generate shell completions
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy completions bash > ~/.local/share/bash-completion/completions/gpsindy")]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

pub(crate) fn run(command: &Completions, screen: &Screen) -> Outcome {
    let mut text = Vec::new();
    clap_complete::generate(command.shell, &mut Arguments::command(), "gpsindy", &mut text);
    screen.out(&String::from_utf8_lossy(&text))
}
