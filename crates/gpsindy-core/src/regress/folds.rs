//! Which rows are held out together: whole runs, or blocks of time.

use crate::error::{Error, Result};

/// A split of the rows into parts that take turns at being held out.
///
/// Neighbouring samples of a log share their noise and their state, so rows are never held out one by one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folds {
    /// Fold of each row.
    fold: Vec<usize>,
    /// Rows of a neighbouring fold that training leaves out around a held-out block.
    gap: usize,
    run: Vec<usize>,
    n_folds: usize,
}

impl Folds {
    /// `count` folds for rows of runs with `lengths` samples, one run after the other.
    ///
    /// With at least `count` runs a fold is a set of whole runs (every `count`-th one). With fewer, each run is cut into
    /// `count` blocks of time, and `gap` rows on either side of a held-out block are not trained on.
    ///
    /// # Errors
    /// Fewer than two folds, or fewer rows than folds.
    pub fn new(lengths: &[usize], count: usize, gap: usize) -> Result<Self> {
        let rows: usize = lengths.iter().sum();
        if count < 2 {
            return Err(Error::range("folds", "at least 2", count));
        }
        if rows < 2 * count {
            return Err(Error::TooFewSamples { what: format!("{count} folds"), needed: 2 * count, found: rows });
        }
        let whole_runs = lengths.iter().filter(|&&n| n > 0).count() >= count;
        let (mut fold, mut run) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
        let mut seen = 0;
        for (index, &n) in lengths.iter().enumerate() {
            for i in 0..n {
                fold.push(if whole_runs { seen % count } else { i * count / n });
                run.push(index);
            }
            seen += usize::from(n > 0);
        }
        Ok(Self { fold, gap: if whole_runs { 0 } else { gap }, run, n_folds: count })
    }

    /// Number of folds.
    pub fn n_folds(&self) -> usize {
        self.n_folds
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.fold.len()
    }

    /// The rows that fold `k` holds out.
    pub fn held_out(&self, k: usize) -> Vec<usize> {
        (0..self.fold.len()).filter(|&i| self.fold[i] == k).collect()
    }

    /// The rows that are trained on while fold `k` is held out.
    pub fn training(&self, k: usize) -> Vec<usize> {
        let n = self.fold.len();
        let near = |i: usize| {
            let (from, to) = (i.saturating_sub(self.gap), (i + self.gap + 1).min(n));
            (from..to).any(|other| self.fold[other] == k && self.run[other] == self.run[i])
        };
        (0..n).filter(|&i| !near(i)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_stay_whole_where_there_are_enough_of_them() {
        let folds = Folds::new(&[3, 2, 4], 3, 5).unwrap();
        assert_eq!(folds.held_out(1), [3, 4]);
        assert_eq!(folds.training(1), [0, 1, 2, 5, 6, 7, 8]);
    }

    #[test]
    fn one_run_is_cut_into_blocks_with_gaps() {
        let folds = Folds::new(&[12], 3, 1).unwrap();
        assert_eq!(folds.held_out(1), [4, 5, 6, 7]);
        assert_eq!(folds.training(1), [0, 1, 2, 9, 10, 11]);
    }

    #[test]
    fn every_row_is_held_out_once() {
        for lengths in [vec![17], vec![5, 30], vec![4, 4, 4, 4, 4, 4]] {
            let folds = Folds::new(&lengths, 4, 2).unwrap();
            let mut seen = vec![0; folds.n_rows()];
            (0..4).flat_map(|k| folds.held_out(k)).for_each(|i| seen[i] += 1);
            assert!(seen.iter().all(|&n| n == 1));
        }
    }

    #[test]
    fn too_few_rows_or_folds_are_refused() {
        assert!(Folds::new(&[3], 2, 0).is_err());
        assert!(Folds::new(&[30], 1, 0).unwrap_err().to_string().contains("at least 2"));
    }
}
