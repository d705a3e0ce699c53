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
        // What cancels has no slope, also where the chain rule would meet 0/0.
        E::Binary(Operator::Subtract | Operator::Divide, a, b) if a == b => E::Number(0.0),
        E::Binary(operator, a, b) => binary(*operator, a, b, name)?,
        E::Call(function, arguments) => call(*function, arguments, name)?,
        E::Simulator(..) => {
            return Err(Error::model(format!("the user's own simulator has no exact derivative by `{name}`")));
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
            let below = lo.clone().minus(a.clone()).apply(F::Step);
            if in_order(&lo, &hi) {
                let above = a.minus(hi).apply(F::Step);
                let inside = number(1.0).minus(below.clone()).minus(above.clone());
                return Ok(inside.times(da).plus(below.times(dlo)).plus(above.times(dhi)));
            }
            // `min(max(z, lo), hi)`: where the bounds have changed places the upper one counts.
            let above = Expression::Call(F::Max, vec![a, lo]).minus(hi).apply(F::Step);
            let raised = number(1.0).minus(below.clone()).times(da).plus(below.times(dlo));
            number(1.0).minus(above.clone()).times(raised).plus(above.times(dhi))
        }
        F::DeadZone => {
            let width = arguments[1].clone();
            let dwidth = derivative(&width, name)?;
            if dwidth != number(0.0) {
                let taken = Expression::Call(F::Clamp, vec![a, width.clone().negated(), width]);
                return Ok(da.minus(derivative(&taken, name)?));
            }
            let outside = a.apply(F::Abs).minus(width).apply(F::Step);
            outside.times(da)
        }
        F::Stick => {
            let w = arguments[1].clone();
            let dw = derivative(&w, name)?;
            let value = Expression::Call(function, arguments.to_vec());
            let slope = number(1.0).minus(value.power(number(2.0)));
            if w == number(0.0) {
                return Ok(number(0.0));
            }
            // Without a corner it is flat; any width will do there.
            let corner = w.clone().plus(number(1.0).minus(w.clone().apply(F::Sign).power(number(2.0))));
            slope.times(da.over(corner.clone()).minus(a.times(dw).over(corner.power(number(2.0)))))
        }
        F::Breakaway => number(0.0),
        F::Delay | F::Play | F::Slew | F::SampleHold => {
            return Err(Error::model(format!("`{}` has no pointwise derivative by `{name}`", function.name())));
        }
    })
}

/// Whether both are numbers and the first is not above the second.
fn in_order(lo: &Expression, hi: &Expression) -> bool {
    let number = |e: &Expression| match e {
        Expression::Number(n) => Some(*n),
        Expression::Negate(a) => match **a {
            Expression::Number(n) => Some(-n),
            _ => None,
        },
        _ => None,
    };
    matches!((number(lo), number(hi)), (Some(lo), Some(hi)) if lo <= hi)
}

#[cfg(test)]
mod tests {
    use super::super::{Expression, Function, Operator, Tape};
    use rand_chacha::ChaCha8Rng;
    use rand_core::{Rng, SeedableRng};

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

    /// A random expression of x, y and the time, up to `depth` operations deep.
    fn random(rng: &mut ChaCha8Rng, depth: usize) -> Expression {
        let pick = |rng: &mut ChaCha8Rng, n: usize| rng.next_u32() as usize % n;
        if depth == 0 || pick(rng, 6) == 0 {
            return match pick(rng, 8) {
                0 => Expression::Pi,
                1 => Expression::Time,
                2 | 3 => Expression::Number(f64::from(rng.next_u32() % 9) - 4.0),
                4 => Expression::variable("y"),
                _ => Expression::variable("x"),
            };
        }
        let a = random(rng, depth - 1);
        match pick(rng, 4) {
            0 => Expression::Negate(a.into()),
            1 | 2 => {
                let operators =
                    [Operator::Add, Operator::Subtract, Operator::Multiply, Operator::Divide, Operator::Power];
                let b = if pick(rng, 8) == 0 { a.clone() } else { random(rng, depth - 1) };
                Expression::Binary(operators[pick(rng, 5)], a.into(), b.into())
            }
            _ => {
                let pointwise: Vec<Function> = Function::ALL.iter().copied().filter(|f| !f.has_memory()).collect();
                let function = pointwise[pick(rng, pointwise.len())];
                let others = (1..function.arity()).map(|_| random(rng, depth - 1));
                let arguments = std::iter::once(a.clone()).chain(others).collect();
                Expression::Call(function, arguments)
            }
        }
    }

    #[test]
    fn derivatives_of_random_expressions_agree_with_differences_where_both_are_numbers() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let (mut compared, mut silent, mut wrong) = (0, 0, Vec::new());
        for _ in 0..4000 {
            let expression = random(&mut rng, 4);
            let exact = expression.derivative("x").unwrap();
            let mut parts = Vec::new();
            expression.visit(&mut |part| parts.push(part.clone()));
            for x in [-1.7, 0.31, 0.9, 2.3] {
                // Differences of two widths that agree, and values that do not: there the function is smooth enough to judge.
                let difference = |h: f64| (value(&expression, x + h) - value(&expression, x - h)) / (2.0 * h);
                let (wide, narrow) = (difference(2e-5), difference(1e-5));
                let smooth = (wide - narrow).abs() < 1e-6 * (1.0 + narrow.abs()) && narrow.abs() < 1e3;
                // `min` and `max` leave out what is not a number; large parts that cancel leave their rounding.
                if !smooth || !parts.iter().all(|part| value(part, x).abs() < 1e3) {
                    continue;
                }
                let found = value(&exact, x);
                if found.is_nan() {
                    silent += 1;
                    continue;
                }
                compared += 1;
                // Truncation is about the difference of the widths, rounding 1e-16 * 1e3/1e-5.
                let error = (found - narrow).abs();
                if !(error < 1e-5 * (1.0 + narrow.abs())) {
                    wrong.push(format!("{expression} at {x}: {found} {narrow}, {exact}"));
                }
            }
        }
        assert!(wrong.is_empty(), "{} of {compared}:\n{}", wrong.len(), wrong.join("\n"));
        assert!(compared > 8000 && silent * 100 < compared, "{compared} compared, {silent} not a number");
    }

    #[test]
    fn bounds_that_have_changed_places_have_the_slope_of_the_upper_one() {
        let slope = |source: &str, x: f64| value(&Expression::parse(source).unwrap().derivative("x").unwrap(), x);
        assert_eq!(slope("clamp(3, 5*x, 1)", 0.9), 0.0);
        assert_eq!(slope("clamp(3, 5*x, 2*x)", 0.9), 2.0);
        assert_eq!(slope("clamp(x, -1, 1)", 0.9), 1.0);
        // z - min(max(z, -w), w) is z - w for a width below zero.
        assert_eq!(slope("dead_zone(-2, -x)", 0.9), 1.0);
        assert_eq!(slope("dead_zone(x, 0.2*x)", 0.9), 0.8);
    }

    #[test]
    fn what_cancels_has_no_slope_and_zero_times_infinity_is_no_number() {
        let slope = |source: &str, x: f64| value(&Expression::parse(source).unwrap().derivative("x").unwrap(), x);
        assert_eq!(slope("acos(x/x)", 0.7), 0.0);
        assert_eq!(slope("sqrt(x*y - x*y)", 0.7), 0.0);
        // A corner, where there is no slope.
        assert!(slope("sqrt(x^2)", 0.0).is_nan());
    }
}
