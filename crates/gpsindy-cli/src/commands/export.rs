//! `gpsindy export`: a model as source code or LaTeX.

use crate::args::Output;
use crate::commands::{check_out, deliver};
use crate::failure::Outcome;
use crate::screen::Screen;
use clap::Args;
use clap::builder::PossibleValuesParser;
use gpsindy_core::{Export as Source, Language};
use gpsindy_files::read_model;
use serde_json::json;
use std::path::PathBuf;

/// Export a model as source code or LaTeX
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy export model.toml --to c --out model.c")]
pub(crate) struct Export {
    /// The model (TOML or JSON); `-` is standard input
    model: PathBuf,
    /// Target language
    #[arg(long, value_name = "LANGUAGE", value_parser = PossibleValuesParser::new(Language::ALL.map(Language::name)))]
    to: String,
    /// Write all digits of the numbers in LaTeX instead of six; source code always has all
    #[arg(long)]
    full_digits: bool,
    #[command(flatten)]
    output: Output,
}

pub(crate) fn run(command: &Export, screen: &Screen) -> Outcome {
    check_out(command.output.out.as_deref(), [&command.model])?;
    let model = read_model(&command.model)?;
    let source = Source { full_digits: command.full_digits }.write(&model, Language::parse(&command.to)?)?;
    if screen.json() {
        let result = json!({"model": model.name, "language": command.to, "source": source});
        return deliver(&command.output, &format!("{result}\n"), screen);
    }
    deliver(&command.output, &source, screen)
}
