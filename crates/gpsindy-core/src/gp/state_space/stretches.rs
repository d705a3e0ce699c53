//! Smooths a long series in four segments in parallel, one in each lane of a register.
//!
//! A filter forgets where it began. Each stretch is entered early, from the stationary state, and left late, with
//! nothing known of what follows; how early follows from the memory of the filter on a clock of the same mean step.
//! Where two stretches meet they must agree to rounding; where they do not, the caller goes the serial way. What the
//! filter leaves of four stretches stays near the processor, so no point is filtered twice but those of the overlaps.
//! Source: as the serial one.
// Indices of small matrices read as in the formulas.
#![allow(clippy::needless_range_loop)]

use super::events::{Column, Events};
use super::lanes::{Lanes, Portable};
use super::matern::Form;
use super::overlap::{Border, LANES, Plan};
use super::scaled::Scaled;
use super::steps::Table;
use super::tile::{TILE, Tile};

/// What is asked for at every point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Row of `K^-1 y` and diagonal of `K^-1`.
    LeftOut,
    /// Means of value and derivative, then their variances.
    Law,
}

/// Fills what is wanted into columns of one number an event.
/// `false` where the series is too short or the memory of the filter too long: then the columns hold nothing of use.
pub(super) fn smooth<const M: usize, S: Form<M>>(
    scaled: &Scaled,
    events: &Events,
    wanted: Wanted,
    out: &mut [Column<'_>],
) -> bool {
    let Some(plan) = Plan::new::<M, S>(scaled, events) else { return false };
    let form = std::marker::PhantomData::<S>;
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = pulp::x86::V3::try_new() {
        return pulp::Simd::vectorize(lanes, Sweep { scaled, events, plan, wanted, out, lanes, form });
    }
    Sweep { scaled, events, plan, wanted, out, lanes: Portable, form }.run()
}

/// What the filter leaves at a point of each stretch.
#[derive(Clone, Copy)]
struct Record<const M: usize, V> {
    /// Before the measurement.
    mean: [V; M],
    covariance: [[V; M]; M],
    /// Innovation over its variance, and one over its variance; 0 without measurement.
    innovation: V,
    precision: V,
}

/// Adjoint of the state before a measurement.
#[derive(Clone, Copy)]
struct Adjoint<const M: usize, V> {
    mean: [V; M],
    information: [[V; M]; M],
}

struct Sweep<'a, 'b, const M: usize, S, N> {
    scaled: &'a Scaled,
    events: &'a Events<'a>,
    plan: Plan,
    wanted: Wanted,
    out: &'a mut [Column<'b>],
    lanes: N,
    form: std::marker::PhantomData<S>,
}

impl<const M: usize, S: Form<M>, N: Lanes> Sweep<'_, '_, M, S, N> {
    #[inline(always)]
    fn run(mut self) -> bool {
        let (n, length) = (self.events.time.len(), self.plan.length);
        let mut records: Vec<Record<M, N::V>> = Vec::new();
        let mut clock: Vec<[[f64; TILE * LANES]; 2]> = Vec::new();
        let mut last: Option<Border<M>> = None;
        for first in (0..n).step_by(LANES * length) {
            let overlap = self.plan.overlap(&self.events.time, first);
            if overlap > length {
                return false;
            }
            let points = (length + 2 * overlap).next_multiple_of(TILE);
            records.reserve(points.saturating_sub(records.len()));
            clock.reserve((points / TILE).saturating_sub(clock.len()));
            if !self.forward(first, overlap, &mut records, &mut clock) {
                return false;
            }
            let (entry, exit) = self.backward(first, overlap, &records, &clock);
            // Borders between the stretches, and between the last four and these.
            for l in 0..=LANES {
                let border = first + l * length;
                let entered = |l| self.border(&records[overlap], &entry, l);
                let left = |l| self.border(&records[overlap + length], &exit, l);
                let agrees = match (l, &last) {
                    _ if border >= n => true,
                    (0, None) => true,
                    (0, Some(last)) => last.agrees(&entered(0)),
                    (LANES, _) => {
                        last = Some(left(LANES - 1));
                        true
                    }
                    _ => left(l - 1).agrees(&entered(l)),
                };
                if !agrees {
                    return false;
                }
            }
        }
        true
    }

    fn border(&self, record: &Record<M, N::V>, at: &Adjoint<M, N::V>, l: usize) -> Border<M> {
        let one = |v: N::V| self.lanes.get(v)[l];
        Border {
            mean: record.mean.map(one),
            covariance: record.covariance.map(|row| row.map(one)),
            adjoint: at.mean.map(one),
            information: at.information.map(|row| row.map(one)),
        }
    }

    #[inline(always)]
    fn row(&self, flat: &[f64; TILE * LANES], s: usize) -> N::V {
        self.lanes.four(flat.as_chunks::<LANES>().0[s])
    }

    #[inline(always)]
    fn rows(&self, flat: &[[[f64; TILE * LANES]; M]; M], s: usize) -> [[N::V; M]; M] {
        let mut out = [[self.lanes.splat(0.0); M]; M];
        for i in 0..M {
            for j in 0..M {
                out[i][j] = self.row(&flat[i][j], s);
            }
        }
        out
    }

    /// `A P A' + Q` of a symmetric P; only the upper half of Q is looked at.
    #[inline(always)]
    fn sandwich(&self, a: &[[N::V; M]; M], p: &[[N::V; M]; M], q: &[[N::V; M]; M]) -> [[N::V; M]; M] {
        let n = self.lanes;
        let mut left = *p;
        for i in 0..M {
            for j in 0..M {
                left[i][j] = n.times(a[i][0], p[0][j]);
                for k in 1..M {
                    left[i][j] = n.plus(a[i][k], p[k][j], left[i][j]);
                }
            }
        }
        let mut out = left;
        for i in 0..M {
            for j in i..M {
                let mut sum = q[i][j];
                for k in 0..M {
                    sum = n.plus(left[i][k], a[j][k], sum);
                }
                (out[i][j], out[j][i]) = (sum, sum);
            }
        }
        out
    }

    #[inline(always)]
    fn turned(&self, a: &[[N::V; M]; M], x: &[N::V; M]) -> [N::V; M] {
        let mut out = *x;
        for i in 0..M {
            out[i] = self.dot(&a[i], x);
        }
        out
    }

    #[inline(always)]
    fn dot(&self, a: &[N::V; M], b: &[N::V; M]) -> N::V {
        let mut sum = self.lanes.times(a[0], b[0]);
        for k in 1..M {
            sum = self.lanes.plus(a[k], b[k], sum);
        }
        sum
    }

    /// Filters four stretches; `false` where a variance is not positive.
    #[inline(always)]
    fn forward(
        &self,
        first: usize,
        overlap: usize,
        records: &mut Vec<Record<M, N::V>>,
        clock: &mut Vec<[[f64; TILE * LANES]; 2]>,
    ) -> bool {
        let n = self.lanes;
        let zero = [0.0; TILE * LANES];
        let mut tile = Tile::<M>::new();
        let mut known = [f64::NAN; TILE * LANES];
        let mut mean = [n.splat(0.0); M];
        let mut p = S::STATIONARY.map(|row| row.map(|x| n.splat(x)));
        records.clear();
        clock.clear();
        for k in (0..self.plan.length + 2 * overlap).step_by(TILE) {
            let begin = |l: usize| (first + l * self.plan.length + k) as isize - overlap as isize;
            tile.take(self.scaled, self.events, [begin(0), begin(1), begin(2), begin(3)]);
            if tile.table.a != known {
                tile.table.decay();
                tile.table.turn::<S>();
                tile.table.drive::<S>();
                known = tile.table.a;
            }
            clock.push([tile.table.a, tile.table.decay]);
            let mut variances = zero;
            for s in 0..TILE {
                let transition = self.rows(&tile.table.transition, s);
                mean = self.turned(&transition, &mean);
                p = self.sandwich(&transition, &p, &self.rows(&tile.table.noise, s));
                let (own, absent) = (self.row(&tile.own, s), self.row(&tile.absent, s));
                let variance = n.add(p[0][0], own);
                let precision = n.over(n.sub(n.splat(1.0), absent), variance);
                let innovation = n.times(n.sub(self.row(&tile.target, s), mean[0]), precision);
                records.push(Record { mean, covariance: p, innovation, precision });
                variances.as_chunks_mut::<LANES>().0[s] = n.get(variance);
                // The first row is the first column.
                let column = p[0];
                // The value's own row without a difference of near numbers.
                let kept = n.plus(own, precision, absent);
                for i in 0..M {
                    mean[i] = n.plus(column[i], innovation, mean[i]);
                    let gain = n.times(column[i], precision);
                    for j in i..M {
                        p[i][j] = if i == 0 { n.times(p[0][j], kept) } else { n.minus(gain, column[j], p[i][j]) };
                        p[j][i] = p[i][j];
                    }
                }
            }
            if !variances.iter().fold(true, |all, v| all & (*v > 0.0)) {
                return false;
            }
        }
        true
    }

    /// Smooths four filtered stretches; the adjoints where they are entered and where the next ones are.
    #[inline(always)]
    fn backward(
        &mut self,
        first: usize,
        overlap: usize,
        records: &[Record<M, N::V>],
        clock: &[[[f64; TILE * LANES]; 2]],
    ) -> (Adjoint<M, N::V>, Adjoint<M, N::V>) {
        let (n, length) = (self.lanes, self.plan.length);
        let mut at = Adjoint { mean: [n.splat(0.0); M], information: [[n.splat(0.0); M]; M] };
        let mut exit = at;
        let mut table = Table::<M, { TILE * LANES }>::new();
        let mut known = [f64::NAN; TILE * LANES];
        let mut found = [[[0.0; LANES]; TILE]; 4];
        let nothing = [[n.splat(0.0); M]; M];
        for (block, [a, decay]) in clock.iter().enumerate().rev() {
            if *a != known {
                (table.a, table.decay, known) = (*a, *decay, *a);
                table.turn::<S>();
            }
            for s in (0..TILE).rev() {
                let k = block * TILE + s;
                let record = &records[k];
                let p = &record.covariance;
                // Here the adjoint is that after the measurement.
                let mut gain = p[0];
                for i in 0..M {
                    gain[i] = n.times(gain[i], record.precision);
                }
                let turned = self.turned(&at.information, &gain);
                let weight = n.sub(record.innovation, self.dot(&gain, &at.mean));
                let diagonal = n.add(record.precision, self.dot(&gain, &turned));
                // (1 - h K') information (1 - K h') + h h'/v with h = (1, 0, ..).
                at.mean[0] = n.add(at.mean[0], weight);
                for i in 1..M {
                    at.information[0][i] = n.sub(at.information[0][i], turned[i]);
                    at.information[i][0] = at.information[0][i];
                }
                let once = n.sub(at.information[0][0], turned[0]);
                at.information[0][0] = n.add(n.sub(once, turned[0]), diagonal);
                if k == overlap + length {
                    exit = at;
                }
                if k < overlap + length {
                    let law = match self.wanted {
                        Wanted::LeftOut => [weight, diagonal, weight, weight],
                        Wanted::Law => self.law(record, &at),
                    };
                    for c in 0..4 {
                        found[c][s] = n.get(law[c]);
                    }
                }
                if k == overlap {
                    self.write(first, block * TILE, overlap, &found);
                    return (at, exit);
                }
                let transition = self.rows(&table.transition, s);
                let mut back = transition;
                for i in 0..M {
                    for j in 0..M {
                        back[i][j] = transition[j][i];
                    }
                }
                at.mean = self.turned(&back, &at.mean);
                at.information = self.sandwich(&back, &at.information, &nothing);
            }
            self.write(first, block * TILE, overlap, &found);
        }
        (at, exit)
    }

    /// Means of value and derivative, then their variances.
    #[inline(always)]
    fn law(&self, record: &Record<M, N::V>, at: &Adjoint<M, N::V>) -> [N::V; 4] {
        let n = self.lanes;
        let mut out = [n.splat(0.0); 4];
        for c in 0..M.min(2) {
            let p = &record.covariance[c];
            let taken = self.turned(&at.information, p);
            out[c] = n.add(record.mean[c], self.dot(p, &at.mean));
            out[2 + c] = n.sub(p[c], self.dot(p, &taken));
        }
        out
    }

    /// Puts what was found at points `k..k + TILE` where it belongs.
    #[inline(always)]
    fn write(&mut self, first: usize, k: usize, overlap: usize, found: &[[[f64; LANES]; TILE]; 4]) {
        let n = self.events.time.len();
        let (from, to) = (k.max(overlap), (k + TILE).min(overlap + self.plan.length));
        for (Column { values, unit }, found) in self.out.iter_mut().zip(found) {
            for l in 0..LANES {
                let begin = first + l * self.plan.length;
                let to = to.min(overlap + n.saturating_sub(begin));
                if from < to {
                    let place = begin + from - overlap;
                    for (out, found) in values[place..place + to - from].iter_mut().zip(&found[from - k..]) {
                        *out = (unit.offset + unit.factor * found[l]).max(unit.lowest);
                    }
                }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<const M: usize, S: Form<M>> pulp::WithSimd for Sweep<'_, '_, M, S, pulp::x86::V3> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<V: pulp::Simd>(self, _: V) -> bool {
        self.run()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
