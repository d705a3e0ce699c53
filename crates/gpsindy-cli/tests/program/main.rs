//! The program as a user runs it, a module a command or a promise: one binary, since each test binary is linked on its own.
#![allow(clippy::unwrap_used)]

mod common;
mod demo;
mod design;
mod diagnose;
mod drive;
mod exam;
mod export;
mod fleet;
mod follow;
mod friction;
mod identify;
mod inspect;
mod out;
mod score;
mod shipped;
mod simulate;
mod smooth;
mod stop;
mod usage;
mod withheld;
