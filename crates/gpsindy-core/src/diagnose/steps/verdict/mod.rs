//! What was found, judged and stated: held-out logs, where the gap lies, causes, checks, the verdict.

pub(crate) mod augment;
pub(crate) mod between;
pub(crate) mod causes;
pub(crate) mod checks;
pub(crate) mod curves;
pub(crate) mod floor;
pub(crate) mod localise;
pub(crate) mod own_size;
pub(crate) mod spread;
pub(crate) mod stability;
pub(crate) mod start;
pub(crate) mod typicality;
pub(crate) mod verify;
pub(crate) mod weigh;
