//! Columns as functions of time, and their weak averages and derivatives in windows.

use super::{BLOCKS, Signal};

/// Intervals of the sums over a window.
const GRID: usize = 48;

/// Most windows: enough for an offset well below a sample's period, few enough for seconds of work.
const MOST: usize = 4_000;

/// Fewest samples of a column.
const FEWEST: usize = 16;

/// A column without its missing values, in units of its own deviation.
#[derive(Debug)]
pub(super) struct Trace {
    pub(super) name: String,
    pub(super) control: bool,
    times: Vec<f64>,
    values: Vec<f64>,
    /// Integral from the first stamp to each.
    integral: Vec<f64>,
    mean: f64,
    deviation: f64,
}

impl Trace {
    /// `None` where a column does not change, or has too few values.
    pub(super) fn of(signal: &Signal<'_>) -> Option<Self> {
        let present = signal.times.iter().zip(signal.values).filter(|(_, v)| v.is_finite());
        let (times, mut values): (Vec<f64>, Vec<f64>) = present.map(|(t, v)| (*t, *v)).unzip();
        if times.len() < FEWEST {
            return None;
        }
        if !signal.control {
            unwrap(&mut values);
        }
        Self::new(signal.name, signal.control, times, values)
    }

    fn new(name: &str, control: bool, times: Vec<f64>, mut values: Vec<f64>) -> Option<Self> {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
        if !(deviation > 1e-12 * mean.abs()) {
            return None;
        }
        values.iter_mut().for_each(|v| *v = (*v - mean) / deviation);
        let mut integral = vec![0.0; times.len()];
        for i in 1..times.len() {
            let height = if control { values[i - 1] } else { 0.5 * (values[i - 1] + values[i]) };
            integral[i] = integral[i - 1] + height * (times[i] - times[i - 1]);
        }
        Some(Self { name: name.into(), control, times, values, integral, mean, deviation })
    }

    /// A function of the column, such as the sine of an angle in rad.
    pub(super) fn through(&self, function: fn(f64) -> f64) -> Option<Self> {
        let values = self.values.iter().map(|v| function(self.mean + self.deviation * v)).collect();
        Self::new(&self.name, self.control, self.times.clone(), values)
    }

    pub(super) fn span(&self) -> (f64, f64) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// Median of the steps, s.
    pub(super) fn period(&self) -> f64 {
        let mut steps: Vec<f64> = self.times.windows(2).map(|w| w[1] - w[0]).collect();
        let middle = steps.len() / 2;
        *steps.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// The last stamp at or before `t`.
    fn place(&self, t: f64) -> usize {
        self.times.partition_point(|stamp| *stamp <= t).saturating_sub(1)
    }

    /// Value and integral at `t`, where `i` is the place of a time before it.
    fn at(&self, t: f64, i: &mut usize) -> (f64, f64) {
        while *i + 1 < self.times.len() && self.times[*i + 1] <= t {
            *i += 1;
        }
        let (k, since) = (*i, t - self.times[*i]);
        if self.control || k + 1 == self.times.len() {
            return (self.values[k], self.integral[k] + self.values[k] * since);
        }
        let slope = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k]);
        let value = self.values[k] + slope * since;
        (value, self.integral[k] + 0.5 * (self.values[k] + value) * since)
    }

    /// Whether two samples within a window lie further apart than its half width.
    fn has_gap(&self, from: f64, to: f64, width: f64) -> bool {
        let (first, last) = (self.place(from), (self.place(to) + 1).min(self.times.len() - 1));
        (first..last).any(|i| self.times[i + 1] - self.times[i] > width)
    }
}

/// An angle without its jumps by a full turn.
fn unwrap(values: &mut [f64]) {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let Some(turn) = [std::f64::consts::TAU, 360.0].into_iter().find(|t| (0.8 * t..1.01 * t).contains(&(high - low)))
    else {
        return;
    };
    let mut turns = 0.0;
    for i in 1..values.len() {
        let jump = values[i] + turns - values[i - 1];
        turns -= turn * (jump / turn).round();
        values[i] += turns;
    }
}

/// Windows over the common time.
#[derive(Debug)]
pub(super) struct Windows {
    pub(super) reach: f64,
    /// Half width, s.
    pub(super) width: f64,
    centres: Vec<f64>,
    /// At each point of the grid: the bump's first derivative, and its second.
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Windows {
    /// `None` where the common time is too short for the jackknife's blocks.
    pub(super) fn new(begin: f64, end: f64, reach: f64, width: f64, fixed: &[&Trace]) -> Option<Self> {
        let (from, to) = (begin + reach + width, end - reach - width);
        let all = ((to - from) / (0.5 * width)).floor();
        if !(all >= 8.0 * BLOCKS as f64) {
            return None;
        }
        let count = (all as usize).min(MOST);
        let centre = |i: usize| from + (to - from) * i as f64 / count as f64;
        let whole = |c: &f64| !fixed.iter().any(|t| !t.control && t.has_gap(c - width, c + width, width));
        let centres: Vec<f64> = (0..=count).map(centre).filter(whole).collect();
        if centres.len() < 8 * BLOCKS {
            return None;
        }
        // psi(s) = (1 - s^2)^3, with weights for averages over the window.
        let grid = |k: usize| -1.0 + 2.0 * k as f64 / GRID as f64;
        let rest = |s: f64| 1.0 - s * s;
        let scale = 2.0 / GRID as f64 / (width * 32.0 / 35.0);
        let first = (0..=GRID).map(grid).map(|s| -6.0 * s * rest(s).powi(2) * scale).collect();
        let second = (0..=GRID).map(grid);
        let second = second.map(|s| (24.0 * s * s - 6.0 * rest(s)) * rest(s) * scale / width).collect();
        Some(Self { reach, width, centres, first, second })
    }

    pub(super) fn len(&self) -> usize {
        self.centres.len()
    }

    /// The block of the jackknife in which a window lies.
    pub(super) fn block(&self, window: usize) -> usize {
        window * BLOCKS / self.len()
    }

    /// The average of a derivative of a column in every window, the column moved to later times by `shift`.
    pub(super) fn weak(&self, trace: &Trace, order: usize, shift: f64) -> Vec<f64> {
        let step = 2.0 * self.width / GRID as f64;
        let average = |centre: &f64| {
            let begin = centre - self.width - shift;
            let mut place = trace.place(begin);
            let base = trace.integral[place];
            let mut sum = 0.0;
            for k in 0..=GRID {
                let (value, integral) = trace.at(begin + k as f64 * step, &mut place);
                sum += match order {
                    0 => -self.first[k] * (integral - base),
                    1 => -self.first[k] * value,
                    _ => self.second[k] * value,
                };
            }
            sum
        };
        self.centres.iter().map(average).collect()
    }
}
