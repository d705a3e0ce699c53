//! The diagnosis of the gap between a simulator and the logs of the machine.

pub mod report;

pub use report::{Diagnosis, Verdict};
