//! Modelica: controls are inputs, `delay` is the language's own.

use super::dialect::{Dialect, number};
use super::names::{is_reserved, title};
use super::program::Program;
use crate::error::{Error, Result};
use crate::expression::{Expression, Function};
use crate::model::check::reads_time;
use crate::model::{InputKind, Model, State};
use std::collections::BTreeMap;

fn call(function: Function, arguments: &[String]) -> String {
    match (function, arguments) {
        (Function::Step, [z]) => format!("(if {z} > 0.0 then 1.0 else 0.0)"),
        (Function::Clamp, [z, low, high]) => format!("min(max({z}, {low}), {high})"),
        (Function::DeadZone, [z, width]) => format!("(({z}) - min(max({z}, -({width})), {width}))"),
        _ => format!("{}({})", function.name(), arguments.join(", ")),
    }
}

/// The attribute for a unit, in Modelica's notation, where it has one: `N*s/m^2` is `N.s/m2`.
fn unit_attribute(unit: &str) -> Option<String> {
    let written = unit.replace('*', ".").replace('^', "");
    let known = |c: char| c.is_ascii_alphanumeric() || "./()-".contains(c);
    (!written.is_empty() && written.chars().all(known)).then(|| format!("unit=\"{written}\""))
}

fn attributes(list: &[Option<String>]) -> String {
    let given: Vec<&str> = list.iter().flatten().map(String::as_str).collect();
    if given.is_empty() { String::new() } else { format!("({})", given.join(", ")) }
}

/// The class's name: no keyword, and no name of the model's own.
fn own_title(program: &Program<'_>) -> String {
    let title = match title(&program.model.name) {
        nameless if nameless == "model" => "Model".into(),
        title => title,
    };
    let is_taken = is_reserved(&title) || program.model.names().any(|n| program.identifier(n) == title);
    if is_taken { title + "_model" } else { title }
}

pub(super) fn write(model: &Model) -> Result<String> {
    let (model, followers) = &with_followers(model);
    let program = Program::new(model)?;
    if program.has(InputKind::Play) {
        return Err(Error::NotExportable {
            what: "`play(...)`".into(),
            why: "Modelica has no play; export to python, c, rust or julia, or replace it in the model".into(),
        });
    }
    for expression in model.states.iter().filter_map(|s| s.measured.as_ref()) {
        if has_growing_delay(expression) {
            return Err(Error::NotExportable {
                what: format!("`{expression}`"),
                why: "Modelica's delay needs to know the largest; export to python, c, rust or julia".into(),
            });
        }
    }
    let name = |name: &str| program.identifier(name);
    let dialect =
        Dialect { name: &name, call, power: |a, b| format!("{a}^{b}"), number, pi: "3.141592653589793", time: "time" };
    let title = own_title(&program);
    let mut text =
        format!("model {title} \"Written by gpsindy; connect the inputs to the controls, held between samples\"\n");
    for p in &model.parameters {
        let value = number(p.value);
        text += &format!("  parameter Real {}{} = {value};\n", name(&p.name), attributes(&[unit_attribute(&p.unit)]));
    }
    for c in &model.controls {
        text += &format!("  input Real {}{};\n", name(&c.name), attributes(&[unit_attribute(&c.unit)]));
    }
    for (s, initial) in model.states.iter().zip(program.initial()) {
        let start = (!followers.contains_key(&s.name)).then(|| format!("start={}, fixed=true", number(initial)));
        text += &format!("  Real {}{};\n", name(&s.name), attributes(&[unit_attribute(&s.unit), start]));
    }
    let measured: Vec<_> = model.states.iter().filter_map(|s| Some((s, s.measured.as_ref()?))).collect();
    for (s, _) in &measured {
        let what = format!("\"what the log's column {} reads\"", s.name);
        text +=
            &format!("  output Real {}_measured{} {what};\n", name(&s.name), attributes(&[unit_attribute(&s.unit)]));
    }
    if !followers.is_empty() {
        text += "initial equation\n";
        for (follower, signal) in followers {
            text += &format!("  {} = {};\n", name(follower), dialect.write(signal)?);
        }
    }
    text += "equation\n";
    for s in &model.states {
        text += &format!("  der({}) = {};\n", name(&s.name), dialect.write(&s.equation)?);
    }
    for (s, expression) in measured {
        text += &format!("  {}_measured = {};\n", name(&s.name), dialect.write(expression)?);
    }
    Ok(text + &format!("end {title};\n"))
}

fn has_growing_delay(expression: &Expression) -> bool {
    let mut found = false;
    expression.visit(&mut |part| {
        if let Expression::Call(Function::Delay, arguments) = part {
            found |= reads_time(&arguments[1]);
        }
    });
    found
}

/// How closely a rate-limited signal is followed, s: that of `SlewRateLimiter` in Modelica's standard library.
const CLOSELY: f64 = 1e-3;

/// The model with a state in the place of every rate limit, and the signal that each of these states follows and starts at.
fn with_followers(model: &Model) -> (Model, BTreeMap<String, Expression>) {
    let (mut model, mut followers) = (model.clone(), BTreeMap::new());
    let next = |model: &Model| {
        let mut found = None;
        let all = model.states.iter().flat_map(|s| std::iter::once(&s.equation).chain(&s.measured));
        all.for_each(|e| {
            e.visit(&mut |part| {
                if let Expression::Call(Function::Slew, arguments) = part {
                    found = Some((part.clone(), arguments.clone()));
                }
            });
        });
        found
    };
    // The last that a visit meets has none within.
    while let Some((call, arguments)) = next(&model) {
        let name = model.free_name("slew");
        let own = Expression::variable(name.clone());
        let instead = |part: Expression| if part == call { own.clone() } else { part };
        for state in &mut model.states {
            state.equation = state.equation.map(&instead);
            state.measured = state.measured.as_ref().map(|measured| measured.map(&instead));
        }
        let [signal, rate] = [arguments[0].clone(), arguments[1].clone()];
        let behind = signal.clone().minus(own).over(Expression::Number(CLOSELY));
        let follows = Expression::Call(Function::Clamp, vec![behind, rate.clone().negated(), rate]);
        model.states.push(State::new(name.clone(), follows));
        followers.insert(name, signal);
    }
    (model, followers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_written_as_modelica_does() {
        assert_eq!(unit_attribute("N*s/m^2").as_deref(), Some("unit=\"N.s/m2\""));
        assert_eq!(unit_attribute("per cent"), None);
    }
}
