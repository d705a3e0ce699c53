//! A few points of four stretches of a series, those of one time side by side.

use super::events::Events;
use super::overlap::LANES;
use super::scaled::Scaled;
use super::steps::Table;

/// Points of one stretch that are prepared at once.
pub(super) const TILE: usize = 16;

/// Points of the four stretches, those of one time side by side.
pub(super) struct Tile<const M: usize> {
    pub(super) table: Table<M, { TILE * LANES }>,
    pub(super) target: [f64; TILE * LANES],
    /// Noise variance of the point.
    pub(super) own: [f64; TILE * LANES],
    /// 1 where there is no measurement, else 0.
    pub(super) absent: [f64; TILE * LANES],
}

impl<const M: usize> Tile<M> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        let zero = [0.0; TILE * LANES];
        Self { table: Table::new(), target: zero, own: zero, absent: zero }
    }

    /// Takes `TILE` points of every stretch, which may lie before the first event or behind the last.
    #[inline(always)]
    pub(super) fn take(&mut self, scaled: &Scaled, events: &Events, begins: [isize; LANES]) {
        let (time, target) = (&*events.time, &*events.target);
        let (n, lambda) = (time.len(), scaled.lambda);
        for (l, begin) in begins.into_iter().enumerate() {
            if begin >= 1 && begin as usize + TILE <= n {
                let begin = begin as usize;
                let now = &time[begin..begin + TILE];
                let past = &time[begin - 1..begin - 1 + TILE];
                let target = &target[begin..begin + TILE];
                for s in 0..TILE {
                    let place = s * LANES + l;
                    self.table.a[place] = (lambda * (now[s] - past[s])).min(300.0);
                    let absent = target[s].is_nan();
                    self.target[place] = if absent { 0.0 } else { target[s] };
                    self.absent[place] = if absent { 1.0 } else { 0.0 };
                    self.own[place] = scaled.rho * events.noise_weight(begin + s) + scaled.jitter;
                }
                continue;
            }
            for s in 0..TILE {
                // Beyond the ends there is no step and no measurement.
                let (place, i) = (s * LANES + l, begin + s as isize);
                let inside = i >= 0 && (i as usize) < n;
                let i = i.max(0) as usize;
                let measured = inside && !target[i].is_nan();
                self.table.a[place] = if inside && i > 0 { (lambda * (time[i] - time[i - 1])).min(300.0) } else { 0.0 };
                self.target[place] = if measured { target[i] } else { 0.0 };
                self.absent[place] = if measured { 0.0 } else { 1.0 };
                let weight = if measured { events.noise_weight(i) } else { 1.0 };
                self.own[place] = scaled.rho * weight + scaled.jitter;
            }
        }
    }
}
