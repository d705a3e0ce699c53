//! Position servos whose inertia is left out: the rate of a place is its distance from a command.

use crate::diagnose::catalogue::sense::is_place;
use crate::expression::{Expression, Operator};
use crate::model::Model;

/// Two names, in whatever order, as those of a command and of the place that goes to it.
pub(crate) fn servo<'m>(model: &'m Model, one: &str, other: &str) -> Option<[&'m str; 2]> {
    let (command, place) = match model.control_index(one) {
        Some(command) => (command, model.state_index(other)?),
        None => (model.control_index(other)?, model.state_index(one)?),
    };
    let (command, place) = (&model.controls[command], &model.states[place]);
    (is_place(&place.unit) && command.unit == place.unit).then_some([&command.name, &place.name])
}

/// The differences of two names in an expression.
pub(crate) fn differences(expression: &Expression) -> Vec<[String; 2]> {
    let mut found = Vec::new();
    expression.visit(&mut |part| {
        if let Expression::Binary(Operator::Subtract, a, b) = part
            && let (Expression::Variable(a), Expression::Variable(b)) = (&**a, &**b)
        {
            found.push([a.clone(), b.clone()]);
        }
    });
    found
}

/// Whether the equation is that of a place and contains the error of its servo: the sign of a place is not that of a motion, and what drives it is
/// the error alone.
pub(super) fn is_servo(model: &Model, state: usize) -> bool {
    let own = &model.states[state];
    let is_error = |[a, b]: &[String; 2]| servo(model, a, b).is_some_and(|[_, place]| place == own.name);
    differences(&own.equation).iter().any(is_error)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::{Control, State};

    #[test]
    fn a_place_that_goes_to_a_command_in_its_unit_is_a_servo() {
        let is = |rate: &str, units: [&str; 2]| {
            let state = State { unit: units[0].into(), ..State::new("q", Expression::parse(rate).unwrap()) };
            let control = Control { unit: units[1].into(), ..Control::new("u") };
            is_servo(&Model { states: vec![state], controls: vec![control], ..Model::default() }, 0)
        };
        assert!(is("(u - q)/0.1", ["rad", "rad"]) && is("-(q - u)*8", ["m", "m"]));
        // A level that a flow fills, a temperature that follows that of its bath, and a place without a target.
        assert!(!is("u - 0.1*q", ["m", "m/s"]) && !is("(u - q)/0.1", ["K", "K"]) && !is("u - q", ["", ""]));
    }
}
