//! Sizes by run, and findings by joint.

use crate::numbers::{percent, with_unit};
use crate::words::{between_sentence, interval, size_of};
use gpsindy_core::diagnose::report::{BetweenRuns, Diagnosis};
use maud::{Markup, html};

/// A size by run, and pooled.
pub(super) fn by_run(report: &Diagnosis, between: &BetweenRuns) -> Markup {
    let row = |value, low, high| {
        let (value, range) = interval(&size_of(between, value, low, high));
        (with_unit(&value, &between.unit), range.unwrap_or_default())
    };
    html! {
        p { (between_sentence(between)) }
        div.wide { table {
            thead { tr { th scope="col" { "run" } th.n scope="col" { code { (between.parameter) } }
                th.n scope="col" { (percent(report.level())) " interval" } } }
            tbody {
                @for run in &between.runs {
                    @let (value, range) = row(run.value, run.low, run.high);
                    tr { th scope="row" { (run.run) } td.n { (value) } td.n { (range) } }
                }
                @let (value, range) = row(between.pooled, between.low, between.high);
                tr { th scope="row" { strong { "pooled" } } td.n { strong { (value) } } td.n { (range) } }
            }
        } }
    }
}

/// What was found, joint by joint.
pub(super) fn by_joint(report: &Diagnosis) -> Markup {
    html! {
        @if !report.by_part.is_empty() {
            h3 { "By joint" }
            div.wide { table {
                tbody { @for row in &report.by_part { tr { th scope="row" { (row.part) } td { (row.says) } } } }
            } }
        }
    }
}
