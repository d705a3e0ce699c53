//! The population of a quantity: mean, spread between units, scatter within a unit, slopes of the covariates.
//!
//! `y_ij = beta' x_ij + u_i + e_ij`, `u_i ~ N(0, tau^2)`, `e_ij ~ N(0, s_ij^2 + omega^2)`; x_ij is 1, the covariates less their mean, and the
//! curves of those that the fleet shows to be nonlinear.
//! tau and omega by restricted maximum likelihood, beta by generalised least squares, a unit's estimate by its posterior.
//!
//! Source: Harville 1977, Maximum likelihood approaches to variance component estimation, equation 5.5.

use super::columns::{self, Column};
use super::limits::{FINEST, LADDER, LOWEST_DECADE, TAIL};
use super::report::{Population, Shrunk};
use super::{Observation, Quantity};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// One period of a unit.
pub(super) struct Row {
    pub(super) since: Option<f64>,
    pub(super) value: f64,
    pub(super) variance: f64,
    /// 1, the centred covariates and their curves.
    pub(super) design: DVector<f64>,
}

/// The periods of a unit, in time.
pub(super) struct Group {
    pub(super) unit: String,
    pub(super) rows: Vec<Row>,
}

/// The observations of one quantity, unit by unit.
pub(super) struct Table {
    pub(super) groups: Vec<Group>,
    n_columns: usize,
    columns: Vec<Column>,
    has_history: bool,
}

/// The population that some of the units show.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// tau^2.
    pub(super) between: f64,
    /// omega^2.
    pub(super) within: f64,
    pub(super) beta: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// Units less columns of the design.
    pub(super) freedom: usize,
}

/// A unit's level and what the population predicts of it.
pub(super) struct Level {
    /// Mean of the unit's residuals from the population's mean.
    pub(super) residual: f64,
    /// Variance of that mean by the errors of its estimates.
    pub(super) own: f64,
    /// Variance by which the population's mean is uncertain there.
    pub(super) mean: f64,
}

impl Table {
    /// The table with these columns besides the level.
    pub(super) fn new(quantity: &Quantity, columns: Vec<Column>) -> Self {
        let all = &quantity.observations;
        let row = |o: &Observation| Row {
            since: o.since,
            value: o.value,
            variance: o.deviation * o.deviation,
            design: DVector::from_iterator(
                1 + columns.len(),
                std::iter::once(1.0).chain(columns.iter().map(|column| column.at(&o.covariates))),
            ),
        };
        let mut groups: Vec<Group> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for observation in all {
            let place = *places.entry(&observation.unit).or_insert(groups.len());
            if place == groups.len() {
                groups.push(Group { unit: observation.unit.clone(), rows: Vec::new() });
            }
            groups[place].rows.push(row(observation));
        }
        let at = |row: &Row| row.since.unwrap_or(f64::NEG_INFINITY);
        groups.iter_mut().for_each(|g| g.rows.sort_by(|a, b| at(a).total_cmp(&at(b))));
        let has_history = groups.iter().any(|g| g.rows.len() > 1);
        Self { groups, n_columns: 1 + columns.len(), columns, has_history }
    }

    /// The units but the odd ones, from which populations are fitted.
    pub(super) fn without(&self, odd: &[usize]) -> Kept<'_> {
        let mut kept = vec![true; self.groups.len()];
        odd.iter().for_each(|&i| kept[i] = false);
        let values = || self.groups.iter().zip(&kept).filter(|(_, k)| **k).flat_map(|(g, _)| &g.rows).map(|r| r.value);
        let count = values().count().max(1) as f64;
        let mean = values().sum::<f64>() / count;
        let size = values().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        Kept { table: self, kept, size, sums: RefCell::default() }
    }

    /// What the columns besides the level are.
    pub(super) fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// What one unit adds to the sums of the likelihood.
    pub(super) fn sums(&self, group: &Group, between: f64, within: f64) -> Sums {
        let mut sums = Sums::zero(self.n_columns);
        let (mut weight, mut x, mut y) = (0.0, DVector::zeros(self.n_columns), 0.0);
        for row in &group.rows {
            let variance = row.variance + within;
            let w = 1.0 / variance;
            sums.xx.ger(w, &row.design, &row.design, 1.0);
            sums.xy.axpy(w * row.value, &row.design, 1.0);
            sums.yy += w * row.value * row.value;
            weight += w;
            x.axpy(w, &row.design, 1.0);
            y += w * row.value;
            sums.log_det += variance.ln();
        }
        // Woodbury: the unit's common part.
        let common = between / (1.0 + between * weight);
        sums.xx.ger(-common, &x, &x, 1.0);
        sums.xy.axpy(-common * y, &x, 1.0);
        sums.yy -= common * y * y;
        sums.log_det += (between * weight).ln_1p();
        sums
    }

    /// The level of unit `i` in addition to `fit`.
    pub(super) fn level(&self, i: usize, fit: &Fit) -> Level {
        let (mut weight, mut x, mut residual) = (0.0, DVector::zeros(self.n_columns), 0.0);
        for row in &self.groups[i].rows {
            let w = 1.0 / (row.variance + fit.within);
            weight += w;
            x.axpy(w, &row.design, 1.0);
            residual += w * (row.value - row.design.dot(&fit.beta));
        }
        x /= weight;
        Level { residual: residual / weight, own: 1.0 / weight, mean: x.dot(&(&fit.covariance * &x)) }
    }

    pub(super) fn report(&self, quantity: &Quantity, odd: &[usize]) -> Population {
        let is_odd = |i: usize| odd.contains(&i);
        let others = self.without(odd);
        let fit = others.fit(None);
        let mut estimates = Vec::new();
        for (i, group) in self.groups.iter().enumerate() {
            let (value, variance) = match &fit {
                Some(fit) => {
                    let Level { residual, own, mean } = self.level(i, fit);
                    // An odd unit is no draw from the population and borrows nothing from it.
                    let kept = if is_odd(i) { 1.0 } else { fit.between / (fit.between + own) };
                    (fit.beta[0] + kept * residual, kept * own + (1.0 - kept).powi(2) * mean)
                }
                None => {
                    let weight: f64 = group.rows.iter().map(|r| 1.0 / r.variance).sum();
                    (group.rows.iter().map(|r| r.value / r.variance).sum::<f64>() / weight, 1.0 / weight)
                }
            };
            estimates.push(Shrunk { unit: group.unit.clone(), value, deviation: variance.sqrt() });
        }
        let spread_p_value = fit.as_ref().and_then(|fit| others.alike(fit.within)).unwrap_or(1.0);
        let (mean, spread) = match &fit {
            Some(fit) => (fit.beta[0], fit.between.sqrt()),
            None => (estimates.iter().map(|e| e.value).sum::<f64>() / estimates.len().max(1) as f64, 0.0),
        };
        Population {
            effect: quantity.effect.clone(),
            state: quantity.state.clone(),
            parameter: quantity.parameter.clone(),
            unit: quantity.unit.clone(),
            mean,
            spread,
            spread_p_value,
            scatter: fit.as_ref().filter(|_| self.has_history).map(|f| f.within.sqrt()),
            units: self.groups.len(),
            covariates: fit
                .as_ref()
                .map_or_else(Vec::new, |fit| columns::slopes(quantity, &self.columns, (&fit.beta, &fit.covariance))),
            randomise: (spread_p_value < TAIL).then_some((mean - 2.0 * spread, mean + 2.0 * spread)),
            estimates,
        }
    }
}

/// What the likelihood needs of some units at given variances; units add up.
#[derive(Debug, Clone)]
pub(super) struct Sums {
    xx: DMatrix<f64>,
    xy: DVector<f64>,
    yy: f64,
    log_det: f64,
}

impl Sums {
    fn zero(k: usize) -> Self {
        Self { xx: DMatrix::zeros(k, k), xy: DVector::zeros(k), yy: 0.0, log_det: 0.0 }
    }

    pub(super) fn add(&mut self, other: &Self, sign: f64) {
        self.xx += &other.xx * sign;
        self.xy.axpy(sign, &other.xy, 1.0);
        self.yy += sign * other.yy;
        self.log_det += sign * other.log_det;
    }

    /// Squares that the best coefficients leave.
    pub(super) fn misfit(&self) -> Option<f64> {
        Some(self.yy - self.xx.clone().cholesky()?.solve(&self.xy).dot(&self.xy))
    }

    /// Restricted log likelihood and coefficients.
    fn solve(&self) -> Option<(f64, DVector<f64>)> {
        let factor = self.xx.clone().cholesky()?;
        let beta = factor.solve(&self.xy);
        let log_information = 2.0 * factor.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        Some((-0.5 * (self.log_det + log_information + self.yy - beta.dot(&self.xy)), beta))
    }
}

/// A variance as a rung of a ladder of its logarithm; none is zero. Rungs are whole numbers, so that fits that differ by one unit ask
/// for the same sums.
pub(super) type Rung = Option<i32>;

/// Units of a table from which populations are fitted, all of them or all but one.
///
/// Leaving one unit out takes its share off the sums of all, so that the fits without each unit in turn cost little more than one fit.
pub(super) struct Kept<'a> {
    table: &'a Table,
    kept: Vec<bool>,
    /// Variance of the values, the scale of the ladder.
    size: f64,
    sums: RefCell<HashMap<(Rung, Rung), Rc<Sums>>>,
}

impl Kept<'_> {
    /// The population of these units, but the one at a place; none where there are too few to estimate a spread.
    pub(super) fn fit(&self, but: Option<usize>) -> Option<Fit> {
        let but = but.filter(|&i| self.kept[i]);
        let count = self.kept.iter().filter(|k| **k).count() - usize::from(but.is_some());
        let freedom = count.checked_sub(self.table.n_columns).filter(|f| *f > 0)?;
        let likelihood = |b: Rung, w: Rung| self.at(b, w, but).solve().map_or(f64::NEG_INFINITY, |s| s.0);
        let (mut between, mut within) = (None, None);
        // One variance at a time: two of them, nearly orthogonal, settle in a few rounds.
        for _ in 0..if self.table.has_history { 4 } else { 1 } {
            between = best_rung(LADDER.len(), |rung| likelihood(rung, within));
            if self.table.has_history {
                within = best_rung(LADDER.len(), |rung| likelihood(between, rung));
            }
        }
        let sums = self.at(between, within, but);
        let (_, beta) = sums.solve()?;
        let (between, within) = (self.variance(between), self.variance(within));
        Some(Fit { between, within, covariance: sums.xx.try_inverse()?, beta, freedom })
    }

    fn variance(&self, rung: Rung) -> f64 {
        self.size * rung_share(rung)
    }

    /// The sums at two rungs, less those of one unit.
    fn at(&self, between: Rung, within: Rung, but: Option<usize>) -> Sums {
        let (b, w) = (self.variance(between), self.variance(within));
        let known = self.sums.borrow().get(&(between, within)).cloned();
        let all = known.unwrap_or_else(|| {
            let all = Rc::new(self.total(b, w));
            self.sums.borrow_mut().insert((between, within), all.clone());
            all
        });
        let mut sums = (*all).clone();
        if let Some(i) = but {
            sums.add(&self.table.sums(&self.table.groups[i], b, w), -1.0);
        }
        sums
    }

    fn total(&self, between: f64, within: f64) -> Sums {
        let mut total = Sums::zero(self.table.n_columns);
        for (group, _) in self.table.groups.iter().zip(&self.kept).filter(|(_, kept)| **kept) {
            total.add(&self.table.sums(group, between, within), 1.0);
        }
        total
    }

    /// Chance of so much scatter between the units if they were alike (Cochran's Q).
    fn alike(&self, within: f64) -> Option<f64> {
        let sums = self.total(0.0, within);
        let (_, beta) = sums.solve()?;
        let alike = Fit { between: 0.0, within, covariance: sums.xx.try_inverse()?, beta, freedom: 0 };
        let places = (0..self.kept.len()).filter(|&i| self.kept[i]);
        let freedom = places.clone().count().checked_sub(self.table.n_columns).filter(|f| *f > 0)?;
        let squares = places.map(|i| {
            let level = self.table.level(i, &alike);
            level.residual * level.residual / level.own
        });
        Some(ChiSquared::new(freedom as f64).ok()?.sf(squares.sum()))
    }
}

/// The variance of a rung, of the scale of its ladder.
pub(super) fn rung_share(rung: Rung) -> f64 {
    rung.map_or(0.0, |m| 10f64.powf(LOWEST_DECADE + f64::from(m) * FINEST))
}

/// The rung of the largest likelihood: zero, or the best of the ladder, looked at finer and finer in so many steps.
pub(super) fn best_rung(steps: usize, likelihood: impl Fn(Rung) -> f64) -> Rung {
    let mut best = (f64::NEG_INFINITY, 0);
    let mut low = 0;
    for &step in LADDER.iter().take(steps) {
        for k in 0..=14 {
            let value = likelihood(Some(low + step * k));
            if value > best.0 {
                best = (value, low + step * k);
            }
        }
        low = best.1 - step;
    }
    if likelihood(None) >= best.0 { None } else { Some(best.1) }
}
