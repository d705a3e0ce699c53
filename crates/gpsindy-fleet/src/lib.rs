//! A fleet of machines: one diagnosis per unit and period of a manifest, then the comparison.
//!
//! - [`Manifest`]: which logs belong to which unit and period, with which model and covariates
//! - [`Fleet`]: computes the missing tasks below a folder, so that a second run resumes the first
//! - [`compare`]: reads the reports below the folder and writes `fleet.json` and `fleet.html`
//!
//! A task is named by a hash of the model, the logs, the settings and the version. Its report is the same bytes whoever made it, so that any
//! number of processes or machines may share one folder.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod date;
mod gather;
mod manifest;
mod run;
mod task;

pub use gather::compare;
pub use manifest::Manifest;
pub use run::{Attempt, Fleet, Shard, Summary};
pub use task::Task;
