//! What a model must fulfil before it is compiled; every message shows the equation and the place.

use super::{Model, SCHEMA};
use crate::error::{Error, Result};
use crate::expression::{Expression, Function};

pub(super) fn check(model: &Model) -> Result<()> {
    if model.schema != SCHEMA {
        return Err(Error::invalid(format!("schema is `{}`, but this version reads `{SCHEMA}`", model.schema)));
    }
    if model.states.is_empty() {
        return Err(Error::invalid("the model has no state; add a [[state]] with a name and an equation"));
    }
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
            return Err(Error::invalid(format!("{place}: no equation has it; add it where a force there would act")));
        }
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
            return Err(Error::invalid(format!("`{name}` is not a name; use a letter, then letters, digits and `_`")));
        }
        if name == "t" || name == "pi" || Function::ALL.iter().any(|f| f.name() == name) {
            return Err(Error::invalid(format!("`{name}` has a meaning in expressions; give it another name")));
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
        if let Expression::Call(function @ (Function::Delay | Function::Play), arguments) = part {
            problem = problem.take().or_else(|| check_history(model, *function, arguments, in_measured));
        }
    });
    match problem {
        None => Ok(()),
        Some(message) => Err(Error::invalid(format!("{place}, `{expression}`: {message}"))),
    }
}

/// What is wrong with a `delay` or `play`, if anything.
fn check_history(model: &Model, function: Function, arguments: &[Expression], in_measured: bool) -> Option<String> {
    let name = function.name();
    let is_state = |n: &String| model.state_index(n).is_some();
    let is_control = |n: &String| model.control_index(n).is_some();
    if arguments.iter().flat_map(Expression::variables).any(|n| model.port_index(&n).is_some()) {
        return Some(format!("`{name}` works on controls, and a port has no past; add the port outside of it"));
    }
    let delayed_state = matches!(&arguments[0], Expression::Variable(n) if is_state(n));
    let state_inside = arguments[0].variables().iter().any(is_state);
    if state_inside && !(in_measured && function == Function::Delay && delayed_state) {
        return Some(format!("`{name}` works on controls (in `measured`, `delay` also on a state)"));
    }
    let amount = arguments[1].variables();
    if amount.iter().any(|n| is_state(n) || is_control(n)) {
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
        for (equation, measured) in
            [("-k*x + u", None), ("delay(u, k) - x", Some("delay(x, 0.1) + k")), ("play(clamp(u, -k, k), 0.1)", None)]
        {
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
            (with("u + k", Port::new("k", "x")), "name `k` stands twice"),
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
}
