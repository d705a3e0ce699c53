//! The page `fleet.html`: which unit differs, what changed and when, what to randomise; one file, no network, no script.

use crate::chart::{Chart, Mark};
use crate::metadata::metadata;
use crate::numbers::{number, percent, with_unit};
use crate::words::effect_name;
use gpsindy_core::fleet::report::{Change, FleetReport, Odd, Population, Shape, Unit};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::collections::{BTreeMap, HashSet};

mod history;

/// Charts of one kind on the page; more are left to the JSON.
const CHARTS: usize = 24;

/// Reports that the page lists; a browser stays quick with so many rows.
const LISTED: usize = 2000;

/// What this page needs in addition to the style of all pages: the marks of odd units, and on a narrow screen no labels without a value.
const STYLE: &str = "svg .period { stroke: var(--measured); stroke-width: 5; stroke-linecap: round; opacity: .6; }
svg .error { stroke: var(--measured); stroke-width: 1; }
svg .odd { stroke: var(--bad); stroke-width: 6; stroke-linecap: round; }
@media (max-width: 36rem) { .stack td:empty { display: none !important; } }";

/// The whole page as text. Links lead to `tasks/KEY/report.html` in its folder.
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
                style { (PreEscaped(STYLE)) }
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

/// The unit's name, linked to its latest report.
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
            @if report.units.is_empty() { p { "No unit has a diagnosis." } } @else if report.odd.is_empty() { p { "No unit stands out from the fleet." } } @else {
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

fn population_of<'a>(report: &'a FleetReport, effect: &str, state: &str, parameter: &str) -> Option<&'a Population> {
    let same =
        |p: &&Population| (p.effect.as_str(), p.state.as_str(), p.parameter.as_str()) == (effect, state, parameter);
    report.population.iter().find(same)
}

fn unit_of<'a>(report: &'a FleetReport, effect: &str, state: &str, parameter: &str) -> &'a str {
    population_of(report, effect, state, parameter).map_or("", |p| p.unit.as_str())
}

/// The size of an effect in one unit and period, where it was found, and its standard error.
fn size_of(unit: &Unit, effect: &str, state: &str, parameter: &str) -> Option<(f64, f64)> {
    let cause = unit.causes.iter().find(|c| c.effect == effect && c.state == state)?;
    let of = |values: &BTreeMap<String, f64>| values.get(parameter).or_else(|| values.get("value")).copied();
    Some((of(&cause.sizes)?, of(&cause.errors).unwrap_or(0.0)))
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
            }
            (history::charts(report))
        }
    }
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
            td data-label="covariates" { @for slope in &p.covariates {
                (slope.covariate) ": " (number(slope.value)) " ± " (number(slope.deviation)) @if slope.curve.is_some() { ", bent" } br;
            } }
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
                div.figures { @for (k, one) in report.population.iter().take(CHARTS).enumerate() { (ranked(report, one, k)) } }
            }
        }
    }
}

/// The units in the order of their size, the odd ones marked.
fn ranked(report: &FleetReport, population: &Population, id: usize) -> Markup {
    let is_odd = |unit: &str| {
        let same = |o: &&Odd| {
            (&o.effect, &o.state, &o.parameter) == (&population.effect, &population.state, &population.parameter)
        };
        report.odd.iter().filter(same).any(|o| o.unit == unit)
    };
    let mut sorted: Vec<(f64, f64, bool)> =
        population.estimates.iter().map(|e| (e.value, e.deviation, is_odd(&e.unit))).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<f64> = (1..=sorted.len()).map(|k| k as f64).collect();
    let band: Vec<(f64, f64)> = sorted.iter().map(|(v, d, _)| (v - 1.96 * d, v + 1.96 * d)).collect();
    let dots = |odd: bool| sorted.iter().map(|(v, _, is)| (*is == odd).then_some(*v)).collect();
    let title = name(&population.effect, &population.state, &population.parameter);
    let chart = Chart {
        title: title.clone(),
        description:
            "One dot per unit, from the smallest to the largest; odd units are large and coloured. Band: 95 % interval."
                .into(),
        x_label: format!("rank among {} units", population.estimates.len()),
        y_label: with_unit(&population.parameter, &population.unit),
        y_range: range(band.iter().flat_map(|(low, high)| [*low, *high])),
        marks: vec![
            Mark::Band("band", &places, band.clone()),
            Mark::Dots(if sorted.len() > 60 { "measured" } else { "period" }, &places, dots(false)),
            Mark::Dots("odd", &places, dots(true)),
        ],
        shades: Vec::new(),
    };
    html! { figure { figcaption { (title) } (chart.draw(id)) } }
}

/// How much a report asks to be read: 0 for a unit that stands out, then by verdict.
fn urgency(unit: &Unit, named: &HashSet<&str>) -> u8 {
    match unit.verdict.as_str() {
        _ if named.contains(unit.unit.as_str()) => 0,
        "unexplained" => 1,
        "partly_explained" => 2,
        "explained" => 3,
        _ => 4,
    }
}

fn units(report: &FleetReport) -> Markup {
    let odd = report.odd.iter().map(|o| o.unit.as_str());
    let named: HashSet<&str> = odd.chain(report.changes.iter().map(|c| c.unit.as_str())).collect();
    let mut listed: Vec<&Unit> = report.units.iter().collect();
    listed.sort_by_key(|unit| urgency(unit, &named));
    let has_history = report.units.iter().any(|u| u.since.is_some());
    html! {
        section {
            h2 { "Every report" }
            p { "Units that stand out come first, then those whose gap is not explained." }
            @if listed.len() > LISTED { p { "The first " (LISTED) " of " (listed.len()) "; all of them are in fleet.json." } }
            div.wide { table.stack {
                thead { tr { th scope="col" { "unit" } @if has_history { th scope="col" { "since" } } th scope="col" { "verdict" }
                    th scope="col" { "causes" } th.n scope="col" { "gap closed" } } }
                tbody { @for unit in listed.iter().take(LISTED) { tr {
                    th scope="row" { a href=(format!("tasks/{}/report.html", unit.key)) { (unit.unit) } }
                    @if has_history { td data-label="since" { (unit.since.as_deref().unwrap_or("")) } }
                    td data-label="verdict" { (unit.verdict.replace('_', " ")) }
                    td data-label="causes" { @for cause in &unit.causes { (effect_name(&cause.effect)) " in " (cause.state) br; } }
                    td.n data-label="gap closed" { @if let Some(closed) = unit.closure { (percent(closed)) } }
                } } }
            } }
            @if !report.failed.is_empty() {
                h3 { "Without a report" }
                ul { @for failed in report.failed.iter().take(LISTED) {
                    li { (failed.unit) " " (failed.since.as_deref().unwrap_or("")) ": " (failed.error) }
                } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(name: &str, verdict: &str) -> Unit {
        Unit {
            unit: name.into(),
            since: None,
            day: None,
            verdict: verdict.into(),
            causes: Vec::new(),
            closure: None,
            key: format!("key-{name}"),
            covariates: BTreeMap::new(),
        }
    }

    /// An odd bias.
    pub(super) fn odd(unit: &str) -> Odd {
        Odd {
            unit: unit.into(),
            effect: "bias".into(),
            state: "v".into(),
            parameter: "c".into(),
            value: 2.0,
            population: 1.0,
            spread: 0.1,
            false_discovery_rate: 0.01,
        }
    }

    #[test]
    fn units_that_stand_out_come_first_and_an_empty_column_is_left_out() {
        let mut report = FleetReport::new();
        report.units = vec![unit("calm", "explained"), unit("open", "unexplained"), unit("off", "explained")];
        report.odd = vec![odd("off")];
        let page = render(&report);
        let list = page.split("Every report").nth(1).unwrap();
        let places = ["key-off", "key-open", "key-calm"].map(|key| list.find(key).unwrap());
        assert!(places.is_sorted(), "{places:?}");
        assert!(!list.contains("since"));
        report.units = (0..LISTED + 5).map(|k| unit(&format!("u{k}"), "no_gap")).collect();
        let page = render(&report);
        assert!(page.contains("The first 2000 of 2005") && !page.contains("key-u2000"));
    }
}
