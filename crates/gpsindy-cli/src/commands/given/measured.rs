//! What of a simulator no log measures: reported before the work begins, because a column with another name is missed silently.

use crate::failure::Failure;
use crate::screen::Screen;
use gpsindy_core::{Expression, Model};
use gpsindy_files::Logs;

/// Warns of every state of a simulator that no column carries, with names that are near. Rates of a measured position are made from it.
pub(crate) fn warn_of_unmeasured(logs: &Logs, model: &Model, screen: &Screen) {
    for name in unmeasured(model, &|name| logs.resolve(name).is_ok()) {
        if let Err(error) = logs.resolve(name) {
            screen.warn(&format!("`{name}` is not measured, the simulator runs it unseen: {}", Failure::from(error)));
        }
    }
}

/// States that neither a column carries nor a position that one carries gives.
fn unmeasured<'a>(model: &'a Model, carried: &dyn Fn(&str) -> bool) -> Vec<&'a str> {
    if !model.calls_simulator() {
        return Vec::new();
    }
    let is_made = |rate: &str| {
        model.states.iter().any(|s| s.equation == Expression::Variable(rate.to_string()) && carried(&s.name))
    };
    model.states.iter().map(|s| s.name.as_str()).filter(|name| !carried(name) && !is_made(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpsindy_core::State;

    #[test]
    fn a_rate_of_a_measured_position_is_measured_and_other_states_are_not() {
        let mut model = Model::default();
        for name in ["shoulder", "elbow", "shoulder_vel", "elbow_vel", "servo_act"] {
            model.states.push(State::new(name, Expression::Pi));
        }
        model.call_simulator(&[(0, 2), (1, 3)]);
        let found = |columns: &'static [&'static str]| unmeasured(&model, &|name| columns.contains(&name));
        assert_eq!(found(&["shoulder", "elbow"]), ["servo_act"]);
        assert_eq!(found(&["shoulder", "servo_act"]), ["elbow", "elbow_vel"]);
        assert_eq!(found(&["shoulder", "elbow_vel", "servo_act"]), ["elbow"]);
    }
}
