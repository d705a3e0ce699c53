//! Which column measures what of a simulator: reported before the work begins, because a column with another name is missed silently.

use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use crate::text::aligned_left;
use gpsindy_core::diagnose::{Part, PartKind};
use gpsindy_core::{Dataset, Model};
use gpsindy_files::{Logs, meant};

/// Lists the columns of a simulator, and warns of the states that no column carries, with names that are near. Rates of a measured position are
/// made from it. Nothing where `before`, which were listed, have the same columns.
pub(crate) fn tell(logs: &Logs, before: Option<&Logs>, model: &Model, screen: &Screen) {
    let table = |logs: &Logs| {
        let found = |name: &str| logs.files().iter().find_map(|log| log.column(name));
        table(model, &|name| found(name).map(|header| header.text.clone()))
    };
    if !model.calls_simulator() || before.is_some_and(|before| table(before) == table(logs)) {
        return;
    }
    screen.note(aligned_left(&table(logs)).trim_end());
    let names = unmeasured(model, &|name| logs.resolve(name).is_ok());
    if names.is_empty() {
        return;
    }
    screen.warn(&format!(
        "not measured, so the simulator runs them unseen: {}; give a column the name of a state with --rename, or hold a joint of a MuJoCo \
         model that does not move with --lock",
        names.join(", ")
    ));
    let columns = free(logs, model);
    for name in names {
        let near = meant(name, columns.iter().map(String::as_str));
        if !near.is_empty() {
            screen.warn(&format!("no column is `{name}`{near}"));
        }
    }
}

/// Columns that carry no state and no control of the model.
fn free(logs: &Logs, model: &Model) -> Vec<String> {
    let states = model.states.iter().map(|state| &state.name);
    let taken: Vec<&String> = states.chain(model.controls.iter().map(|control| &control.name)).collect();
    logs.columns().into_iter().filter(|column| !taken.contains(&column)).collect()
}

/// Refuses a joint that is asked about and of which the logs carry nothing: the others would be searched for what it lacks.
pub(crate) fn check_asked(logs: &Logs, asked: &[Part], model: &Model) -> Outcome {
    let is_carried = |name: &String| logs.resolve(name).is_ok();
    let Some(part) = asked.iter().find(|part| part.kind == PartKind::Joint && !part.states.iter().any(is_carried))
    else {
        return Ok(());
    };
    let columns = free(logs, model);
    let near = part.states.first().map_or(String::new(), |name| meant(name, columns.iter().map(String::as_str)));
    Err(Failure::input(format!(
        "--joint {}: no column of the logs measures it, neither `{}`{near}; give a column that name with --rename",
        part.name,
        part.states.join("` nor `")
    )))
}

/// Warns of a joint whose readings go beyond a full turn and have no unit in their header: degrees look like that, and would be read as radians.
pub(crate) fn doubt_degrees(logs: &Logs, data: &Dataset, model: &Model, screen: &Screen) {
    if !model.calls_simulator() {
        return;
    }
    let is_bare =
        |name: &str| logs.files().iter().filter_map(|log| log.column(name)).all(|header| header.unit.is_empty());
    let far = model.states.iter().filter(|state| state.unit == "rad" && is_bare(&state.name)).filter_map(|state| {
        let farthest = farthest(data, &state.name)?;
        (farthest > TURN).then(|| format!("{} to {farthest:.1}", state.name))
    });
    let far: Vec<String> = far.collect();
    if !far.is_empty() {
        screen.warn(&format!(
            "read as rad, readings go beyond a full turn: {}; if they are degrees, multiply them by pi/180, else write [rad] behind the name in the header",
            far.join(", ")
        ));
    }
}

/// A full turn, rad.
const TURN: f64 = std::f64::consts::TAU;

/// Largest size of a column's readings.
fn farthest(data: &Dataset, column: &str) -> Option<f64> {
    let place = data.channels().iter().position(|channel| channel.name == column)?;
    let values = data.runs().iter().flat_map(|run| run.column(place));
    values.map(|value| value.abs()).filter(|size| size.is_finite()).max_by(f64::total_cmp)
}

/// Units that measure the same, each with its size in the first of them.
const SCALES: [&[(&str, f64)]; 5] = [
    &[("rad", 1.0), ("deg", DEGREE), ("°", DEGREE), ("degree", DEGREE), ("degrees", DEGREE)],
    &[("rad/s", 1.0), ("deg/s", DEGREE), ("°/s", DEGREE), ("rpm", 6.0 * DEGREE), ("rev/min", 6.0 * DEGREE)],
    &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2)],
    &[("m/s", 1.0), ("mm/s", 1e-3), ("cm/s", 1e-2), ("km/h", 1.0 / 3.6)],
    &[("N", 1.0), ("kN", 1e3), ("mN", 1e-3)],
];
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Refuses a column whose header names another unit of the same kind than the simulator has: degrees would be read as radians.
pub(crate) fn check_units(logs: &Logs, model: &Model) -> Outcome {
    if !model.calls_simulator() {
        return Ok(());
    }
    let states = model.states.iter().map(|s| (&s.name, &s.unit));
    for (name, unit) in states.chain(model.controls.iter().map(|c| (&c.name, &c.unit))) {
        for log in logs.files() {
            let Some(header) = log.column(name) else { continue };
            if let Some(factor) = factor(&header.unit, unit) {
                return Err(Failure::input(format!(
                    "{}: column `{}` is in {}, and `{name}` of the simulator in {unit}; multiply the column by {factor:.6}, or correct the unit in its header",
                    log.file, header.text, header.unit
                )));
            }
        }
    }
    Ok(())
}

/// What a value of one unit is multiplied by to be one of the other; nothing where they are the same, or measure different things.
fn factor(from: &str, to: &str) -> Option<f64> {
    let size = |unit: &str, scale: &[(&str, f64)]| scale.iter().find(|(name, _)| *name == unit).map(|(_, size)| *size);
    let factor = SCALES.iter().find_map(|scale| Some(size(from, scale)? / size(to, scale)?))?;
    (factor != 1.0).then_some(factor)
}

/// Every state and control of a simulator with its unit and its column, whose whole header `header` finds.
fn table(model: &Model, header: &dyn Fn(&str) -> Option<String>) -> Vec<[String; 3]> {
    let mut rows = vec![["simulator".into(), "unit".into(), "column of the logs".into()]];
    for (index, state) in model.states.iter().enumerate() {
        let position = model.integral_of(index).map(|place| &model.states[place]);
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
    let is_made = |rate: usize| model.integral_of(rate).is_some_and(|place| carried(&model.states[place].name));
    let states = model.states.iter().enumerate();
    states.filter(|(rate, s)| !carried(&s.name) && !is_made(*rate)).map(|(_, s)| s.name.as_str()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpsindy_core::{Channel, Expression, Run, State};

    #[test]
    fn the_farthest_reading_leaves_out_what_is_missing() {
        let values = faer::Mat::from_fn(4, 1, |i, _| [0.2, f64::NAN, -31.0, 30.0][i]);
        let run = Run { name: "deg.csv".into(), time: vec![0.0, 0.1, 0.2, 0.3], values };
        let data = Dataset::new(vec![Channel::new("elbow")], vec![run]).unwrap();
        assert_eq!((farthest(&data, "elbow"), farthest(&data, "wrist")), (Some(31.0), None));
    }

    #[test]
    fn units_of_one_kind_have_a_factor_and_others_none() {
        assert!((factor("deg", "rad").unwrap() - 0.0174533).abs() < 1e-6);
        assert!((factor("rpm", "rad/s").unwrap() - 0.1047198).abs() < 1e-6);
        assert!([("rad", "rad"), ("", "rad"), ("m", "rad"), ("deg", "°")].iter().all(|(a, b)| factor(a, b).is_none()));
    }

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
