//! The readers of logs, one a format, and what they share: messages, the maps to their fields, and stamps.

pub(crate) mod csv_log;
#[cfg(any(feature = "mcap", feature = "ulog"))]
pub(crate) mod mapped;
#[cfg(feature = "mcap")]
pub(crate) mod mcap_log;
#[cfg(any(feature = "mcap", feature = "ulog"))]
pub(crate) mod message;
#[cfg(feature = "parquet")]
pub(crate) mod parquet_log;
#[cfg(any(feature = "mcap", feature = "ulog"))]
pub(crate) mod stamps;
#[cfg(feature = "ulog")]
pub(crate) mod ulog;
