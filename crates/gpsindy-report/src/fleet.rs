//! The page `fleet.html`: which unit differs, what changed and when, what to randomise; one file, no network, no script.

use crate::chart::{Chart, Mark};
use crate::metadata::metadata;
use crate::words::{effect_name, number, percent, with_unit};
use gpsindy_core::fleet::report::{Change, FleetReport, Odd, Population, Shape, Unit};
use maud::{DOCTYPE, Markup, html};

/// Charts of one kind on the page; more are left to the JSON.
const CHARTS: usize = 24;

/// The whole page as text. Links lead to `tasks/KEY/report.html` beside it.
///
/// ```
/// let page = gpsindy_report::fleet::render(&gpsindy_core::fleet::FleetReport::new());
/// assert!(page.starts_with("<!DOCTYPE html>"));
/// ```
pub fn render(report: &FleetReport) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (metadata("Fleet comparison (gpsindy)"))
            body {
                (head(report))
                main {
                    (odd(report))
                    (changes(report))
                    (populations(report))
                    (units(report))
                }
            }
        }
    };
    page.into_string()
}

fn head(report: &FleetReport) -> Markup {
    let mut names: Vec<&str> = report.units.iter().map(|u| u.unit.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    html! {
        header {
            p.kicker { "One design, many machines" }
            h1 { (names.len()) " unit" (plural(names.len())) " compared" }
            dl.facts {
                div { dt { "Odd units" } dd { (report.odd.len()) } }
                div { dt { "Changes over time" } dd { (report.changes.len()) } }
                div { dt { "Reports" } dd { (report.units.len()) } }
                div { dt { "Failed" } dd { (report.failed.len()) } }
            }
            @for note in &report.notes { p { (note) } }
        }
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// `Coulomb friction in v: c`.
fn name(effect: &str, state: &str, parameter: &str) -> String {
    let place = if state.is_empty() { String::new() } else { format!(" in the equation of {state}") };
    format!("{}{place}: {parameter}", effect_name(effect))
}

fn link(report: &FleetReport, unit: &str) -> Markup {
    let last = report.units.iter().rev().find(|u| u.unit == unit);
    html! { @match last { Some(found) => a href=(format!("tasks/{}/report.html", found.key)) { (unit) }, None => (unit) } }
}

fn odd(report: &FleetReport) -> Markup {
    let row = |odd: &Odd| {
        let unit = unit_of(report, &odd.effect, &odd.state, &odd.parameter);
        html! { tr {
            th scope="row" { (link(report, &odd.unit)) }
            td data-label="size" { (name(&odd.effect, &odd.state, &odd.parameter)) }
            td.n data-label="this unit" { (with_unit(&number(odd.value), unit)) }
            td.n data-label="fleet" { (with_unit(&number(odd.population), unit)) " ± " (number(odd.spread)) }
            td.n data-label="false discovery rate" { (percent(odd.false_discovery_rate)) }
        } }
    };
    html! {
        section {
            h2 { "Which unit differs?" }
            @if report.odd.is_empty() { p { "No unit stands out from the fleet." } } @else {
                p { "The rest of the fleet does not predict these units. At most one in twenty such findings is expected to be false." }
                div.wide { table.stack {
                    thead { tr { th scope="col" { "unit" } th scope="col" { "size" } th.n scope="col" { "this unit" } th.n scope="col" { "fleet, spread" }
                        th.n scope="col" { "false discovery rate" } } }
                    tbody { @for one in &report.odd { (row(one)) } }
                } }
            }
        }
    }
}

fn unit_of<'a>(report: &'a FleetReport, effect: &str, state: &str, parameter: &str) -> &'a str {
    let same =
        |p: &&Population| (p.effect.as_str(), p.state.as_str(), p.parameter.as_str()) == (effect, state, parameter);
    report.population.iter().find(same).map_or("", |p| p.unit.as_str())
}

/// The size of an effect in one unit and period, where it was found.
fn size_of(unit: &Unit, effect: &str, state: &str, parameter: &str) -> Option<f64> {
    let cause = unit.causes.iter().find(|c| c.effect == effect && c.state == state)?;
    cause.sizes.get(parameter).or_else(|| cause.sizes.get("value")).copied()
}

fn changes(report: &FleetReport) -> Markup {
    let row = |change: &Change| {
        let unit = unit_of(report, &change.effect, &change.state, &change.parameter);
        let since = if change.date.is_empty() { format!("day {}", number(change.since)) } else { change.date.clone() };
        html! { tr {
            th scope="row" { (link(report, &change.unit)) }
            td data-label="size" { (name(&change.effect, &change.state, &change.parameter)) }
            td data-label="what" { @if change.shape == Shape::Step { "step" } @else { "drift" } " since " (since) }
            td.n data-label="from" { (with_unit(&number(change.from), unit)) }
            td.n data-label="to" { (with_unit(&number(change.to), unit)) }
            td.n data-label="probability" { (percent(change.probability)) }
        } }
    };
    html! {
        section {
            h2 { "What changed, and when?" }
            @if report.changes.is_empty() { p { "No unit changed beyond what its covariates and the errors of the estimates explain." } } @else {
                div.wide { table.stack {
                    thead { tr { th scope="col" { "unit" } th scope="col" { "size" } th scope="col" { "what" } th.n scope="col" { "from" }
                        th.n scope="col" { "to" } th.n scope="col" { "probability" } } }
                    tbody { @for one in &report.changes { (row(one)) } }
                } }
                div.figures { @for (k, one) in report.changes.iter().take(CHARTS).enumerate() { (history(report, one, k)) } }
            }
        }
    }
}

/// One unit's estimates over its periods.
fn history(report: &FleetReport, change: &Change, id: usize) -> Markup {
    let own = report.units.iter().filter(|u| u.unit == change.unit);
    let values: Vec<f64> = own.filter_map(|u| size_of(u, &change.effect, &change.state, &change.parameter)).collect();
    let places: Vec<f64> = (1..=values.len()).map(|k| k as f64).collect();
    let title = format!("{}: {}", change.unit, name(&change.effect, &change.state, &change.parameter));
    let chart = Chart {
        title: title.clone(),
        description: "One dot per period, in the order of time.".into(),
        x_label: "period".into(),
        y_label: with_unit(&change.parameter, unit_of(report, &change.effect, &change.state, &change.parameter)),
        y_range: range(values.iter().copied().chain([change.from, change.to])),
        marks: vec![Mark::Dots("measured", &places, values.iter().map(|v| Some(*v)).collect())],
        shades: Vec::new(),
    };
    html! { figure { figcaption { (title) } (chart.draw(1000 + id)) } }
}

/// The range of some values with a tenth of room at either end.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.filter(|v| v.is_finite()).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let room = 0.1 * (high - low);
    (low - room, high + room)
}

fn populations(report: &FleetReport) -> Markup {
    let row = |p: &Population| {
        html! { tr {
            th scope="row" { (name(&p.effect, &p.state, &p.parameter)) }
            td.n data-label="units" { (p.units) }
            td.n data-label="mean" { (with_unit(&number(p.mean), &p.unit)) }
            td.n data-label="spread" { (number(p.spread)) }
            td data-label="in the simulator" {
                @match p.randomise {
                    Some((low, high)) => { "draw from " (number(low)) " to " (number(high)) },
                    None => { "one value for all units" },
                }
            }
            td data-label="covariates" { @for slope in &p.covariates { (slope.covariate) ": " (number(slope.value)) " ± " (number(slope.deviation)) br; } }
        } }
    };
    html! {
        section {
            h2 { "What should the simulator randomise?" }
            @if report.population.is_empty() { p { "No effect was found in more than one unit or period." } } @else {
                div.wide { table.stack {
                    thead { tr { th scope="col" { "size" } th.n scope="col" { "units" } th.n scope="col" { "mean" } th.n scope="col" { "spread" }
                        th scope="col" { "in the simulator" } th scope="col" { "per unit of a covariate" } } }
                    tbody { @for one in &report.population { (row(one)) } }
                } }
                div.figures { @for (k, one) in report.population.iter().take(CHARTS).enumerate() { (ranked(one, k)) } }
            }
        }
    }
}

/// The units in the order of their size.
fn ranked(population: &Population, id: usize) -> Markup {
    let mut sorted: Vec<(f64, f64)> = population.estimates.iter().map(|e| (e.value, e.deviation)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<f64> = (1..=sorted.len()).map(|k| k as f64).collect();
    let band: Vec<(f64, f64)> = sorted.iter().map(|(v, d)| (v - 1.96 * d, v + 1.96 * d)).collect();
    let title = name(&population.effect, &population.state, &population.parameter);
    let chart = Chart {
        title: title.clone(),
        description: "One dot per unit, from the smallest to the largest. Band: 95 % interval.".into(),
        x_label: "rank".into(),
        y_label: with_unit(&population.parameter, &population.unit),
        y_range: range(band.iter().flat_map(|(low, high)| [*low, *high])),
        marks: vec![
            Mark::Band("band", &places, band.clone()),
            Mark::Dots("measured", &places, sorted.iter().map(|(v, _)| Some(*v)).collect()),
        ],
        shades: Vec::new(),
    };
    html! { figure { figcaption { (title) } (chart.draw(id)) } }
}

fn units(report: &FleetReport) -> Markup {
    html! {
        section {
            h2 { "Every report" }
            div.wide { table.stack {
                thead { tr { th scope="col" { "unit" } th scope="col" { "since" } th scope="col" { "verdict" } th scope="col" { "causes" }
                    th.n scope="col" { "gap closed" } } }
                tbody { @for unit in &report.units { tr {
                    th scope="row" { a href=(format!("tasks/{}/report.html", unit.key)) { (unit.unit) } }
                    td data-label="since" { (unit.since.as_deref().unwrap_or("")) }
                    td data-label="verdict" { (unit.verdict.replace('_', " ")) }
                    td data-label="causes" { @for cause in &unit.causes { (effect_name(&cause.effect)) " in " (cause.state) br; } }
                    td.n data-label="gap closed" { @if let Some(closed) = unit.closure { (percent(closed)) } }
                } } }
            } }
            @if !report.failed.is_empty() {
                h3 { "Without a report" }
                ul { @for failed in &report.failed { li { (failed.unit) " " (failed.since.as_deref().unwrap_or("")) ": " (failed.error) } } }
            }
        }
    }
}
