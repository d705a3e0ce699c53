//! The page `report.html`: verdict, location, causes, closure, next steps; one file, no network, no script.

mod closure;
mod parts;

use crate::figures::{Charts, residual_curve, residual_trace, signal};
use crate::metadata::metadata;
use crate::numbers::{number, p_value, percent, percent_closed, span, with_deviation, with_unit};
use crate::provenance::{self, Provenance};
use crate::sets::set_sentence;
use crate::words::{
    cause_name, cause_place, effect_meaning, equivalents, excluded_name, interval, left_sentence, listed,
    parameter_meaning, stability_sentence, verdict_name, verdict_sentence,
};
use closure::closure;
use gpsindy_core::diagnose::report::{Cause, Diagnosis, Figures, Verdict};
use maud::{DOCTYPE, Markup, html};
use parts::{by_joint, by_run};
use std::collections::BTreeSet;

/// Probability below which a cause that is not included is left to the JSON.
const WORTH: f64 = 0.001;

/// Figures of one kind that are open on the page; the others are folded.
const OPEN_FIGURES: usize = 4;

/// Excluded effects that are open on the page; a longer list is folded.
const OPEN_EXCLUDED: usize = 6;

/// The whole page as text: HTML, style and figures in one file that needs no other.
///
/// ```
/// # let json = r#"{"schema": "gpsindy.diagnosis/1", "model": "cart", "runs": {"train": [], "holdout": []},
/// #   "verdict": "no_gap", "gap": {"detected": false, "p_value": 0.4, "by_state": [], "by_region": [], "by_window": []},
/// #   "causes": [], "excluded": [], "unexplained": {"probability": 0.0, "share": 0.0, "depends_on": []},
/// #   "closure": {"metric": "rollout_rmse", "floor_source": "sensor noise", "by_state": []}, "notes": []}"#;
/// let report: gpsindy_core::diagnose::Diagnosis = serde_json::from_str(json)?;
/// assert!(gpsindy_report::render(&report).starts_with("<!DOCTYPE html>"));
/// # Ok::<(), serde_json::Error>(())
/// ```
pub fn render(report: &Diagnosis) -> String {
    render_with(report, &Provenance::default())
}

/// As [`render`], with what the engine does not know: when, by which command and from which files.
pub fn render_with(report: &Diagnosis, provenance: &Provenance) -> String {
    let mut charts = Charts::new(provenance.time_unit());
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (metadata(&format!("{}: {} (gpsindy diagnosis)", report.model, verdict_name(report.verdict))))
            body {
                (head(report))
                main {
                    (place(report, provenance, &mut charts))
                    (causes(report))
                    (closure(report, provenance, &mut charts))
                    (checks(report))
                    @if let Some(power) = &report.power { (crate::power::section(power)) }
                    (next(report))
                    (logs(report, provenance, &mut charts))
                }
                (foot(report, provenance))
            }
        }
    };
    page.into_string()
}

fn head(report: &Diagnosis) -> Markup {
    let (sign, class) = match report.verdict {
        Verdict::NoGap => ("✓", "good"),
        Verdict::Explained => ("●", "good"),
        Verdict::PartlyExplained => ("◐", "part"),
        _ => ("?", "bad"),
    };
    let best = report.included().next();
    html! {
        header {
            p.kicker { "The model " strong { (report.model) } " against its logs" }
            h1 class=(class) { span aria-hidden="true" { (sign) " " } (verdict_name(report.verdict)) }
            p.lead { (verdict_sentence(report)) }
            dl.facts {
                div { dt { "Gap" } dd { @if report.gap.detected { "found" } @else if report.is_undecided() { "not decided" } @else { "none found" } }
                    @if !report.is_undecided() { dd.small { (p_value(report.gap.p_value)) } } }
                @if let Some(cause) = best {
                    div { dt { "First cause" } dd { (percent(cause.probability)) } dd.small { (cause_name(cause)) } }
                }
                @if let Some(closed) = report.closure.closed.filter(|_| best.is_some()) {
                    div { dt { "Gap closed" } dd { (percent_closed(closed)) }
                        @if let (Some(low), Some(high)) = (report.closure.low, report.closure.high) {
                            dd.small { (percent_closed(low)) " to " (percent_closed(high)) " on held-out runs" }
                        }
                    }
                }
                @if report.verdict != Verdict::NoGap && !report.is_undecided() {
                    div { dt { "Unmodelled structure" } dd { (percent(report.unexplained.probability)) } dd.small { "probability" } }
                }
            }
        }
    }
}

/// What must hold of the causes before they are believed.
fn checks(report: &Diagnosis) -> Markup {
    html! {
        @if !report.checks.is_empty() {
            section {
                h2 { "Can the causes be believed?" }
                div.wide { table.stack {
                    thead { tr { th scope="col" { "check" } th scope="col" { "result" } th.n scope="col" { "p-value" } th scope="col" { } } }
                    tbody { @for check in &report.checks { tr {
                        th scope="row" { (check.id.replace('_', " ")) }
                        td { @if check.passed { "passed" } @else { strong { "failed" } } }
                        td.n data-label="p-value" { (check.p_value.map_or(String::new(), p_value)) }
                        td { (check.says) }
                    } } }
                } }
            }
        }
    }
}

/// A bar in a table cell; decoration, the number is next to it.
fn bar(share: f64, class: &str) -> Markup {
    let width = if share.is_finite() { (share * 100.0).clamp(0.0, 100.0) } else { 100.0 };
    html! { span.bar.(class) aria-hidden="true" style=(format!("width:{width:.1}%")) {} }
}

fn place(report: &Diagnosis, provenance: &Provenance, charts: &mut Charts<'_>) -> Markup {
    let gap = &report.gap;
    let none = Figures::default();
    let residuals = &report.figures.as_ref().unwrap_or(&none).residuals;
    let curves: Vec<Markup> = residuals.iter().filter_map(|f| residual_curve(report, f, charts)).collect();
    // The runs with the largest marked windows first; states in the order of the engine.
    let mut traces: Vec<_> = residuals.iter().flat_map(|f| f.traces.iter().map(move |t| (f, t))).collect();
    let marked = |run: &str| gap.by_window.iter().filter(|w| w.run == run).map(|w| w.share).fold(0.0, f64::max);
    traces.sort_by(|a, b| marked(&b.1.run).total_cmp(&marked(&a.1.run)));
    let traces: Vec<Markup> = traces.into_iter().map(|(f, t)| residual_trace(report, f, t, charts)).collect();
    html! {
        section {
            h2 { "Where is the gap?" }
            h3 { "By equation" }
            @if gap.by_state.is_empty() { p { "No equation stands out." } } @else {
                div.wide { table.stack {
                    thead { tr { th scope="col" { "equation" } th.n scope="col" { "share" } th.bars { } th.n scope="col" { "residual (rms)" }
                        th.n scope="col" { "noise (rms)" } th.n scope="col" { "p-value" } } }
                    tbody { @for row in &gap.by_state { tr {
                        th scope="row" { code { (row.state) "'" } }
                        td.n { (percent(row.share)) } td.bars { (bar(row.share, "gap")) }
                        td.n data-label="residual (rms)" { (with_unit(&number(row.residual_rms), &row.unit)) }
                        td.n data-label="noise (rms)" { (with_unit(&number(row.noise_rms), &row.unit)) }
                        td.n data-label="p-value" { (p_value(row.p_value)) }
                    } } }
                } }
            }
            h3 { "By region" }
            @if gap.by_region.is_empty() { p { "The gap is not concentrated in any region of the variables." } } @else {
                div.wide { table {
                    thead { tr { th scope="col" { "equation" } th scope="col" { "region" } th.n scope="col" { "share" } th.bars { } } }
                    tbody { @for row in &gap.by_region { tr {
                        th scope="row" { code { (row.state) "'" } }
                        @let (from, to) = span(row.from, row.to);
                        td { code { (row.variable) } " from " (from) " to " (to) }
                        td.n { (percent(row.share)) } td.bars { (bar(row.share, "gap")) }
                    } } }
                } }
            }
            (grid(curves, "more equations"))
            h3 { "Over time" }
            @if gap.by_window.is_empty() { p { "The gap is not concentrated in any time window." } } @else {
                div.wide { table {
                    thead { tr { th scope="col" { "run" } th.n scope="col" { "time" } th.n scope="col" { "share" } th.bars { } } }
                    tbody { @for row in &gap.by_window { tr {
                        th scope="row" { (row.run) }
                        @let (from, to) = span(row.from, row.to);
                        td.n { (from) " to " (with_unit(&to, provenance.time_unit())) }
                        td.n { (percent(row.share)) } td.bars { (bar(row.share, "gap")) }
                    } } }
                } }
            }
            (grid(traces, "more runs"))
        }
    }
}

/// Figures side by side; those beyond the first few are folded.
fn grid(figures: Vec<Markup>, more: &str) -> Markup {
    let (open, folded) = figures.split_at(figures.len().min(OPEN_FIGURES));
    html! {
        @if !open.is_empty() { div.figures { @for figure in open { (figure) } } }
        @if !folded.is_empty() {
            details { summary { (more) " (" (folded.len()) ")" } div.figures { @for figure in folded { (figure) } } }
        }
    }
}

fn causes(report: &Diagnosis) -> Markup {
    html! {
        section {
            h2 { "Which effect causes it?" }
            @if !report.causes.iter().any(|c| c.included || c.probability >= WORTH) {
                p { @if report.verdict == Verdict::NoGap { "There is no gap, so no cause was searched for." }
                    @else { "No effect of the catalogue is a plausible cause." } }
            } @else {
                ol.causes { @for cause in report.causes.iter().filter(|c| c.included || c.probability >= WORTH) { (one_cause(report, cause)) } }
            }
            @if let Some(set) = set_sentence(report) { p { (set) } }
            (by_joint(report))
            (parameters(report))
            (excluded(report))
        }
    }
}

/// Parameters of the augmented model besides the nominal ones.
fn parameters(report: &Diagnosis) -> Markup {
    if report.parameters.is_empty() {
        return html! {};
    }
    html! {
        h3 { "Parameters" }
        div.wide { table {
            thead { tr { th scope="col" { "parameter" } th.n scope="col" { "nominal" } th.n scope="col" { "fitted" } th scope="col" { "unit" } } }
            tbody { @for row in &report.parameters { tr {
                th scope="row" { code { (row.name) } }
                td.n { @match row.nominal { Some(nominal) => (number(nominal)), None => "new" } }
                td.n { @if row.deviation.is_some() || row.nominal != Some(row.value) { (with_deviation(row.value, row.deviation)) } @else { "unchanged" } }
                td { (row.unit) }
            } } }
        } }
        p.soft { "± is one standard deviation. It accounts for the size and the autocorrelation of the residual." }
    }
}

fn excluded(report: &Diagnosis) -> Markup {
    let given = if report.included().next().is_some() { ", given the causes above" } else { "" };
    let list = html! {
        ul { @for row in &report.excluded { li { (excluded_name(row)) ": not above " (with_unit(&number(row.above), &row.unit)) } } }
    };
    html! {
        @if !report.excluded.is_empty() {
            h3 { "Excluded effects" }
            p.soft { "Each of these effects would have been detected with 95 % probability, had it been larger than stated" (given) "." }
            @if report.excluded.len() > OPEN_EXCLUDED {
                details { summary { (report.excluded.len()) " effects" } (list) }
            } @else { (list) }
        }
    }
}

fn one_cause(report: &Diagnosis, cause: &Cause) -> Markup {
    let class = if cause.included { "included" } else { "" };
    let equivalent = equivalents(cause);
    html! {
        li class=(class) {
            h3 {
                span { (percent(cause.probability)) }
                span { (cause_name(cause)) " " (cause_place(cause)) }
                span.tag { @if cause.included { "included" } @else { "not included" } }
            }
            p.soft { (effect_meaning(&cause.effect)) }
            @if !cause.form.is_empty() { code.equation { (cause.form) } }
            @if !cause.parameters.is_empty() {
                ul { @for parameter in &cause.parameters {
                    @let (value, range) = interval(parameter);
                    li { code { (parameter.name) } (parameter_meaning(cause, parameter)) " = " strong { (with_unit(&value, &parameter.unit)) }
                        @if let Some(range) = range { ", " (percent(report.level())) " interval " (range) } @else { ", no interval" } }
                } }
            }
            @if let Some(stability) = &cause.stability { p { (stability_sentence(stability)) } }
            @for between in &cause.between_runs { (by_run(report, between)) }
            @if !equivalent.is_empty() {
                p { "These logs cannot distinguish it from " (listed(&equivalent, "or")) "." }
            }
        }
    }
}

fn next(report: &Diagnosis) -> Markup {
    let mut experiments: Vec<&Cause> = report.causes.iter().filter(|c| c.next_experiment.is_some()).collect();
    let mut seen = BTreeSet::new();
    experiments.retain(|cause| seen.insert(cause.next_experiment.as_deref()));
    let none = Figures::default();
    let figures = report.figures.as_ref().unwrap_or(&none);
    // Of an engine's file the changed lines say what the call of a simulator can't.
    let difference = &figures.difference;
    let equations: &[_] = if difference.is_empty() { &figures.equations } else { &[] };
    html! {
        section {
            h2 { "What to do next" }
            @if report.included().next().is_some() {
                h3 { "Use the augmented model" }
                @if let Some(file) = &report.augmented_model { p { "It is in " code { (file) } " and takes the place of the nominal model." } }
                @for equation in equations {
                    @if !equation.before.is_empty() { code.equation { span.soft { "nominal   " } (equation.left) " = " (equation.before) } }
                    code.equation { span.soft { "augmented " } (equation.left) " = " (changed(&equation.before, &equation.after)) }
                }
                @if !difference.is_empty() { pre.difference { @for line in difference {
                    @match line.as_bytes().first() {
                        Some(b'+') => ins { (line) },
                        Some(b'-') => del { (line) },
                        _ => (line),
                    }
                    "\n"
                } } }
                @if equations.is_empty() { @for cause in report.included() {
                    code.equation { (cause.state) ": " ins { (cause.form) } }
                } }
            } @else if report.verdict == Verdict::NoGap {
                p { "Keep the model as it is. These logs cannot reveal effects smaller than the excluded sizes." }
            } @else {
                p { "No cause is certain enough to change the model. Look at the residuals above. Record more data where the gap "
                    "is largest, and log quantities there that the model does not have." }
            }
            @if !experiments.is_empty() {
                h3 { "Experiments that would distinguish the causes" }
                ul { @for cause in experiments { li {
                    (cause_name(cause)) @if !cause.equivalent.is_empty() { " or " (listed(&equivalents(cause), "or")) }
                    ": " strong { (cause.next_experiment.as_deref().unwrap_or_default()) }
                } } }
            }
            @if report.verdict != Verdict::NoGap {
                h3 { "Unmodelled structure" }
                p { (left_sentence(report)) }
            }
            @if !report.notes.is_empty() {
                h3 { "Notes" }
                ul { @for note in &report.notes { li { (note) } } }
            }
        }
    }
}

/// The new equation with what was added to the old one marked: all that is not its beginning or its end, in whole words.
fn changed(before: &str, after: &str) -> Markup {
    let mut first = before.chars().zip(after.chars()).take_while(|(a, b)| a == b).count();
    let rest = before.chars().count().min(after.chars().count()) - first;
    let mut last = before.chars().rev().zip(after.chars().rev()).take(rest).take_while(|(a, b)| a == b).count();
    let new: Vec<char> = after.chars().collect();
    let is_of_word = |place: usize| new.get(place).is_some_and(|c| c.is_alphanumeric() || *c == '_');
    while first > 0 && is_of_word(first - 1) && is_of_word(first) {
        first -= 1;
    }
    while last > 0 && is_of_word(new.len() - last) && new.len() > last && is_of_word(new.len() - last - 1) {
        last -= 1;
    }
    let part = |range: std::ops::Range<usize>| new[range].iter().collect::<String>();
    html! { (part(0..first)) ins { (part(first..new.len() - last)) } (part(new.len() - last..new.len())) }
}

/// The data: the files, and the columns as they were logged.
fn logs(report: &Diagnosis, provenance: &Provenance, charts: &mut Charts<'_>) -> Markup {
    let none = Figures::default();
    let signals = &report.figures.as_ref().unwrap_or(&none).signals;
    if signals.is_empty() && provenance.logs.is_empty() {
        return html! {};
    }
    let drawn: Vec<Markup> = signals.iter().map(|s| signal(s, charts)).collect();
    html! {
        section {
            h2 { "Data" }
            (provenance::table(provenance))
            @if !drawn.is_empty() { details { summary { "Signals as logged (" (drawn.len()) ")" } div.figures { @for chart in &drawn { (chart) } } } }
        }
    }
}

fn foot(report: &Diagnosis, provenance: &Provenance) -> Markup {
    let named = |runs: &[String]| if runs.is_empty() { "none".to_string() } else { runs.join(", ") };
    html! {
        footer {
            p { "Fitted on: " (named(&report.runs.train)) ". Validated on held-out runs, which no fit and no selection has seen: " (named(&report.runs.holdout)) "." }
            p { "Shares refer to the squared gap in units of the noise. Probabilities are calibrated on randomly drawn systems: of the causes "
                "stated at 90 %, nine in ten are right. " code { "report.json" } " holds the same numbers (schema " code { (report.schema) } ")." }
            (provenance::line(provenance))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_equation_gained_is_marked_and_the_rest_is_not() {
        let text = |before: &str, after: &str| changed(before, after).into_string();
        assert_eq!(text("u - b*v", "u - b*v - c*sign(v)"), "u - b*v<ins> - c*sign(v)</ins>");
        assert_eq!(text("k*u", "k*(1 + c)*u"), "k*<ins>(1 + c)*</ins>u");
        assert_eq!(text("v", "v"), "v<ins></ins>");
        assert_eq!(text("a*(de - r)", "a*(dead_zone(de, c) - r)"), "a*(<ins>dead_zone(de, c)</ins> - r)");
        assert_eq!(text("a*u", "a*u_late"), "a*<ins>u_late</ins>");
        assert_eq!(text("u", "lag_u"), "<ins>lag_u</ins>");
        assert_eq!(text("", "v - w"), "<ins>v - w</ins>");
    }
}
