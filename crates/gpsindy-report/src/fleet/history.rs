//! Small charts of single units over time: one for every change, then one for every odd unit that has a history.

use super::{CHARTS, link, name, population_of, range, size_of};
use crate::chart::{Chart, Mark};
use crate::numbers::with_unit;
use gpsindy_core::fleet::report::{Change, FleetReport, Odd, Population, Shape, Unit};
use maud::{Markup, html};

/// Standard errors on either side of an estimate: 95 %.
const INTERVAL: f64 = 1.96;

/// Number of the first chart: below it are those of the populations.
const FIRST: usize = 1000;

/// A size of a unit over its periods.
struct History<'a> {
    unit: &'a str,
    effect: &'a str,
    state: &'a str,
    parameter: &'a str,
    change: Option<&'a Change>,
    /// A number that no other chart of the page has.
    id: usize,
}

/// The charts, the changes first and then the odd units, in the order of the tables.
pub(super) fn charts(report: &FleetReport) -> Markup {
    let changed = (FIRST..).zip(&report.changes).map(|(id, change)| {
        let Change { unit, effect, state, parameter, .. } = change;
        History { unit, effect, state, parameter, change: Some(change), id }
    });
    let odd = (FIRST + report.changes.len()..).zip(&report.odd).map(|(id, odd)| {
        let Odd { unit, effect, state, parameter, .. } = odd;
        History { unit, effect, state, parameter, change: None, id }
    });
    let odd = odd.filter(|o| !report.changes.iter().any(|change| o.is_of(change)));
    let drawn: Vec<Markup> = changed.chain(odd).filter_map(|history| history.figure(report)).take(CHARTS).collect();
    html! { @if !drawn.is_empty() { div.figures { @for figure in drawn { (figure) } } } }
}

impl History<'_> {
    fn is_of(&self, change: &Change) -> bool {
        let Change { unit, effect, state, parameter, .. } = change;
        (self.unit, self.effect, self.state, self.parameter) == (unit, effect, state, parameter)
    }

    /// Day, size at the fleet's mean covariates, and standard error of every period in which the size was found.
    fn periods(&self, report: &FleetReport, population: Option<&Population>) -> Vec<(f64, f64, f64)> {
        let one = |u: &Unit| {
            let slopes = population.iter().flat_map(|p| &p.covariates);
            let moved: f64 = slopes.filter_map(|slope| Some(slope.effect(*u.covariates.get(&slope.covariate)?))).sum();
            let (size, error) = size_of(u, self.effect, self.state, self.parameter)?;
            Some((u.day?, size - moved, error))
        };
        let mut periods: Vec<_> = report.units.iter().filter(|u| u.unit == self.unit).filter_map(one).collect();
        periods.sort_by(|a, b| a.0.total_cmp(&b.0));
        periods
    }

    /// None for a unit without a history.
    fn figure(&self, report: &FleetReport) -> Option<Markup> {
        let population = population_of(report, self.effect, self.state, self.parameter);
        let periods = self.periods(report, population);
        let (first, last) = (periods.first()?.0, periods.last()?.0);
        if last <= first {
            return None;
        }
        let days: Vec<f64> = periods.iter().map(|p| p.0 - first).collect();
        // A stroke from the low end to the high one, and a gap before the next.
        let at: Vec<f64> = days.iter().flat_map(|&day| [day; 3]).collect();
        let ends =
            |&(_, size, error): &(f64, f64, f64)| [Some(size - INTERVAL * error), Some(size + INTERVAL * error), None];
        let ends: Vec<Option<f64>> = periods.iter().flat_map(ends).collect();
        let levels = self.change.iter().flat_map(|c| [c.from, c.to]).chain(population.map(|p| p.mean));
        let y_range = range(ends.iter().flatten().copied().chain(levels));
        let inside = |day: f64| (day - first).clamp(0.0, last - first);
        let when = self.change.map(|c| [inside(c.interval.0), inside(c.interval.1)]);
        let path = self.change.map(|c| {
            let day = inside(c.since);
            match c.shape {
                Shape::Step => (vec![0.0, day, day, last - first], vec![c.from, c.from, c.to, c.to]),
                _ => (vec![0.0, day, last - first], vec![c.from, c.from, c.to]),
            }
        });
        let whole = [0.0, last - first];
        let mut marks = Vec::new();
        marks.extend(when.as_ref().map(|days| Mark::Band("band", days, vec![y_range; 2])));
        marks.extend(population.map(|p| Mark::Line("before", &whole, vec![Some(p.mean); 2])));
        marks.push(Mark::Line("error", &at, ends));
        marks.push(Mark::Dots("period", &days, periods.iter().map(|p| Some(p.1)).collect()));
        marks.extend(path.as_ref().map(|(x, y)| Mark::Line("after", x, y.iter().copied().map(Some).collect())));
        let about = name(self.effect, self.state, self.parameter);
        let stated =
            if self.change.is_some() { " Solid line: the change. Band: 90 % interval of its day." } else { "" };
        let begun = report.units.iter().find(|u| u.unit == self.unit && u.day == Some(first));
        let since = begun.and_then(|u| u.since.as_deref()).unwrap_or("the first period");
        let chart = Chart {
            title: format!("{}: {about}", self.unit),
            description: format!(
                "One dot per period with its 95 % interval, at the mean covariates of the fleet. Broken line: mean of the fleet.{stated}"
            ),
            x_label: if since.parse::<f64>().is_ok() {
                format!("days since day {since}")
            } else {
                format!("days since {since}")
            },
            y_label: with_unit(self.parameter, population.map_or("", |p| p.unit.as_str())),
            y_range,
            marks,
            shades: Vec::new(),
        };
        Some(html! { figure { figcaption { (link(report, self.unit)) ": " (about) } (chart.draw(self.id)) } })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::odd;
    use super::*;
    use gpsindy_core::fleet::report::UnitCause;
    use std::collections::BTreeMap;

    #[test]
    fn a_change_and_an_odd_unit_are_drawn_against_the_day_with_their_intervals() {
        let size = |value: f64| BTreeMap::from([("c".to_string(), value)]);
        let period = |unit: &str, day: f64| Unit {
            unit: unit.into(),
            since: Some(format!("2026-01-{:02}", day + 1.0)),
            day: Some(day),
            verdict: "explained".into(),
            causes: vec![UnitCause {
                effect: "bias".into(),
                state: "v".into(),
                probability: 1.0,
                sizes: size(1.0 + day),
                errors: size(0.1),
            }],
            closure: None,
            key: format!("{unit}-{day}"),
            covariates: BTreeMap::new(),
        };
        let mut report = FleetReport::new();
        report.units = ["a", "b", "c"].iter().flat_map(|unit| [0.0, 2.0, 9.0].map(|day| period(unit, day))).collect();
        report.changes = vec![Change {
            unit: "a".into(),
            effect: "bias".into(),
            state: "v".into(),
            parameter: "c".into(),
            shape: Shape::Step,
            since: 4.0,
            date: "2026-01-05".into(),
            interval: (3.0, 5.0),
            from: 1.0,
            to: 10.0,
            probability: 1.0,
            held: Vec::new(),
        }];
        report.odd = vec![odd("a"), odd("b")];
        let page = charts(&report).into_string();
        assert_eq!(page.matches("<svg viewBox=\"0 0 440").count(), 2, "{page}");
        assert!(page.contains("tasks/a-9/report.html") && page.contains("tasks/b-9/report.html"), "{page}");
        assert_eq!(page.matches("class=\"band\"").count(), 1);
        assert_eq!(page.matches("class=\"error\"").count(), 2);
        assert!(page.contains("days since 2026-01-01"), "{page}");
        assert!(page.contains("chart1000-title") && page.contains("chart1002-title"), "{page}");
        // Without days there is nothing to draw against.
        report.units.iter_mut().for_each(|unit| unit.day = None);
        assert!(charts(&report).into_string().is_empty());
    }
}
