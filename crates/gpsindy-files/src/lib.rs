//! File formats and nothing else: logs as CSV, models as TOML or JSON, results as CSV.
//!
//! Shared by the command line and the Python package; it prints nothing and decides nothing about the method.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod align;
mod constants;
mod effects;
mod error;
mod formats;
mod header;
mod input;
mod inspect;
mod log;
mod logs;
mod map_file;
mod merge;
mod model;
mod near;
mod options;
mod output;
mod stream;
mod table;
mod time;
mod topic;

pub use align::TopicOffset;
pub use effects::{parse_effects, read_effects};
pub use error::{Error, Result, shortened};
pub use header::Header;
pub use inspect::{ClockReport, ColumnReport, Finding, Inspection, TopicReport, inspect};
pub use log::Log;
pub use logs::{Assembled, Logs, Task};
pub use model::{model_to_json, model_to_toml, parse_model, read_model, write_model};
pub use near::{hint, meant};
pub use options::{LogOptions, Offset, Stamp};
pub use output::{finish_writing, start_of, write_together, write_whole};
pub use stream::{Sample, Stream};
pub use table::Table;
