//! What several commands are given: the simulator, what its file does not say, and what of it the logs lack.

pub(crate) mod measured;
pub(crate) mod nominal;
pub(crate) mod setup;
pub(crate) mod targets;
