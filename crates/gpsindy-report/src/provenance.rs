//! Provenance of a diagnosis, which the engine does not know: date, command, files and the unit of time.

use crate::numbers::{number, with_unit};
use maud::{Markup, html};

/// When, by which command and from which files a diagnosis was made; what is empty is left out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Provenance {
    /// The day, as `2026-11-22`.
    pub date: String,
    /// The program and its version.
    pub version: String,
    /// The command line.
    pub command: String,
    /// The runs, in the order in which they were read.
    pub logs: Vec<LogFacts>,
    /// Unit of the logs' time column; empty: seconds.
    pub time_unit: String,
}

impl Provenance {
    /// Unit of every time on the page.
    pub(crate) fn time_unit(&self) -> &str {
        if self.time_unit.is_empty() { "s" } else { &self.time_unit }
    }
}

/// What a run holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogFacts {
    /// Name of the run.
    pub name: String,
    /// No fit and no choice saw it.
    pub held_out: bool,
    /// How many samples it has.
    pub samples: usize,
    /// From the first to the last sample, in the unit of time.
    pub duration: f64,
}

/// The runs in a table.
pub(crate) fn table(provenance: &Provenance) -> Markup {
    if provenance.logs.is_empty() {
        return html! {};
    }
    html! {
        div.wide { table {
            thead { tr { th scope="col" { "run" } th scope="col" { "part" } th.n scope="col" { "samples" }
                th.n scope="col" { "duration" } th.n scope="col" { "rate" } } }
            tbody { @for log in &provenance.logs { tr {
                th scope="row" { (log.name) }
                td { @if log.held_out { "held out" } @else { "fitted" } }
                td.n { (log.samples) }
                td.n { (with_unit(&number(log.duration), provenance.time_unit())) }
                td.n { @if log.duration > 0.0 { (with_unit(&number((log.samples.max(1) - 1) as f64 / log.duration), &rate_unit(provenance.time_unit()))) } }
            } } }
        } }
    }
}

/// Unit of a sampling rate.
fn rate_unit(time_unit: &str) -> String {
    if time_unit == "s" { "Hz".into() } else { format!("1/{time_unit}") }
}

/// Date, version and command in a line.
pub(crate) fn line(provenance: &Provenance) -> Markup {
    let stated: Vec<&str> =
        [&provenance.date, &provenance.version].into_iter().map(String::as_str).filter(|s| !s.is_empty()).collect();
    html! {
        @if !stated.is_empty() || !provenance.command.is_empty() {
            p { (stated.join(", ")) @if !provenance.command.is_empty() { @if !stated.is_empty() { ": " } code { (provenance.command) } } }
        }
    }
}
