//! Lulls of a column: where its sensor falls silent within a run, or stands still and then jumps to where it would have been.

/// Samples from which a lull is one: a column that repeats a value once in a hundred samples does so ten times in a row by chance never.
const LULL: usize = 10;

/// How many times the usual distance of a column's values a silence lasts: a slower sensor is silent between its own samples.
const LONG: f64 = 10.0;

/// Share of the samples that may repeat a value elsewhere, where a standstill is the sensor's: one with coarse steps repeats values when its
/// machine rests.
const REPEATS: f64 = 0.01;

/// How many times the usual change a sensor jumps that stood still: a machine that rested starts from where it is.
const JUMP: f64 = 5.0;

/// A lull within a run: its first sample and how many it has.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Lull {
    pub(crate) first: usize,
    pub(crate) count: usize,
}

/// The longest lulls so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lulls {
    sample: usize,
    /// Since the run's first value, none before.
    silent: Option<usize>,
    silence: Lull,
    /// Samples within runs that hold no value.
    missing: usize,
    /// The value of now, where it began, how often it was repeated, and whether the run began with it.
    stay: Option<Stay>,
    still: Still,
    repeats: usize,
}

#[derive(Debug, Clone, Copy)]
struct Stay {
    value: f64,
    lull: Lull,
    is_first: bool,
}

/// The longest standstill, the value and the change that ended it.
#[derive(Debug, Clone, Copy, Default)]
struct Still {
    lull: Lull,
    value: f64,
    jump: f64,
}

impl Lulls {
    /// Takes the next sample, NaN where it has no value.
    pub(crate) fn push(&mut self, value: f64) {
        let sample = self.sample;
        self.sample += 1;
        if value.is_nan() {
            self.silent = self.silent.map(|count| count + 1);
            return;
        }
        let silent = self.silent.replace(0).unwrap_or(0);
        self.missing += silent;
        if silent > self.silence.count {
            self.silence = Lull { first: sample - silent, count: silent };
        }
        match &mut self.stay {
            Some(stay) if stay.value == value => {
                stay.lull.count += 1;
                self.repeats += 1;
            }
            Some(stay) => {
                if !stay.is_first && stay.lull.count > self.still.lull.count {
                    self.still = Still { lull: stay.lull, value: stay.value, jump: (value - stay.value).abs() };
                }
                *stay = Stay { value, lull: Lull { first: sample, count: 1 }, is_first: false };
            }
            None => self.stay = Some(Stay { value, lull: Lull { first: sample, count: 1 }, is_first: true }),
        }
    }

    /// A run ends: what comes is no part of its lulls.
    pub(crate) fn end_run(&mut self) {
        (self.silent, self.stay) = (None, None);
    }

    /// The longest silence, where it is far longer than that between two values of this column. `count`: its values.
    pub(crate) fn silence(&self, count: usize) -> Option<Lull> {
        let Lull { count: longest, .. } = self.silence;
        let usual = 1.0 + (self.missing - longest) as f64 / count.max(1) as f64;
        (longest >= LULL && longest as f64 > LONG * usual).then_some(self.silence)
    }

    /// The longest standstill of a column that moves at nearly every other sample, where it ends with a jump. A stay at zero or at an end of
    /// the range is a rest or a stop. `kept`: samples to take the usual change from.
    pub(crate) fn standstill(&self, kept: &[f64], (min, max): (f64, f64), count: usize) -> Option<Lull> {
        let Still { lull, value, jump } = self.still;
        let elsewhere = self.repeats.saturating_sub(lull.count - usize::from(lull.count > 0));
        if lull.count < LULL || elsewhere as f64 > REPEATS * count as f64 || [0.0, min, max].contains(&value) {
            return None;
        }
        let mut changes: Vec<f64> =
            kept.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|change| *change > 0.0).collect();
        changes.sort_unstable_by(f64::total_cmp);
        let usual = changes.get(changes.len() / 2)?;
        (jump > JUMP * usual).then_some(lull)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn wave(i: usize) -> f64 {
        (i as f64 * 0.05).sin() + 1e-3 * ((i * 7919) % 101) as f64 / 101.0
    }

    fn lulls(count: usize, value: impl Fn(usize) -> f64) -> (Option<Lull>, Option<Lull>) {
        let values: Vec<f64> = (0..count).map(value).collect();
        let mut found = Lulls::default();
        values.iter().for_each(|v| found.push(*v));
        let present = values.iter().filter(|v| !v.is_nan()).count();
        let bounds = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        (found.silence(present), found.standstill(&values, bounds, present))
    }

    #[test]
    fn a_sensor_that_falls_silent_or_stands_still_and_comes_back_is_found_with_its_place() {
        let silent = lulls(1000, |i| if (300..420).contains(&i) { f64::NAN } else { wave(i) });
        assert_eq!(silent, (Some(Lull { first: 300, count: 120 }), None));
        let still = lulls(1000, |i| wave(if (300..420).contains(&i) { 300 } else { i }));
        assert_eq!(still, (None, Some(Lull { first: 300, count: 120 })));
    }

    #[test]
    fn a_slower_sensor_a_rest_and_a_stop_are_none() {
        assert_eq!(lulls(1000, |i| if i % 20 == 0 { wave(i) } else { f64::NAN }), (None, None));
        // Scattered losses; a rest at zero; one from which the motion goes on; a stop; a coarse sensor.
        assert_eq!(lulls(1000, |i| if (i * 7919) % 10 < 3 { f64::NAN } else { wave(i) }), (None, None));
        assert_eq!(lulls(1000, |i| if (300..420).contains(&i) { 0.0 } else { wave(i) + 0.3 }), (None, None));
        assert_eq!(lulls(1000, |i| wave(i - i.clamp(300, 420) + 300)), (None, None));
        assert_eq!(lulls(1000, |i| if (300..420).contains(&i) { 1.5 } else { wave(i) }), (None, None));
        assert_eq!(lulls(1000, |i| (wave(i) * 20.0).round()), (None, None));
    }

    #[test]
    fn a_lull_does_not_reach_over_the_end_of_a_run() {
        let mut found = Lulls::default();
        let mut run = |of: &dyn Fn(usize) -> f64| {
            (0..100).for_each(|i| found.push(of(i)));
            found.end_run();
        };
        run(&|i| if i < 80 { wave(i) } else { f64::NAN });
        run(&|i| if i < 20 { f64::NAN } else { wave(i) });
        assert_eq!(found.silence(160), None);
    }
}
