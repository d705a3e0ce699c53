//! File formats and nothing else: logs as CSV, models as TOML or JSON, results as CSV.
//!
//! Shared by the command line and the Python package; it prints nothing and decides nothing about the method.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod effects;
mod error;
mod header;
mod log;
mod logs;
mod model;
mod output;
mod stream;
mod table;

pub use effects::{parse_effects, read_effects};
pub use error::{Error, Result};
pub use header::Header;
pub use log::{Log, LogOptions};
pub use logs::Logs;
pub use model::{model_to_json, model_to_toml, parse_model, read_model, write_model};
pub use output::write_whole;
pub use stream::{Sample, Stream};
pub use table::Table;
