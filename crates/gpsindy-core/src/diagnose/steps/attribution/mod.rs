//! From a gap to the effects that explain it: suspects, screening, moves, and what decides between them.

pub(crate) mod attribute;
pub(crate) mod contained;
pub(crate) mod contest;
pub(crate) mod detect;
pub(crate) mod forcing;
pub(crate) mod gross;
pub(crate) mod hold;
pub(crate) mod lengthen;
pub(crate) mod moves;
pub(crate) mod nameless;
pub(crate) mod pairs;
pub(crate) mod places;
pub(crate) mod round;
pub(crate) mod screen;
pub(crate) mod search;
pub(crate) mod settle;
pub(crate) mod simplify;
pub(crate) mod survey;
pub(crate) mod suspects;
