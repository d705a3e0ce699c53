//! Which covariates are nonlinear: a curve is added to the line of a covariate if the fleet shows one.
//!
//! A machine warms up as `1 - exp(-t/tau)` and an oil thins as `exp(-T/theta)`: a line through that leaves a residual which follows the season,
//! as the use of the machine does, and looks like wear. A curve is one exponential, steep at either end of the covariate's range, of a
//! scale out of a short list. It enters if its likelihood pays for one number more and for the choice among the curves.
//!
//! Source: Chen and Chen 2008, equation 2 (Bayesian information criterion extended by the number of models of a size).

use super::Quantity;
use super::columns::{self, Column};
use super::population::{Fit, Sums, Table};

/// The table of a quantity, with the curves that pay for themselves.
pub(super) fn table(quantity: &Quantity) -> Table {
    let mut table = Table::new(quantity, columns::straight(quantity));
    while let Some(column) = next(quantity, &table) {
        table = Table::new(quantity, with(&table, column));
    }
    table
}

/// The columns of a table and one more.
fn with(table: &Table, column: Column) -> Vec<Column> {
    table.columns().iter().cloned().chain([column]).collect()
}

/// The curve that the fleet shows most clearly in addition to the columns of `table`; none where no curve pays for itself.
fn next(quantity: &Quantity, table: &Table) -> Option<Column> {
    let bent: Vec<&Column> = table.columns().iter().filter(|c| c.is_curve()).collect();
    let is_free = |c: &&Column| !c.is_curve() && !bent.iter().any(|b| b.is_of_same_covariate(c));
    let lines = table.columns().iter().filter(is_free);
    let tried: Vec<Column> = lines.flat_map(|line| columns::curves(quantity, line)).collect();
    if tried.is_empty() {
        return None;
    }
    let fit = table.without(&[]).fit(None)?;
    let cost = 0.5 * (quantity.observations.len() as f64).ln() + (tried.len() as f64).ln();
    let before = Units::new(table, &fit)?;
    let gains = tried.into_iter().filter_map(|column| {
        let bent = Table::new(quantity, with(table, column.clone()));
        Some((least_gain(&before, &Units::new(&bent, &fit)?, cost)?, column))
    });
    gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, column)| column)
}

/// The sums of a table, unit by unit and together, at the variances of a fit.
struct Units {
    each: Vec<Sums>,
    all: Sums,
}

impl Units {
    fn new(table: &Table, fit: &Fit) -> Option<Self> {
        let each: Vec<Sums> = table.groups.iter().map(|g| table.sums(g, fit.between, fit.within)).collect();
        let mut all = each.first()?.clone();
        each.iter().skip(1).for_each(|sums| all.add(sums, 1.0));
        Some(Self { each, all })
    }

    fn without(&self, unit: usize) -> Sums {
        let mut sums = self.all.clone();
        sums.add(&self.each[unit], -1.0);
        sums
    }
}

/// Logarithm of the likelihood that a column gains, less its cost; none if it gains nothing without one of the units. An odd unit at the end
/// of a range, or one that wears, else bends the curve of the whole fleet.
fn least_gain(before: &Units, after: &Units, cost: f64) -> Option<f64> {
    let gain = |before: &Sums, after: &Sums| {
        Some(0.5 * (before.misfit()? - after.misfit()?) - cost).filter(|gain| *gain > 0.0)
    };
    let mut least = gain(&before.all, &after.all)?;
    for unit in 0..before.each.len() {
        least = least.min(gain(&before.without(unit), &after.without(unit))?);
    }
    Some(least)
}
