//! One candidate term and its name.

use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Operator};

/// A term: an expression whose factors are in the order of the variables, named by how it prints.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    expression: Expression,
    name: String,
}

impl Term {
    /// The product of variables (indices, repeated for powers) and of a sine or cosine of one.
    pub(super) fn product(variables: &[String], factors: &[usize], wave: Option<(Function, usize)>) -> Self {
        let mut product = Expression::Number(1.0);
        for (j, name) in variables.iter().enumerate() {
            let count = factors.iter().filter(|&&f| f == j).count();
            if count > 0 {
                let power = Expression::variable(name).power(Expression::Number(count as f64));
                product = product.times(power);
            }
        }
        if let Some((function, j)) = wave {
            product = product.times(Expression::variable(&variables[j]).apply(function));
        }
        Self::of(product)
    }

    /// Reads a term of `variables`; plain products are put into the usual order, so `x2*x1` is `x1*x2`.
    ///
    /// # Errors
    /// Text that can't be read, a name that is no variable, or `delay`, `play`, `sample_hold`, `stick` and `breakaway`.
    pub fn parse(text: &str, variables: &[String]) -> Result<Self> {
        let expression = Expression::parse(text)?;
        if let Some(name) = expression.variables().iter().find(|name| !variables.contains(name)) {
            return Err(Error::unknown(&format!("in term `{text}` the name"), name, variables));
        }
        let mut with_memory = false;
        expression.visit(&mut |part| {
            with_memory |=
                matches!(part, Expression::Call(function, _) if function.has_memory() || function.may_hold());
        });
        if with_memory {
            return Err(Error::settings(format!(
                "term `{text}`: `delay`, `play`, `sample_hold`, `stick` and `breakaway` can't stand in a term; give the control a delay instead, or write tanh"
            )));
        }
        Ok(Self::of(canonical(&expression, variables)))
    }

    fn of(expression: Expression) -> Self {
        let name = expression.to_string();
        Self { expression, name }
    }

    /// The term as an expression of the variables.
    pub fn expression(&self) -> &Expression {
        &self.expression
    }

    /// How much is in it: variables with their whole powers, and functions; 1 for the constant.
    ///
    /// `x` 1, `x^2` and `x*v` and `sin(x)` 2, `v*sin(x)` 3.
    pub fn complexity(&self) -> usize {
        weight(&self.expression).max(1)
    }

    /// The name, which reads back as the term.
    pub fn name(&self) -> &str {
        &self.name
    }
}

fn weight(expression: &Expression) -> usize {
    match expression {
        Expression::Number(_) | Expression::Pi => 0,
        Expression::Time | Expression::Variable(_) => 1,
        Expression::Negate(inner) => weight(inner),
        Expression::Binary(Operator::Power, base, exponent) => match **exponent {
            Expression::Number(n) if n.fract() == 0.0 => weight(base) * (n.abs().clamp(1.0, 100.0) as usize),
            _ => 1 + weight(base) + weight(exponent),
        },
        Expression::Binary(_, a, b) => weight(a) + weight(b),
        Expression::Call(_, arguments) | Expression::Simulator(_, arguments) => {
            1 + arguments.iter().map(weight).sum::<usize>()
        }
    }
}

/// Factors of a product with their whole powers, a plain number apart.
fn collect(expression: &Expression, power: f64, factors: &mut Vec<(Expression, f64)>) {
    match expression {
        Expression::Binary(Operator::Multiply, a, b) => {
            collect(a, power, factors);
            collect(b, power, factors);
        }
        Expression::Binary(Operator::Power, base, exponent) => match **exponent {
            Expression::Number(n) if n.fract() == 0.0 && n > 0.0 => collect(base, power * n, factors),
            _ => push(factors, expression, power),
        },
        _ => push(factors, expression, power),
    }
}

fn push(factors: &mut Vec<(Expression, f64)>, base: &Expression, power: f64) {
    match factors.iter_mut().find(|(other, _)| other == base) {
        Some((_, total)) => *total += power,
        None => factors.push((base.clone(), power)),
    }
}

/// The same product with equal factors joined: numbers, variables in their order, then the rest as it was.
fn canonical(expression: &Expression, variables: &[String]) -> Expression {
    let mut factors = Vec::new();
    collect(expression, 1.0, &mut factors);
    let place = |factor: &Expression| match factor {
        Expression::Number(_) | Expression::Pi => 0,
        Expression::Variable(name) => 1 + variables.iter().position(|v| v == name).unwrap_or(0),
        _ => 1 + variables.len(),
    };
    factors.sort_by_key(|(factor, _)| place(factor));
    let powers = factors.into_iter().map(|(base, power)| base.power(Expression::Number(power)));
    powers.fold(Expression::Number(1.0), Expression::times)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> String {
        Term::parse(text, &["x".into(), "v".into(), "u".into()]).unwrap().name().into()
    }

    #[test]
    fn products_are_named_in_the_order_of_the_variables() {
        let table = [
            ("v*x", "x*v"),
            ("u*v*x*v", "x*v^2*u"),
            ("(x*v)^2", "x^2*v^2"),
            ("x*x^2", "x^3"),
            ("sin(x)*v", "v*sin(x)"),
            ("1", "1"),
            ("x*abs(v)", "x*abs(v)"),
            ("v^-1", "v^(-1)"),
            ("x + v", "x + v"),
            ("cos(x)^2*u", "u*cos(x)^2"),
        ];
        for (text, expected) in table {
            assert_eq!(name(text), expected, "{text}");
            assert_eq!(name(expected), expected);
        }
    }

    #[test]
    fn complexity_counts_variables_and_functions() {
        let table = [("1", 1), ("x", 1), ("x^3", 3), ("x*v", 2), ("sin(x)", 2), ("x*v*sin(u)", 4), ("abs(x)^2", 4)];
        for (text, expected) in table {
            let term = Term::parse(text, &["x".into(), "v".into(), "u".into()]).unwrap();
            assert_eq!(term.complexity(), expected, "{text}");
        }
    }

    #[test]
    fn unknown_names_and_memories_are_refused() {
        let variables = ["x".to_string()];
        assert!(Term::parse("x*k", &variables).unwrap_err().to_string().contains("`k`"));
        assert!(Term::parse("delay(x, 0.1)", &variables).unwrap_err().to_string().contains("delay"));
        assert!(Term::parse("x*", &variables).is_err());
    }
}
