//! Repeats: a sensor that is slower than its log, as the column itself shows it.
//!
//! Such a column shows a reading again, with its noise, until the next one comes. A repeat says nothing that the reading did not say, and
//! when the values change is when the sensor samples.

use crate::diagnose::limits::sampling::{
    FEWEST_CHANGES, FITTING, IRREGULAR, LONGER, OFF_STAMP, ONE_NOT_TWO, SHORTEST_REPEAT,
};
use crate::refine::{Log, present};

/// What the repeats of a column say of its sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Repeats {
    /// Share of the values that are readings; the others repeat the one before.
    pub(crate) news: f64,
    /// Period and phase at which the sensor samples, s, where one clock serves all logs.
    pub(crate) clock: Option<(f64, f64)>,
    /// The period, s, where the sensor's clock begins anew with each run instead.
    pub(crate) own_period: Option<f64>,
}

/// A value that differs from the one before: when that one was logged, and when it, s.
type Change = (f64, f64);

impl Repeats {
    /// `None` where the column repeats no value, or repeats values for another reason: a coarse step or a standstill, neither of which has
    /// a length of its own.
    pub(crate) fn of(logs: &[Log], column: usize) -> Option<Self> {
        let mut changes: Vec<Vec<Change>> = Vec::new();
        let (mut gaps, mut jumps, mut values) = (Vec::new(), Vec::new(), 0_usize);
        for log in logs {
            let there = present(&log.measured[column]);
            let changed = |i: &usize| there[*i].1 != there[i - 1].1;
            let at: Vec<usize> = (1..there.len()).filter(changed).collect();
            gaps.extend(at.windows(2).map(|pair| pair[1] - pair[0]));
            jumps.extend(at.iter().map(|&i| (there[i].1 - there[i - 1].1).abs()));
            changes.push(changes_in(log, column));
            values += there.len();
        }
        if gaps.len() < FEWEST_CHANGES {
            return None;
        }
        gaps.sort_unstable();
        let short = gaps[gaps.len() / IRREGULAR];
        let is_regular =
            short >= SHORTEST_REPEAT && gaps[gaps.len() * 3 / 4] as f64 <= (1.0 + LONGER) * short as f64 + 1.0;
        // A ramp that is read in coarse steps repeats its values regularly, too, and goes on by one step.
        let step = jumps.iter().copied().fold(f64::INFINITY, f64::min);
        let is_stepped = jumps.iter().filter(|&&jump| jump < ONE_NOT_TWO * step).count() * 2 > jumps.len();
        let firsts = logs.iter().filter(|log| log.measured[column].iter().any(|v| v.is_finite())).count();
        let news = (jumps.len() + firsts) as f64 / values.max(1) as f64;
        (is_regular && !is_stepped).then(|| {
            let clock = clock(&changes);
            let own_period = if clock.is_none() { own_period(&changes) } else { None };
            Self { news, clock, own_period }
        })
    }
}

/// Period, s, of a sensor whose clock begins anew with each run.
fn own_period(changes: &[Vec<Change>]) -> Option<f64> {
    let alone = changes.iter().filter_map(|own| Some((own.len() as f64, clock(std::slice::from_ref(own))?.0)));
    // A slope is known as the third power of the number of its points.
    let (sum, weight) =
        alone.fold((0.0, 0.0), |(sum, weight), (n, period)| (sum + n.powi(3) * period, weight + n.powi(3)));
    let period = Some(sum / weight).filter(|period| period.is_finite())?;
    changes.iter().any(|own| moment(own, period).is_some()).then_some(period)
}

/// A moment at which a sensor of this period samples in a run; `None` where it does not show it.
pub(crate) fn own_moment(log: &Log, column: usize, period: f64) -> Option<f64> {
    moment(&changes_in(log, column), period)
}

/// The middle of the moments which, a whole number of periods on, lie between the two stamps of nearly every change.
fn moment(changes: &[Change], period: f64) -> Option<f64> {
    let &(first, _) = changes.get(1)?;
    // Of every change the earliest and the latest moment, from the middle of one of them on and less whole periods.
    let around = |origin: f64| {
        let of = move |&(before, after): &Change| {
            let off = OFF_STAMP * (after - before);
            let turns = ((0.5 * (before + after) - origin) / period).round() * period;
            (before - off - turns, after + off - turns)
        };
        changes.iter().map(of)
    };
    let holds = |at: f64| around(at).filter(|(low, high)| (*low..=*high).contains(&at)).count();
    let candidates = around(first).flat_map(|(low, high)| [low, high]);
    let best = candidates.max_by_key(|&at| holds(at))?;
    if (holds(best) as f64) < FITTING * changes.len() as f64 {
        return None;
    }
    let held = || around(best).filter(|(low, high)| (*low..=*high).contains(&best));
    let low = held().map(|(low, _)| low).fold(f64::NEG_INFINITY, f64::max);
    let high = held().map(|(_, high)| high).fold(f64::INFINITY, f64::min);
    Some(0.5 * (low + high))
}

/// Where the values of a column change in a log.
fn changes_in(log: &Log, column: usize) -> Vec<Change> {
    let there = present(&log.measured[column]);
    let pairs = there.windows(2).filter(|pair| pair[1].1 != pair[0].1);
    pairs.map(|pair| (log.time[pair[0].0], log.time[pair[1].0])).collect()
}

/// The readings of a column that repeats them, and the rows in which they come.
pub(crate) fn readings(column: &[f64]) -> Vec<(usize, f64)> {
    let mut all = present(column);
    all.dedup_by_key(|(_, value)| *value);
    all
}

/// Period and phase, of which one moment lies between the two stamps of nearly every change.
fn clock(changes: &[Vec<Change>]) -> Option<(f64, f64)> {
    let of_pair = |pair: &[Change]| pair[1].1 - pair[0].1;
    let mut periods: Vec<f64> = changes.iter().flat_map(|log| log.windows(2).map(of_pair)).collect();
    periods.sort_by(f64::total_cmp);
    // Without those of readings that happen to be the same.
    let median = *periods.get(periods.len() / 2)?;
    let usual = periods.iter().filter(|period| **period < ONE_NOT_TWO * median);
    let (sum, count) = usual.fold((0.0, 0.0), |(sum, count), period| (sum + period, count + 1.0));
    let all = || changes.iter().flatten();
    let &(before, first) = all().next()?;
    // A line through the middles of all changes by their numbers, each counted by the line through those before it.
    let (mut period, mut phase) = (sum / count, 0.5 * (before + first));
    let (mut n, mut k, mut t, mut kk, mut kt) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let origin = phase;
    for &(before, after) in all() {
        let middle = 0.5 * (before + after);
        let number = ((middle - phase) / period).round();
        let late = middle - origin;
        (n, k, t, kk, kt) = (n + 1.0, k + number, t + late, kk + number * number, kt + number * late);
        let spread = n * kk - k * k;
        if spread > 0.0 {
            period = (n * kt - k * t) / spread;
            phase = origin + (t - period * k) / n;
        }
        if !(period > 0.0) {
            return None;
        }
    }
    let fits = |period: f64, phase: f64| {
        let is_between = |&&(before, after): &&Change| {
            let moment = phase + period * ((0.5 * (before + after) - phase) / period).round();
            let off = OFF_STAMP * (after - before);
            (before - off..=after + off).contains(&moment)
        };
        all().filter(is_between).count() as f64 >= FITTING * n
    };
    // A log that its own controller wrote has whole numbers of its samples, each from the first that shows it.
    let whole = (period / (first - before)).round() * (first - before);
    let found = [(whole, first), (period, phase)];
    found.into_iter().find(|&(period, phase)| period > 0.0 && fits(period, phase))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::sampled_at;
    use crate::random::normal;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    const STEP: f64 = 0.02;

    /// Three logs of a swing, read at the moments that `sampled` gives, with noise of this deviation, in whole numbers of `digit`.
    fn logs(sampled: impl Fn(f64) -> f64, swing: impl Fn(f64) -> f64, noise: f64, digit: f64) -> Vec<Log> {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let log = |run: usize| {
            let time: Vec<f64> = (0..400).map(|i| STEP * (i + 450 * run) as f64).collect();
            let (mut last, mut value) = (f64::NAN, 0.0);
            let mut read = |t: f64| {
                if sampled(t) != last {
                    last = sampled(t);
                    value = ((swing(last) + noise * normal(&mut random)) / digit).round() * digit;
                }
                value
            };
            let measured = vec![time.iter().map(|&t| read(t)).collect()];
            Log { time, measured, ..Log::default() }
        };
        (0..3).map(log).collect()
    }

    fn swing(t: f64) -> f64 {
        (2.0 * t).sin()
    }

    #[test]
    fn a_sensor_that_holds_shows_its_clock() {
        for (period, phase) in [(0.08, 0.0), (0.1, 0.04), (0.13, 0.011), (0.0571, 0.03)] {
            let found = Repeats::of(&logs(|t| sampled_at(t, phase, period), swing, 0.05, 1e-6), 0).unwrap();
            assert!((found.news * period / STEP - 1.0).abs() < 0.03, "{found:?}");
            let clock = found.clock.unwrap();
            // Over 26 s the moments are right within a sample.
            assert!((clock.0 - period).abs() * 26.0 / period < STEP, "{clock:?} for {period}");
            let off = (clock.1 - phase + 0.5 * period).rem_euclid(period) - 0.5 * period;
            assert!(off.abs() <= STEP, "{clock:?} for {phase}");
        }
    }

    #[test]
    fn a_sensor_whose_clock_begins_anew_in_each_run_shows_one_period() {
        let period = 0.168;
        // Each log is as long as 53.6 periods.
        let begins = |t: f64| (t / (STEP * 450.0)).floor() * STEP * 450.0;
        let phase = |t: f64| [0.02, 0.11, 0.07][(begins(t) / (STEP * 450.0)) as usize];
        let sampled = |t: f64| sampled_at(t, begins(t) + phase(t), period);
        let logs = logs(sampled, swing, 0.05, 1e-6);
        let repeats = Repeats::of(&logs, 0).unwrap();
        assert_eq!(repeats.clock, None);
        let found = repeats.own_period.unwrap();
        assert!((found / period - 1.0).abs() < 1e-3, "{found}");
        for log in &logs {
            let turns = (own_moment(log, 0, found).unwrap() - log.time[0] - phase(log.time[0])) / period;
            // Half of a sample.
            assert!((turns - turns.round()).abs() * period < 0.5 * STEP, "{turns}");
        }
    }

    #[test]
    fn a_sensor_whose_clock_jitters_or_whose_digits_are_coarse_holds_all_the_same() {
        let jitter = |t: f64| {
            let number = (t / 0.2).floor();
            let late = |k: f64| 0.2 * k + 0.02 * (7.3 * k * k).sin().abs();
            if t < late(number) { late(number - 1.0) } else { late(number) }
        };
        assert!(Repeats::of(&logs(jitter, swing, 0.05, 1e-6), 0).is_some());
        assert!(Repeats::of(&logs(|t| sampled_at(t, 0.0, 0.1), swing, 0.05, 0.01), 0).is_some());
    }

    #[test]
    fn what_repeats_for_another_reason_is_no_hold() {
        let every = |t: f64| t;
        let stops = |t: f64| (t / 1.6).floor() + (5.0 * (t / 1.6).fract()).min(1.0);
        assert_eq!(Repeats::of(&logs(every, swing, 0.05, 1e-6), 0), None, "fine digits");
        for (noise, digit) in [(0.05, 0.1), (0.05, 0.3), (1e-3, 0.1), (0.0, 0.05), (0.0, 0.4)] {
            assert_eq!(Repeats::of(&logs(every, swing, noise, digit), 0), None, "{noise} in steps of {digit}");
        }
        assert_eq!(Repeats::of(&logs(every, |t| 0.5 * t, 0.0, 0.05), 0), None, "a ramp in coarse steps");
        assert_eq!(Repeats::of(&logs(every, stops, 0.0, 1e-6), 0), None, "standstills");
        assert_eq!(Repeats::of(&logs(every, |_| 3.0, 0.0, 1e-6), 0), None, "no motion");
    }

    #[test]
    fn readings_leave_repeats_out() {
        let column = [1.0, 1.0, f64::NAN, 1.0, 2.0, 2.0, 1.0];
        assert_eq!(readings(&column), [(0, 1.0), (4, 2.0), (6, 1.0)]);
    }
}
