//! How a language writes an expression: its functions, its power, its names.

use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Operator};

/// The parts in which languages differ.
pub(super) struct Dialect<'a> {
    /// A variable by the model's name.
    pub(super) name: &'a dyn Fn(&str) -> String,
    /// A function call with arguments that are already written.
    pub(super) call: fn(Function, &[String]) -> String,
    /// A power with both operands in a form that binds tightest.
    pub(super) power: fn(&str, &str) -> String,
    /// A number.
    pub(super) number: fn(f64) -> String,
    /// The circle constant.
    pub(super) pi: &'static str,
    /// The time.
    pub(super) time: &'static str,
}

/// How tightly a written piece binds: sums 1, a leading sign 2, products 3, all else 9.
type Piece = (String, u8);

impl Dialect<'_> {
    /// The expression as source.
    pub(super) fn write(&self, expression: &Expression) -> Result<String> {
        Ok(self.piece(expression)?.0)
    }

    fn at(&self, expression: &Expression, needed: u8) -> Result<String> {
        let (text, binding) = self.piece(expression)?;
        Ok(if binding >= needed { text } else { format!("({text})") })
    }

    /// A sign may lead a product, but not be inside it.
    fn product(&self, a: &Expression, sign: &str, b: &Expression) -> Result<Piece> {
        let left = self.at(a, 2)?;
        let binding = if left.starts_with('-') { 2 } else { 3 };
        Ok((format!("{left}{sign}{}", self.at(b, 4)?), binding))
    }

    fn piece(&self, expression: &Expression) -> Result<Piece> {
        Ok(match expression {
            Expression::Number(value) => ((self.number)(*value), if value.is_sign_negative() { 2 } else { 9 }),
            Expression::Pi => (self.pi.into(), 9),
            Expression::Time => (self.time.into(), 9),
            Expression::Variable(name) => ((self.name)(name), 9),
            Expression::Negate(a) => (format!("-{}", self.at(a, 4)?), 2),
            Expression::Binary(Operator::Add, a, b) => (format!("{} + {}", self.at(a, 1)?, self.at(b, 3)?), 1),
            Expression::Binary(Operator::Subtract, a, b) => (format!("{} - {}", self.at(a, 1)?, self.at(b, 3)?), 1),
            Expression::Binary(Operator::Multiply, a, b) => self.product(a, "*", b)?,
            Expression::Binary(Operator::Divide, a, b) => self.product(a, "/", b)?,
            Expression::Binary(Operator::Power, a, b) => ((self.power)(&self.at(a, 9)?, &self.at(b, 9)?), 4),
            Expression::Call(function, arguments) => {
                let written = arguments.iter().map(|a| self.write(a)).collect::<Result<Vec<_>>>()?;
                ((self.call)(*function, &written), 9)
            }
            Expression::Simulator(..) => return Err(no_equations()),
        })
    }
}

pub(super) fn no_equations() -> Error {
    Error::NotExportable {
        what: "the model".into(),
        why: "it calls the user's own simulator, which has no equations".into(),
    }
}

/// A number that reads back as itself and is a floating-point number in every language.
pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}
