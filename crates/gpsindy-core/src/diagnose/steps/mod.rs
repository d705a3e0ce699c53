//! The steps of a diagnosis, and their parts; docs/architecture.md has their order.

pub(crate) mod attribution;
pub(crate) mod findings;
pub(crate) mod logs;
pub(crate) mod verdict;
