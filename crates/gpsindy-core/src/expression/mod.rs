//! The expression language of models, terms and effects: parse, print, differentiate, evaluate.
//!
//! The grammar is that of the model file: `+ - * / ^`, parentheses, numbers, `pi`, the time `t`,
//! names, and the functions of [`Function`].

mod derivative;
pub(crate) mod elementary;
mod parse;
mod print;
mod tape;
pub(crate) mod vectors;

pub use tape::Tape;

use crate::error::Result;

/// An arithmetic operator of two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Operator {
    /// `a + b`
    Add,
    /// `a - b`
    Subtract,
    /// `a * b`
    Multiply,
    /// `a / b`
    Divide,
    /// `a ^ b`, right associative, binds tighter than a minus sign before it
    Power,
}

macro_rules! functions {
    ($($variant:ident $name:literal $arity:literal $doc:literal),+ $(,)?) => {
        /// A function of the expression language.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Function { $(#[doc = $doc] $variant),+ }

        impl Function {
            /// Every function there is.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The name in expressions.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }

            /// How many arguments it takes.
            pub fn arity(self) -> usize {
                match self { $(Self::$variant => $arity),+ }
            }
        }
    };
}

functions! {
    Sin "sin" 1 "Sine, argument in rad.",
    Cos "cos" 1 "Cosine, argument in rad.",
    Tan "tan" 1 "Tangent, argument in rad.",
    Asin "asin" 1 "Inverse sine, rad.",
    Acos "acos" 1 "Inverse cosine, rad.",
    Atan "atan" 1 "Inverse tangent, rad.",
    Atan2 "atan2" 2 "Angle of the point (second, first argument), rad.",
    Sinh "sinh" 1 "Hyperbolic sine.",
    Cosh "cosh" 1 "Hyperbolic cosine.",
    Tanh "tanh" 1 "Hyperbolic tangent.",
    Exp "exp" 1 "Exponential.",
    Log "log" 1 "Natural logarithm.",
    Sqrt "sqrt" 1 "Square root.",
    Abs "abs" 1 "Absolute value.",
    Sign "sign" 1 "-1, 0 or 1.",
    Min "min" 2 "The smaller of two values.",
    Max "max" 2 "The larger of two values.",
    Step "step" 1 "1 above zero, else 0.",
    Clamp "clamp" 3 "`clamp(z, lo, hi)`: z kept between lo and hi.",
    DeadZone "dead_zone" 2 "`dead_zone(z, width)`: 0 inside +-width, else z shifted toward 0 by width.",
    Delay "delay" 2 "`delay(control, tau)`: the control tau seconds earlier.",
    Play "play" 2 "`play(control, width)`: the control through a play of that total width.",
    Slew "slew" 2 "`slew(control, rate)`: the control, followed no faster than that rate per second; at first it is where the control is.",
    SampleHold "sample_hold" 3 "`sample_hold(control, period, phase)`: the control as it was when last sampled: at the time `phase`, s, and every `period` seconds before and after.",
    Stick "stick" 2 "`stick(state, w)`: the state's direction of motion, `tanh(state/w)`; with w = 0 a sign that holds it at rest while its rate allows.",
    Breakaway "breakaway" 2 "`breakaway(state, r)`: `stick(state, 0)` that holds up to r times what it has in motion.",
}

impl Function {
    /// Whether its value depends on what its first argument was before.
    pub fn has_memory(self) -> bool {
        matches!(self, Self::Delay | Self::Play | Self::Slew | Self::SampleHold)
    }

    /// Whether it may hold its state at rest.
    pub fn may_hold(self) -> bool {
        matches!(self, Self::Stick | Self::Breakaway)
    }
}

/// A parsed expression.
///
/// ```
/// use gpsindy_core::Expression;
/// let force = Expression::parse("-k*x - 0.3*v")?;
/// assert_eq!(force.to_string(), "-k*x - 0.3*v");
/// assert_eq!(force.derivative("x")?.to_string(), "-k");
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum Expression {
    /// A number.
    Number(f64),
    /// `pi`
    Pi,
    /// The time `t`, s.
    Time,
    /// A state, control or parameter by name.
    Variable(String),
    /// `-a`
    Negate(Box<Expression>),
    /// Two operands and what joins them.
    Binary(Operator, Box<Expression>, Box<Expression>),
    /// A function of the language and its arguments.
    Call(Function, Vec<Expression>),
    /// One output of the user's own simulator, called with these arguments (states, then controls).
    /// It has no text form that can be read back.
    Simulator(usize, Vec<Expression>),
}

impl Expression {
    /// Reads an expression.
    ///
    /// # Errors
    /// [`crate::Error::Parse`] with the place and what was expected there.
    pub fn parse(text: &str) -> Result<Self> {
        parse::parse(text)
    }

    /// A name as an expression.
    pub fn variable(name: impl Into<String>) -> Self {
        Self::Variable(name.into())
    }

    /// The partial derivative by the variable `name`, simplified.
    ///
    /// Where the function has a corner (`abs`, `min`, `clamp`, ...) a one-sided derivative is
    /// returned; `sign` and `step` count as flat.
    ///
    /// It is not a number where the chain rule meets 0 times infinity: where a function of infinite slope (`sqrt` and powers below
    /// 1 at 0, `asin` and `acos` at -1 and 1, `log` at 0) sees an argument that does not change there, as in `sqrt(x^2)` at 0 and
    /// `acos(cos(x))` at 0. What is the same on both sides of `-` or `/` is known to cancel, so `acos(v/v)` has slope 0.
    ///
    /// # Errors
    /// When `name` appears inside `delay`, `play` or the user's own simulator.
    pub fn derivative(&self, name: &str) -> Result<Self> {
        derivative::derivative(self, name)
    }

    /// `a + b`, with zeros left out.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Number(0.0), b) => b,
            (a, Self::Number(0.0)) => a,
            (Self::Number(a), Self::Number(b)) => Self::Number(a + b),
            (a, Self::Negate(b)) => a.minus(*b),
            (a, b) => Self::Binary(Operator::Add, a.into(), b.into()),
        }
    }

    /// `a - b`, with zeros left out.
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Number(0.0), b) => b.negated(),
            (a, Self::Number(0.0)) => a,
            (Self::Number(a), Self::Number(b)) => Self::Number(a - b),
            (a, Self::Negate(b)) => a.plus(*b),
            (a, b) => Self::Binary(Operator::Subtract, a.into(), b.into()),
        }
    }

    /// `a * b`, with zeros and ones simplified.
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        match (self, other) {
            (Self::Number(0.0), _) | (_, Self::Number(0.0)) => Self::Number(0.0),
            (Self::Number(1.0), b) => b,
            (a, Self::Number(1.0)) => a,
            (Self::Number(a), Self::Number(b)) => Self::Number(a * b),
            (Self::Negate(a), b) => a.times(b).negated(),
            (a, Self::Negate(b)) => a.times(*b).negated(),
            (a, b) => Self::Binary(Operator::Multiply, a.into(), b.into()),
        }
    }

    /// `a / b`, with zeros and ones simplified.
    #[must_use]
    pub fn over(self, other: Self) -> Self {
        match (self, other) {
            (Self::Number(0.0), _) => Self::Number(0.0),
            (a, Self::Number(1.0)) => a,
            (Self::Negate(a), b) => a.over(b).negated(),
            (a, b) => Self::Binary(Operator::Divide, a.into(), b.into()),
        }
    }

    /// `a ^ b`, with the powers 0 and 1 simplified.
    #[must_use]
    pub fn power(self, exponent: Self) -> Self {
        match (self, exponent) {
            (_, Self::Number(0.0)) => Self::Number(1.0),
            (a, Self::Number(1.0)) => a,
            (a, b) => Self::Binary(Operator::Power, a.into(), b.into()),
        }
    }

    /// `-a`, without double signs.
    #[must_use]
    pub fn negated(self) -> Self {
        match self {
            Self::Number(a) => Self::Number(-a),
            Self::Negate(a) => *a,
            a => Self::Negate(a.into()),
        }
    }

    /// `function(self)` for a function of one argument.
    #[must_use]
    pub fn apply(self, function: Function) -> Self {
        Self::Call(function, vec![self])
    }

    /// Calls `visit` with this expression and every part of it, outermost first.
    pub fn visit(&self, visit: &mut dyn FnMut(&Self)) {
        visit(self);
        match self {
            Self::Number(_) | Self::Pi | Self::Time | Self::Variable(_) => {}
            Self::Negate(a) => a.visit(visit),
            Self::Binary(_, a, b) => {
                a.visit(visit);
                b.visit(visit);
            }
            Self::Call(_, arguments) | Self::Simulator(_, arguments) => arguments.iter().for_each(|a| a.visit(visit)),
        }
    }

    /// The expression in which `replace` had the first word at every part, innermost first.
    #[must_use]
    pub fn map(&self, replace: &dyn Fn(Self) -> Self) -> Self {
        let mapped = match self {
            Self::Number(_) | Self::Pi | Self::Time | Self::Variable(_) => self.clone(),
            Self::Negate(a) => Self::Negate(a.map(replace).into()),
            Self::Binary(operator, a, b) => Self::Binary(*operator, a.map(replace).into(), b.map(replace).into()),
            Self::Call(function, arguments) => {
                Self::Call(*function, arguments.iter().map(|a| a.map(replace)).collect())
            }
            Self::Simulator(output, arguments) => {
                Self::Simulator(*output, arguments.iter().map(|a| a.map(replace)).collect())
            }
        };
        replace(mapped)
    }

    /// The expression with every `name` replaced by `value`.
    #[must_use]
    pub fn substitute(&self, name: &str, value: &Self) -> Self {
        self.map(&|part| match part {
            Self::Variable(ref found) if found == name => value.clone(),
            other => other,
        })
    }

    /// The name that it is a multiple of, and the number: `(180/pi)*w`; `None` for anything else.
    pub(crate) fn multiple(&self) -> Option<(f64, &str)> {
        match self {
            Self::Variable(name) => Some((1.0, name)),
            Self::Negate(a) => a.multiple().map(|(factor, name)| (-factor, name)),
            Self::Binary(Operator::Multiply, a, b) => match (a.number(), b.number()) {
                (Some(number), None) => b.multiple().map(|(factor, name)| (number * factor, name)),
                (None, Some(number)) => a.multiple().map(|(factor, name)| (number * factor, name)),
                _ => None,
            },
            Self::Binary(Operator::Divide, a, b) => {
                let (factor, name) = a.multiple()?;
                Some((factor / b.number()?, name))
            }
            _ => None,
        }
    }

    /// Its value where it is made of numbers alone.
    fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            Self::Pi => Some(std::f64::consts::PI),
            Self::Negate(a) => a.number().map(|a| -a),
            Self::Binary(Operator::Multiply, a, b) => Some(a.number()? * b.number()?),
            Self::Binary(Operator::Divide, a, b) => Some(a.number()? / b.number()?),
            _ => None,
        }
    }

    /// The names in it, each once, in order of appearance.
    pub fn variables(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        self.visit(&mut |part| {
            if let Self::Variable(name) = part
                && !names.contains(name)
            {
                names.push(name.clone());
            }
        });
        names
    }

    /// Whether `name` appears in it.
    pub fn contains(&self, name: &str) -> bool {
        let mut found = false;
        self.visit(&mut |part| found |= matches!(part, Self::Variable(n) if n == name));
        found
    }
}
