//! How covariates enter a fleet: as a line, and beside it as a curve where the fleet shows one.
//!
//! A machine warms up as `1 - exp(-t/tau)` and an oil thins as `exp(-T/theta)`: a line through that leaves a rest which follows the season,
//! as the use of the machine does, and looks like wear. A curve is one exponential, steep at either end of the covariate's range, of a
//! scale out of a short list. It enters if its likelihood pays for one number more and for the choice among the curves.
//!
//! Source: Chen and Chen 2008, equation 2 (Bayesian information criterion extended by the number of models of a size).

use super::Quantity;
use super::limits::{BENDS, FEWEST_VALUES};
use super::population::{Fit, Sums, Table};
use super::report::{Curve, Slope};

/// A column of the design beside the level.
#[derive(Debug, Clone)]
pub(super) struct Column {
    covariate: usize,
    /// Mean of the covariate.
    mean: f64,
    /// A curve of size 1, or the line.
    curve: Option<Curve>,
}

impl Column {
    pub(super) fn at(&self, covariates: &[f64]) -> f64 {
        let x = covariates[self.covariate];
        self.curve.as_ref().map_or(x - self.mean, |curve| curve.form(x, self.mean))
    }
}

/// The lines. A covariate that never changes tells nothing and can't be parted from the mean.
pub(super) fn straight(quantity: &Quantity) -> Vec<Column> {
    let all = &quantity.observations;
    let count = all.len().max(1) as f64;
    let moves = |c: &usize| all.iter().any(|o| o.covariates[*c] != all[0].covariates[*c]);
    let mean = |c: usize| all.iter().map(|o| o.covariates[c]).sum::<f64>() / count;
    let line = |covariate| Column { covariate, mean: mean(covariate), curve: None };
    (0..quantity.covariates.len()).filter(moves).map(line).collect()
}

/// The curve that the fleet shows most clearly beside the columns of `table`; none where no curve pays for itself.
pub(super) fn next(quantity: &Quantity, table: &Table) -> Option<Column> {
    let is_bent = |covariate: usize| table.columns().iter().any(|c| c.covariate == covariate && c.curve.is_some());
    let lines = table.columns().iter().filter(|c| c.curve.is_none() && !is_bent(c.covariate));
    let tried: Vec<Column> = lines.flat_map(|line| curves(quantity, line)).collect();
    if tried.is_empty() {
        return None;
    }
    let fit = table.without(&[]).fit(None)?;
    let cost = 0.5 * (quantity.observations.len() as f64).ln() + (tried.len() as f64).ln();
    let before = Units::new(table, &fit)?;
    let gains = tried.into_iter().filter_map(|column| {
        let known = table.columns().iter().cloned();
        let bent = Table::with(quantity, known.chain([column.clone()]).collect());
        Some((least_gain(&before, &Units::new(&bent, &fit)?, cost)?, column))
    });
    gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, column)| column)
}

/// The curves of a covariate: both ends, every scale.
fn curves(quantity: &Quantity, line: &Column) -> Vec<Column> {
    let mut values: Vec<f64> = quantity.observations.iter().map(|o| o.covariates[line.covariate]).collect();
    values.sort_by(f64::total_cmp);
    let (low, high) = (values[0], values[values.len() - 1]);
    values.dedup();
    if values.len() < FEWEST_VALUES {
        return Vec::new();
    }
    let curve = |(from, sign): (f64, f64), share: f64| {
        let scale = sign * share * (high - low);
        Column { curve: Some(Curve { from, scale, size: 1.0, deviation: 0.0 }), ..line.clone() }
    };
    let ends = [(low, 1.0), (high, -1.0)];
    ends.iter().flat_map(|&end| BENDS.map(|share| curve(end, share))).collect()
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

/// What every covariate does, by the coefficients of a fit.
pub(super) fn slopes(quantity: &Quantity, columns: &[Column], fit: &Fit) -> Vec<Slope> {
    let size = |place: usize| (fit.beta[1 + place], fit.covariance[(1 + place, 1 + place)].sqrt());
    let curve = |covariate: usize| {
        let place = columns.iter().position(|c| c.covariate == covariate && c.curve.is_some())?;
        let (size, deviation) = size(place);
        columns[place].curve.clone().map(|curve| Curve { size, deviation, ..curve })
    };
    let lines = columns.iter().enumerate().filter(|(_, column)| column.curve.is_none());
    lines
        .map(|(place, column)| Slope {
            covariate: quantity.covariates[column.covariate].clone(),
            value: size(place).0,
            deviation: size(place).1,
            mean: column.mean,
            curve: curve(column.covariate),
        })
        .collect()
}
