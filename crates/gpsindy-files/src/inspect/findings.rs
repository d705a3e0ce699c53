//! Flaws of a log: one sentence each, with what to do.

use super::column::Column;
use super::difference::{self, How};
use super::lulls::Lull;
use super::stamps::median;
use super::text::short;
use super::{Sheet, TopicReport};
use serde::Serialize;

/// Jitter from which steps are called uneven; a tenth of it moves a finite difference by as much as the noise of a good
/// encoder does.
const JITTER: f64 = 0.05;

/// Spacing of float32 stamps, relative to the typical step, from which differences over a step suffer.
const COARSE_STAMPS: f64 = 0.01;

/// Share of changes within a level from which a column is called coarse.
const COARSE: f64 = 0.5;

/// Share of repeated samples from which a column is called held.
const HELD: f64 = 0.2;

/// Share of the samples for which a column may be silent at one end: a fourth is what a diagnosis holds out to verify on.
const SILENT: f64 = 0.25;

/// Rows below which a run hardly says more than its own start: by then the chance of a wrong name grows, whatever the noise.
const FEW: usize = 30;

/// Steps of whole numbers that may count milliseconds: machines are logged at 1 kHz and less, slow processes once a minute and less often.
/// A step of one is left alone: years, hours and seconds have it, too.
const MILLISECONDS: std::ops::Range<f64> = 2.0..60.0;

/// Something that spoils an identification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The topic; empty for a table.
    pub topic: String,
    /// The field or column, where one is at fault.
    pub column: Option<String>,
    /// `time_unit`, `jitter`, `gaps`, `repeated_stamps`, `backward_stamps`, `float32_stamps`, `clock_drift`, `constant`, `quantised`,
    /// `held`, `frozen`, `clipped`, `wrapped`, `difference`, `missing`, `text`, `short` or `unread`.
    pub kind: String,
    /// A sentence.
    pub text: String,
}

struct Flaws<'a> {
    topic: &'a str,
    found: &'a mut Vec<Finding>,
}

impl Flaws<'_> {
    fn stamps(&mut self, kind: &str, text: String) {
        self.found.push(Finding { topic: self.topic.into(), column: None, kind: kind.into(), text });
    }

    fn column(&mut self, column: &str, kind: &str, text: String) {
        self.found.push(Finding { topic: self.topic.into(), column: Some(column.into()), kind: kind.into(), text });
    }
}

/// What is wrong within a topic.
pub(crate) fn of(sheet: &Sheet, report: &TopicReport, found: &mut Vec<Finding>) {
    let mut flaws = Flaws { topic: &sheet.topic, found };
    if let Some(why) = &sheet.unread {
        flaws.stamps("unread", why.clone());
    }
    if let Some(doubt) = &sheet.doubt {
        flaws.stamps("time_unit", doubt.clone());
    }
    clock(report, &mut flaws);
    lengths(sheet, &mut flaws);
    for (column, report) in sheet.columns.iter().zip(&report.columns) {
        let name = &report.name;
        if let Some((count, first)) = &column.texts {
            let are = if *count == 1 { "1 cell is".into() } else { format!("{count} cells are") };
            let text = format!(
                "{are} no number among numbers, the first {first}; the column can't be used, leave such cells empty"
            );
            flaws.column(name, "text", text);
        }
        if !report.numeric {
            continue;
        }
        if report.count == 0 {
            flaws.column(name, "missing", "holds no value".into());
            continue;
        }
        let [before, behind] = column.silence();
        for (share, which, how) in [(before, "first", "begins"), (behind, "last", "ends")] {
            if share >= SILENT {
                let text = format!(
                    "{how} within the log: the {which} {:.1} % of the samples hold no value; a control keeps its nearest one there, a state is unknown",
                    100.0 * share
                );
                flaws.column(name, "missing", text);
            }
        }
        if report.constant {
            let value = report.min.unwrap_or(f64::NAN);
            flaws.column(
                name,
                "constant",
                format!("is always {value}; it carries no information and cannot be a state"),
            );
            continue;
        }
        if let Some(turn) = report.turn {
            let unit = if turn > 100.0 { "degrees: convert it to rad" } else { "rad: unwrap it with --angle" };
            flaws.column(
                name,
                "wrapped",
                format!("jumps by a full turn {} times; it is an angle in {unit}", report.wraps),
            );
        }
        lulls(sheet, column, name, &mut flaws);
        let changes = column.changes();
        if let Some((end, times)) = column.clipped() {
            let text =
                format!("stays at {} {times} times and nowhere else; its sensor or its range ends there", short(end));
            flaws.column(name, "clipped", text);
        }
        // A ramp moves by a level every time; a coarse sensor also stays on one.
        let moves = changes.same > 0.1 && changes.small > changes.same + 0.1;
        let coarse = report.step.filter(|_| changes.small > COARSE && moves);
        if let Some(step) = coarse {
            let share = 100.0 * changes.small;
            let text = format!(
                "has a resolution of {}, and {share:.0} % of its changes are one such step or none",
                short(step)
            );
            flaws.column(name, "quantised", text);
        } else if changes.same > HELD && changes.held > 1 {
            let rate = report_rate(sheet) / changes.held as f64;
            let how = if changes.regular > 0.7 {
                format!("repeats each value for {} samples; its own rate is {} Hz", changes.held, short(rate))
            } else {
                format!(
                    "does not change in {:.0} % of its samples; it is a command, or its sensor is slower than the log",
                    100.0 * changes.same
                )
            };
            flaws.column(name, "held", how);
        }
    }
    for made in difference::find(sheet) {
        let of = &sheet.columns[made.of].name;
        let how = match made.how {
            How::Difference(1) => format!("is the difference of `{of}` from one sample to the next"),
            How::Difference(k) => {
                format!("is the difference of `{of}` over {k} samples, late by {:.1} samples", k as f64 / 2.0)
            }
            How::LowPass(past) => {
                // A weight of the past is exp(-step / time constant).
                format!("is the difference of `{of}` through a low pass of {:.1} samples", -1.0 / past.ln())
            }
        };
        let text = format!("{how}, not a measurement; leave it out or name it with --derivative");
        flaws.column(&sheet.columns[made.column].name, "difference", text);
    }
}

/// Where a column drops out or freezes within the log.
fn lulls(sheet: &Sheet, column: &Column, name: &str, flaws: &mut Flaws<'_>) {
    let place = |lull: &Lull| {
        let at = |i: usize| sheet.stamps.get(i).map_or(String::new(), |t| format!("{t:.3} s"));
        format!("from {} to {} ({} samples)", at(lull.first), at(lull.first + lull.count - 1), lull.count)
    };
    let [silent, still] = column.lulls();
    if let Some(lull) = silent {
        let text = format!("holds no value {}; a control keeps its last one there, a state is unknown", place(&lull));
        flaws.column(name, "missing", text);
    }
    if let Some(lull) = still {
        let text = format!(
            "stands still {} and then jumps; its sensor froze: empty these cells, or cut the log there",
            place(&lull)
        );
        flaws.column(name, "frozen", text);
    }
}

fn clock(report: &TopicReport, flaws: &mut Flaws<'_>) {
    let clock = &report.clock;
    let (Some(period), Some(jitter)) = (clock.period, clock.jitter) else { return };
    if clock.backward > 0 {
        flaws.stamps("backward_stamps", format!("{} earlier than the one before", stamps_are(clock.backward)));
    }
    if clock.repeated > 0 {
        flaws.stamps("repeated_stamps", format!("{} the same as the one before", stamps_are(clock.repeated)));
    }
    if jitter > JITTER {
        let what = if clock.clock == "log" {
            "; these are times of recording, and times of sampling would be better"
        } else {
            ""
        };
        flaws.stamps(
            "jitter",
            format!("the step varies by \u{b1}{:.0} % around {} s{what}", 100.0 * jitter, short(period)),
        );
    }
    if clock.gaps > 0 {
        let gaps = if clock.gaps == 1 {
            "1 gap; it begins".into()
        } else {
            format!("{} gaps; the longest begins", clock.gaps)
        };
        let (longest, at) = (clock.longest.unwrap_or(0.0), clock.longest_at.unwrap_or(0.0));
        flaws.stamps("gaps", format!("{gaps} at {at:.3} s and lasts {} s", short(longest)));
    }
    if let Some(resolution) = clock.resolution.filter(|r| *r > COARSE_STAMPS * period) {
        let share = 100.0 * resolution / period;
        let text = format!(
            "stamps are float32: {resolution:.2e} s apart at the end, {share:.1} % of a step; write them as float64"
        );
        flaws.stamps("float32_stamps", text);
    }
    if let Some(drift) = clock.drift {
        let text = format!(
            "the clock of the headers and that of the recorder drift apart by {:.0} ppm; do not mix topics with and without headers",
            1e6 * drift
        );
        flaws.stamps("clock_drift", text);
    }
}

/// Runs that are too short, and stamps that may count milliseconds.
fn lengths(sheet: &Sheet, flaws: &mut Flaws<'_>) {
    let ends = sheet.runs.iter().skip(1).copied().chain([sheet.stamps.len()]);
    let few: Vec<usize> = sheet.runs.iter().zip(ends).map(|(&begin, end)| end - begin).filter(|&n| n < FEW).collect();
    if let Some(fewest) = few.iter().min() {
        let runs = if sheet.runs.len() == 1 {
            "the log has".into()
        } else {
            format!("{} of {} runs have", few.len(), sheet.runs.len())
        };
        let fewest = if few.len() == 1 { format!("{fewest} samples") } else { format!("{fewest} samples and more") };
        flaws.stamps("short", format!("{runs} {fewest}, fewer than {FEW}: names and sizes from so few are guesses"));
    }
    let steps = sheet.stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let step = median(steps.collect());
    if sheet.doubt.is_none()
        && sheet.has_plain_time
        && MILLISECONDS.contains(&step)
        && sheet.stamps.iter().all(|t| is_whole(*t))
    {
        flaws.stamps("time_unit", format!("stamps are whole numbers, {step} from one to the next, and are taken for seconds; milliseconds must be divided by 1e3, and seconds can be named in the header: t [s]"));
    }
}

/// Whether a stamp is a whole number but for the rounding of the arithmetic that made it.
fn is_whole(t: f64) -> bool {
    (t - t.round()).abs() <= 4.0 * f64::EPSILON * t.abs()
}

/// What is wrong between topics: clocks that do not meet.
pub(crate) fn between(sheets: &[Sheet], found: &mut Vec<Finding>) {
    let spans: Vec<(&Sheet, f64, f64)> = sheets
        .iter()
        .filter(|s| s.stamps.len() > 1)
        .map(|s| {
            let of = |pick: fn(f64, f64) -> f64, from: f64| s.stamps.iter().copied().fold(from, pick) + s.origin;
            (s, of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
        })
        .collect();
    // The topic that the most others meet is taken for right.
    let meets = |a: &(&Sheet, f64, f64), b: &(&Sheet, f64, f64)| a.1 <= b.2 && b.1 <= a.2;
    let Some(right) = spans.iter().max_by_key(|a| spans.iter().filter(|b| meets(a, b)).count()) else { return };
    for alone in spans.iter().filter(|a| !meets(a, right)) {
        found.push(Finding {
            topic: alone.0.topic.clone(),
            column: None,
            kind: "clock_drift".into(),
            text: format!("its stamps do not overlap with those of {}; try --stamp log", right.0.topic),
        });
    }
}

fn stamps_are(count: usize) -> String {
    if count == 1 { "1 stamp is".into() } else { format!("{count} stamps are") }
}

/// Samples a second, NaN where there are too few.
fn report_rate(sheet: &Sheet) -> f64 {
    let steps: Vec<f64> = sheet.stamps.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    1.0 / median(steps)
}
