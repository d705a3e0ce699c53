//! What the cells of every column are: numbers or texts.

use super::cell::{cell, number, shown};
use super::scan::{self, Body};
use crate::input::Input;

/// What the cells of a column are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cells {
    pub(crate) numbers: usize,
    pub(crate) texts: usize,
    /// The first text, in quotes.
    pub(crate) text: String,
}

impl Cells {
    /// Of every one of `count` columns; none where a line can't be read.
    pub(super) fn of_columns(input: &Input, body: Body, count: usize) -> Vec<Self> {
        let mut all = vec![Self::default(); count];
        let done = scan::rows(input, body, &gpsindy_core::Silent, &mut |row| {
            all.iter_mut().enumerate().for_each(|(i, cells)| cells.take(cell(row, i)));
            Ok(())
        });
        if done.is_ok() { all } else { Vec::new() }
    }

    fn take(&mut self, cell: &str) {
        match number(cell) {
            Ok(value) => self.numbers += usize::from(!value.is_nan()),
            Err(()) => {
                if self.texts == 0 {
                    self.text = shown(cell);
                }
                self.texts += 1;
            }
        }
    }
}
