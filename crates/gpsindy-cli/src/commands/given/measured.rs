//! Which column measures what of a simulator: reported before the work begins, because a column with another name is missed silently.

use crate::failure::Failure;
use crate::screen::Screen;
use crate::text::aligned_left;
use gpsindy_core::{Expression, Model};
use gpsindy_files::Logs;

/// Lists the columns of a simulator, and warns of every state that no column carries, with names that are near. Rates of a measured
/// position are made from it.
pub(crate) fn tell(logs: &Logs, model: &Model, screen: &Screen) {
    if !model.calls_simulator() {
        return;
    }
    let header = |name: &str| logs.files().iter().find_map(|log| log.column(name)).map(|header| header.text.clone());
    screen.note(aligned_left(&table(model, &header)).trim_end());
    for name in unmeasured(model, &|name| logs.resolve(name).is_ok()) {
        if let Err(error) = logs.resolve(name) {
            screen.warn(&format!("`{name}` is not measured, the simulator runs it unseen: {}", Failure::from(error)));
        }
    }
}

/// Every state and control of a simulator with its unit and its column, whose whole header `header` finds.
fn table(model: &Model, header: &dyn Fn(&str) -> Option<String>) -> Vec<[String; 3]> {
    let mut rows = vec![["simulator".into(), "unit".into(), "column of the logs".into()]];
    for state in &model.states {
        let position = model.states.iter().find(|s| s.equation == Expression::Variable(state.name.clone()));
        let column = header(&state.name).unwrap_or_else(|| match position.filter(|p| header(&p.name).is_some()) {
            Some(position) => format!("derivative of {}", position.name),
            None => "not measured".into(),
        });
        rows.push([state.name.clone(), state.unit.clone(), column]);
    }
    for control in &model.controls {
        let column = header(&control.name).unwrap_or_else(|| "missing".into());
        rows.push([control.name.clone(), control.unit.clone(), column]);
    }
    rows
}

/// States that neither a column carries nor a position that one carries gives.
fn unmeasured<'a>(model: &'a Model, carried: &dyn Fn(&str) -> bool) -> Vec<&'a str> {
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
        let header = |name: &str| (name == "shoulder").then(|| "q1 [deg]".to_string());
        let columns: Vec<String> = table(&model, &header).into_iter().map(|[.., column]| column).collect();
        assert_eq!(
            columns,
            [
                "column of the logs",
                "q1 [deg]",
                "not measured",
                "derivative of shoulder",
                "not measured",
                "not measured"
            ]
        );
    }
}
