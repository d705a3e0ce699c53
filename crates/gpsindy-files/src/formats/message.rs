//! Messages of a topic: their schema, the path to a field in them, and how their bytes are read.

#[cfg(feature = "mcap")]
pub(crate) mod cdr;
#[cfg(feature = "mcap")]
pub(crate) mod json;
pub(crate) mod kind;
#[cfg(feature = "mcap")]
mod layout;
pub(crate) mod path;
#[cfg(feature = "mcap")]
pub(crate) mod schema;
#[cfg(feature = "mcap")]
pub(crate) mod want;
