//! A fleet of machines: one diagnosis per unit and period of a manifest, then the comparison.
//!
//! - [`Manifest`]: which logs belong to which unit and period, with which model and covariates
//! - [`Store`]: where results go, a [`Folder`] or another place that keeps files by name
//! - [`Fleet`]: computes the missing tasks, so that a second run resumes the first
//! - [`compare`]: reads the reports and writes `fleet.json` and `fleet.html` next to them
//! - [`Watched`]: a folder to which logs are added, as a manifest of what is whole
//!
//! A task is named by a hash of the model, the logs, the settings and the version. Its report is the same bytes whoever made it, so that any
//! number of processes or machines may share one store.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod date;
mod gather;
mod manifest;
mod run;
mod store;
mod task;
mod watch;

pub use gather::compare;
pub use manifest::Manifest;
pub use run::{Attempt, Fleet, Shard, Summary};
pub use store::{Folder, Store};
pub use task::Task;
pub use watch::{Look, Watched};
