//! Ports: places where an unmodelled force may act; zero in the model itself.

use super::Model;
use crate::expression::Expression;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A named input that is zero: it marks where a force that nobody modelled may act.
///
/// Equations use it like a control, logs don't carry it. Friction in one joint of an arm enters every row of
/// its equations through one port, as the mechanics say.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Port {
    /// Name: a letter, then letters, digits and `_`.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "super::check::plain_text"))]
    pub name: String,
    /// The state that moves at this place: what friction and drag there depend on.
    pub variable: String,
    /// Unit as one line of plain text, empty where none is known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "String::is_empty", deserialize_with = "super::check::plain_text")
    )]
    pub unit: String,
    /// The state that is the place's position: what springs, weights and ripples there depend on.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub position: Option<String>,
    /// Effects at this place that the user's own simulator has as parameters: the effect's id, the parameter's name.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub carried: Vec<(String, String)>,
}

impl Port {
    /// A port with the motion `variable`, without a unit and without a position.
    pub fn new(name: impl Into<String>, variable: impl Into<String>) -> Self {
        Self { name: name.into(), variable: variable.into(), unit: String::new(), position: None, carried: Vec::new() }
    }
}

impl Model {
    /// The same equations with every port at zero, and no port left.
    #[must_use]
    pub fn closed(&self) -> Self {
        let mut model = self.clone();
        let ports = std::mem::take(&mut model.ports);
        if ports.is_empty() {
            return model;
        }
        let open = |e: &Expression| ports.iter().any(|p| e.contains(&p.name));
        for state in &mut model.states {
            for part in std::iter::once(&mut state.equation).chain(&mut state.measured) {
                if open(part) {
                    *part = without(part, &ports);
                }
            }
        }
        model
    }
}

/// `expression` with `ports` at zero, and what is zero with them left out.
fn without(expression: &Expression, ports: &[Port]) -> Expression {
    use crate::expression::Operator;
    let go = |e: &Expression| without(e, ports);
    match expression {
        Expression::Variable(name) if ports.iter().any(|p| p.name == *name) => Expression::Number(0.0),
        Expression::Number(_) | Expression::Pi | Expression::Time | Expression::Variable(_) => expression.clone(),
        Expression::Negate(a) => go(a).negated(),
        Expression::Binary(operator, a, b) => match operator {
            Operator::Add => go(a).plus(go(b)),
            Operator::Subtract => go(a).minus(go(b)),
            Operator::Multiply => go(a).times(go(b)),
            Operator::Divide => go(a).over(go(b)),
            Operator::Power => go(a).power(go(b)),
        },
        Expression::Call(function, arguments) => Expression::Call(*function, arguments.iter().map(go).collect()),
        Expression::Simulator(output, arguments) => Expression::Simulator(*output, arguments.iter().map(go).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::State;
    use super::*;

    fn arm(equation: &str) -> Model {
        Model {
            states: vec![
                State::new("th", Expression::variable("w")),
                State::new("w", Expression::parse(equation).unwrap()),
            ],
            ports: vec![Port { position: Some("th".into()), ..Port::new("tau", "w") }],
            ..Model::default()
        }
    }

    #[test]
    fn a_closed_model_has_nothing_left_of_its_ports() {
        for (open, closed) in [
            ("-9.81*sin(th) + tau/0.3", "-9.81*sin(th)"),
            ("(tau - 2*w)/(1 + th)", "-2*w/(1 + th)"),
            ("-w*tau", "0"),
            ("clamp(tau - w, -1, 1)", "clamp(-w, -1, 1)"),
        ] {
            let model = arm(open).closed();
            assert!(model.ports.is_empty());
            assert_eq!(model.states[1].equation.to_string(), closed);
        }
    }

    #[test]
    fn a_compiled_model_takes_its_ports_as_zero() {
        let open = arm("tau - 3*w");
        let closed = open.closed();
        let rates = |model: &Model| {
            let mut dx = [0.0; 2];
            crate::model::Dynamics::derivative(&model.compile().unwrap(), 0.0, &[0.1, 0.7], &[], &mut dx).unwrap();
            dx
        };
        assert_eq!(rates(&open), rates(&closed));
    }
}
