//! Histories of the units with the covariates held: what the fleet says of a covariate is taken off, and what it leaves open stays open.
//!
//! `r_j = level + x_j' gamma + e_j`, `gamma ~ N(0, C)`. C is the covariance of the fleet's coefficients, and the spread of the units' own
//! ones about them: one machine warms up more than another, and that difference follows the season as its use does. A change is tested
//! against all that gamma could explain. The spread and the scatter of a period by restricted maximum likelihood over all units but the odd ones.
//!
//! Source: Laird and Ware 1982, Random-effects models for longitudinal data, section 3.

use super::limits::{FEWEST_PERIODS, SLOPE_ROUNDS, SLOPE_STEPS};
use super::population::{Group, Row, Rung, Table, best_rung, rung_share};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The history of a unit.
pub(super) struct Series {
    pub(super) unit: String,
    pub(super) time: Vec<f64>,
    pub(super) value: DVector<f64>,
    /// Errors of the estimates, and the scatter of a period once it is known.
    pub(super) variance: DVector<f64>,
    /// The columns besides the level, each of mean square 1 over the fleet.
    design: DMatrix<f64>,
    /// A root of C.
    root: DMatrix<f64>,
}

/// Histories of the units of one quantity that are long enough.
pub(super) fn series(table: &Table, odd: &[usize]) -> Vec<Series> {
    let Some(fit) = table.without(odd).fit(None) else { return Vec::new() };
    let sizes = sizes(table);
    let one = |group: &Group| {
        let rows: Vec<_> = group.rows.iter().filter_map(|row| row.since.map(|t| (t, row))).collect();
        // What the covariates say is taken off; the level itself stays.
        let held = |row: &Row| row.value - row.design.dot(&fit.beta) + fit.beta[0];
        let (count, k) = (rows.len(), sizes.len());
        Series {
            unit: group.unit.clone(),
            time: rows.iter().map(|(t, _)| *t).collect(),
            value: DVector::from_iterator(count, rows.iter().map(|(_, row)| held(row))),
            variance: DVector::from_iterator(count, rows.iter().map(|(_, row)| row.variance)),
            design: DMatrix::from_fn(count, k, |j, c| rows[j].1.design[1 + c] / sizes[c]),
            root: DMatrix::zeros(k, k),
        }
    };
    let mut all: Vec<Series> = table.groups.iter().map(one).collect();
    let usual: Vec<&Series> = all.iter().enumerate().filter(|(i, _)| !odd.contains(i)).map(|(_, s)| s).collect();
    let (own, within) = spreads(&usual, fit.within, sizes.len());
    let known = DMatrix::from_fn(sizes.len(), sizes.len(), |a, b| fit.covariance[(1 + a, 1 + b)] * sizes[a] * sizes[b]);
    let open = known + DMatrix::from_diagonal(&own);
    let root = Cholesky::new(open).map_or_else(|| DMatrix::from_diagonal(&own.map(f64::sqrt)), |c| c.unpack());
    all.retain(|s| s.time.len() >= FEWEST_PERIODS);
    for series in &mut all {
        series.variance.add_scalar_mut(within);
        series.root.clone_from(&root);
    }
    all
}

/// Root mean square of every column besides the level.
fn sizes(table: &Table) -> Vec<f64> {
    let rows = || table.groups.iter().flat_map(|g| &g.rows);
    let count = rows().count().max(1) as f64;
    let of = |c: usize| (rows().map(|row| row.design[1 + c].powi(2)).sum::<f64>() / count).sqrt();
    (0..table.columns().len()).map(of).map(|size| if size > 0.0 { size } else { 1.0 }).collect()
}

/// Spread of the units' own coefficients, and the scatter of a period around it, as variances.
fn spreads(series: &[&Series], within: f64, columns: usize) -> (DVector<f64>, f64) {
    let count: usize = series.iter().map(|s| s.value.len()).sum();
    let mean = |s: &Series| s.value.mean();
    let squares = series.iter().map(|s| s.value.add_scalar(-mean(s)).norm_squared()).sum::<f64>();
    let size = squares / count.max(1) as f64;
    let of = |rung: Rung| size * rung_share(rung);
    let (mut own, mut within) = (DVector::zeros(columns), within);
    let likelihood = |own: &DVector<f64>, within: f64| {
        let root = DMatrix::from_diagonal(&own.map(f64::sqrt));
        series.iter().filter(|s| s.value.len() > 1).map(|s| s.likelihood(within, &root)).sum::<f64>()
    };
    for _ in 0..if columns == 0 { 0 } else { SLOPE_ROUNDS } {
        for c in 0..columns {
            let with = |rung: Rung| {
                let mut changed = own.clone();
                changed[c] = of(rung);
                changed
            };
            own[c] = of(best_rung(SLOPE_STEPS, |rung| likelihood(&with(rung), within)));
        }
        within = of(best_rung(SLOPE_STEPS, |rung| likelihood(&own, of(rung))));
    }
    (own, within)
}

/// The inverse of a history's covariance, as a map.
pub(super) struct Inverse {
    weight: DVector<f64>,
    /// The columns times the root of C.
    open: DMatrix<f64>,
    inner: Cholesky<f64, Dyn>,
}

impl Inverse {
    fn new(variance: &DVector<f64>, open: DMatrix<f64>) -> Option<Self> {
        let weight = variance.map(|v| 1.0 / v);
        let mut weighed = open.clone();
        weighed.column_iter_mut().for_each(|mut column| column.component_mul_assign(&weight));
        let inner = DMatrix::identity(open.ncols(), open.ncols()) + open.tr_mul(&weighed);
        Some(Self { weight, inner: Cholesky::new(inner)?, open })
    }

    /// Woodbury.
    pub(super) fn times(&self, vector: &DVector<f64>) -> DVector<f64> {
        let weighed = vector.component_mul(&self.weight);
        let share = &self.open * self.inner.solve(&self.open.tr_mul(&weighed));
        &weighed - share.component_mul(&self.weight)
    }

    fn log_det(&self) -> f64 {
        let inner = 2.0 * self.inner.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>();
        inner - self.weight.iter().map(|w| w.ln()).sum::<f64>()
    }
}

impl Series {
    /// The inverse of its covariance.
    pub(super) fn inverse(&self) -> Option<Inverse> {
        Inverse::new(&self.variance, &self.design * &self.root)
    }

    /// Restricted log likelihood with this scatter of a period and this root of C.
    fn likelihood(&self, within: f64, root: &DMatrix<f64>) -> f64 {
        let Some(inverse) = Inverse::new(&self.variance.add_scalar(within), &self.design * root) else {
            return f64::NEG_INFINITY;
        };
        let ones = inverse.times(&DVector::repeat(self.value.len(), 1.0));
        let (total, sum) = (ones.sum(), ones.dot(&self.value));
        let misfit = self.value.dot(&inverse.times(&self.value)) - sum * sum / total;
        -0.5 * (inverse.log_det() + total.ln() + misfit)
    }
}
