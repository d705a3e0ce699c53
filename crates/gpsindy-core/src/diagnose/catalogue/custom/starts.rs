//! Start values for an effect of the user's own: which of its parameters are sizes, and which set its shape.

use crate::diagnose::catalogue::custom::{CustomEffect, CustomParameter};
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::expression::{Expression, Tape};
use crate::model::Model;

/// Parts of a range at which a shape is tried.
const PARTS: [f64; 5] = [0.5, 0.1, 0.25, 0.75, 0.9];

/// Starts of the form's parameters, in their order.
///
/// A parameter in which the form is a straight line through nothing is a size: a small one is screened and drawn to
/// its length, however wide its range. The others set the shape and are tried over their ranges. A form without a size
/// is tried at finite steps.
pub(crate) fn starts(custom: &CustomEffect, model: &Model, scene: &Scene, state: usize) -> Vec<Start> {
    let sizes = sizes(custom);
    let shapes = |part: f64| -> Vec<f64> { custom.parameters.iter().map(|p| within(p, part)).collect() };
    let steps: Option<Vec<f64>> = sizes.iter().map(|&i| small_step(custom, i, model, scene, state)).collect();
    let Some(steps) = steps.filter(|s| !s.is_empty()) else {
        return PARTS
            .map(|part| Start {
                columns: vec![shapes(part)],
                combine: Combine::Keep,
                amplitudes: Vec::new(),
                is_pointed: false,
            })
            .into();
    };
    let has_shape = sizes.len() < custom.parameters.len();
    let parts = if has_shape { &PARTS[..] } else { &PARTS[..1] };
    let column = |part: f64, moved: usize| {
        let mut values = shapes(part);
        for (&i, &step) in sizes.iter().zip(&steps) {
            values[i] = if i == sizes[moved] { step } else { 0.0 };
        }
        values
    };
    let start = |part: f64| Start {
        columns: (0..sizes.len()).map(|moved| column(part, moved)).collect(),
        combine: Combine::Amplitude,
        amplitudes: sizes.iter().map(|&i| (i, 0.0)).collect(),
        is_pointed: false,
    };
    parts.iter().map(|&part| start(part)).collect()
}

/// A value within the range; by ratio where the range spans more than a decade on one side of zero.
fn within(parameter: &CustomParameter, part: f64) -> f64 {
    let (low, high) = (parameter.low, parameter.high);
    let by_ratio = low * high > 0.0 && (high / low).abs().ln().abs() > 10f64.ln();
    if by_ratio { low * (high / low).powf(part) } else { low + part * (high - low) }
}

/// Parameters in all of which together the form is a straight line, and without which it is nothing.
fn sizes(custom: &CustomEffect) -> Vec<usize> {
    /// More columns than this are not drawn to their lengths together.
    const MOST: usize = 3;
    let form = &custom.form;
    let names: Vec<&str> = custom.parameters.iter().map(|p| p.name.as_str()).collect();
    let is_linear = |name: &str| form.derivative(name).is_ok_and(|slope| !slope.contains(name));
    let mut linear: Vec<usize> = (0..names.len()).filter(|&i| is_linear(names[i])).take(MOST).collect();
    // A product of two of them is no straight line in both: the first stays a size.
    let mut i = 1;
    while i < linear.len() {
        let slope = form.derivative(names[linear[i]]);
        let mixed = slope.is_ok_and(|s| linear[..i].iter().any(|&other| s.contains(names[other])));
        if mixed {
            linear.remove(i);
        } else {
            i += 1;
        }
    }
    let zero = Expression::Number(0.0);
    let nothing = linear.iter().fold(form.clone(), |f, &i| f.substitute(names[i], &zero));
    let variables = nothing.variables();
    let Ok(tape) = Tape::new(&[nothing], &variables) else { return Vec::new() };
    let vanishes = [0.7, -1.3, 2.1].iter().all(|&v| {
        let values: Vec<f64> = (0..variables.len()).map(|k| v * (1.0 + 0.37 * k as f64)).collect();
        tape.evaluate_once(&values, 0.5)[0] == 0.0
    });
    if vanishes { linear } else { Vec::new() }
}

/// A size of parameter `i` that changes the rate by about a thousandth of what is typical; `None` where it moves nothing.
fn small_step(custom: &CustomEffect, i: usize, model: &Model, scene: &Scene, state: usize) -> Option<f64> {
    let slope = custom.form.derivative(&custom.parameters[i].name).ok()?;
    let names = slope.variables();
    let tape = Tape::new(&[slope], &names).ok()?;
    let value = |name: &String, sign: f64| {
        if let Some(own) = custom.parameters.iter().find(|p| p.name == *name) {
            return within(own, 0.5);
        }
        let state = model.state_index(name).and_then(|j| scene.states.get(j));
        let moving = state.or_else(|| model.control_index(name).and_then(|c| scene.controls.get(c)));
        match (moving, model.parameter_index(name)) {
            (Some(excursion), _) => sign * excursion.size(),
            (None, Some(p)) => model.parameters[p].value,
            (None, None) => 1.0,
        }
    };
    let at = |sign: f64| {
        let values: Vec<f64> = names.iter().map(|n| value(n, sign)).collect();
        tape.evaluate_once(&values, 0.5 * (scene.times.0 + scene.times.1))[0].abs()
    };
    let largest = at(1.0).max(at(-0.6));
    let step = 1e-3 * scene.rates.get(state)? / largest;
    (step.is_finite() && step > 0.0).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effect(form: &str, parameters: &[(&str, f64, f64)]) -> CustomEffect {
        let range = |&(name, low, high): &(&str, f64, f64)| CustomParameter {
            name: name.into(),
            low,
            high,
            unit: String::new(),
        };
        CustomEffect {
            id: "own".into(),
            state: "v".into(),
            form: Expression::parse(form).unwrap(),
            parameters: parameters.iter().map(range).collect(),
        }
    }

    #[test]
    fn a_factor_is_a_size_and_what_stands_inside_a_function_is_a_shape() {
        assert_eq!(sizes(&effect("-c*tanh(v/w)", &[("c", -10.0, 10.0), ("w", 0.01, 1.0)])), [0]);
        assert_eq!(sizes(&effect("a*x + b*x^3", &[("a", -1.0, 1.0), ("b", -1.0, 1.0)])), [0, 1]);
        assert_eq!(sizes(&effect("a*b*x", &[("a", -1.0, 1.0), ("b", -1.0, 1.0)])), [0]);
        assert!(sizes(&effect("x^p", &[("p", 1.0, 3.0)])).is_empty());
        // Something that acts without any of its parameters has no size.
        assert!(sizes(&effect("v + c*x", &[("c", -1.0, 1.0)])).is_empty());
    }

    #[test]
    fn a_range_over_decades_is_tried_by_ratio() {
        let range = CustomParameter { name: "w".into(), low: 1e-3, high: 10.0, unit: String::new() };
        assert!((within(&range, 0.5) - 0.1).abs() < 1e-12);
        assert_eq!(within(&CustomParameter { low: -1.0, high: 3.0, ..range }, 0.5), 1.0);
    }
}
