//! A column under inspection: counted to its end, its first samples kept for a closer look.

use super::lulls::{Lull, Lulls};
use serde::Serialize;

/// Samples that are kept of a column.
pub(crate) const KEPT: usize = 5_000;

/// Levels below which steps between values count as quantisation: 16 bits. Finer ones are a number's own digits.
const LEVELS: f64 = 65_536.0;

/// By how many times a stay at an end must be longer than all others, and how often it must occur, for a column to be called clipped: noise
/// repeats a value by chance where its steps are coarse, and a machine rests once at a stop.
const STAY: usize = 3;
const TWICE: usize = 2;

/// What a field or column holds.
#[derive(Debug, Clone, Serialize)]
pub struct ColumnReport {
    /// The path to write behind the topic in a map, or the column's name.
    pub name: String,
    /// The name after which options know a table's column.
    pub column: String,
    /// The type as the format names it.
    pub kind: String,
    /// The unit, empty where the format has none.
    pub unit: String,
    /// Whether it holds numbers.
    pub numeric: bool,
    /// Values that are there.
    pub count: usize,
    /// Share of samples without a value.
    pub missing: f64,
    /// Smallest and largest value.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// Whether all values are one.
    pub constant: bool,
    /// The step between neighbouring levels, where values take few.
    pub step: Option<f64>,
    /// Share of samples that repeat the one before.
    pub repeated: f64,
    /// Jumps by a full turn.
    pub wraps: usize,
    /// Full turn of a wrapped angle, where it is one.
    pub turn: Option<f64>,
}

/// A column as it is read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) column: String,
    pub(crate) kind: String,
    pub(crate) unit: String,
    pub(crate) numeric: bool,
    pub(crate) kept: Vec<f64>,
    /// How many cells are no numbers among numbers, and the first of them.
    pub(crate) texts: Option<(usize, String)>,
    samples: usize,
    count: usize,
    min: f64,
    max: f64,
    last: f64,
    repeated: usize,
    /// Samples before the first value, and up to the last.
    silent: usize,
    until: usize,
    /// Jumps by about 2 pi and by about 360.
    wraps: [usize; 2],
    lulls: Lulls,
}

/// Full turns.
const TURNS: [f64; 2] = [std::f64::consts::TAU, 360.0];

impl Column {
    pub(crate) fn new(name: &str, column: &str, kind: &str, unit: &str, numeric: bool) -> Self {
        let (name, column, kind, unit) = (name.into(), column.into(), kind.into(), unit.into());
        let (min, max, last) = (f64::INFINITY, f64::NEG_INFINITY, f64::NAN);
        Self { name, column, kind, unit, numeric, min, max, last, ..Self::default() }
    }

    /// The same where some cells are no numbers: how many, and the first.
    pub(crate) fn with_texts(self, texts: Option<(usize, String)>) -> Self {
        Self { texts, ..self }
    }

    /// Takes the next sample.
    pub(crate) fn push(&mut self, value: f64) {
        self.samples += 1;
        self.lulls.push(value);
        if self.kept.len() < KEPT {
            self.kept.push(value);
        }
        if value.is_nan() {
            return;
        }
        if self.count == 0 {
            self.silent = self.samples - 1;
        }
        self.until = self.samples;
        self.count += 1;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.repeated += usize::from(value == self.last);
        for (wraps, turn) in self.wraps.iter_mut().zip(TURNS) {
            let jump = (value - self.last).abs();
            *wraps += usize::from(jump > 0.75 * turn && jump < 1.01 * turn);
        }
        self.last = value;
    }

    /// Shares of the samples before the first value and behind the last.
    pub(crate) fn silence(&self) -> [f64; 2] {
        let share = |count: usize| count as f64 / self.samples.max(1) as f64;
        [share(self.silent), share(self.samples - self.until)]
    }

    /// A run ends: the next sample does not follow the last.
    pub(crate) fn end_run(&mut self) {
        self.last = f64::NAN;
        self.lulls.end_run();
    }

    /// Where it falls silent, and where it stands still though it moves everywhere else.
    pub(crate) fn lulls(&self) -> [Option<Lull>; 2] {
        let still = self.lulls.standstill(&self.kept, (self.min, self.max), self.count);
        [self.lulls.silence(self.count), still]
    }

    pub(crate) fn report(&self) -> ColumnReport {
        let some = self.count > 0;
        let turn = self.turn();
        ColumnReport {
            name: self.name.clone(),
            column: self.column.clone(),
            kind: self.kind.clone(),
            unit: self.unit.clone(),
            numeric: self.numeric,
            count: self.count,
            missing: if self.samples == 0 { 0.0 } else { 1.0 - self.count as f64 / self.samples as f64 },
            min: some.then_some(self.min),
            max: some.then_some(self.max),
            constant: self.count > 1 && self.min == self.max,
            step: self.step(),
            repeated: if self.count > 1 { self.repeated as f64 / (self.count - 1) as f64 } else { 0.0 },
            wraps: turn.map_or(0, |(_, wraps)| wraps),
            turn: turn.map(|(turn, _)| turn),
        }
    }

    /// The full turn by which it jumps, and how often: an angle stays within one turn.
    fn turn(&self) -> Option<(f64, usize)> {
        let range = self.max - self.min;
        let fits = |(turn, wraps): (f64, usize)| {
            (wraps > 0 && range > 0.8 * turn && range < 1.01 * turn).then_some((turn, wraps))
        };
        TURNS.into_iter().zip(self.wraps).find_map(fits)
    }

    /// The distance of neighbouring levels, where all kept values are multiples of it and the levels are few.
    fn step(&self) -> Option<f64> {
        let mut levels: Vec<f64> = self.kept.iter().copied().filter(|v| v.is_finite()).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        if levels.len() < 3 {
            return None;
        }
        let range = levels[levels.len() - 1] - levels[0];
        let step = levels.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        if range / step > LEVELS {
            return None;
        }
        // Levels in single precision are not on exact multiples.
        let size = levels[0].abs().max(levels[levels.len() - 1].abs());
        let slack = 0.02 * step + 2.0 * size * f64::from(f32::EPSILON);
        if slack > 0.25 * step {
            return None;
        }
        // The mean of the smallest steps is a finer estimate than the smallest one.
        let steps = levels.windows(2).map(|w| w[1] - w[0]);
        let single: Vec<f64> = steps.filter(|d| *d < 1.5 * step).collect();
        let step = single.iter().sum::<f64>() / single.len() as f64;
        let off = |v: &f64| {
            let levels = (v - levels[0]) / step;
            (levels - levels.round()).abs() * step
        };
        let slack = slack + 0.02 * step;
        (levels.iter().filter(|v| off(v) > slack).count() * 50 <= levels.len()).then_some(step)
    }

    /// Whether it stays again and again at its largest or smallest value, and nowhere else: which, and how often.
    pub(crate) fn clipped(&self) -> Option<(f64, usize)> {
        let values: Vec<f64> = self.kept.iter().copied().filter(|v| !v.is_nan()).collect();
        let mut stays: Vec<(f64, usize)> = Vec::new();
        for &value in &values {
            match stays.last_mut() {
                Some((last, count)) if *last == value => *count += 1,
                _ => stays.push((value, 1)),
            }
        }
        let is_end = |value: f64| value == self.min || value == self.max;
        // What a column begins or ends with says nothing of where its values would have gone.
        let inner = stays.get(1..stays.len().saturating_sub(1)).unwrap_or_default();
        let elsewhere = inner.iter().filter(|(value, _)| !is_end(*value)).map(|(_, count)| *count).max()?;
        let times = |end: f64| inner.iter().filter(|(value, count)| *value == end && *count > STAY * elsewhere).count();
        [self.max, self.min].into_iter().map(|end| (end, times(end))).find(|(_, times)| *times >= TWICE)
    }

    /// Of the changes between kept samples: the share that is a level at most (repeats included), and the mean number of
    /// samples for which a value is held.
    pub(crate) fn changes(&self) -> Changes {
        let step = self.step().unwrap_or(0.0);
        let values: Vec<f64> = self.kept.iter().copied().filter(|v| !v.is_nan()).collect();
        let (mut small, mut same, mut longest, mut held) = (0_usize, 0_usize, 1_usize, 1_usize);
        let mut lengths: Vec<usize> = Vec::new();
        for pair in values.windows(2) {
            let change = (pair[1] - pair[0]).abs();
            small += usize::from(change <= 1.5 * step);
            same += usize::from(change == 0.0);
            if change == 0.0 {
                held += 1;
                longest = longest.max(held);
            } else {
                lengths.push(held);
                held = 1;
            }
        }
        let all = values.len().saturating_sub(1).max(1) as f64;
        lengths.sort_unstable();
        let middle = lengths.get(lengths.len() / 2).copied().unwrap_or(held);
        let regular = lengths.iter().filter(|l| l.abs_diff(middle) <= 1).count() as f64 / lengths.len().max(1) as f64;
        Changes { small: small as f64 / all, same: same as f64 / all, held: middle, regular }
    }
}

/// How the kept samples of a column change.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Changes {
    /// Share of changes by one level at most, none included.
    pub(crate) small: f64,
    /// Share of no change.
    pub(crate) same: f64,
    /// Samples for which a value is typically held.
    pub(crate) held: usize,
    /// Share of values that are held so long, give or take one sample.
    pub(crate) regular: f64,
}
