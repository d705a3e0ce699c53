//! The figures of the page: residuals of the equations, held-out rollouts and their residuals, signals as logged.

use crate::chart::{Chart, Mark};
use crate::numbers::with_unit;
use gpsindy_core::diagnose::report::{
    Diagnosis, ResidualCheck, ResidualFigure, ResidualTrace, RolloutFigure, SignalFigure,
};
use maud::{Markup, html};

/// What the charts of a page share: a running number and the unit of time.
pub(crate) struct Charts<'a> {
    drawn: usize,
    time_unit: &'a str,
}

impl<'a> Charts<'a> {
    pub(crate) fn new(time_unit: &'a str) -> Self {
        Self { drawn: 0, time_unit }
    }

    fn next(&mut self) -> usize {
        self.drawn += 1;
        self.drawn
    }

    fn time_label(&self) -> String {
        format!("t ({})", self.time_unit)
    }
}

/// Residual against the variable that it depends on most, with the regions of the gap shaded.
pub(crate) fn residual_curve(report: &Diagnosis, figure: &ResidualFigure, charts: &mut Charts<'_>) -> Option<Markup> {
    let curve = figure.curve.as_ref().filter(|curve| !curve.x.is_empty())?;
    let shades: Vec<_> = report
        .gap
        .by_region
        .iter()
        .filter(|region| region.state == figure.state && region.variable == curve.variable)
        .map(|region| (region.from, region.to, region.share))
        .collect();
    let band: Vec<_> = curve.y.iter().zip(&curve.band).map(|(y, half)| (y - half, y + half)).collect();
    let mut y_range = limits(band.iter().flat_map(|(low, high)| [*low, *high]).chain([0.0]));
    let mut marks = vec![Mark::Band("band", &curve.x, band), Mark::Line("residual", &curve.x, present(&curve.y))];
    if !curve.explained.is_empty() {
        y_range = limits(curve.explained.iter().copied().chain([y_range.0, y_range.1]));
        marks.push(Mark::Line("after", &curve.x, present(&curve.explained)));
    }
    let chart = Chart {
        title: format!("Residual of the equation of {} against {}", figure.state, curve.variable),
        description:
            "Line and band: residual of the equation with its 95 % band. Shaded: the regions with most of the gap."
                .into(),
        x_label: axis(&curve.variable, &curve.unit),
        y_label: axis(&format!("residual of {}'", figure.state), &figure.unit),
        marks,
        shades,
        y_range: padded(y_range),
    };
    let gap = (!chart.shades.is_empty()).then_some(("gap", "region of the gap"));
    let explained = (!curve.explained.is_empty()).then_some(("after", "included causes"));
    let legend = [Some(("residual", "residual, with 95 % band")), explained, gap];
    Some(framed(
        html! { "Residual of the equation of " (figure.state) " against " (curve.variable) },
        chart.draw(charts.next()),
        legend.into_iter().flatten(),
    ))
}

/// Residual over the time of one run, with the windows of the gap shaded.
pub(crate) fn residual_trace(
    report: &Diagnosis,
    figure: &ResidualFigure,
    trace: &ResidualTrace,
    charts: &mut Charts<'_>,
) -> Markup {
    let windows = report.gap.by_window.iter().filter(|window| window.run == trace.run);
    let shades: Vec<_> = windows.map(|window| (window.from, window.to, window.share)).collect();
    let band: Vec<_> = trace.y.iter().zip(&trace.band).map(|(y, half)| (y - half, y + half)).collect();
    let y_range = limits(band.iter().flat_map(|(low, high)| [*low, *high]).chain([0.0]));
    let marks = vec![Mark::Band("band", &trace.time, band), Mark::Line("residual", &trace.time, present(&trace.y))];
    let chart = Chart {
        title: format!("Residual of the equation of {} over time, run {}", figure.state, trace.run),
        description: format!(
            "Residual with its 95 % band. Shaded: {} time windows with most of the gap.",
            shades.len()
        ),
        x_label: charts.time_label(),
        y_label: axis(&format!("residual of {}'", figure.state), &figure.unit),
        marks,
        shades,
        y_range: padded(y_range),
    };
    let gap = (!chart.shades.is_empty()).then_some(("gap", "window of the gap"));
    framed(
        html! { "Run " (trace.run) ", equation of " (figure.state) },
        chart.draw(charts.next()),
        [Some(("residual", "residual, with 95 % band")), gap].into_iter().flatten(),
    )
}

/// A held-out log and both rollouts.
pub(crate) fn rollout(figure: &RolloutFigure, charts: &mut Charts<'_>) -> Markup {
    // The log lies under the models as a broad line, so that it shows where they cover it.
    let mut marks = vec![
        Mark::Line("log", &figure.time, figure.measured.clone()),
        Mark::Dots("measured", &figure.time, figure.measured.clone()),
    ];
    let mut legend = vec![("measured", "measured"), ("before", "nominal model")];
    marks.push(Mark::Line("before", &figure.time, figure.before.clone()));
    if !figure.after.is_empty() {
        marks.push(Mark::Line("after", &figure.time, figure.after.clone()));
        legend.push(("after", "augmented model"));
    }
    let ended = diverged(&figure.before, &figure.time)
        .map(|t| format!(" The nominal rollout diverges at t = {t:.2} {}.", charts.time_unit))
        .unwrap_or_default();
    let solid = if figure.after.is_empty() { "" } else { " Solid: of the augmented one." };
    let chart = Chart {
        title: format!("{} in held-out run {}", figure.column, figure.run),
        description: format!("Dots: the log. Dashed: rollout of the nominal model.{solid}{ended}"),
        x_label: charts.time_label(),
        y_label: axis(&figure.column, &figure.unit),
        marks,
        shades: Vec::new(),
        y_range: rollout_range(figure),
    };
    framed(html! { (figure.column) ", run " (figure.run) }, chart.draw(charts.next()), legend)
}

/// The residual of the augmented model in a held-out log, over time.
pub(crate) fn left_over(figure: &RolloutFigure, charts: &mut Charts<'_>) -> Markup {
    let lines = figure.measured.iter().zip(if figure.after.is_empty() { &figure.before } else { &figure.after });
    let left: Vec<Option<f64>> = lines.map(|(measured, model)| Some((*measured)? - (*model)?)).collect();
    let y_range = limits(left.iter().copied().flatten().chain([0.0]));
    let chart = Chart {
        title: format!("Residual of {} in held-out run {}", figure.column, figure.run),
        description: "The log minus the rollout of the augmented model.".into(),
        x_label: charts.time_label(),
        y_label: axis(&format!("residual of {}", figure.column), &figure.unit),
        marks: vec![Mark::Line("residual", &figure.time, left)],
        shades: Vec::new(),
        y_range: padded(y_range),
    };
    let legend = [("residual", "measured minus augmented model")];
    framed(html! { "Residual of " (figure.column) ", run " (figure.run) }, chart.draw(charts.next()), legend)
}

/// Autocorrelation of the residual of a column.
pub(crate) fn autocorrelation(check: &ResidualCheck, charts: &mut Charts<'_>) -> Option<Markup> {
    let count = check.autocorrelation.len();
    if count < 2 {
        return None;
    }
    let lags: Vec<f64> = (1..=count).map(|lag| lag as f64).collect();
    let band = vec![(-check.band, check.band); count];
    let y_range = limits(check.autocorrelation.iter().copied().chain([check.band, -check.band]));
    let chart = Chart {
        title: format!("Autocorrelation of the residual of {}", check.column),
        description: "Line: autocorrelation of the residual by lag. Band: where 99 % of the values of white noise lie."
            .into(),
        x_label: "lag (samples)".into(),
        y_label: "autocorrelation".into(),
        marks: vec![Mark::Band("band", &lags, band), Mark::Line("residual", &lags, present(&check.autocorrelation))],
        shades: Vec::new(),
        y_range: padded(y_range),
    };
    Some(framed(
        html! { "Autocorrelation of the residual of " (check.column) },
        chart.draw(charts.next()),
        [("residual", "residual, with the 99 % band of white noise")],
    ))
}

/// A column as it was logged.
pub(crate) fn signal(figure: &SignalFigure, charts: &mut Charts<'_>) -> Markup {
    let part = if figure.held_out { "held out" } else { "fitted" };
    let chart = Chart {
        title: format!("{} in run {} ({part})", figure.column, figure.run),
        description: "The column as it was logged.".into(),
        x_label: charts.time_label(),
        y_label: axis(&figure.column, &figure.unit),
        marks: vec![Mark::Line("residual", &figure.time, figure.values.clone())],
        shades: Vec::new(),
        y_range: padded(limits(figure.values.iter().copied().flatten())),
    };
    let kind = if figure.is_control { "control" } else { "state" };
    framed(html! { (figure.column) ", run " (figure.run) }, chart.draw(charts.next()), [("residual", kind)])
}

/// All of the log and of both rollouts, but not more than thrice the log's own range around it.
fn rollout_range(figure: &RolloutFigure) -> (f64, f64) {
    let logged = limits(figure.measured.iter().copied().flatten());
    let all = limits(figure.measured.iter().chain(&figure.before).chain(&figure.after).copied().flatten());
    if logged.0 > logged.1 {
        return padded(all);
    }
    let span = (logged.1 - logged.0).max(1e-9 * logged.0.abs());
    padded((all.0.max(logged.0 - span), all.1.min(logged.1 + span)))
}

/// Time of the first absent value of a rollout.
fn diverged(rollout: &[Option<f64>], time: &[f64]) -> Option<f64> {
    rollout.iter().position(Option::is_none).and_then(|i| time.get(i).copied())
}

fn framed(caption: Markup, chart: Markup, legend: impl IntoIterator<Item = (&'static str, &'static str)>) -> Markup {
    html! {
        figure {
            figcaption { (caption) }
            (chart)
            p.legend {
                @for (class, words) in legend {
                    span {
                        svg.key viewBox="0 0 28 12" aria-hidden="true" {
                            @match class {
                                "gap" => rect.gap x="2" y="0" width="24" height="12" style="--share:.6" {},
                                "measured" => path.measured d="M4 6h0M11 6h0M18 6h0M25 6h0" {},
                                _ => path.(class) d="M1 6L27 6" {},
                            }
                        }
                        (words)
                    }
                    " "
                }
            }
        }
    }
}

fn axis(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.into() } else { with_unit(name, &format!("({unit})")) }
}

fn present(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|v| v.is_finite().then_some(*v)).collect()
}

fn limits(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

fn padded((low, high): (f64, f64)) -> (f64, f64) {
    let margin = 0.05 * (high - low);
    (low - margin, high + margin)
}
