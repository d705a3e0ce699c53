//! Presents a diagnosis: one HTML page, one screenful of text, one score card for an exam.
//!
//! Pure functions of [`gpsindy_core::diagnose::Diagnosis`]: nothing here reads a file or prints.
//!
//! - [`render`]: the page `report.html`, self-contained, for a wide screen, a phone and paper
//! - [`summary`]: what a terminal shows
//! - [`effect_page`], [`effects_index`], [`effect_picture`], [`GalleryCase`]: the pages of docs/effects
//! - [`fleet`]: the page of a whole fleet
//! - [`scorecard`]: an exam's answers against its diagnoses
//! - [`SCHEMA`]: the JSON Schema of `report.json`
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod chart;
mod effects;
mod figures;
pub mod fleet;
mod html;
mod metadata;
mod numbers;
mod pictures;
mod power;
mod provenance;
pub mod scorecard;
mod sets;
mod summary;
mod words;

pub use effects::{GalleryCase, effect_page, effects_index};
pub use html::{render, render_with};
pub use pictures::{EffectPicture, effect_picture};
pub use provenance::{LogFacts, Provenance};
pub use summary::{summary, summary_with};

use gpsindy_core::diagnose::report::Diagnosis;

/// The JSON Schema of `gpsindy.diagnosis/1`, which `report.json` follows.
pub const SCHEMA: &str = include_str!("../diagnosis.schema.json");

/// First line of the corrected model's file.
const MARK: &str = "# Written by gpsindy diagnose";

/// The file `report.json`: the report without the curves of the page, which are no part of the schema's promise.
///
/// # Errors
/// None for a report that the engine made: all of its numbers are finite.
pub fn json(report: &Diagnosis) -> Result<String, serde_json::Error> {
    let bare = Diagnosis { figures: None, ..report.clone() };
    serde_json::to_string_pretty(&bare).map(|text| text + "\n")
}

/// The file `augmented.toml` from the model's own text: a line that says what it is comes first.
pub fn augmented(report: &Diagnosis, model: &str) -> String {
    let what = if report.included().next().is_some() {
        "the nominal model with the causes added"
    } else {
        "the nominal model as it was: no cause is included"
    };
    format!("{MARK}: {what}.\n{model}")
}

/// The file of a simulator that was identified from its logs, which is `model` with a comment that says so.
pub fn simulator(model: &str) -> String {
    format!("{MARK}: the simulator, identified from its logs.\n{model}")
}

/// Every file that some diagnosis writes into the folder of its report.
pub const FILES: [&str; 8] = [
    "report.json",
    "report.html",
    "augmented.toml",
    "augmented.xml",
    "augmented.ssv",
    "randomization.py",
    "simulator.toml",
    "open.json",
];

/// Files of an earlier diagnosis that the `new` ones do not replace: they would be taken for the new one's. `start` is how a file of the
/// folder begins, none where there is no such file.
pub fn stale(new: &[&str], start: impl Fn(&str) -> Option<String>) -> Vec<&'static str> {
    let is_left = |name: &&str| !new.contains(name) && start(name).is_some_and(|start| is_ours(name, &start));
    FILES.into_iter().filter(is_left).collect()
}

/// Whether a file of a report's folder that begins with `start` was written by a diagnosis.
pub fn is_ours(name: &str, start: &str) -> bool {
    match name {
        "report.json" => start.contains("\"gpsindy.diagnosis/"),
        "report.html" => start.contains("content=\"gpsindy\""),
        // Files of engines, in the user's own words but for a comment at the top.
        "augmented.xml" | "augmented.ssv" => start.contains("<!-- gpsindy:"),
        "randomization.py" => start.contains("written by gpsindy"),
        "open.json" => start.contains("\"candidates\""),
        _ => start.starts_with(MARK),
    }
}
