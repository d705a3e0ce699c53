//! `gpsindy man`: the manual pages.

use crate::args::Arguments;
use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::{Args, CommandFactory};
use std::path::PathBuf;

/// Generate manual pages
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy man | man -l -")]
pub(crate) struct Man {
    /// Write one page per command into this existing folder [default: the main page to stdout]
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(command: &Man, screen: &Screen) -> Outcome {
    let top = Arguments::command();
    if let Some(folder) = &command.out {
        if !folder.is_dir() {
            return Err(Failure::input(format!("--out: folder {} does not exist; create it first", folder.display())));
        }
        return clap_mangen::generate_to(top, folder).map_err(|e| Failure::Work(format!("{}: {e}", folder.display())));
    }
    let mut text = Vec::new();
    let rendered = clap_mangen::Man::new(top).render(&mut text);
    rendered.map_err(|e| Failure::Work(format!("manual page: {e}")))?;
    screen.out(&String::from_utf8_lossy(&text))
}
