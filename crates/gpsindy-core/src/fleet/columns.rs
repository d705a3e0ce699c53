//! The columns of a design besides the level: a covariate as a line, and as a curve of it.

use super::Quantity;
use super::limits::{BENDS, FEWEST_VALUES};
use super::report::{Curve, Slope};
use nalgebra::{DMatrix, DVector};

/// A column of the design besides the level.
#[derive(Debug, Clone)]
pub(super) struct Column {
    covariate: usize,
    /// Mean of the covariate.
    mean: f64,
    /// A curve of size 1, or the line.
    curve: Option<Curve>,
}

impl Column {
    pub(super) fn is_curve(&self) -> bool {
        self.curve.is_some()
    }

    pub(super) fn is_of_same_covariate(&self, other: &Self) -> bool {
        self.covariate == other.covariate
    }

    pub(super) fn at(&self, covariates: &[f64]) -> f64 {
        let x = covariates[self.covariate];
        self.curve.as_ref().map_or(x - self.mean, |curve| curve.form(x, self.mean))
    }
}

/// The lines. A covariate that never changes carries no information and can't be separated from the mean.
pub(super) fn straight(quantity: &Quantity) -> Vec<Column> {
    let all = &quantity.observations;
    let count = all.len().max(1) as f64;
    let moves = |c: &usize| all.iter().any(|o| o.covariates[*c] != all[0].covariates[*c]);
    let mean = |c: usize| all.iter().map(|o| o.covariates[c]).sum::<f64>() / count;
    let line = |covariate| Column { covariate, mean: mean(covariate), curve: None };
    (0..quantity.covariates.len()).filter(moves).map(line).collect()
}

/// The curves that may be added to a line: both ends, every scale; none where the covariate has too few values.
pub(super) fn curves(quantity: &Quantity, line: &Column) -> Vec<Column> {
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

/// What every covariate does, by the coefficients of the level and the columns, and their covariance.
pub(super) fn slopes(
    quantity: &Quantity,
    columns: &[Column],
    (beta, covariance): (&DVector<f64>, &DMatrix<f64>),
) -> Vec<Slope> {
    let size = |place: usize| (beta[1 + place], covariance[(1 + place, 1 + place)].sqrt());
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
