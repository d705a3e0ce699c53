//! A line chart as an SVG file on white, for the pictures of docs/.

use std::fmt::Write;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 44.0;

/// How a series is drawn.
pub(crate) enum Stroke {
    Dots(f64),
    Line,
    Dashes,
}

/// Values over the horizontal axis.
pub(crate) struct Series<'a> {
    /// In the legend; none where another series of the same colour has one.
    pub(crate) name: Option<&'a str>,
    pub(crate) colour: &'a str,
    pub(crate) stroke: Stroke,
    pub(crate) x: &'a [f64],
    pub(crate) y: &'a [f64],
}

/// An axis: its ends, the distance of its ticks, and what is added to a tick for its label.
pub(crate) struct Axis {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) step: f64,
    pub(crate) offset: f64,
}

impl Axis {
    fn share(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }

    fn ticks(&self) -> impl Iterator<Item = (f64, f64)> {
        // A millionth of a step, so that rounding never drops the last tick.
        let count = ((self.to - self.from) / self.step + 1e-6) as usize;
        (0..=count).map(|i| self.from + self.step * i as f64).map(|at| (at, at + self.offset))
    }
}

pub(crate) struct Plot<'a> {
    /// For readers who can't see it.
    pub(crate) title: &'a str,
    pub(crate) y_label: &'a str,
    /// At the upper right; empty where the legend says it all.
    pub(crate) note: &'a str,
    pub(crate) x_label: &'a str,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series<'a>>,
}

impl Plot<'_> {
    /// The whole file.
    pub(crate) fn draw(&self) -> String {
        let across = |value: f64| LEFT + (WIDTH - LEFT - RIGHT) * self.x.share(value);
        let up = |value: f64| HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * self.y.share(value);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"13\" role=\"img\">\n\
             <title>{}</title>\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#ffffff\"/>\n",
            self.title
        );
        for (value, label) in self.y.ticks() {
            let (at, right) = (up(value), WIDTH - RIGHT);
            let _ =
                writeln!(svg, "<line x1=\"{LEFT}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#dddddd\"/>");
            text(&mut svg, LEFT - 8.0, at + 4.5, "end", &label.to_string());
        }
        for (value, label) in self.x.ticks() {
            text(&mut svg, across(value), HEIGHT - BOTTOM + 20.0, "middle", &label.to_string());
        }
        text(&mut svg, LEFT - 40.0, 20.0, "start", self.y_label);
        text(&mut svg, WIDTH - RIGHT, 20.0, "end", self.note);
        text(&mut svg, WIDTH - RIGHT, HEIGHT - 6.0, "end", self.x_label);
        let mut at = LEFT + 110.0;
        for series in &self.series {
            let points = || series.x.iter().zip(series.y).map(|(x, y)| (across(*x), up(*y)));
            let _ = match series.stroke {
                Stroke::Dots(radius) => points().try_for_each(|(x, y)| {
                    writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{}\"/>", series.colour)
                }),
                Stroke::Line | Stroke::Dashes => {
                    let points: Vec<String> = points().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
                    let dashes = if matches!(series.stroke, Stroke::Dashes) { " stroke-dasharray=\"7 4\"" } else { "" };
                    let points = points.join(" ");
                    writeln!(
                        svg,
                        "<polyline points=\"{points}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{dashes}/>",
                        series.colour
                    )
                }
            };
            if let Some(name) = series.name {
                let _ = writeln!(svg, "<circle cx=\"{at}\" cy=\"15.5\" r=\"4\" fill=\"{}\"/>", series.colour);
                text(&mut svg, at + 9.0, 20.0, "start", name);
                at += 30.0 + 8.0 * name.len() as f64;
            }
        }
        svg + "</svg>\n"
    }
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    if !words.is_empty() {
        let _ =
            writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"#333333\">{words}</text>");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_its_ends_among_its_ticks() {
        let axis = Axis { from: 0.0, to: 0.3, step: 0.1, offset: 1900.0 };
        let labels: Vec<f64> = axis.ticks().map(|(_, label)| label).collect();
        assert_eq!(labels.len(), 4);
        assert_eq!((labels[0], labels[3]), (1900.0, 1900.3));
    }

    #[test]
    fn a_legend_names_only_series_that_have_a_name() {
        let line = |name| Series { name, colour: "#000", stroke: Stroke::Line, x: &[0.0, 1.0], y: &[0.0, 1.0] };
        let axis = || Axis { from: 0.0, to: 1.0, step: 1.0, offset: 0.0 };
        let plot = Plot {
            title: "t",
            y_label: "",
            note: "",
            x_label: "",
            x: axis(),
            y: axis(),
            series: vec![line(Some("log")), line(None)],
        };
        let svg = plot.draw();
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(svg.contains(">log</text>"), "{svg}");
    }
}
