//! Accumulates rows of the weak form into triangular factors of constant size.
//!
//! Within a stretch of time `x(t) = x0 + (integral of Theta) xi`, with x0 free. The free start is eliminated row by row: each
//! row less the mean of those before it, times `sqrt(w / (w + 1))` for w rows before (Helmert's transformation), has an
//! independent error of the same size and no x0. Stretches take turns in twenty groups, so that terms can be cross-validated
//! later and errors that a stretch has in common are seen. With a memory, a row's weight falls as `exp(-age / memory)`.
//!
//! Source: Golub and Van Loan 2013, Matrix Computations, section 6.5 (updating a QR factorisation).

use crate::error::Result;
use crate::identify::limits::online::{FORGOTTEN, GROUPS};
use crate::regress::Reduced;
use faer::Mat;

/// Samples that follow one another in a run.
#[derive(Debug)]
pub(super) struct Block {
    /// Sample times, s, r of them.
    pub(super) time: Vec<f64>,
    /// (r x p), the integral of each term over the step that ends at the sample.
    pub(super) steps: Mat<f64>,
    /// Whether that step can be integrated over: false after a gap and at the begin of a run.
    pub(super) joined: Vec<bool>,
    /// Whether every state is known well enough at the sample.
    pub(super) known: Vec<bool>,
    /// (r x n), the states as logged; NaN is missing.
    pub(super) values: Mat<f64>,
}

/// Sum of the weights of rows, and of their squares.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Weight {
    pub(super) sum: f64,
    pub(super) squares: f64,
}

/// Rows of one state in one group.
#[derive(Debug, Clone, Default)]
struct Group {
    rows: Option<Reduced>,
    weight: Weight,
}

/// Mean of the rows of one state in the open stretch, and their weight.
#[derive(Debug, Clone)]
struct Running {
    weight: f64,
    at: f64,
    theta: Vec<f64>,
    target: f64,
}

/// The stretch of time that is being added to.
#[derive(Debug, Clone)]
struct Stretch {
    start: f64,
    /// Integral of every term since its first sample.
    sums: Vec<f64>,
    /// One a state.
    running: Vec<Running>,
}

/// Everything that was taken in.
#[derive(Debug, Clone)]
pub(super) struct Accumulator {
    n_terms: usize,
    /// Time constant of the weights, s; infinite where nothing is forgotten.
    memory: f64,
    /// One list a group, one entry a state.
    groups: Vec<Vec<Group>>,
    /// Stretches begun.
    n_stretches: usize,
    stretch: Option<Stretch>,
    /// The time that the weights refer to, s.
    now: f64,
}

/// Rows of one group and state that a block brings.
#[derive(Debug, Clone, Default)]
struct Fresh {
    theta: Vec<f64>,
    target: Vec<f64>,
    weight: Weight,
}

impl Accumulator {
    pub(super) fn new(n_states: usize, n_terms: usize, memory: Option<f64>) -> Self {
        Self {
            n_terms,
            memory: memory.unwrap_or(f64::INFINITY),
            groups: vec![vec![Group::default(); n_states]; GROUPS],
            n_stretches: 0,
            stretch: None,
            now: f64::NEG_INFINITY,
        }
    }

    /// Ends the stretch that is open; the next row begins another.
    pub(super) fn close(&mut self) {
        self.stretch = None;
    }

    /// Takes the samples of `block` in; a stretch ends once it is `length` s long.
    ///
    /// # Errors
    /// A row that is not finite.
    pub(super) fn take(&mut self, block: &Block, length: f64) -> Result<()> {
        let Some(&end) = block.time.last() else { return Ok(()) };
        let n_states = block.values.ncols();
        let mut fresh = vec![vec![Fresh::default(); n_states]; GROUPS];
        for (i, &t) in block.time.iter().enumerate() {
            let old = self.stretch.as_ref().is_some_and(|s| t - s.start >= length);
            if old || !block.joined[i] || !block.known[i] {
                self.stretch = None;
            }
            if !block.known[i] {
                continue;
            }
            if self.stretch.is_none() {
                self.n_stretches += 1;
                let running = Running { weight: 0.0, at: t, theta: vec![0.0; self.n_terms], target: 0.0 };
                let sums = vec![0.0; self.n_terms];
                self.stretch = Some(Stretch { start: t, sums, running: vec![running; n_states] });
            } else if let Some(stretch) = &mut self.stretch {
                (0..self.n_terms).for_each(|j| stretch.sums[j] += block.steps[(i, j)]);
            }
            let group = (self.n_stretches - 1) % GROUPS;
            let Some(stretch) = &mut self.stretch else { continue };
            let age = (0.5 * (t - end) / self.memory).exp();
            for (s, running) in stretch.running.iter_mut().enumerate() {
                let value = block.values[(i, s)];
                if value.is_finite() {
                    running.weight *= ((running.at - t) / self.memory).exp();
                    running.at = t;
                    running.add(&stretch.sums, value, age, &mut fresh[group][s]);
                }
            }
        }
        let decay = if self.now.is_finite() { (0.5 * (self.now - end) / self.memory).exp() } else { 1.0 };
        self.now = end;
        for (group, fresh) in self.groups.iter_mut().flatten().zip(fresh.into_iter().flatten()) {
            group.merge(fresh, decay, self.n_terms)?;
        }
        Ok(())
    }

    /// Groups of state `s` that hold enough to be distinguished, and the weight of each.
    pub(super) fn groups(&self, s: usize) -> (Vec<Reduced>, Vec<Weight>) {
        let whole: f64 = self.groups.iter().map(|group| group[s].weight.sum).sum();
        let stated = |group: &&Group| group.weight.sum > FORGOTTEN * whole;
        let kept = self.groups.iter().map(|group| &group[s]).filter(stated);
        kept.filter_map(|group| Some((group.rows.clone()?, group.weight))).unzip()
    }
}

impl Running {
    /// The row as it differs from the mean of those before it; then the mean with it.
    fn add(&mut self, sums: &[f64], value: f64, age: f64, fresh: &mut Fresh) {
        if self.weight > 0.0 {
            let factor = age * (self.weight / (self.weight + 1.0)).sqrt();
            fresh.theta.extend(sums.iter().zip(&self.theta).map(|(sum, mean)| factor * (sum - mean)));
            fresh.target.push(factor * (value - self.target));
            fresh.weight.sum += age * age;
            fresh.weight.squares += age.powi(4);
        }
        self.weight += 1.0;
        for (mean, sum) in self.theta.iter_mut().zip(sums) {
            *mean += (sum - *mean) / self.weight;
        }
        self.target += (value - self.target) / self.weight;
    }
}

impl Group {
    /// Older rows times `decay`, and `fresh` ones.
    fn merge(&mut self, fresh: Fresh, decay: f64, n_terms: usize) -> Result<()> {
        if decay != 1.0 {
            self.rows = self.rows.take().map(|rows| rows.scaled(decay));
            self.weight.sum *= decay * decay;
            self.weight.squares *= decay.powi(4);
        }
        let count = fresh.target.len();
        if count == 0 {
            return Ok(());
        }
        let theta = Mat::from_fn(count, n_terms, |i, j| fresh.theta[i * n_terms + j]);
        let rows = Reduced::new(theta.as_ref(), &fresh.target)?;
        self.rows = Some(match self.rows.take() {
            Some(older) => Reduced::stack(&[&older, &rows])?,
            None => rows,
        });
        self.weight.sum += fresh.weight.sum;
        self.weight.squares += fresh.weight.squares;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(from: usize, to: usize) -> Block {
        let time: Vec<f64> = (from..to).map(|i| 0.1 * i as f64).collect();
        let r = time.len();
        Block {
            steps: Mat::from_fn(r, 2, |i, j| if j == 0 { 0.1 } else { 0.1 * (3.0 * time[i]).cos() }),
            joined: (from..to).map(|i| i > 0).collect(),
            known: vec![true; r],
            values: Mat::from_fn(r, 1, |i, _| 2.0 + (time[i] * 1.7).sin()),
            time,
        }
    }

    fn whole(accumulator: &Accumulator) -> Reduced {
        let (groups, _) = accumulator.groups(0);
        Reduced::stack(&groups.iter().collect::<Vec<_>>()).unwrap()
    }

    /// Weighted sum of squares about the best free start of every stretch, by the book.
    fn by_the_book(xi: [f64; 2], stretches: &[(usize, usize)], memory: f64) -> f64 {
        let all = block(0, 100);
        let mut total = 0.0;
        for &(from, to) in stretches {
            let (mut sums, mut rows) = ([0.0; 2], Vec::new());
            for i in from..to {
                if i > from {
                    sums = [sums[0] + all.steps[(i, 0)], sums[1] + all.steps[(i, 1)]];
                }
                let weight = ((all.time[i] - all.time[99]) / memory).exp();
                rows.push((weight, all.values[(i, 0)] - sums[0] * xi[0] - sums[1] * xi[1]));
            }
            let weight: f64 = rows.iter().map(|r| r.0).sum();
            let mean = rows.iter().map(|r| r.0 * r.1).sum::<f64>() / weight;
            total += rows.iter().map(|r| r.0 * (r.1 - mean).powi(2)).sum::<f64>();
        }
        total
    }

    #[test]
    fn rows_folded_block_by_block_leave_the_residual_of_a_free_start_a_stretch() {
        for memory in [None, Some(2.0)] {
            let mut accumulator = Accumulator::new(1, 2, memory);
            for (from, to) in [(0, 7), (7, 8), (8, 45), (45, 100)] {
                accumulator.take(&block(from, to), 2.95).unwrap();
            }
            let stretches = [(0, 30), (30, 60), (60, 90), (90, 100)];
            for xi in [[0.0, 0.0], [0.3, -1.0], [1.0, 2.0]] {
                let expected = by_the_book(xi, &stretches, memory.unwrap_or(f64::INFINITY));
                // Rounding of sums of a hundred terms.
                assert!((whole(&accumulator).residual(&xi) / expected - 1.0).abs() < 1e-11, "{memory:?} {xi:?}");
            }
        }
    }

    #[test]
    fn a_sample_that_is_not_known_ends_the_stretch_and_gives_no_row() {
        let mut accumulator = Accumulator::new(1, 2, None);
        let mut broken = block(0, 20);
        broken.known[10] = false;
        accumulator.take(&broken, 100.0).unwrap();
        assert_eq!(accumulator.n_stretches, 2);
        // Ten and nine samples, less one free start each.
        assert_eq!(accumulator.groups(0).1.iter().map(|w| w.sum).sum::<f64>(), 17.0);
    }

    #[test]
    fn what_is_kept_does_not_grow() {
        let mut accumulator = Accumulator::new(1, 2, Some(3.0));
        for k in 0..2000 {
            accumulator.take(&block(10 * k, 10 * k + 10), 2.0).unwrap();
            let (groups, weights) = accumulator.groups(0);
            assert!(groups.iter().all(|group| group.a.nrows() <= 12));
            // Rows weigh as much as the memory holds: 3 s at 10 Hz, and the newest itself.
            assert!(weights.iter().map(|w| w.sum).sum::<f64>() < 31.0);
        }
    }
}
