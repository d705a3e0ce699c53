//! Prints expressions so that they read back as themselves, with as few parentheses as that needs.

use super::{Expression, Operator};
use std::fmt;

impl Operator {
    fn symbol(self) -> &'static str {
        match self {
            Self::Add => " + ",
            Self::Subtract => " - ",
            Self::Multiply => "*",
            Self::Divide => "/",
            Self::Power => "^",
        }
    }
}

/// How tightly the outermost operation binds: sums 1, products 3, a leading sign 2, powers 5, the rest 9.
fn binding(expression: &Expression) -> u8 {
    match expression {
        Expression::Binary(Operator::Add | Operator::Subtract, ..) => 1,
        Expression::Negate(_) => 2,
        Expression::Number(value) if *value < 0.0 || (*value == 0.0 && value.is_sign_negative()) => 2,
        Expression::Binary(Operator::Multiply | Operator::Divide, ..) => 3,
        Expression::Binary(Operator::Power, ..) => 5,
        _ => 9,
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => write_number(f, *value),
            Self::Pi => f.write_str("pi"),
            Self::Time => f.write_str("t"),
            Self::Variable(name) => f.write_str(name),
            Self::Negate(inner) => {
                f.write_str("-")?;
                write_at(f, inner, 3)
            }
            Self::Binary(operator, left, right) => {
                let (for_left, for_right) = match operator {
                    Operator::Add => (1, 2),
                    Operator::Subtract => (1, 3),
                    Operator::Multiply => (2, 4),
                    Operator::Divide => (2, 4),
                    Operator::Power => (6, 5),
                };
                // A sign may lead a product, but not be inside it.
                write_at(f, left, for_left)?;
                f.write_str(operator.symbol())?;
                write_at(f, right, for_right)
            }
            Self::Call(function, arguments) => write_call(f, function.name(), arguments),
            Self::Simulator(output, arguments) => write_call(f, &format!("simulator_{}", output + 1), arguments),
        }
    }
}

fn write_at(f: &mut fmt::Formatter<'_>, expression: &Expression, needed: u8) -> fmt::Result {
    if binding(expression) >= needed { write!(f, "{expression}") } else { write!(f, "({expression})") }
}

fn write_call(f: &mut fmt::Formatter<'_>, name: &str, arguments: &[Expression]) -> fmt::Result {
    write!(f, "{name}(")?;
    for (i, argument) in arguments.iter().enumerate() {
        if i > 0 {
            f.write_str(", ")?;
        }
        write!(f, "{argument}")?;
    }
    f.write_str(")")
}

/// The shortest text that reads back to the same number; powers of ten only where they shorten it.
fn write_number(f: &mut fmt::Formatter<'_>, value: f64) -> fmt::Result {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e15).contains(&size) { write!(f, "{value:e}") } else { write!(f, "{value}") }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Expression {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Expression {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Self::parse(&text).map_err(serde::de::Error::custom)
    }
}
