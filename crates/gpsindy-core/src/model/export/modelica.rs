//! Modelica: controls are inputs, `delay` is the language's own.

use super::dialect::{Dialect, identifier, number};
use super::program::Program;
use crate::error::{Error, Result};
use crate::expression::Function;
use crate::model::Model;

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

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    if program.plays() {
        return Err(Error::invalid(
            "Modelica has no play: export to python, c, rust or julia, or replace `play(...)` in the model",
        ));
    }
    let name = |name: &str| program.identifier(name);
    let dialect =
        Dialect { name: &name, call, power: |a, b| format!("{a}^{b}"), number, pi: "3.141592653589793", time: "time" };
    let title = identifier(if model.name.is_empty() { "Model" } else { &model.name }, &["model", "end"]);
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
        let start = Some(format!("start={}, fixed=true", number(initial)));
        text += &format!("  Real {}{};\n", name(&s.name), attributes(&[unit_attribute(&s.unit), start]));
    }
    let measured: Vec<_> = model.states.iter().filter_map(|s| Some((s, s.measured.as_ref()?))).collect();
    for (s, _) in &measured {
        let what = format!("\"what the log's column {} reads\"", s.name);
        text +=
            &format!("  output Real {}_measured{} {what};\n", name(&s.name), attributes(&[unit_attribute(&s.unit)]));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_written_as_modelica_does() {
        assert_eq!(unit_attribute("N*s/m^2").as_deref(), Some("unit=\"N.s/m2\""));
        assert_eq!(unit_attribute("per cent"), None);
    }
}
