//! Every threshold of the diagnosis by its step: its value, what it decides, and why it has that value. Names are unique.
//!
//! Each ends with where the value comes from. "Argument" means that it follows from what is written next to it. "Convention" means
//! that any value near it would do, and that no data set was looked at to find it. "Data" names what was looked at; "development
//! seeds" are those of the generator of random systems in `tests/suite`, 0 to 9,999.
//!
//! Outside of these files there are only guards against rounding and exact mathematics, which stand where they are used, and what
//! defines an effect: its starts, ranges and planted sizes, in its file of the catalogue. `tests/limits.rs` checks all of it.

mod attribute;
pub(crate) mod catalogue;
mod contest;
pub(crate) mod curves;
mod design;
mod detect;
mod fits;
pub(crate) mod floor;
pub(crate) mod forcing;
pub(crate) mod innovations;
pub(crate) mod localise;
mod logs;
mod noise;
mod power;
pub(crate) mod sampling;
pub(crate) mod stability;
pub(crate) mod start;
pub(crate) mod verify;
pub(crate) mod weigh;

pub(crate) use attribute::*;
pub(crate) use contest::*;
pub(crate) use design::*;
pub(crate) use detect::*;
pub(crate) use fits::*;
pub(crate) use logs::*;
pub(crate) use noise::*;
pub(crate) use power::*;
