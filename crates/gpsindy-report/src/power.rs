//! The power study for people: which effects these logs could reveal, from what size, and which would be mistaken for others.

use crate::numbers::{number, with_unit};
use crate::words::{effect_name, listed};
use gpsindy_core::diagnose::Effect;
use gpsindy_core::diagnose::report::{PowerEffect, PowerReport, PowerRival};
use maud::{Markup, html};

/// How far an effect would be revealed; the order is that of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Reach {
    /// By name, alone.
    Named,
    /// As a member of a group.
    Grouped,
    /// A gap, but another name or none.
    Seen,
    /// Nothing.
    Hidden,
}

const REACHES: [(Reach, &str); 4] = [
    (Reach::Named, "Would be named"),
    (Reach::Grouped, "Would be named as one of a group"),
    (Reach::Seen, "Would show as a gap, but not by name"),
    (Reach::Hidden, "Would not show"),
];

fn reach(effect: &PowerEffect) -> Reach {
    match (effect.named_from, effect.detected_from) {
        (Some(_), _) if effect.group.is_empty() => Reach::Named,
        (Some(_), _) => Reach::Grouped,
        (None, Some(_)) => Reach::Seen,
        (None, None) => Reach::Hidden,
    }
}

/// `Coulomb friction of v`, `input delay of u`, `wrong parameter m`, `sensor bias of x`.
fn name(effect: &PowerEffect) -> String {
    place(&effect.effect, &effect.state, &effect.variables)
}

fn place(id: &str, state: &str, variables: &[String]) -> String {
    let effect = Effect::from_id(id);
    let on = if variables.is_empty() { state.to_string() } else { variables.join(" and ") };
    let word = if effect == Some(Effect::ParameterError) { "" } else { "of " };
    let name = format!("{} {word}{on}", effect_name(id));
    let is_told_by_name = effect.is_some_and(|e| e.acts_on_input() || e == Effect::ParameterError);
    let is_elsewhere = !variables.is_empty() && !variables.iter().any(|v| v == state) && !is_told_by_name;
    if is_elsewhere { format!("{name} in {state}'") } else { name }
}

fn rival(rival: &PowerRival) -> String {
    if rival.effect == "none" {
        "a gap without a cause".into()
    } else {
        place(&rival.effect, &rival.state, &rival.variables)
    }
}

/// The size from which, as `c = 0.2 m/s^2`; of a saturation the limit below which.
fn size(effect: &PowerEffect, value: f64) -> String {
    let value = with_unit(&number(value), &effect.unit);
    match Effect::from_id(&effect.effect) {
        Some(Effect::ParameterError) => format!("{value} off"),
        Some(known) if known.size_is_a_limit() => format!("{value} down"),
        _ => format!("{} = {value}", effect.parameter),
    }
}

/// How large the gap is at the smallest size that will do, in units of the noise.
fn gap_at(effect: &PowerEffect, value: f64) -> f64 {
    effect.trials.iter().find(|t| t.size == value).map_or(f64::NAN, |t| t.gap_to_noise)
}

fn doubts(effect: &PowerEffect) -> String {
    let group: Vec<String> = effect.group.iter().map(|id| effect_name(id)).collect();
    let mut parts = Vec::new();
    if !group.is_empty() {
        parts.push(format!("indistinguishable from {}", listed(&group, "or")));
    }
    let taken: Vec<String> = effect.confused_with.iter().take(2).map(rival).collect();
    if !taken.is_empty() {
        let when = if effect.named_from.is_some() { "when smaller mistaken for" } else { "mistaken for" };
        parts.push(format!("{when} {}", listed(&taken, "or")));
    }
    if effect.named_from.is_none()
        && effect.trials.is_empty()
        && let Some(limit) = &effect.limit
    {
        parts.push(limit.clone());
    }
    parts.join("; ")
}

fn sorted(report: &PowerReport) -> Vec<(Reach, &PowerEffect)> {
    let mut rows: Vec<(Reach, &PowerEffect)> = report.effects.iter().map(|e| (reach(e), e)).collect();
    // Stable: the catalogue's order within each part.
    rows.sort_by_key(|r| r.0);
    rows
}

fn preface(report: &PowerReport) -> String {
    let null = &report.null;
    let alarms = match null.draws {
        0 => String::new(),
        n => format!(
            " Of {n} copies without any effect {} showed a gap and {} a cause.",
            number(null.alarms as f64),
            number(null.included as f64)
        ),
    };
    format!(
        "Each effect was added to simulated copies of these logs, and the copies were diagnosed without knowing it. Sizes are the smallest of those tried.{alarms}"
    )
}

/// Lines for a terminal: a heading and its text, or a row and nothing.
pub(crate) fn lines(report: &PowerReport) -> Vec<String> {
    let mut lines = vec![preface(report)];
    for (part, title) in REACHES {
        let rows: Vec<&PowerEffect> = sorted(report).into_iter().filter(|r| r.0 == part).map(|r| r.1).collect();
        if rows.is_empty() {
            continue;
        }
        lines.push(format!("{title}:"));
        let width = rows.iter().map(|e| name(e).chars().count()).max().unwrap_or(0).min(40);
        for effect in rows {
            let from = effect.named_from.or(effect.detected_from);
            let from = from.map(|v| format!("from {} ({:.1} x noise)", size(effect, v), gap_at(effect, v)));
            let rest: Vec<String> = from.into_iter().chain([doubts(effect)]).filter(|s| !s.is_empty()).collect();
            lines.push(format!("  {:<width$}  {}", name(effect), rest.join("; ")));
        }
    }
    lines
}

/// The section of the page.
pub(crate) fn section(report: &PowerReport) -> Markup {
    html! {
        section {
            h2 { "What could these logs reveal?" }
            p { (preface(report)) }
            div.wide { table.stack.power {
                thead { tr { th scope="col" { "added effect" } th.n scope="col" { "gap seen from" } th.n scope="col" { "named from" }
                    th scope="col" { "remarks" } } }
                @for (part, title) in REACHES {
                    @let rows: Vec<&PowerEffect> = sorted(report).into_iter().filter(|r| r.0 == part).map(|r| r.1).collect();
                    @if !rows.is_empty() {
                        tbody {
                            tr { th.part colspan="4" scope="rowgroup" { (title) } }
                            @for effect in rows { tr {
                                th scope="row" { (name(effect)) }
                                td.n data-label="gap seen from" { (cell(effect, effect.detected_from)) }
                                td.n data-label="named from" { (cell(effect, effect.named_from)) }
                                td.text data-label="remarks" { (doubts(effect)) }
                            } }
                        }
                    }
                }
            } }
            p.soft { "In brackets: the noise-free error of the nominal model, root mean square, in units of the noise. "
                "An effect counts as named if it, or a group with it, was the first cause in every copy." }
        }
    }
}

fn cell(effect: &PowerEffect, value: Option<f64>) -> Markup {
    html! {
        @match value {
            Some(value) => span { (size(effect, value)) " " span.soft { "(" (format!("{:.1}", gap_at(effect, value))) ")" } }
            None => span { "–" }
        }
    }
}
