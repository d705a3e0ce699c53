//! The power study: effects are planted in copies of the logs, withheld, and diagnosed.

pub(crate) mod copies;
pub(crate) mod settings;
pub(crate) mod study;
pub(crate) mod trial;
