//! Parameters that the user believes in up to a tolerance, and those of them that turn out to be causes.

use crate::diagnose::catalogue::joint::dissipative_bounds;
use crate::diagnose::fit::fitted::Fitted;
use crate::diagnose::steps::attribute::{again_with, values};
use crate::diagnose::steps::contest::{CONVINCING, Contest, MATERIAL};
use crate::diagnose::steps::detect::TOLERABLE;
use crate::error::Result;
use crate::model::Model;
use crate::refine::Free;
use nalgebra::{DMatrix, DVector};

/// Standard deviations of a tolerance beyond which a value is no longer tolerated: it is an error, and must win as one.
///
/// A belief's tails would not hold it: thousands of residuals that are structure and not noise outweigh any of them, and
/// a viscous friction of twice its value then hides a dry one before that has a name.
const BELIEVED: f64 = 3.0;

/// Tolerances within which a parameter's move is what the user expects.
const EXPECTED: f64 = 2.0;

/// A tolerated parameter that the logs move.
pub(crate) struct Moved {
    /// Its index in the model.
    pub(crate) parameter: usize,
    /// Squared distance from its nominal value, in standard deviations of what the logs tell of it.
    pub(crate) squared: f64,
    /// Whether the move stays within what the user believes.
    pub(crate) is_believed: bool,
}

/// The parameters that the user believes in up to a tolerance, free with that belief.
pub(crate) fn tolerated(model: &Model) -> Vec<Free> {
    model
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(i, p)| {
            let sd = p.tolerance? * p.value.abs();
            let (lower, upper) = dissipative_bounds(model, &p.name).unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            let (lower, upper) = (lower.max(p.value - BELIEVED * sd), upper.min(p.value + BELIEVED * sd));
            (sd > 0.0).then(|| Free { prior: Some((p.value, sd)), lower, upper, ..Free::new(i, p.value.abs()) })
        })
        .collect()
}

impl Fitted {
    /// How far the logs alone move each tolerated parameter from its nominal value, in standard deviations
    /// of what the logs tell of it.
    pub(crate) fn moved(&self) -> Vec<Moved> {
        self.free
            .iter()
            .enumerate()
            .filter_map(|(place, f)| {
                let (mean, sd) = f.prior?;
                let information = 1.0 / self.refined.covariance[place][place] - 1.0 / (sd * sd);
                let distance = self.refined.parameters[f.parameter] - mean;
                let squared = distance * distance * information / self.inflation();
                let is_believed = distance.abs() <= EXPECTED * sd;
                (information > 0.0 && squared.is_finite()).then_some(Moved {
                    parameter: f.parameter,
                    squared,
                    is_believed,
                })
            })
            .collect()
    }

    /// Whether free parameter number `place` is a tolerated one that stands where its tolerance ends.
    pub(crate) fn is_strained(&self, place: usize) -> bool {
        let free = &self.free[place];
        let value = self.refined.parameters[free.parameter];
        free.prior.is_some_and(|(mean, sd)| (value - mean).abs() >= 0.999 * BELIEVED * sd)
    }

    /// Mean squared change of the outputs (noise units) that the tolerated parameters make together by their move from
    /// the nominal values.
    pub(crate) fn strain(&self) -> f64 {
        let tolerated: Vec<(usize, f64, f64)> = self
            .free
            .iter()
            .enumerate()
            .filter_map(|(place, f)| f.prior.map(|(mean, sd)| (place, self.refined.parameters[f.parameter] - mean, sd)))
            .collect();
        let count = tolerated.len();
        let covariance = |i: usize, j: usize| self.refined.covariance[tolerated[i].0][tolerated[j].0];
        let Some(mut information) = DMatrix::from_fn(count, count, covariance).try_inverse() else { return 0.0 };
        tolerated.iter().enumerate().for_each(|(i, t)| information[(i, i)] -= t.2.powi(-2));
        let moved = DVector::from_fn(count, |i, _| tolerated[i].1);
        let strain = moved.dot(&(&information * &moved)) / self.count().max(1) as f64;
        if strain.is_finite() { strain.max(0.0) } else { 0.0 }
    }
}

/// Tolerated parameters that the logs move clearly and materially are causes, and must win their place like any other.
///
/// Returns the nominal model without their tolerance, and the winner with them as hypotheses.
pub(crate) fn charge_tolerated(
    contest: &Contest<'_>,
    nominal: Fitted,
    best: Fitted,
    notes: &mut Vec<String>,
) -> Result<(Fitted, Fitted)> {
    let count = best.count().max(2) as f64;
    let convincing = |moved: &Moved| {
        let material = if moved.is_believed { TOLERABLE } else { MATERIAL };
        moved.squared > 2.0 * CONVINCING + count.ln() && moved.squared > material * count * best.misfit().min(1.0)
    };
    let mut charged: Vec<usize> = best.moved().into_iter().filter(convincing).map(|m| m.parameter).collect();
    let strained =
        (0..best.free.len()).filter(|&place| best.is_strained(place)).map(|place| best.free[place].parameter);
    charged.extend(strained);
    charged.sort_unstable();
    charged.dedup();
    if charged.is_empty() {
        return Ok((nominal, best));
    }
    let free = nominal.free.iter().filter(|f| !charged.contains(&f.parameter)).cloned().collect();
    let fitted = Fitted::nominal(nominal.system.clone(), nominal.experiment.clone(), free, &contest.settings)?;
    let base = Fitted { model_error: nominal.model_error, ..fitted };
    let mut causes = Vec::new();
    for &index in &charged {
        let parameter = &nominal.system.model().parameters[index];
        let Some(hypothesis) = contest.hypotheses.iter().find(|h| h.frees() == Some(&parameter.name)) else {
            return Ok((nominal, best));
        };
        causes.push((hypothesis, vec![best.refined.parameters[index]]));
        let name = &parameter.name;
        notes.push(format!("the logs move parameter `{name}` from its nominal value; it is reported as a cause even where it stays within its tolerance"));
    }
    causes.extend((0..best.hypotheses.len()).map(|place| (&best.hypotheses[place], values(&best, place))));
    let fit = again_with(contest, &base, &best, &causes)?;
    Ok((base, fit))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Parameter, State};

    #[test]
    fn a_tolerance_ends_at_three_standard_deviations_and_at_a_change_of_sign() {
        let parameter = |name: &str, value: f64, tolerance: f64| Parameter {
            tolerance: Some(tolerance),
            ..Parameter::new(name, value)
        };
        let model = Model {
            states: vec![State::new("v", Expression::parse("-b*v - d*v + c").unwrap())],
            parameters: vec![parameter("b", 2.0, 0.1), parameter("d", 1.0, 0.5), parameter("c", -4.0, 0.5)],
            ..Model::default()
        };
        let bounds: Vec<(f64, f64)> = tolerated(&model).iter().map(|f| (f.lower, f.upper)).collect();
        // A damping stays one, however wide its tolerance; a constant may turn around.
        let expected = [(1.4, 2.6), (0.0, 2.5), (-10.0, 2.0)];
        for (found, expected) in bounds.iter().zip(expected) {
            assert!((found.0 - expected.0).abs() < 1e-12 && (found.1 - expected.1).abs() < 1e-12, "{bounds:?}");
        }
    }
}
