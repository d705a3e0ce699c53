//! LaTeX: the equations, the readings of the sensors, and the parameters, as `align*` environments.

use super::dialect::no_equations;
use crate::error::Result;
use crate::expression::{Expression, Function, Operator};
use crate::model::{Model, Parameter};

const GREEK: &[&str] = &[
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Sigma",
    "Phi", "Psi", "Omega",
];

/// How tightly a written piece binds: sums 1, a leading sign 2, products 3, powers 5, all else 9.
type Piece = (String, u8);

pub(super) fn write(model: &Model, full_digits: bool) -> Result<String> {
    let latex = Latex { full_digits };
    let mut blocks = Vec::new();
    let rates = model.states.iter().map(|s| Ok(format!("\\dot{{{}}} &= {}", name(&s.name), latex.at(&s.equation, 1)?)));
    blocks.push(rates.collect::<Result<Vec<_>>>()?);
    let measured = model.states.iter().filter_map(|s| Some((s, s.measured.as_ref()?)));
    let measured = measured.map(|(s, m)| Ok(format!("y_{{{}}} &= {}", name(&s.name), latex.at(m, 1)?)));
    blocks.push(measured.collect::<Result<Vec<_>>>()?);
    let parameter = |p: &Parameter| {
        let unit = if p.unit.trim().is_empty() { String::new() } else { format!("\\ \\mathrm{{{}}}", unit(&p.unit)) };
        format!("{} &= {}{unit}", name(&p.name), latex.number(p.value))
    };
    blocks.push(model.parameters.iter().map(parameter).collect());
    let mut text = String::new();
    let titles = ["rates of the states", "what the columns of a log read", "parameters"];
    for (title, block) in titles.into_iter().zip(blocks).filter(|(_, block)| !block.is_empty()) {
        text += &format!("% {title}\n\\begin{{align*}}\n  {}\n\\end{{align*}}\n", block.join(" \\\\\n  "));
    }
    Ok(text)
}

/// How numbers are written.
struct Latex {
    full_digits: bool,
}

impl Latex {
    fn at(&self, expression: &Expression, needed: u8) -> Result<String> {
        let (text, binding) = self.piece(expression)?;
        Ok(if binding >= needed { text } else { format!("\\left({text}\\right)") })
    }

    fn piece(&self, expression: &Expression) -> Result<Piece> {
        Ok(match expression {
            Expression::Number(value) => {
                let text = self.number(*value);
                // A power of ten is a product.
                let binding = if value.is_sign_negative() { 2 } else { 9 - 6 * u8::from(text.contains("times")) };
                (text, binding)
            }
            Expression::Pi => ("\\pi".into(), 9),
            Expression::Time => ("t".into(), 9),
            Expression::Variable(variable) => (name(variable), 9),
            Expression::Negate(a) => (format!("-{}", self.at(a, 3)?), 2),
            Expression::Binary(Operator::Add, a, b) => (format!("{} + {}", self.at(a, 1)?, self.at(b, 3)?), 1),
            Expression::Binary(Operator::Subtract, a, b) => (format!("{} - {}", self.at(a, 1)?, self.at(b, 3)?), 1),
            Expression::Binary(Operator::Multiply, a, b) => {
                // A sign may lead a product.
                let (left, right) = (self.at(a, 2)?, self.at(b, 3)?);
                let sign = if right.starts_with(|c: char| c.is_ascii_digit()) { "\\cdot" } else { "\\," };
                (format!("{left} {sign} {right}"), if left.starts_with('-') { 2 } else { 3 })
            }
            Expression::Binary(Operator::Divide, a, b) => {
                (format!("\\frac{{{}}}{{{}}}", self.at(a, 1)?, self.at(b, 1)?), 9)
            }
            Expression::Binary(Operator::Power, a, b) => {
                // A function or a fraction needs parentheses under an exponent, a name or a number does not.
                let plain =
                    matches!(**a, Expression::Number(_) | Expression::Pi | Expression::Time | Expression::Variable(_));
                let base = if plain { self.at(a, 9)? } else { format!("\\left({}\\right)", self.at(a, 1)?) };
                (format!("{{{base}}}^{{{}}}", self.at(b, 1)?), 5)
            }
            Expression::Call(function, arguments) => (self.call(*function, arguments)?, 9),
            Expression::Simulator(..) => return Err(no_equations()),
        })
    }

    fn call(&self, function: Function, arguments: &[Expression]) -> Result<String> {
        let first = self.at(&arguments[0], 1)?;
        let list = arguments.iter().map(|a| self.at(a, 1)).collect::<Result<Vec<_>>>()?.join(", ");
        Ok(match function {
            Function::Sqrt => format!("\\sqrt{{{first}}}"),
            Function::Abs => format!("\\left|{first}\\right|"),
            Function::Asin | Function::Acos | Function::Atan => {
                format!("\\arc{}\\left({first}\\right)", &function.name()[1..])
            }
            Function::Log => format!("\\ln\\left({first}\\right)"),
            Function::Sign => format!("\\operatorname{{sgn}}\\left({first}\\right)"),
            Function::Delay => {
                let shift = self.at(&arguments[1], 2)?;
                match &arguments[0] {
                    Expression::Variable(_) => format!("{first}\\left(t - {shift}\\right)"),
                    _ => format!("\\left.\\left({first}\\right)\\right|_{{t - {shift}}}"),
                }
            }
            Function::SampleHold => {
                let (period, phase) = (self.at(&arguments[1], 1)?, self.at(&arguments[2], 1)?);
                format!("\\operatorname{{hold}}_{{{period},\\,{phase}}}\\left({first}\\right)")
            }
            Function::Slew => {
                format!("\\operatorname{{slew}}_{{{}}}\\left({first}\\right)", self.at(&arguments[1], 1)?)
            }
            Function::Play => {
                format!("\\operatorname{{play}}_{{{}}}\\left({first}\\right)", self.at(&arguments[1], 1)?)
            }
            Function::Atan2 | Function::Step | Function::Clamp | Function::DeadZone => {
                format!("\\operatorname{{{}}}\\left({list}\\right)", function.name().replace('_', "\\_"))
            }
            other => format!("\\{}\\left({list}\\right)", other.name()),
        })
    }

    fn number(&self, value: f64) -> String {
        /// Digits that a reader of equations wants.
        const DIGITS: usize = 6;
        let rounded = format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value);
        let value: f64 = if self.full_digits { value } else { rounded };
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
}

/// A unit inside `\mathrm`: `N*s/m^2` becomes `N\,s/m^{2}`. Marks that LaTeX reads itself are escaped, `^` too, since `^^5c`
/// is a backslash.
fn unit(text: &str) -> String {
    let mut written = String::new();
    let mut rest = text.trim();
    while let Some(character) = rest.chars().next() {
        rest = &rest[character.len_utf8()..];
        match character {
            '^' => {
                let digits = rest.strip_prefix('-').unwrap_or(rest);
                let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
                let (power, after) = rest.split_at(rest.len() - digits.len() + end);
                if end == 0 {
                    written += "\\wedge ";
                } else {
                    written += &format!("^{{{power}}}");
                    rest = after;
                }
            }
            '*' | ' ' | '\u{b7}' | '\u{22c5}' => written += "\\,",
            '\u{b0}' => written += "{}^{\\circ}",
            '\u{b5}' | '\u{3bc}' => written += "\\mu ",
            '\u{3a9}' | '\u{2126}' => written += "\\Omega ",
            '\\' => written += "\\backslash ",
            '~' => written += "\\sim ",
            '%' | '$' | '#' | '&' | '_' | '{' | '}' => written.extend(['\\', character]),
            plain if plain.is_ascii_graphic() => written.push(plain),
            other if other.is_alphanumeric() => written += &format!("\\text{{{other}}}"),
            _ => written += "\\,",
        }
    }
    written
}

/// `omega_1` is an omega with index 1, `x1` an x with index 1, `wheel_speed_x` an upright wheel speed with index x,
/// `tau_max` a tau with an upright index.
fn name(variable: &str) -> String {
    let parts: Vec<&str> = variable.split('_').collect();
    if parts.iter().any(|part| part.is_empty()) {
        return format!("\\mathrm{{{}}}", variable.replace('_', "\\_"));
    }
    let n_words = parts.iter().take_while(|part| is_word(part)).count();
    let (base, parts) = parts.split_at(n_words.max(1));
    let digits = base[base.len() - 1].chars().rev().take_while(char::is_ascii_digit).count();
    let base = base.join("\\ ");
    let (base, number) = base.split_at(base.len() - digits);
    let index: Vec<&str> = std::iter::once(number).filter(|n| !n.is_empty()).chain(parts.iter().copied()).collect();
    let mut written: Vec<String> = Vec::new();
    for group in index.chunk_by(|a, b| is_word(a) && is_word(b)) {
        written.push(word(&group.join("\\ ")));
    }
    if written.is_empty() { word(base) } else { format!("{}_{{{}}}", word(base), written.join(", ")) }
}

/// Whether a part of a name is a word: not a letter, a Greek letter's name or one of these with a number.
fn is_word(part: &str) -> bool {
    let letters = part.trim_end_matches(|c: char| c.is_ascii_digit());
    letters == part && letters.chars().count() > 1 && !GREEK.contains(&letters)
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
            let latex = Latex { full_digits: false };
            assert_eq!(latex.at(&Expression::parse(source).unwrap(), 1).unwrap(), wanted, "{source}");
        }
    }

    #[test]
    fn names_get_their_subscripts() {
        for (source, wanted) in [
            ("omega_1", "\\omega_{1}"),
            ("tau_max", "\\tau_{\\mathrm{max}}"),
            ("coulomb_friction_c", "\\mathrm{coulomb\\ friction}_{c}"),
            ("q_wrist_roll", "q_{\\mathrm{wrist\\ roll}}"),
            ("wrist_roll", "\\mathrm{wrist\\ roll}"),
            ("x1_dot", "x_{1, \\mathrm{dot}}"),
            ("wheel2", "\\mathrm{wheel}_{2}"),
            ("theta1", "\\theta_{1}"),
            ("_x", "\\mathrm{\\_x}"),
        ] {
            assert_eq!(name(source), wanted, "{source}");
        }
    }

    #[test]
    fn units_are_upright_and_cannot_give_a_command() {
        for (source, wanted) in [
            ("m/s^2", "m/s^{2}"),
            ("N*s/m^-1", "N\\,s/m^{-1}"),
            ("%", "\\%"),
            ("\u{b0}C", "{}^{\\circ}C"),
            ("m^^5cinput{x}", "m\\wedge ^{5}cinput\\{x\\}"),
            ("\\input{/etc/passwd}", "\\backslash input\\{/etc/passwd\\}"),
        ] {
            assert_eq!(unit(source), wanted, "{source}");
        }
    }

    #[test]
    fn numbers_have_six_digits_or_all() {
        let write = |value, full_digits| Latex { full_digits }.number(value);
        assert_eq!(write(0.123_456_789, false), "0.123457");
        assert_eq!(write(0.123_456_789, true), "0.123456789");
        assert_eq!(write(1_234_567.89, false), "1.23457 \\times 10^{6}");
        assert_eq!(write(-9.81, false), "-9.81");
    }
}
