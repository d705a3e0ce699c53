//! A diagnosis for people: one HTML page, one screenful of text, one score card for an exam.
//!
//! Pure functions of [`gpsindy_core::diagnose::Diagnosis`]: nothing here reads a file or prints.
//!
//! - [`render`]: the page `report.html`, self-contained, for a wide screen, a phone and paper
//! - [`summary`]: what a terminal shows
//! - [`scorecard`]: an exam's answers against its diagnoses
//! - [`SCHEMA`]: the JSON Schema of `report.json`
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod chart;
mod figures;
mod html;
mod power;
pub mod scorecard;
mod summary;
mod words;

pub use html::render;
pub use summary::summary;

/// The JSON Schema of `gpsindy.diagnosis/1`, which `report.json` follows.
pub const SCHEMA: &str = include_str!("../diagnosis.schema.json");
