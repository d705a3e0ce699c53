//! Messages of a topic: their schema, the path to a field in them, and how their bytes are read.

pub(crate) mod cdr;
pub(crate) mod json;
mod layout;
pub(crate) mod path;
pub(crate) mod schema;
pub(crate) mod want;
