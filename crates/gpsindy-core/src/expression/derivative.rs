//! Exact partial derivatives of expressions.

use super::{Expression, Function, Operator};
use crate::error::{Error, Result};

pub(super) fn derivative(expression: &Expression, name: &str) -> Result<Expression> {
    use Expression as E;
    if !expression.contains(name) {
        return Ok(E::Number(0.0));
    }
    Ok(match expression {
        E::Number(_) | E::Pi | E::Time => E::Number(0.0),
        E::Variable(_) => E::Number(1.0),
        E::Negate(a) => derivative(a, name)?.negated(),
        E::Binary(operator, a, b) => binary(*operator, a, b, name)?,
        E::Call(function, arguments) => call(*function, arguments, name)?,
        E::Simulator(..) => {
            return Err(Error::invalid(format!("the user's own simulator has no exact derivative by `{name}`")));
        }
    })
}

fn binary(operator: Operator, a: &Expression, b: &Expression, name: &str) -> Result<Expression> {
    let (da, db) = (derivative(a, name)?, derivative(b, name)?);
    let (a, b) = (a.clone(), b.clone());
    Ok(match operator {
        Operator::Add => da.plus(db),
        Operator::Subtract => da.minus(db),
        Operator::Multiply => da.times(b.clone()).plus(a.times(db)),
        Operator::Divide => {
            let second = a.times(db).over(b.clone().power(Expression::Number(2.0)));
            da.over(b).minus(second)
        }
        Operator::Power if !b.contains(name) => {
            let lowered = match &b {
                Expression::Number(n) => Expression::Number(n - 1.0),
                other => other.clone().minus(Expression::Number(1.0)),
            };
            b.times(a.power(lowered)).times(da)
        }
        Operator::Power => {
            let value = a.clone().power(b.clone());
            let growth = db.times(a.clone().apply(Function::Log)).plus(b.times(da).over(a));
            value.times(growth)
        }
    })
}

fn call(function: Function, arguments: &[Expression], name: &str) -> Result<Expression> {
    use Function as F;
    let number = Expression::Number;
    let a = arguments[0].clone();
    let da = derivative(&a, name)?;
    let one_argument = |slope: Expression| slope.times(da.clone());
    Ok(match function {
        F::Sin => one_argument(a.apply(F::Cos)),
        F::Cos => one_argument(a.apply(F::Sin).negated()),
        F::Tan => one_argument(number(1.0).plus(a.apply(F::Tan).power(number(2.0)))),
        F::Asin => da.over(number(1.0).minus(a.power(number(2.0))).apply(F::Sqrt)),
        F::Acos => da.over(number(1.0).minus(a.power(number(2.0))).apply(F::Sqrt)).negated(),
        F::Atan => da.over(number(1.0).plus(a.power(number(2.0)))),
        F::Atan2 => {
            let b = arguments[1].clone();
            let db = derivative(&b, name)?;
            let square = a.clone().power(number(2.0)).plus(b.clone().power(number(2.0)));
            b.times(da).minus(a.times(db)).over(square)
        }
        F::Sinh => one_argument(a.apply(F::Cosh)),
        F::Cosh => one_argument(a.apply(F::Sinh)),
        F::Tanh => one_argument(number(1.0).minus(a.apply(F::Tanh).power(number(2.0)))),
        F::Exp => one_argument(a.apply(F::Exp)),
        F::Log => da.over(a),
        F::Sqrt => da.over(number(2.0).times(a.apply(F::Sqrt))),
        F::Abs => one_argument(a.apply(F::Sign)),
        F::Sign | F::Step => number(0.0),
        F::Min | F::Max => {
            let b = arguments[1].clone();
            let db = derivative(&b, name)?;
            let first_counts = if function == F::Min { b.minus(a) } else { a.minus(b) };
            let weight = first_counts.apply(F::Step);
            weight.clone().times(da).plus(number(1.0).minus(weight).times(db))
        }
        F::Clamp => {
            let (lo, hi) = (arguments[1].clone(), arguments[2].clone());
            let (dlo, dhi) = (derivative(&lo, name)?, derivative(&hi, name)?);
            let below = lo.minus(a.clone()).apply(F::Step);
            let above = a.minus(hi).apply(F::Step);
            let inside = number(1.0).minus(below.clone()).minus(above.clone());
            inside.times(da).plus(below.times(dlo)).plus(above.times(dhi))
        }
        F::DeadZone => {
            let width = arguments[1].clone();
            let dwidth = derivative(&width, name)?;
            let outside = a.clone().apply(F::Abs).minus(width).apply(F::Step);
            outside.times(da.minus(a.apply(F::Sign).times(dwidth)))
        }
        F::Delay | F::Play => {
            return Err(Error::invalid(format!("`{}` has no pointwise derivative by `{name}`", function.name())));
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Expression, Tape};

    fn value(expression: &Expression, x: f64) -> f64 {
        let tape = Tape::new(std::slice::from_ref(expression), &["x".into(), "y".into()]).unwrap();
        tape.evaluate_once(&[x, 0.7], 0.4)[0]
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        let sources = [
            "sin(x)*cos(2*x)",
            "tan(x)",
            "asin(x/2)",
            "acos(x/2)",
            "atan(3*x)",
            "atan2(x, y)",
            "atan2(y, x)",
            "sinh(x)",
            "cosh(x)",
            "tanh(x/y)",
            "exp(-x^2)",
            "log(x + 2)",
            "sqrt(x + 1)",
            "abs(x - 0.5)",
            "min(x, y)",
            "max(x^2, y)",
            "clamp(2*x, -1, y*x)",
            "dead_zone(x, 0.2*x)",
            "x^3 - 2/x",
            "(x + 2)^(x*y)",
            "y^x",
            "-x*t",
            "sign(x)*x",
        ];
        for source in sources {
            let expression = Expression::parse(source).unwrap();
            let exact = expression.derivative("x").unwrap();
            for x in [0.31, 0.9, 1.1] {
                let h = 1e-5;
                let difference = (value(&expression, x + h) - value(&expression, x - h)) / (2.0 * h);
                let found = value(&exact, x);
                // Truncation h^2 f'''/6 and rounding eps/h are both below 1e-8 for these functions.
                assert!(
                    (found - difference).abs() < 1e-7 * (1.0 + found.abs()),
                    "{source} at {x}: {found} {difference}, {exact}"
                );
            }
        }
    }

    #[test]
    fn a_delayed_control_has_no_derivative_by_itself() {
        let delayed = Expression::parse("delay(u, 0.1)").unwrap();
        assert!(delayed.derivative("u").is_err());
        assert_eq!(delayed.derivative("x").unwrap(), Expression::Number(0.0));
    }
}
