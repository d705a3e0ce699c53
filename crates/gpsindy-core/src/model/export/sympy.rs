//! SymPy: symbols, a matrix of rates, equations.

use super::dialect::{Dialect, number};
use super::names::{line_comment, python_string};
use super::program::Program;
use crate::error::Result;
use crate::expression::{Expression, Function};
use crate::model::{InputKind, Model};

fn call(function: Function, arguments: &[String]) -> String {
    match (function, arguments) {
        (Function::Abs, [a]) => format!("sp.Abs({a})"),
        (Function::Min | Function::Max, [a, b]) => format!("sp.{}({a}, {b})", capital(function.name())),
        (Function::Step, [z]) => format!("sp.Heaviside({z}, 0)"),
        (Function::Clamp, [z, low, high]) => format!("sp.Min(sp.Max({z}, {low}), {high})"),
        (Function::DeadZone, [z, width]) => format!("({z} - sp.Min(sp.Max({z}, -({width})), {width}))"),
        (function, _) if function.has_memory() => format!("{}({})", function.name(), arguments.join(", ")),
        _ => format!("sp.{}({})", function.name(), arguments.join(", ")),
    }
}

/// Whole numbers as such: `x**3` and not `x**3.0`.
fn exact(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e15 { format!("{value}") } else { number(value) }
}

fn capital(name: &str) -> String {
    name[..1].to_uppercase() + &name[1..]
}

pub(super) fn write(model: &Model) -> Result<String> {
    let program = Program::new(model)?;
    let name = |name: &str| program.identifier(name);
    let dialect =
        Dialect { name: &name, call, power: |a, b| format!("{a}**{b}"), number: exact, pi: "sp.pi", time: "t" };
    let title = python_string(&program.called());
    let mut text = format!("\"\"\"{title}: its equations as SymPy expressions, written by gpsindy.\"\"\"\n\n");
    text += "import sympy as sp\n\nt = sp.Symbol(\"t\", real=True)\n";
    let lists = [
        ("states", model.states.iter().map(|s| (&s.name, &s.unit)).collect::<Vec<_>>()),
        ("controls", model.controls.iter().map(|c| (&c.name, &c.unit)).collect()),
        ("parameters", model.parameters.iter().map(|p| (&p.name, &p.unit)).collect()),
    ];
    for (list, entries) in &lists {
        for (entry, unit) in entries {
            let unit = if unit.is_empty() { String::new() } else { format!("  # {}", line_comment(unit)) };
            text += &format!("{} = sp.Symbol(\"{entry}\", real=True){unit}\n", name(entry));
        }
        let names: Vec<String> = entries.iter().map(|(entry, _)| name(entry)).collect();
        text += &format!("{list}_list = [{}]\n", names.join(", "));
    }
    if !program.history.is_empty() || !program.late.is_empty() {
        text += "\n\ndef delay(signal, tau):\n    \"\"\"The signal tau seconds earlier: its symbols become functions of t - tau.\"\"\"\n    \
            earlier = signal.subs(t, t - tau)\n    \
            return earlier.subs([(s, sp.Function(s.name)(t - tau)) for s in states_list + controls_list])\n\n\n";
    }
    if program.has(InputKind::Play) {
        text += "# A play has no closed form: play(signal, width) stays a function without a definition.\n\
            play = sp.Function(\"play\")\n";
    }
    if program.has(InputKind::Slew) {
        text += "# Nor has a rate limit: slew(signal, rate) stays a function without a definition.\n\
            slew = sp.Function(\"slew\")\n";
    }
    let values: Vec<String> =
        model.parameters.iter().map(|p| format!("{}: {}", name(&p.name), number(p.value))).collect();
    text += &format!("\nvalues = {{{}}}\n", values.join(", "));
    let matrix = |list: Vec<&Expression>| -> Result<String> {
        let rows = list.into_iter().map(|e| Ok(format!("    {},\n", dialect.write(e)?))).collect::<Result<String>>()?;
        Ok(format!("sp.Matrix([\n{rows}])\n"))
    };
    text += &format!("rates = {}", matrix(model.states.iter().map(|s| &s.equation).collect())?);
    if program.outputs.is_some() {
        let own: Vec<Expression> = model.states.iter().map(|s| Expression::variable(&s.name)).collect();
        let measured = model.states.iter().zip(&own).map(|(s, own)| s.measured.as_ref().unwrap_or(own)).collect();
        text += &format!("# What the columns of a log read.\noutputs = {}", matrix(measured)?);
    }
    text +=
        "equations = [sp.Eq(sp.Derivative(sp.Function(s.name)(t), t), rate) for s, rate in zip(states_list, rates)]\n";
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_stay_whole() {
        assert_eq!([3.0, -2.0, 0.5].map(exact), ["3", "-2", "0.5"]);
    }
}
