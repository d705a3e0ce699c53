//! The operations of a tape, on several lanes at once.

use crate::expression::vectors::vectors;
use crate::expression::{Function, Operator, elementary};
use pulp::Simd;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Operation {
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Square,
    Cube,
    /// `a*b + c`, `a*b - c` and `c - a*b`, each rounded twice.
    MultiplyAdd,
    MultiplySubtract,
    SubtractProduct,
    // The only one with a part of its own: one byte then says which of all operations it is.
    Call(Function),
}

impl From<Operator> for Operation {
    fn from(operator: Operator) -> Self {
        match operator {
            Operator::Add => Self::Add,
            Operator::Subtract => Self::Subtract,
            Operator::Multiply => Self::Multiply,
            Operator::Divide => Self::Divide,
            Operator::Power => Self::Power,
        }
    }
}

impl Operation {
    /// The operation lane by lane, in vectors where the processor has them for it; an operand is looked up where it is read.
    #[inline(always)]
    pub(super) fn compute<'o, S: Simd, const L: usize>(
        self,
        simd: S,
        operand: impl Fn(usize) -> &'o [f64; L],
        out: &mut [f64; L],
    ) {
        let one = || [operand(0); 3];
        let two = || [operand(0), operand(1), operand(0)];
        let three = || [operand(0), operand(1), operand(2)];
        match self {
            Self::Negate => vectors::<S, L>(one(), out, |a, _, _| simd.neg_f64s(a), |a, _, _| -a),
            Self::Square => vectors::<S, L>(one(), out, |a, _, _| simd.mul_f64s(a, a), |a, _, _| a * a),
            Self::Cube => {
                vectors::<S, L>(one(), out, |a, _, _| simd.mul_f64s(simd.mul_f64s(a, a), a), |a, _, _| a * a * a);
            }
            Self::Add => vectors::<S, L>(two(), out, |a, b, _| simd.add_f64s(a, b), |a, b, _| a + b),
            Self::Subtract => vectors::<S, L>(two(), out, |a, b, _| simd.sub_f64s(a, b), |a, b, _| a - b),
            Self::Multiply => vectors::<S, L>(two(), out, |a, b, _| simd.mul_f64s(a, b), |a, b, _| a * b),
            Self::Divide => vectors::<S, L>(two(), out, |a, b, _| simd.div_f64s(a, b), |a, b, _| a / b),
            Self::MultiplyAdd => {
                let vector = |a, b, c| simd.add_f64s(simd.mul_f64s(a, b), c);
                vectors::<S, L>(three(), out, vector, |a, b, c| a * b + c);
            }
            Self::MultiplySubtract => {
                let vector = |a, b, c| simd.sub_f64s(simd.mul_f64s(a, b), c);
                vectors::<S, L>(three(), out, vector, |a, b, c| a * b - c);
            }
            Self::SubtractProduct => {
                let vector = |a, b, c| simd.sub_f64s(c, simd.mul_f64s(a, b));
                vectors::<S, L>(three(), out, vector, |a, b, c| c - a * b);
            }
            Self::Call(Function::Sin) => elementary::sin(operand(0), out),
            Self::Call(Function::Cos) => elementary::cos(operand(0), out),
            Self::Call(Function::Tanh) => elementary::tanh(operand(0), out),
            Self::Call(Function::Stick) => {
                let (a, b) = (operand(0), operand(1));
                let mut ratio = [0.0; L];
                vectors::<S, L>(two(), &mut ratio, |a, b, _| simd.div_f64s(a, b), |a, b, _| a / b);
                elementary::tanh(&ratio, out);
                for lane in 0..L {
                    if b[lane] == 0.0 {
                        out[lane] = sign(a[lane]);
                    }
                }
            }
            Self::Call(Function::Exp) => elementary::exp(operand(0), out),
            Self::Call(Function::Sqrt) => vectors::<S, L>(one(), out, |a, _, _| simd.sqrt_f64s(a), |a, _, _| a.sqrt()),
            Self::Call(Function::Abs) => vectors::<S, L>(one(), out, |a, _, _| simd.abs_f64s(a), |a, _, _| a.abs()),
            other => single(other, three(), out),
        }
    }
}

/// The operations for which there is no vector instruction.
fn single<const L: usize>(operation: Operation, [a, b, c]: [&[f64; L]; 3], out: &mut [f64; L]) {
    let one = |f: fn(f64) -> f64| std::array::from_fn(|i| f(a[i]));
    *out = match operation {
        Operation::Power => std::array::from_fn(|i| a[i].powf(b[i])),
        Operation::Call(function) => match function {
            Function::Tan => one(f64::tan),
            Function::Asin => one(f64::asin),
            Function::Acos => one(f64::acos),
            Function::Atan => one(f64::atan),
            Function::Atan2 => std::array::from_fn(|i| a[i].atan2(b[i])),
            Function::Sinh => one(f64::sinh),
            Function::Cosh => one(f64::cosh),
            Function::Log => one(f64::ln),
            Function::Sign | Function::Breakaway => one(sign),
            Function::Min => std::array::from_fn(|i| a[i].min(b[i])),
            Function::Max => std::array::from_fn(|i| a[i].max(b[i])),
            Function::Step => one(|z| f64::from(z > 0.0)),
            Function::Clamp => std::array::from_fn(|i| a[i].max(b[i]).min(c[i])),
            Function::DeadZone => std::array::from_fn(|i| a[i] - a[i].max(-b[i]).min(b[i])),
            _ => [f64::NAN; L],
        },
        _ => [f64::NAN; L],
    };
}

/// -1, 0 or 1; `f64::signum` has no zero.
fn sign(z: f64) -> f64 {
    if z > 0.0 {
        1.0
    } else if z < 0.0 {
        -1.0
    } else {
        z
    }
}
