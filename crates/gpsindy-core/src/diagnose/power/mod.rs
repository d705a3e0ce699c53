//! The power study: diagnoses simulated copies of the logs to which an effect was added.

pub(crate) mod copies;
pub(crate) mod settings;
pub(crate) mod study;
pub(crate) mod trial;
