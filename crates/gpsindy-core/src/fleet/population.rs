//! The population of a quantity: mean, spread between units, scatter within a unit, slopes of the covariates.
//!
//! `y_ij = beta' x_ij + u_i + e_ij`, `u_i ~ N(0, tau^2)`, `e_ij ~ N(0, s_ij^2 + omega^2)`; x_ij is 1 and the covariates less their mean.
//! tau and omega by restricted maximum likelihood, beta by generalised least squares, a unit's estimate by its posterior.
//!
//! Source: Harville 1977, Maximum likelihood approaches to variance component estimation, equation 5.5.

use super::limits::DECADES;
use super::report::{Population, Shrunk, Slope};
use super::{Observation, Quantity};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// One period of a unit.
pub(super) struct Row {
    pub(super) since: Option<f64>,
    pub(super) value: f64,
    pub(super) variance: f64,
    /// 1 and the centred covariates.
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
    covariance: DMatrix<f64>,
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
    pub(super) fn new(quantity: &Quantity) -> Self {
        let all = &quantity.observations;
        let count = all.len().max(1) as f64;
        let k = quantity.covariates.len();
        let means: Vec<f64> = (0..k).map(|c| all.iter().map(|o| o.covariates[c]).sum::<f64>() / count).collect();
        // A covariate that never changes tells nothing and can't be parted from the mean.
        let moving: Vec<usize> =
            (0..k).filter(|&c| all.iter().any(|o| o.covariates[c] != all[0].covariates[c])).collect();
        let row = |o: &Observation| Row {
            since: o.since,
            value: o.value,
            variance: o.deviation * o.deviation,
            design: DVector::from_iterator(
                1 + moving.len(),
                std::iter::once(1.0).chain(moving.iter().map(|&c| o.covariates[c] - means[c])),
            ),
        };
        let mut groups: Vec<Group> = Vec::new();
        for observation in all {
            let row = row(observation);
            match groups.iter_mut().find(|g| g.unit == observation.unit) {
                Some(group) => group.rows.push(row),
                None => groups.push(Group { unit: observation.unit.clone(), rows: vec![row] }),
            }
        }
        let at = |row: &Row| row.since.unwrap_or(f64::NEG_INFINITY);
        groups.iter_mut().for_each(|g| g.rows.sort_by(|a, b| at(a).total_cmp(&at(b))));
        let has_history = groups.iter().any(|g| g.rows.len() > 1);
        Self { groups, n_columns: 1 + moving.len(), has_history }
    }

    /// The population of the units for which `keep` holds; none where there are too few to tell a spread.
    pub(super) fn fit(&self, keep: impl Fn(usize) -> bool) -> Option<Fit> {
        let kept: Vec<&Group> = self.groups.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, g)| g).collect();
        let freedom = kept.len().checked_sub(self.n_columns).filter(|f| *f > 0)?;
        let values: Vec<f64> = kept.iter().flat_map(|g| g.rows.iter().map(|r| r.value)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let size = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        let solve = |between: f64, within: f64| self.solve(&kept, between, within);
        let likelihood = |between: f64, within: f64| solve(between, within).map_or(f64::NEG_INFINITY, |s| s.1);
        let (mut between, mut within) = (0.1 * size, 0.0);
        // One variance at a time: two of them, nearly orthogonal, settle in a few rounds.
        for _ in 0..if self.has_history { 4 } else { 1 } {
            between = best_variance(size, |v| likelihood(v, within));
            if self.has_history {
                within = best_variance(size, |v| likelihood(between, v));
            }
        }
        let (information, _, beta) = solve(between, within)?;
        Some(Fit { between, within, covariance: information.try_inverse()?, beta, freedom })
    }

    /// Information, restricted log likelihood and coefficients at given variances.
    fn solve(&self, kept: &[&Group], between: f64, within: f64) -> Option<(DMatrix<f64>, f64, DVector<f64>)> {
        let k = self.n_columns;
        let (mut xx, mut xy, mut yy, mut log_det) = (DMatrix::zeros(k, k), DVector::zeros(k), 0.0, 0.0);
        for group in kept {
            let (mut weight, mut x, mut y) = (0.0, DVector::zeros(k), 0.0);
            for row in &group.rows {
                let variance = row.variance + within;
                let w = 1.0 / variance;
                xx.ger(w, &row.design, &row.design, 1.0);
                xy.axpy(w * row.value, &row.design, 1.0);
                yy += w * row.value * row.value;
                weight += w;
                x.axpy(w, &row.design, 1.0);
                y += w * row.value;
                log_det += variance.ln();
            }
            // Woodbury: the unit's common part.
            let common = between / (1.0 + between * weight);
            xx.ger(-common, &x, &x, 1.0);
            xy.axpy(-common * y, &x, 1.0);
            yy -= common * y * y;
            log_det += (between * weight).ln_1p();
        }
        let factor = xx.clone().cholesky()?;
        let beta = factor.solve(&xy);
        let log_information = 2.0 * factor.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        let likelihood = -0.5 * (log_det + log_information + yy - beta.dot(&xy));
        Some((xx, likelihood, beta))
    }

    /// The level of unit `i` beside `fit`.
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
        let fit = self.fit(|i| !is_odd(i));
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
        let spread_p_value = self.fit_alike(is_odd).unwrap_or(1.0);
        let (mean, spread) = match &fit {
            Some(fit) => (fit.beta[0], fit.between.sqrt()),
            None => (estimates.iter().map(|e| e.value).sum::<f64>() / estimates.len().max(1) as f64, 0.0),
        };
        let moving = quantity.covariates.iter().enumerate().filter(|(c, _)| {
            quantity.observations.iter().any(|o| o.covariates[*c] != quantity.observations[0].covariates[*c])
        });
        let slopes = fit.iter().flat_map(|fit| {
            moving.clone().enumerate().map(|(place, (_, name))| Slope {
                covariate: name.clone(),
                value: fit.beta[1 + place],
                deviation: fit.covariance[(1 + place, 1 + place)].sqrt(),
            })
        });
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
            covariates: slopes.collect(),
            randomise: (spread_p_value < 0.05).then_some((mean - 2.0 * spread, mean + 2.0 * spread)),
            estimates,
        }
    }

    /// Chance of so much scatter between the units if they were alike (Cochran's Q).
    fn fit_alike(&self, is_odd: impl Fn(usize) -> bool) -> Option<f64> {
        let within = self.fit(|i| !is_odd(i))?.within;
        let kept: Vec<&Group> = self.groups.iter().enumerate().filter(|(i, _)| !is_odd(*i)).map(|(_, g)| g).collect();
        let (information, _, beta) = self.solve(&kept, 0.0, within)?;
        let alike = Fit { between: 0.0, within, covariance: information.try_inverse()?, beta, freedom: 0 };
        let places = (0..self.groups.len()).filter(|i| !is_odd(*i));
        let squares = places.map(|i| {
            let level = self.level(i, &alike);
            level.residual * level.residual / level.own
        });
        let freedom = kept.len().checked_sub(self.n_columns).filter(|f| *f > 0)?;
        Some(ChiSquared::new(freedom as f64).ok()?.sf(squares.sum()))
    }
}

/// The variance of the largest likelihood: 0, or the best of a grid of its logarithm, looked at finer and finer.
fn best_variance(size: f64, likelihood: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = DECADES;
    let at = |decade: f64| size * 10f64.powf(decade);
    let mut best = (f64::NEG_INFINITY, low);
    for _ in 0..5 {
        let step = (high - low) / 14.0;
        for k in 0..=14 {
            let decade = low + step * f64::from(k);
            let value = likelihood(at(decade));
            if value > best.0 {
                best = (value, decade);
            }
        }
        (low, high) = (best.1 - step, best.1 + step);
    }
    if likelihood(0.0) >= best.0 { 0.0 } else { at(best.1) }
}
