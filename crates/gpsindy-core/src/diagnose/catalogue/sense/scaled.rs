//! What a parameter scales: a whole equation, or what is left of a drive.

use crate::diagnose::limits::catalogue::PROBED;
use crate::expression::{Expression, Tape};
use crate::model::Model;

/// Relative differences of products of a few numbers. Rounding.
const ROUNDING: f64 = 1e-9;

/// Points at which an equation is probed: of a polynomial or a ratio, few agree nowhere by chance. Exact.
const POINTS: usize = 5;

/// Whether a parameter scales the whole equation of `state` and stands in no other: another value of it is then another inertia of this
/// axis. One mass of two axes is not: a bridge moves with one of them alone.
pub(super) fn is_scaled(state: usize, model: &Model) -> bool {
    let equation = &model.states[state].equation;
    let is_own = |name: &str| model.rows_with(name).all(|row| row == state);
    model.parameters.iter().any(|parameter| scales(equation, model, &parameter.name) && is_own(&parameter.name))
}

/// Whether `p d(f)/dp` is the same multiple of `f` everywhere.
fn scales(equation: &Expression, model: &Model, parameter: &str) -> bool {
    let Some((value, slope)) = slope(equation, model, parameter) else { return false };
    let Some(found) = probed(model, &[equation.clone(), slope]) else { return false };
    let ratio = |point: &Vec<f64>| point[1] * value / point[0];
    let first = ratio(&found[0]);
    first.is_finite()
        && first.abs() > ROUNDING
        && found.iter().all(|point| (ratio(point) / first - 1.0).abs() < ROUNDING)
}

/// What a control drives through a parameter, as a voltage drives a current through a resistance: the control and what stands against it there,
/// `u - K*w` of `(u - K*w)/R`, where the parameter scales a sum with fixed factors. The control alone where nothing does, and where the parameter scales the whole equation.
pub(crate) fn driven_through(equation: &Expression, model: &Model, parameter: &str, control: &str) -> Expression {
    let alone = Expression::variable(control);
    if scales(equation, model, parameter) {
        return alone;
    }
    let others = against(equation, model, parameter, control).unwrap_or_default();
    others.into_iter().fold(alone, |sum, (name, factor)| {
        let part = Expression::Number(factor.abs()).times(Expression::variable(name));
        if factor < 0.0 { sum.minus(part) } else { sum.plus(part) }
    })
}

/// The other variables in the terms of a parameter, and their factors for one of the control; `None` where these terms are no sum that the
/// parameter scales.
fn against(equation: &Expression, model: &Model, parameter: &str, control: &str) -> Option<Vec<(String, f64)>> {
    let (_, slope) = slope(equation, model, parameter)?;
    let moving: Vec<String> =
        model.names().filter(|name| model.parameter_index(name).is_none()).map(str::to_string).collect();
    let held: Vec<String> = moving.into_iter().filter(|name| slope.contains(name)).collect();
    let own = held.iter().position(|name| name == control)?;
    let factors = held.iter().map(|name| slope.derivative(name).ok()).collect::<Option<Vec<Expression>>>()?;
    let variables = held.iter().map(|name| Expression::variable(name.clone()));
    let sum = factors
        .iter()
        .zip(variables)
        .fold(Expression::Number(0.0), |sum, (factor, z)| sum.plus(factor.clone().times(z)));
    let bends = factors.iter().map(|factor| factor.derivative(parameter).ok()).collect::<Option<Vec<Expression>>>()?;
    let found = probed(model, &[&[slope, sum][..], &factors, &bends].concat())?;
    let same = |a: f64, b: f64| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    let (factors, bends) = found[0][2..].split_at(held.len());
    let is_linear = |point: &Vec<f64>| {
        same(point[0], point[1]) && factors.iter().zip(&point[2..]).all(|(&first, &factor)| same(factor, first))
    };
    // One power of the parameter in all terms.
    let is_scaled = factors.iter().zip(bends).all(|(factor, bend)| same(bend * factors[own], factor * bends[own]));
    let is_sum = found.iter().all(is_linear) && is_scaled && factors[own] != 0.0;
    let others = held.into_iter().zip(factors).enumerate().filter(|(i, _)| *i != own);
    is_sum.then(|| others.map(|(_, (name, factor))| (name, factor / found[0][2 + own])).collect())
}

/// The parameter's value, and the derivative of an equation by it.
fn slope(equation: &Expression, model: &Model, parameter: &str) -> Option<(f64, Expression)> {
    let value = model.parameters[model.parameter_index(parameter)?].value;
    let slope = equation.contains(parameter).then(|| equation.derivative(parameter).ok())??;
    Some((value, slope))
}

/// Values of expressions at points without a pattern; a parameter has its own.
fn probed(model: &Model, expressions: &[Expression]) -> Option<Vec<Vec<f64>>> {
    let names: Vec<String> = model.names().map(str::to_string).collect();
    let tape = Tape::new(expressions, &names).ok()?;
    let at = |point: usize, (i, name): (usize, &String)| match model.parameter_index(name) {
        Some(p) => model.parameters[p].value,
        None => PROBED.0 + (PROBED.1 * i as f64 + PROBED.2 * point as f64).sin(),
    };
    let values = |point: usize| names.iter().enumerate().map(|name| at(point, name)).collect::<Vec<f64>>();
    Some((0..POINTS).map(|point| tape.evaluate_once(&values(point), PROBED.3)).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::{Control, Parameter, State};

    /// A motor without a state for its current.
    fn motor(rate: &str) -> Model {
        let parameter = |(name, value): (&str, f64)| Parameter::new(name, value);
        Model {
            states: vec![State::new("w", Expression::parse(rate).unwrap())],
            controls: vec![Control::new("u")],
            parameters: [("R", 2.0), ("K", 0.1), ("J", 0.5), ("b", 0.3)].map(parameter).into(),
            ..Model::default()
        }
    }

    fn through(rate: &str, parameter: &str) -> String {
        let model = motor(rate);
        driven_through(&model.states[0].equation, &model, parameter, "u").to_string()
    }

    #[test]
    fn the_voltage_across_a_winding_is_what_the_speed_leaves_of_it() {
        let rate = "(K*(u - K*w)/R - b*w)/J";
        let found = through(rate, "R");
        let at = |u: f64, w: f64| {
            let tape = Tape::new(&[Expression::parse(&found).unwrap()], &["u".into(), "w".into()]).unwrap();
            tape.evaluate_once(&[u, w], 0.0)[0]
        };
        assert!((at(3.0, 5.0) - 2.5).abs() < 1e-9, "{found}");
        // A friction is no resistance to the voltage, an inertia scales all, and a gain scales the voltage alone.
        for (rate, parameter) in [(rate, "b"), (rate, "J"), ("K*u - b*w", "K"), ("(K*(u - K*w)/R - b*w)/J", "K")] {
            assert_eq!(through(rate, parameter), "u", "{parameter} of {rate}");
        }
    }

    #[test]
    fn a_parameter_scales_an_equation_where_all_its_terms_have_it() {
        let model = motor("(K*u - b*w)/J");
        assert!(scales(&model.states[0].equation, &model, "J"));
        assert!(!scales(&model.states[0].equation, &model, "b"));
    }
}
