//! What suspects would gain, by straight lines: responses, bases, gains.

pub(crate) mod basis;
pub(crate) mod bounded;
pub(crate) mod elimination;
pub(crate) mod functions;
pub(crate) mod gains;
pub(crate) mod outs;
pub(crate) mod responses;
