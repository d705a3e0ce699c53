//! A fleet: compares many machines of one design, from estimates and their errors to tables.
//!
//! The estimates of the units are draws from a population, so that estimates from short logs shrink towards it (empirical
//! Bayes). Covariates such as load
//! and temperature are regressed out first, along curves where the fleet shows them: they move friction more than wear does. A unit is odd if the rest of the fleet does not
//! predict it; a change is a step or a drift that a constant does not explain.
//!
//! Source: Robbins 1956 (empirical Bayes); Benjamini and Hochberg 1995 (false discovery rate); Bittencourt 2014, Linköping dissertation
//! 1617 (temperature and load change friction more than wear does).

mod changes;
mod columns;
mod curved;
mod held;
mod limits;
mod odd;
mod population;
pub mod report;

pub use report::FleetReport;

use crate::error::{Error, Result};
use changes::changes;
use held::Series;
use odd::odd;
use population::Table;
use report::{Change, Odd, Population};

/// One quantity of one unit in one period: what a diagnosis found, and how sure it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The machine.
    pub unit: String,
    /// When the period began, days since some fixed day; absent where the fleet has no history.
    pub since: Option<f64>,
    /// Estimate, in the quantity's unit.
    pub value: f64,
    /// Its standard error, above 0.
    pub deviation: f64,
    /// Covariates of the period, in the order of [`Quantity::covariates`].
    pub covariates: Vec<f64>,
}

/// One number that every unit has: the size of an effect or a parameter of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Id of the effect; `parameter` for a parameter of the nominal model.
    pub effect: String,
    /// The state in whose equation it acts; empty for a parameter.
    pub state: String,
    /// Name of the number.
    pub parameter: String,
    /// Its unit as text, may be empty.
    pub unit: String,
    /// Names of the covariates.
    pub covariates: Vec<String>,
    /// One entry a unit and period.
    pub observations: Vec<Observation>,
}

/// Settings of a comparison.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `false_discovery_rate` | 0.05 | above 0, below 0.5 | share of the odd units, and of the changes, that may be false |
#[derive(Debug, Clone, PartialEq)]
pub struct Compare {
    /// Share of the odd units, and of the changes, that may be false.
    pub false_discovery_rate: f64,
}

impl Default for Compare {
    fn default() -> Self {
        Self { false_discovery_rate: limits::FALSE_DISCOVERIES }
    }
}

/// What sets the units of a fleet apart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Comparison {
    /// One entry a quantity: its mean and spread, and every unit's estimate drawn towards them.
    pub population: Vec<Population>,
    /// Units that the rest of the fleet does not predict, the clearest first.
    pub odd: Vec<Odd>,
    /// Steps and drifts of single units, the surest first.
    pub changes: Vec<Change>,
}

impl Compare {
    /// Compares the units quantity by quantity; false discoveries are counted over all of them.
    ///
    /// # Errors
    /// A setting out of range, a value or an error that is not finite, an error that is not above 0, covariates that don't match.
    ///
    /// ```
    /// use gpsindy_core::fleet::{Compare, Observation, Quantity};
    ///
    /// let observation = |unit: usize| Observation {
    ///     unit: format!("arm {unit}"),
    ///     since: None,
    ///     value: 0.30 + 0.01 * ((7 * unit) % 5) as f64 + if unit == 11 { 0.2 } else { 0.0 },
    ///     deviation: 0.004,
    ///     covariates: Vec::new(),
    /// };
    /// let friction = Quantity {
    ///     effect: "coulomb_friction".into(),
    ///     state: "v".into(),
    ///     parameter: "c".into(),
    ///     unit: "N".into(),
    ///     covariates: Vec::new(),
    ///     observations: (0..30).map(observation).collect(),
    /// };
    /// let found = Compare::default().run(&[friction])?;
    /// assert_eq!(found.odd.len(), 1);
    /// assert_eq!(found.odd[0].unit, "arm 11");
    /// # Ok::<(), gpsindy_core::Error>(())
    /// ```
    pub fn run(&self, quantities: &[Quantity]) -> Result<Comparison> {
        self.check(quantities)?;
        let tables: Vec<Table> = quantities.iter().map(curved::table).collect();
        let unusual: Vec<Vec<usize>> = tables.iter().map(|table| odd(table, self.false_discovery_rate)).collect();
        let odd = odd::discoveries(quantities, &tables, &unusual, self.false_discovery_rate);
        let series: Vec<Vec<Series>> = tables.iter().zip(&unusual).map(|(t, u)| held::series(t, u)).collect();
        let changes = changes(quantities, &series, self.false_discovery_rate);
        let population = quantities.iter().zip(&tables).zip(&unusual);
        Ok(Comparison { population: population.map(|((q, t), u)| t.report(q, u)).collect(), odd, changes })
    }

    fn check(&self, quantities: &[Quantity]) -> Result<()> {
        if !(self.false_discovery_rate > 0.0 && self.false_discovery_rate < 0.5) {
            return Err(Error::range("false_discovery_rate", "above 0 and below 0.5", self.false_discovery_rate));
        }
        for quantity in quantities {
            let name = format!("{} {}", quantity.effect, quantity.parameter);
            for observation in &quantity.observations {
                let numbers = [observation.value, observation.deviation];
                let finite = numbers.iter().chain(&observation.covariates).chain(&observation.since);
                if !finite.into_iter().all(|v| v.is_finite()) {
                    return Err(Error::NotFinite { what: format!("{name} of unit `{}`", observation.unit) });
                }
                if observation.deviation <= 0.0 {
                    let expected = "above 0";
                    return Err(Error::range(&format!("standard error of {name}"), expected, observation.deviation));
                }
                if observation.covariates.len() != quantity.covariates.len() {
                    let what = format!("covariates of unit `{}`", observation.unit);
                    return Err(Error::shape(what, quantity.covariates.len(), observation.covariates.len()));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
