//! Cells: the values between one reading of a sensor and the next, which repeat it and its noise.
//!
//! A cell says once what its reading says. Where a model foresees the repeats, all of its errors are that of the reading; where it does not,
//! they differ by what it misses, which no noise excuses.

/// The cells of one column in one window.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cells {
    /// The cell of every row; none where nothing was measured.
    of_row: Vec<Option<usize>>,
    /// Values of every cell.
    counts: Vec<f64>,
}

impl Cells {
    /// By row, whether a value is there and whether it repeats the one before; nothing where none does.
    pub(crate) fn new(rows: impl Iterator<Item = (bool, bool)>) -> Option<Self> {
        let (mut cells, mut any) = (Self::default(), false);
        for (there, repeats) in rows {
            if there && (!repeats || cells.counts.is_empty()) {
                cells.counts.push(0.0);
            }
            any |= there && repeats;
            let own = if there { cells.counts.len().checked_sub(1) } else { None };
            own.into_iter().for_each(|cell| cells.counts[cell] += 1.0);
            cells.of_row.push(own);
        }
        any.then_some(cells)
    }

    /// The cells and the values of the rows that have one.
    fn values<'a>(&'a self, rows: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        self.of_row.iter().zip(rows).filter_map(|(cell, value)| Some(((*cell)?, *value)))
    }

    /// The mean of every cell.
    pub(crate) fn means(&self, rows: &[f64]) -> Vec<f64> {
        let mut means = vec![0.0; self.counts.len()];
        self.values(rows).for_each(|(cell, value)| means[cell] += value / self.counts[cell]);
        means
    }

    /// Sum over the cells of the mean square by which their values differ from their means.
    pub(crate) fn within(&self, rows: &[f64], means: &[f64]) -> f64 {
        self.values(rows).map(|(cell, value)| (value - means[cell]).powi(2) / self.counts[cell]).sum()
    }

    /// Rows of which every cell counts once: its mean as `whitened`, and what its values differ by times `scale`.
    pub(crate) fn spread(&self, rows: &mut [f64], (means, whitened): (&[f64], &[f64]), scale: f64) {
        for (cell, value) in self.of_row.iter().zip(rows) {
            *value = match *cell {
                Some(cell) => (whitened[cell] + (*value - means[cell]) * scale) / self.counts[cell].sqrt(),
                None => 0.0,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_counts_once_however_often_its_reading_is_repeated() {
        // Two readings, one of them repeated twice with a hole between.
        let rows = [(true, false), (true, false), (false, false), (true, true), (true, true)];
        let Some(cells) = Cells::new(rows.into_iter()) else { panic!("no cells") };
        let errors = [1.0, 2.0, f64::NAN, 2.0, 5.0];
        let means = cells.means(&errors);
        assert_eq!(means, [1.0, 3.0]);
        assert!((cells.within(&errors, &means) - 2.0).abs() < 1e-12);
        let mut values = errors;
        cells.spread(&mut values, (&means, &means), 1.0);
        let sum: f64 = values.iter().map(|v| v * v).sum();
        assert!((sum - (1.0 + 9.0 + 2.0)).abs() < 1e-12, "{values:?}");
        assert!(Cells::new([(true, false); 3].into_iter()).is_none());
    }
}
