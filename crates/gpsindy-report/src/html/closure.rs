//! The section of the page on held-out rollouts: how much of the gap the causes close.

use super::{bar, grid};
use crate::figures::{Charts, autocorrelation, left_over, rollout};
use crate::numbers::{number_or, percent_closed, with_unit};
use crate::provenance::Provenance;
use crate::words::closure_sentence;
use gpsindy_core::diagnose::report::{Diagnosis, Figures};
use maud::{Markup, html};

pub(super) fn closure(report: &Diagnosis, provenance: &Provenance, charts: &mut Charts<'_>) -> Markup {
    let closure = &report.closure;
    let has_causes = report.included().next().is_some();
    let none = Figures::default();
    let figures = report.figures.as_ref().unwrap_or(&none);
    let rollouts: Vec<Markup> = figures.rollouts.iter().map(|figure| rollout(figure, charts)).collect();
    let rests: Vec<Markup> = figures.rollouts.iter().map(|figure| left_over(figure, charts)).collect();
    let checks: Vec<Markup> = figures.checks.iter().filter_map(|check| autocorrelation(check, charts)).collect();
    html! {
        section {
            h2 { "How much of it is closed?" }
            p { (closure_sentence(report, provenance.time_unit())) }
            (totals(report))
            @if !closure.by_state.is_empty() {
                h3 { "By logged column" }
                div.wide { table.stack {
                    thead { tr { th scope="col" { "column" } th.n scope="col" { "nominal" }
                        @if has_causes { th.n scope="col" { "augmented" } }
                        th.n scope="col" { "noise floor" } @if has_causes { th.n scope="col" { "closed" } } } }
                    tbody { @for row in &closure.by_state { tr {
                        th scope="row" { code { (row.state) } }
                        (error_cell("nominal", row.before, &row.unit))
                        @if has_causes { (error_cell("augmented", row.after, &row.unit)) }
                        (error_cell("noise floor", row.floor, &row.unit))
                        @if has_causes { td.n data-label="closed" { @if let Some(closed) = row.closed { (percent_closed(closed)) } } }
                    } } }
                } }
            }
            (fits(report))
            @if !rollouts.is_empty() { h3 { "Held-out rollouts" } }
            (grid(rollouts, "more rollouts"))
            @if has_causes && !rests.is_empty() {
                h3 { "Residuals of the augmented model" }
                (grid(rests, "more residuals"))
                (grid(checks, "more columns"))
            }
        }
    }
}

/// The rms error of a column, in its unit.
fn error_cell(label: &str, value: Option<f64>, unit: &str) -> Markup {
    let unit = if value.is_some() { unit } else { "" };
    html! { td.n data-label=(label) { (with_unit(&number_or(value, "diverged"), unit)) } }
}

/// Which share of each column's motion the models follow, run by run.
fn fits(report: &Diagnosis) -> Markup {
    let none = Figures::default();
    let rollouts = &report.figures.as_ref().unwrap_or(&none).rollouts;
    let has_causes = report.included().next().is_some();
    if rollouts.iter().all(|r| r.fit_before.is_none() && r.fit_after.is_none()) {
        return html! {};
    }
    let cell = |fit: Option<f64>| fit.map_or_else(|| "diverged".into(), |fit| format!("{:.0}\u{a0}%", 100.0 * fit));
    html! {
        details {
            summary { "Fit by run and column" }
            div.wide { table {
                thead { tr { th scope="col" { "run" } th scope="col" { "column" } th.n scope="col" { "nominal" }
                    @if has_causes { th.n scope="col" { "augmented" } } } }
                tbody { @for row in rollouts { tr {
                    th scope="row" { (row.run) } td { code { (row.column) } } td.n { (cell(row.fit_before)) }
                    @if has_causes { td.n { (cell(row.fit_after)) } }
                } } }
            } }
            p.soft { "Fit of a rollout: 1 - rms(error)/rms(column - its mean)." }
        }
    }
}

fn totals(report: &Diagnosis) -> Markup {
    let closure = &report.closure;
    let has_causes = report.included().next().is_some();
    let rows = [
        Some(("nominal model", closure.before, "before")),
        has_causes.then_some(("augmented model", closure.after, "after")),
        Some(("noise floor", closure.floor, "floor")),
    ];
    let rows: Vec<_> = rows.into_iter().flatten().collect();
    if rows.iter().all(|(_, value, _)| value.is_none()) {
        return html! {};
    }
    // A rollout that diverged gets the longest bar, and leaves the others visibly shorter.
    let diverged = closure.before.is_none() || closure.after.is_none();
    let largest = rows.iter().filter_map(|(_, value, _)| *value).fold(0.0, f64::max) * if diverged { 3.0 } else { 1.0 };
    let bound = if closure.floor_source == "sensor noise" {
        " Disturbances that no model can predict come on top."
    } else {
        ""
    };
    html! {
        div.wide { table {
            thead { tr { th scope="col" { "held-out rollout error" } th.n scope="col" { "in units of the noise" } th.bars {} } }
            tbody { @for (name, value, class) in rows { tr {
                th scope="row" { (name) }
                td.n { (number_or(value, if class == "floor" { "unknown" } else { "diverged" })) }
                td.bars { @if let Some(value) = value { (bar(value / largest, class)) } @else if class != "floor" { (bar(1.0, class)) } }
            } } }
        } }
        p.soft { "Root mean square over samples and columns, each column's error divided by its noise. "
            "The floor is the error that noise alone causes" @if !closure.floor_source.is_empty() { " (from " (closure.floor_source) ")" } "." (bound)
            " Every rollout starts from the state that the first samples of the log give." }
    }
}
