//! LaTeX: the equations, what the sensors read, and the parameters, as `align*` environments.

use super::dialect::no_equations;
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::Model;

const GREEK: &[&str] = &[
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Sigma",
    "Phi", "Psi", "Omega",
];

/// How tightly a written piece binds: sums 1, a leading sign 2, products 3, powers 5, all else 9.
type Piece = (String, u8);

pub(super) fn write(model: &Model) -> Result<String> {
    let mut blocks = Vec::new();
    let rates = model.states.iter().map(|s| Ok(format!("\\dot{{{}}} &= {}", name(&s.name), at(&s.equation, 1)?)));
    blocks.push(rates.collect::<Result<Vec<_>>>()?);
    let measured = model.states.iter().filter_map(|s| Some((s, s.measured.as_ref()?)));
    let measured = measured.map(|(s, m)| Ok(format!("y_{{{}}} &= {}", name(&s.name), at(m, 1)?)));
    blocks.push(measured.collect::<Result<Vec<_>>>()?);
    let parameter = |p: &crate::model::Parameter| {
        let unit = if p.unit.is_empty() { String::new() } else { format!("\\ \\mathrm{{{}}}", escaped(&p.unit)) };
        format!("{} &= {}{unit}", name(&p.name), number(p.value))
    };
    blocks.push(model.parameters.iter().map(parameter).collect());
    let mut text = String::new();
    let titles = ["rates of the states", "what the columns of a log read", "parameters"];
    for (title, block) in titles.into_iter().zip(blocks).filter(|(_, block)| !block.is_empty()) {
        text += &format!("% {title}\n\\begin{{align*}}\n  {}\n\\end{{align*}}\n", block.join(" \\\\\n  "));
    }
    Ok(text)
}

fn at(expression: &Expression, needed: u8) -> Result<String> {
    let (text, binding) = piece(expression)?;
    Ok(if binding >= needed { text } else { format!("\\left({text}\\right)") })
}

fn piece(expression: &Expression) -> Result<Piece> {
    Ok(match expression {
        Expression::Number(value) => {
            let text = number(*value);
            // A power of ten is a product.
            let binding = if value.is_sign_negative() { 2 } else { 9 - 6 * u8::from(text.contains("times")) };
            (text, binding)
        }
        Expression::Pi => ("\\pi".into(), 9),
        Expression::Time => ("t".into(), 9),
        Expression::Variable(variable) => (name(variable), 9),
        Expression::Negate(a) => (format!("-{}", at(a, 3)?), 2),
        Expression::Binary(Operator::Add, a, b) => (format!("{} + {}", at(a, 1)?, at(b, 3)?), 1),
        Expression::Binary(Operator::Subtract, a, b) => (format!("{} - {}", at(a, 1)?, at(b, 3)?), 1),
        Expression::Binary(Operator::Multiply, a, b) => {
            // A sign may lead a product.
            let (left, right) = (at(a, 2)?, at(b, 3)?);
            let sign = if right.starts_with(|c: char| c.is_ascii_digit()) { "\\cdot" } else { "\\," };
            (format!("{left} {sign} {right}"), if left.starts_with('-') { 2 } else { 3 })
        }
        Expression::Binary(Operator::Divide, a, b) => (format!("\\frac{{{}}}{{{}}}", at(a, 1)?, at(b, 1)?), 9),
        Expression::Binary(Operator::Power, a, b) => {
            // A function or a fraction needs parentheses under an exponent, a name or a number does not.
            let plain =
                matches!(**a, Expression::Number(_) | Expression::Pi | Expression::Time | Expression::Variable(_));
            let base = if plain { at(a, 9)? } else { format!("\\left({}\\right)", at(a, 1)?) };
            (format!("{{{base}}}^{{{}}}", at(b, 1)?), 5)
        }
        Expression::Call(function, arguments) => (call(*function, arguments)?, 9),
        Expression::Simulator(..) => return Err(no_equations()),
    })
}

fn call(function: Function, arguments: &[Expression]) -> Result<String> {
    let first = at(&arguments[0], 1)?;
    let list = arguments.iter().map(|a| at(a, 1)).collect::<Result<Vec<_>>>()?.join(", ");
    Ok(match function {
        Function::Sqrt => format!("\\sqrt{{{first}}}"),
        Function::Abs => format!("\\left|{first}\\right|"),
        Function::Asin | Function::Acos | Function::Atan => {
            format!("\\arc{}\\left({first}\\right)", &function.name()[1..])
        }
        Function::Log => format!("\\ln\\left({first}\\right)"),
        Function::Sign => format!("\\operatorname{{sgn}}\\left({first}\\right)"),
        Function::Delay => {
            let shift = at(&arguments[1], 2)?;
            match &arguments[0] {
                Expression::Variable(_) => format!("{first}\\left(t - {shift}\\right)"),
                _ => format!("\\left.\\left({first}\\right)\\right|_{{t - {shift}}}"),
            }
        }
        Function::Play => format!("\\operatorname{{play}}_{{{}}}\\left({first}\\right)", at(&arguments[1], 1)?),
        Function::Atan2 | Function::Step | Function::Clamp | Function::DeadZone => {
            format!("\\operatorname{{{}}}\\left({list}\\right)", escaped(function.name()))
        }
        other => format!("\\{}\\left({list}\\right)", other.name()),
    })
}

fn escaped(text: &str) -> String {
    text.replace('_', "\\_").replace('%', "\\%").replace('*', "\\,").replace('^', "\\hat{}")
}

/// `omega_1` is an omega with index 1, `x1` an x with index 1, `speed` an upright word.
fn name(variable: &str) -> String {
    let (base, index) = match variable.split_once('_') {
        Some((base, index)) if !base.is_empty() && !index.is_empty() => (base, index.replace('_', ", ")),
        Some(_) => return format!("\\mathrm{{{}}}", escaped(variable)),
        None => {
            let digits = variable.chars().rev().take_while(char::is_ascii_digit).count();
            let (base, index) = variable.split_at(variable.len() - digits);
            (base, index.to_string())
        }
    };
    let index = if index.is_empty() { index } else { format!("_{{{}}}", word(&index)) };
    word(base) + &index
}

fn word(text: &str) -> String {
    if GREEK.contains(&text) {
        format!("\\{text}")
    } else if text.chars().count() == 1 || text.chars().all(|c| c.is_ascii_digit()) {
        text.into()
    } else {
        format!("\\mathrm{{{text}}}")
    }
}

fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-4..1e6).contains(&size) {
        return format!("{value}");
    }
    let text = format!("{value:e}");
    match text.split_once('e') {
        Some((digits, exponent)) => format!("{digits} \\times 10^{{{exponent}}}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_look_as_one_would_write_them() {
        for (source, wanted) in [
            ("-k*x1 - 0.3*v", "-k \\, x_{1} - 0.3 \\, v"),
            ("(u - b*omega_1)/m", "\\frac{u - b \\, \\omega_{1}}{m}"),
            ("-(a + b)*speed", "-\\left(a + b\\right) \\, \\mathrm{speed}"),
            ("sin(x)^2", "{\\left(\\sin\\left(x\\right)\\right)}^{2}"),
            ("2*3", "2 \\cdot 3"),
            ("delay(u, tau)", "u\\left(t - \\tau\\right)"),
            ("play(u, w)", "\\operatorname{play}_{w}\\left(u\\right)"),
            ("1e-7*x", "1 \\times 10^{-7} \\, x"),
            ("1e-7^2", "{\\left(1 \\times 10^{-7}\\right)}^{2}"),
            ("abs(v)*asin(x)", "\\left|v\\right| \\, \\arcsin\\left(x\\right)"),
        ] {
            assert_eq!(at(&Expression::parse(source).unwrap(), 1).unwrap(), wanted, "{source}");
        }
    }
}
