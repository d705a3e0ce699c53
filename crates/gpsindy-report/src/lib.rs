//! A diagnosis for people: one HTML page, one screenful of text, one score card for an exam.
//!
//! Pure functions of [`gpsindy_core::diagnose::Diagnosis`]: nothing here reads a file or prints.
//!
//! - [`render`]: the page `report.html`, self-contained, for a wide screen, a phone and paper
//! - [`summary`]: what a terminal shows
//! - [`fleet`]: the page of a whole fleet
//! - [`scorecard`]: an exam's answers against its diagnoses
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod chart;
mod figures;
pub mod fleet;
mod html;
mod power;
pub mod scorecard;
mod summary;
mod words;

pub use html::render;
pub use summary::summary;
