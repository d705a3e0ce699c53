//! The steps of a diagnosis, in the order in which the body takes them.

pub(crate) mod attribute;
pub(crate) mod check;
pub(crate) mod contest;
pub(crate) mod curves;
pub(crate) mod detect;
pub(crate) mod floor;
pub(crate) mod hold;
pub(crate) mod localise;
pub(crate) mod merge;
pub(crate) mod prepare;
pub(crate) mod prune;
pub(crate) mod screen;
pub(crate) mod stability;
pub(crate) mod start;
pub(crate) mod verify;
pub(crate) mod weigh;
