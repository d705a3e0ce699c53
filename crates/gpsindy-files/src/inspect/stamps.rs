//! The stamps of a topic: rate, jitter, gaps, what the clock does.

use super::Sheet;
use serde::Serialize;

/// A step longer than this many typical ones is a gap.
const GAP: f64 = 2.5;

/// The clock and steps of a topic.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ClockReport {
    /// What gives the stamps: the time column's name, `header` or `log`.
    pub clock: String,
    /// First stamp as the log says it, s.
    pub first: Option<f64>,
    /// Last stamp as the log says it, s.
    pub last: Option<f64>,
    /// Samples a second: one over the typical step.
    pub rate: Option<f64>,
    /// Typical step, s: the median.
    pub period: Option<f64>,
    /// Half the distance between the 5 % and the 95 % quantile of the steps, relative to the typical step.
    pub jitter: Option<f64>,
    /// Steps longer than 2.5 typical ones.
    pub gaps: usize,
    /// The longest step, s, and the stamp at which it begins.
    pub longest: Option<f64>,
    /// Stamp at which the longest step begins, s, as the log says it.
    pub longest_at: Option<f64>,
    /// Stamps that repeat the one before.
    pub repeated: usize,
    /// Stamps that lie before the one before.
    pub backward: usize,
    /// Median of the time of recording less the header's stamp, s.
    pub latency: Option<f64>,
    /// How much faster the clock of recording runs than that of the headers, relative.
    pub drift: Option<f64>,
    /// Steps between neighbouring float32 numbers at the last stamp, s, where stamps are float32.
    pub resolution: Option<f64>,
}

impl ClockReport {
    pub(crate) fn of(sheet: &Sheet) -> Self {
        let mut report = Self { clock: sheet.clock.clone(), ..Self::default() };
        let stamps = &sheet.stamps;
        let (Some(first), Some(last)) = (stamps.first(), stamps.last()) else { return report };
        report.first = Some(first + sheet.origin);
        report.last = Some(last + sheet.origin);
        let steps = steps(sheet);
        report.repeated = steps.iter().filter(|(_, step)| *step == 0.0).count();
        report.backward = steps.iter().filter(|(_, step)| *step < 0.0).count();
        let mut forward: Vec<f64> = steps.iter().map(|(_, step)| *step).filter(|step| *step > 0.0).collect();
        forward.sort_by(f64::total_cmp);
        if forward.is_empty() {
            return report;
        }
        let at = |part: f64| forward[((forward.len() - 1) as f64 * part).round() as usize];
        let period = at(0.5);
        report.period = Some(period);
        report.rate = Some(1.0 / period);
        report.jitter = Some(0.5 * (at(0.95) - at(0.05)) / period);
        report.gaps = forward.iter().filter(|step| **step > GAP * period).count();
        if let Some((i, step)) = steps.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            report.longest = Some(*step);
            report.longest_at = Some(stamps[*i] + sheet.origin);
        }
        if !sheet.latency.is_empty() {
            report.latency = Some(median(sheet.latency.clone()));
            report.drift = drift(stamps, &sheet.latency);
        }
        let end = stamps.iter().fold(0.0, |most: f64, t| most.max(t.abs()));
        if sheet.single || looks_single(stamps, period) {
            report.resolution = Some(f64::from((end as f32).next_up()) - f64::from(end as f32));
        }
        report
    }
}

/// The steps within runs, and where each begins.
pub(crate) fn steps(sheet: &Sheet) -> Vec<(usize, f64)> {
    let begins: std::collections::HashSet<usize> = sheet.runs.iter().copied().collect();
    let inside = (1..sheet.stamps.len()).filter(|i| !begins.contains(i));
    inside.map(|i| (i - 1, sheet.stamps[i] - sheet.stamps[i - 1])).collect()
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Relative speed of two clocks, by the median latencies of the first and last fifth, where it exceeds the scatter.
fn drift(stamps: &[f64], latency: &[f64]) -> Option<f64> {
    let part = latency.len() / 5;
    if part < 10 || stamps.len() != latency.len() {
        return None;
    }
    let (early, late) = (latency[..part].to_vec(), latency[latency.len() - part..].to_vec());
    let time = |of: &[f64]| median(of.to_vec());
    let apart = time(&stamps[stamps.len() - part..]) - time(&stamps[..part]);
    let (a, b) = (median(early.clone()), median(late.clone()));
    let scatter = |values: &[f64], middle: f64| median(values.iter().map(|v| (v - middle).abs()).collect());
    // The error of a median of so many samples, as if they were normal.
    let error = 1.86 * (scatter(&early, a).max(scatter(&late, b))) / (part as f64).sqrt();
    let rate = (b - a) / apart;
    // Five errors, and more than the 20 ppm by which any two quartz clocks differ.
    ((b - a).abs() > 5.0 * error && rate.abs() > 2e-5).then_some(rate)
}

/// Whether stamps are float32 numbers written with more digits: all of them are such numbers, and their steps differ by the
/// spacing of such numbers.
fn looks_single(stamps: &[f64], period: f64) -> bool {
    if stamps.len() < 20 || !stamps.iter().all(|t| f64::from(*t as f32) == *t) {
        return false;
    }
    let uneven = stamps.windows(2).filter(|w| {
        let spacing = f64::from((w[1].abs() as f32).next_up()) - f64::from(w[1].abs() as f32);
        let off = (w[1] - w[0] - period).abs();
        off > 0.0 && off <= 2.0 * spacing
    });
    uneven.count() > 0
}
