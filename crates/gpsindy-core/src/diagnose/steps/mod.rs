//! The steps of a diagnosis, in the order in which the body takes them.

pub(crate) mod attribute;
pub(crate) mod augment;
pub(crate) mod charge;
pub(crate) mod check;
pub(crate) mod contest;
pub(crate) mod curves;
pub(crate) mod detect;
pub(crate) mod findings;
pub(crate) mod floor;
pub(crate) mod hold;
pub(crate) mod lengthen;
pub(crate) mod localise;
pub(crate) mod noise;
pub(crate) mod places;
pub(crate) mod prepare;
pub(crate) mod refit;
pub(crate) mod round;
pub(crate) mod screen;
pub(crate) mod search;
pub(crate) mod simplify;
pub(crate) mod stability;
pub(crate) mod start;
pub(crate) mod suspects;
pub(crate) mod verify;
pub(crate) mod weigh;
pub(crate) mod windows;
