//! Parameters with a tolerance, and how much of the gap they absorb.

use crate::diagnose::catalogue::joint::dissipative_bounds;
use crate::diagnose::limits::BELIEVED;
use crate::model::Model;
use crate::refine::{Free, Refined};
use nalgebra::{DMatrix, DVector};

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

/// Mean squared change of the outputs (noise units) that the tolerated parameters make together by their move from
/// the nominal values, over `count` values.
pub(crate) fn strain(refined: &Refined, free: &[Free], count: usize) -> f64 {
    let tolerated: Vec<(usize, f64, f64)> = free
        .iter()
        .enumerate()
        .filter_map(|(place, f)| f.prior.map(|(mean, sd)| (place, refined.parameters[f.parameter] - mean, sd)))
        .collect();
    let size = tolerated.len();
    let covariance = |i: usize, j: usize| refined.covariance[tolerated[i].0][tolerated[j].0];
    let Some(mut information) = DMatrix::from_fn(size, size, covariance).try_inverse() else { return 0.0 };
    tolerated.iter().enumerate().for_each(|(i, t)| information[(i, i)] -= t.2.powi(-2));
    let moved = DVector::from_fn(size, |i, _| tolerated[i].1);
    let strain = moved.dot(&(&information * &moved)) / count.max(1) as f64;
    if strain.is_finite() { strain.max(0.0) } else { 0.0 }
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
