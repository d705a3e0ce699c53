//! Checks of a model before it is compiled; every message shows the equation and the position.

use super::{Model, SCHEMA};
use crate::error::{Error, Result};
use crate::expression::{Expression, Function};
use crate::model::sticking::is_fixed;

pub(super) fn check(model: &Model) -> Result<()> {
    if model.schema != SCHEMA {
        return Err(Error::Schema { found: model.schema.clone(), supported: SCHEMA.into() });
    }
    if model.states.is_empty() {
        return Err(Error::model("the model has no state; add a [[state]] with a name and an equation"));
    }
    check_texts(model)?;
    check_names(model)?;
    for state in &model.states {
        let place = format!("equation of state `{}`", state.name);
        check_expression(model, &state.equation, &place, false)?;
        if let Some(measured) = &state.measured {
            check_expression(model, measured, &format!("measured output of state `{}`", state.name), true)?;
        }
    }
    check_ports(model)?;
    for parameter in &model.parameters {
        if !parameter.value.is_finite() {
            return Err(Error::NotFinite { what: format!("value of parameter `{}`", parameter.name) });
        }
        if parameter.tolerance.is_some_and(|tolerance| !(tolerance.is_finite() && tolerance >= 0.0)) {
            let found = parameter.tolerance.unwrap_or(f64::NAN);
            return Err(Error::range(&format!("tolerance of parameter {}", parameter.name), "0 or above", found));
        }
    }
    for (name, value) in &model.initial {
        if model.state_index(name).is_none() {
            return Err(Error::unknown("initial state", name, model.states.iter().map(|s| &s.name)));
        }
        if !value.is_finite() {
            return Err(Error::NotFinite { what: format!("initial value of state `{name}`") });
        }
    }
    Ok(())
}

/// What moves at a port is a state, and something feels the port.
fn check_ports(model: &Model) -> Result<()> {
    let known = || model.states.iter().map(|s| &s.name);
    for port in &model.ports {
        if model.state_index(&port.variable).is_none() {
            return Err(Error::unknown(&format!("variable of port {}", port.name), &port.variable, known()));
        }
        if let Some(position) = port.position.as_ref().filter(|p| model.state_index(p).is_none()) {
            return Err(Error::unknown(&format!("position of port {}", port.name), position, known()));
        }
        if !model.states.iter().any(|s| s.equation.contains(&port.name)) {
            let place = format!("port `{}`", port.name);
            return Err(Error::model(format!("{place}: no equation has it; add it where a force there would act")));
        }
    }
    Ok(())
}

/// Whether a character shows on paper: not so a control character, a line's end, a soft hyphen, what has no width, a change of direction.
///
/// ```
/// assert!(gpsindy_core::shows('m') && !gpsindy_core::shows('\u{feff}'));
/// ```
pub fn shows(character: char) -> bool {
    let hides = character.is_control()
        || matches!(character, '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{feff}')
        || matches!(character, '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{fff9}'..='\u{fffb}');
    !hides
}

/// The first character that does not show.
fn hidden_character(text: &str) -> Option<(usize, char)> {
    text.chars().enumerate().find(|&(_, c)| !shows(c)).map(|(i, c)| (i + 1, c))
}

/// Reads a name or a unit, so that a reader of files knows the line of one that hides something.
#[cfg(feature = "serde")]
pub(super) fn plain_text<'de, D: serde::Deserializer<'de>>(reader: D) -> std::result::Result<String, D::Error> {
    let text: String = serde::Deserialize::deserialize(reader)?;
    match hidden_character(&text) {
        Some((position, character)) => {
            let what = "name or unit".into();
            Err(serde::de::Error::custom(Error::HiddenCharacter { what, position, character }))
        }
        None => Ok(text),
    }
}

/// Names and units end up in comments of exported programs, in tables and on screens.
fn check_texts(model: &Model) -> Result<()> {
    let check = |text: &str, what: &dyn Fn() -> String| match hidden_character(text) {
        Some((position, character)) => Err(Error::HiddenCharacter { what: what(), position, character }),
        None => Ok(()),
    };
    check(&model.name, &|| "name of the model".into())?;
    let states = model.states.iter().map(|s| ("state", &s.name, &s.unit));
    let controls = model.controls.iter().map(|c| ("control", &c.name, &c.unit));
    let ports = model.ports.iter().map(|p| ("port", &p.name, &p.unit));
    let parameters = model.parameters.iter().map(|p| ("parameter", &p.name, &p.unit));
    for (i, (kind, name, unit)) in states.chain(controls).chain(ports).chain(parameters).enumerate() {
        check(name, &|| format!("name of a {kind}, number {} of all names", i + 1))?;
        check(unit, &|| format!("unit of {kind} `{name}`"))?;
    }
    Ok(())
}

fn check_names(model: &Model) -> Result<()> {
    let mut seen: Vec<&str> = Vec::new();
    // A simulator's own parameters keep their names, as in `hip.armature`.
    let calls = model.calls_simulator();
    let is_own = |name: &str| calls && model.parameter_index(name).is_some();
    for name in model.names() {
        let mut characters = name.chars();
        let starts_well = characters.next().is_some_and(|c| c.is_alphabetic() || c == '_');
        if !starts_well || !characters.all(|c| c.is_alphanumeric() || c == '_' || (c == '.' && is_own(name))) {
            let why = "is not a name; use a letter, then letters, digits and `_`".into();
            return Err(Error::BadName { name: name.into(), why });
        }
        if name == "t" || name == "pi" || Function::ALL.iter().any(|f| f.name() == name) {
            let why = "has a meaning in expressions; give it another name".into();
            return Err(Error::BadName { name: name.into(), why });
        }
        if seen.contains(&name) {
            return Err(Error::Duplicate { kind: "name".into(), name: name.into() });
        }
        seen.push(name);
    }
    Ok(())
}

fn check_expression(model: &Model, expression: &Expression, place: &str, in_measured: bool) -> Result<()> {
    for name in expression.variables() {
        if !model.names().any(|n| n == name) {
            let position = expression.to_string().find(&name).map_or(1, |i| i + 1);
            let known: Vec<&str> = model.names().collect();
            let message = format!("name `{name}` is unknown in the {place}; known: {}", known.join(", "));
            return Err(Error::Parse { text: expression.to_string(), position, message });
        }
    }
    let mut problem = None;
    expression.visit(&mut |part| {
        if let Expression::Call(function, arguments) = part
            && function.has_memory()
        {
            problem = problem.take().or_else(|| check_history(model, *function, arguments, in_measured));
        }
        if let Expression::Call(function, arguments) = part
            && function.may_hold()
        {
            problem = problem.take().or_else(|| check_stick(model, *function, arguments));
        }
    });
    match problem {
        None => Ok(()),
        Some(why) => Err(Error::Equation { place: place.into(), expression: expression.to_string(), why }),
    }
}

/// What is wrong with a `delay`, `play` or `sample_hold`, if anything.
fn check_history(model: &Model, function: Function, arguments: &[Expression], in_measured: bool) -> Option<String> {
    let name = function.name();
    let is_state = |n: &String| model.state_index(n).is_some();
    let is_control = |n: &String| model.control_index(n).is_some();
    if arguments.iter().flat_map(Expression::variables).any(|n| model.port_index(&n).is_some()) {
        return Some(format!("`{name}` works on controls, and a port has no past; add the port outside of it"));
    }
    let delayed_state = matches!(&arguments[0], Expression::Variable(n) if is_state(n));
    let state_inside = arguments[0].variables().iter().any(is_state);
    if state_inside && !(in_measured && matches!(function, Function::Delay | Function::SampleHold) && delayed_state) {
        return Some(format!("`{name}` works on controls (in `measured`, `delay` and `sample_hold` also on a state)"));
    }
    let mut amounts = arguments[1..].iter().flat_map(Expression::variables);
    let may_grow = delayed_state && function == Function::Delay;
    if amounts.any(|n| is_state(&n) || is_control(&n)) || (!may_grow && arguments[1..].iter().any(reads_time)) {
        let which = if arguments.len() > 2 { "other arguments" } else { "second argument" };
        return Some(format!("the {which} of `{name}` must be made of numbers and parameters"));
    }
    if may_grow && !grows_steadily(&arguments[1]) {
        return Some(format!("the delay of `{name}` may grow with `t` only as a straight line does"));
    }
    None
}

/// Whether an expression is a straight line in time.
fn grows_steadily(expression: &Expression) -> bool {
    const TIME: &str = "t";
    let named = |part: Expression| if part == Expression::Time { Expression::variable(TIME) } else { part };
    let slope = expression.map(&named).derivative(TIME);
    slope.is_ok_and(|slope| !slope.contains(TIME))
}

pub(super) fn reads_time(expression: &Expression) -> bool {
    let mut found = false;
    expression.visit(&mut |part| found |= *part == Expression::Time);
    found
}

/// What is wrong with a `stick` or `breakaway`, if anything.
fn check_stick(model: &Model, function: Function, arguments: &[Expression]) -> Option<String> {
    let name = function.name();
    let is_state = |part: &Expression| matches!(part, Expression::Variable(n) if model.state_index(n).is_some());
    if !is_state(&arguments[0]) {
        return Some(format!("the first argument of `{name}` must be a state alone"));
    }
    if function == Function::Breakaway && !is_fixed(model, &arguments[1]) {
        return Some(format!("the second argument of `{name}` must be made of numbers and parameters"));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::{Control, Model, Parameter, Port, State};
    use crate::expression::Expression;

    fn model(equation: &str, measured: Option<&str>) -> Model {
        let mut state = State::new("x", Expression::parse(equation).unwrap());
        state.measured = measured.map(|m| Expression::parse(m).unwrap());
        Model {
            states: vec![state],
            controls: vec![Control::new("u")],
            parameters: vec![Parameter::new("k", 1.0)],
            ..Model::default()
        }
    }

    #[test]
    fn good_models_pass() {
        for (equation, measured) in [
            ("-k*x + u", None),
            ("delay(u, k) - x", Some("delay(x, 0.1) + k")),
            ("play(clamp(u, -k, k), 0.1)", None),
            ("slew(2*u, k) - x", Some("delay(x, k - 0.02*t)")),
            ("sample_hold(u*k, 0.1, -0.02)", Some("sample_hold(x, k, 0)")),
        ] {
            model(equation, measured).check().unwrap();
        }
    }

    #[test]
    fn a_port_needs_a_motion_and_an_equation() {
        let with = |equation: &str, port: Port| Model { ports: vec![port], ..model(equation, None) };
        with("u + f", Port::new("f", "x")).check().unwrap();
        let placed = Port { position: Some("y".into()), ..Port::new("f", "x") };
        for (model, words) in [
            (with("u + f", Port::new("f", "v")), "variable of port f `v` is unknown; known: x"),
            (with("u + f", placed), "position of port f `y` is unknown; known: x"),
            (with("u", Port::new("f", "x")), "port `f`: no equation has it"),
            (with("u + delay(f, 0.1)", Port::new("f", "x")), "a port has no past"),
            (with("u + k", Port::new("k", "x")), "name `k` appears twice"),
        ] {
            let error = model.check().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn contradictions_are_told_with_the_equation() {
        for (equation, measured, words) in [
            ("-q*x", None, "name `q` is unknown in the equation of state `x`; known: x, u, k"),
            ("delay(x, 0.1)", None, "works on controls"),
            ("delay(u, x)", None, "numbers and parameters"),
            ("u", Some("delay(x, 0.1*t^2)"), "the delay of `delay` may grow with `t` only as a straight line does"),
            ("slew(x, 1)", None, "`slew` works on controls"),
            ("delay(u, 0.1*t)", None, "the second argument of `delay` must be made of numbers and parameters"),
            (
                "sample_hold(u, 0.1, u)",
                None,
                "the other arguments of `sample_hold` must be made of numbers and parameters",
            ),
            ("sample_hold(x, 0.1, 0)", None, "works on controls"),
            ("u", Some("y"), "measured output"),
            ("u", Some("play(x, 1)"), "works on controls"),
        ] {
            let error = model(equation, measured).check().unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        let mut twice = model("u", None);
        twice.parameters.push(Parameter::new("x", 0.0));
        assert!(twice.check().unwrap_err().to_string().contains("twice"));
        let mut reserved = model("u", None);
        reserved.parameters.push(Parameter::new("sin", 0.0));
        assert!(reserved.check().unwrap_err().to_string().contains("meaning"));
    }

    #[test]
    fn text_that_does_not_show_is_refused_with_its_place() {
        for hidden in
            ['\n', '\r', '\0', '\u{1b}', '\u{85}', '\u{2028}', '\u{202e}', '\u{2066}', '\u{feff}', '\u{ad}', '\u{200b}']
        {
            let mut named = model("u", None);
            named.name = format!("a{hidden}b");
            let code = format!("U+{:04X}", hidden as u32);
            let error = named.check().unwrap_err().to_string();
            assert_eq!(
                error,
                format!("name of the model: character 2 is {code}, which does not show; write one line of plain text")
            );
            let mut with_unit = model("u", None);
            with_unit.parameters[0].unit = format!("m{hidden}");
            let error = with_unit.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("unit of parameter `k`: character 2 is {code}")), "{error}");
            let mut with_name = model("u", None);
            with_name.controls[0].name = format!("u{hidden}");
            let error = with_name.check().unwrap_err().to_string();
            assert!(error.starts_with("name of a control, number 2 of all names: character 2 is U+"), "{error}");
        }
    }
}
