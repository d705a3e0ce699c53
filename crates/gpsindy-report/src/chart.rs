//! One small line chart as inline SVG: axes, grid, lines, dots, bands, shaded stretches.
//!
//! Colours are CSS classes, so that a chart follows light, dark and print; every chart carries a
//! title and a description for readers who can't see it. The drawing area is narrow on purpose:
//! a phone shows it at its full size, a wide screen puts two side by side.

use crate::numbers::{fixed, number};
use maud::{Markup, html};
use std::fmt::Write;

const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 250.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 40.0;
/// Width of a digit of a tick's label, generously.
const CHARACTER: f64 = 7.0;

/// What a chart draws; later marks lie over earlier ones.
pub(crate) enum Mark<'a> {
    /// A line of a CSS class, broken where `y` is absent.
    Line(&'static str, &'a [f64], Vec<Option<f64>>),
    /// Dots of a CSS class.
    Dots(&'static str, &'a [f64], Vec<Option<f64>>),
    /// A band between two curves.
    Band(&'static str, &'a [f64], Vec<(f64, f64)>),
}

/// A chart before it is drawn.
pub(crate) struct Chart<'a> {
    /// For screen readers and as a tooltip.
    pub(crate) title: String,
    /// What a reader should see in it, in a sentence.
    pub(crate) description: String,
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    pub(crate) marks: Vec<Mark<'a>>,
    /// Stretches of x with a share in 0..1: the larger, the darker.
    pub(crate) shades: Vec<(f64, f64, f64)>,
    /// Range of y; what lies outside is cut off.
    pub(crate) y_range: (f64, f64),
}

impl Chart<'_> {
    /// The `<svg>`; `id` is unique on the page.
    pub(crate) fn draw(&self, id: usize) -> Markup {
        let (x, y) = (Axis::x(self.x_limits()), Axis::y(self.y_range));
        let (title_id, text_id) = (format!("chart{id}-title"), format!("chart{id}-text"));
        let (width, height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
        html! {
            svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-labelledby=(format!("{title_id} {text_id}")) {
                title id=(title_id) { (self.title) }
                desc id=(text_id) { (self.description) }
                text.label x="4" y="14" { (self.y_label) }
                text.label x=(WIDTH - RIGHT) y=(HEIGHT - 6.0) text-anchor="end" { (self.x_label) }
                @for tick in &y.ticks {
                    line.grid x1=(LEFT) x2=(WIDTH - RIGHT) y1=(px(TOP + y.at(*tick))) y2=(px(TOP + y.at(*tick))) {}
                    text.tick x=(LEFT - 6.0) y=(px(TOP + y.at(*tick) + 4.0)) text-anchor="end" { (y.write(*tick)) }
                }
                @for tick in &x.ticks {
                    line.grid x1=(px(LEFT + x.at(*tick))) x2=(px(LEFT + x.at(*tick))) y1=(TOP) y2=(HEIGHT - BOTTOM) {}
                    text.tick x=(px(LEFT + x.at(*tick))) y=(HEIGHT - BOTTOM + 16.0) text-anchor="middle" { (x.write(*tick)) }
                }
                // A nested drawing cuts off at its own edge, without an id that another chart could carry too.
                svg x=(LEFT) y=(TOP) width=(width) height=(height) viewBox=(format!("0 0 {width} {height}")) {
                    @for (from, to, share) in &self.shades {
                        rect.gap x=(px(x.at(*from))) y="0" width=(px((x.at(*to) - x.at(*from)).max(1.5))) height=(height)
                            style=(format!("--share:{:.2}", share.clamp(0.0, 1.0))) {
                            title { "gap from " (number(*from)) " to " (number(*to)) }
                        }
                    }
                    @if y.low < 0.0 && y.high > 0.0 {
                        line.zero x1="0" x2=(width) y1=(px(y.at(0.0))) y2=(px(y.at(0.0))) {}
                    }
                    @for mark in &self.marks { (mark.draw(&x, &y)) }
                }
                rect.frame x=(LEFT) y=(TOP) width=(width) height=(height) {}
            }
        }
    }

    fn x_limits(&self) -> (f64, f64) {
        let mut limits = (f64::INFINITY, f64::NEG_INFINITY);
        for mark in &self.marks {
            let (Mark::Line(_, x, _) | Mark::Dots(_, x, _) | Mark::Band(_, x, _)) = mark;
            for &value in x.iter().filter(|v| v.is_finite()) {
                limits = (limits.0.min(value), limits.1.max(value));
            }
        }
        limits
    }
}

impl Mark<'_> {
    fn draw(&self, x: &Axis, y: &Axis) -> Markup {
        let mut path = String::new();
        match self {
            Mark::Line(class, xs, ys) => {
                let mut pen_down = false;
                for (&xv, yv) in xs.iter().zip(ys) {
                    let Some(yv) = yv else {
                        pen_down = false;
                        continue;
                    };
                    push(&mut path, if pen_down { 'L' } else { 'M' }, x.at(xv), y.at(*yv));
                    pen_down = true;
                }
                html! { path.(class) d=(path) {} }
            }
            Mark::Dots(class, xs, ys) => {
                for (&xv, yv) in xs.iter().zip(ys) {
                    if let Some(yv) = yv {
                        push(&mut path, 'M', x.at(xv), y.at(*yv));
                        path.push_str("h0");
                    }
                }
                html! { path.(class) d=(path) {} }
            }
            Mark::Band(class, xs, ends) => {
                for (i, (&xv, (low, _))) in xs.iter().zip(ends).enumerate() {
                    push(&mut path, if i == 0 { 'M' } else { 'L' }, x.at(xv), y.at(*low));
                }
                for (&xv, (_, high)) in xs.iter().zip(ends).rev() {
                    push(&mut path, 'L', x.at(xv), y.at(*high));
                }
                html! { path.(class) d=(path) {} }
            }
        }
    }
}

/// Coordinates with one decimal; far outside the drawing they are held, so that the text stays short.
fn push(path: &mut String, command: char, x: f64, y: f64) {
    // Writing to a String can't fail.
    let _ = write!(path, "{command}{:.1} {:.1}", x.clamp(-999.0, 9999.0), y.clamp(-999.0, 9999.0));
}

fn px(value: f64) -> String {
    fixed(value, 1)
}

/// A linear axis with round ticks.
struct Axis {
    low: f64,
    high: f64,
    /// Pixels at `low` and at `high`.
    ends: (f64, f64),
    ticks: Vec<f64>,
    step: f64,
}

impl Axis {
    /// With fewer ticks where their labels would run into each other.
    fn x(limits: (f64, f64)) -> Self {
        let width = WIDTH - LEFT - RIGHT;
        let with = |wanted: f64| Self::new(limits, (0.0, width), wanted);
        let fits = |axis: &Self| {
            let characters: usize = axis.ticks.iter().map(|t| axis.write(*t).chars().count() + 2).sum();
            characters as f64 * CHARACTER <= width
        };
        [6.0, 4.0, 3.0, 2.0].into_iter().map(with).find(fits).unwrap_or_else(|| with(1.0))
    }

    fn y(limits: (f64, f64)) -> Self {
        Self::new(limits, (HEIGHT - TOP - BOTTOM, 0.0), 5.0)
    }

    fn new((low, high): (f64, f64), ends: (f64, f64), wanted: f64) -> Self {
        let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.0 } else { low.abs().max(1.0) * 0.5 };
        let (low, high) = (low - margin, high + margin);
        let step = round_step((high - low) / wanted);
        let first = (low / step).ceil();
        let count = ((high / step).floor() - first).clamp(0.0, 20.0) as usize;
        let ticks = (0..=count).map(|i| (first + i as f64) * step).collect();
        Self { low, high, ends, ticks, step }
    }

    fn at(&self, value: f64) -> f64 {
        self.ends.0 + (value - self.low) / (self.high - self.low) * (self.ends.1 - self.ends.0)
    }

    fn write(&self, tick: f64) -> String {
        if tick.abs() < self.step * 1e-6 {
            return "0".into();
        }
        let size = self.low.abs().max(self.high.abs());
        if !(1e-3..1e6).contains(&size) {
            // As many digits as distinguish two ticks.
            let digits = (tick.abs().log10().floor() - self.step.log10().floor()).clamp(0.0, 9.0) as usize;
            let text = format!("{tick:.digits$e}");
            let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
            return format!("{}e{power}", fixed(mantissa.parse().unwrap_or(tick), digits));
        }
        fixed(tick, (-self.step.log10().floor()).clamp(0.0, 9.0) as usize)
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|s| *s >= step * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::x((-0.13, 3.9));
        assert_eq!(axis.ticks, [0.0, 1.0, 2.0, 3.0]);
        let axis = Axis::y((0.0, 1e-5));
        assert_eq!(axis.ticks.len(), 6);
        assert_eq!(axis.write(axis.ticks[1]), "2e-6");
    }

    #[test]
    fn labels_of_small_ticks_that_are_close_differ() {
        let axis = Axis::y((7.671e-4, 7.675e-4));
        let mut labels: Vec<String> = axis.ticks.iter().map(|t| axis.write(*t)).collect();
        assert!(labels.len() > 2);
        labels.dedup();
        assert_eq!(labels.len(), axis.ticks.len(), "{labels:?}");
    }

    #[test]
    fn labels_of_ticks_keep_apart() {
        let axis = Axis::x((10_000.0, 10_000.003));
        let characters: usize = axis.ticks.iter().map(|t| axis.write(*t).len()).sum();
        assert!((1..=60).contains(&characters), "{:?}", axis.ticks);
    }

    #[test]
    fn an_axis_without_extent_or_without_values_still_draws() {
        for limits in [(2.0, 2.0), (f64::INFINITY, f64::NEG_INFINITY), (0.0, 0.0)] {
            let axis = Axis::y(limits);
            assert!(axis.ticks.iter().all(|t| axis.at(*t).is_finite()), "{limits:?}");
        }
    }

    #[test]
    fn a_missing_sample_breaks_the_line() {
        let (x, y) = (Axis::x((0.0, 2.0)), Axis::y((0.0, 1.0)));
        let times = [0.0, 1.0, 2.0];
        let line = Mark::Line("after", &times, vec![Some(0.0), None, Some(1.0)]);
        let text = line.draw(&x, &y).into_string();
        assert_eq!(text.matches('M').count(), 2);
        assert!(!text.contains('L'));
    }
}
