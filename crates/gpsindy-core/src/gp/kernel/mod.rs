//! Covariance functions and their hyperparameters: the paper's section on Gaussian processes
//! names the squared exponential, Matern, periodic and rational quadratic kernels.
//!
//! Source: Rasmussen & Williams 2006, Gaussian Processes for Machine Learning, chapter 4.

pub(super) mod covariance;
pub(super) mod exp;
mod profile;

use std::fmt;

/// A covariance function; its hyperparameters are kept apart as one list of logarithms.
///
/// With the scaled distance `q = sum_d (x_d - x'_d)^2 / length_d^2`:
///
/// | kernel | value | log hyperparameters for inputs of dimension d |
/// | --- | --- | --- |
/// | `SquaredExponential` | `s^2 exp(-q/2)` | s, d lengths |
/// | `Matern12` | `s^2 exp(-sqrt q)` | s, d lengths |
/// | `Matern32` | `s^2 (1 + r) exp(-r)`, `r = sqrt(3 q)` | s, d lengths |
/// | `Matern52` | `s^2 (1 + r + r^2/3) exp(-r)`, `r = sqrt(5 q)` | s, d lengths |
/// | `RationalQuadratic` | `s^2 (1 + q/(2 alpha))^-alpha` | s, d lengths, alpha |
/// | `Periodic` | `s^2 exp(-2 sin^2(pi (x_1 - x'_1)/period)/length^2)` | s, length (a pure number), period |
/// | `Sum`, `Product` | of the two | those of the left, then those of the right |
///
/// `s` is a standard deviation in the unit of the targets; lengths and the period have the unit
/// of the inputs. The periodic kernel sees the first input only.
///
/// ```
/// use gpsindy_core::gp::Kernel;
/// let kernel: Kernel = "se*periodic".parse()?;
/// assert_eq!(kernel.n_hyper(1), 5);
/// assert_eq!(kernel.to_string(), "se*periodic");
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// Infinitely smooth.
    SquaredExponential,
    /// Continuous, nowhere differentiable (Ornstein-Uhlenbeck).
    Matern12,
    /// Once differentiable.
    Matern32,
    /// Twice differentiable.
    Matern52,
    /// Repeats itself exactly, infinitely smooth within a period.
    Periodic,
    /// A mixture of squared exponentials of many lengths.
    RationalQuadratic,
    /// Sum of two independent processes.
    Sum(Box<Kernel>, Box<Kernel>),
    /// Product of two covariances; a squared exponential times a periodic one is nearly periodic.
    Product(Box<Kernel>, Box<Kernel>),
}

/// What a hyperparameter is; it decides the bounds and the prior of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Standard deviation of the process, unit of the targets.
    Amplitude,
    /// Correlation length along input `usize`, unit of that input.
    Length(usize),
    /// Length of a periodic kernel, a pure number.
    Roughness,
    /// Period, unit of the first input.
    Period,
    /// Exponent of the rational quadratic kernel, a pure number.
    Exponent,
}

impl Kernel {
    /// Whether it has a state-space form, of linear cost.
    pub(crate) fn has_state_space(&self) -> bool {
        matches!(self, Self::Matern12 | Self::Matern32 | Self::Matern52)
    }

    /// `self + other`.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self::Sum(Box::new(self), Box::new(other))
    }

    /// `self * other`.
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        Self::Product(Box::new(self), Box::new(other))
    }

    /// Number of hyperparameters for inputs of dimension `dimension`.
    pub fn n_hyper(&self, dimension: usize) -> usize {
        match self {
            Self::SquaredExponential | Self::Matern12 | Self::Matern32 | Self::Matern52 => 1 + dimension,
            Self::RationalQuadratic => 2 + dimension,
            Self::Periodic => 3,
            Self::Sum(a, b) | Self::Product(a, b) => a.n_hyper(dimension) + b.n_hyper(dimension),
        }
    }

    /// What each hyperparameter is, in order.
    pub fn roles(&self, dimension: usize) -> Vec<Role> {
        let lengths = (0..dimension).map(Role::Length);
        match self {
            Self::SquaredExponential | Self::Matern12 | Self::Matern32 | Self::Matern52 => {
                std::iter::once(Role::Amplitude).chain(lengths).collect()
            }
            Self::RationalQuadratic => {
                std::iter::once(Role::Amplitude).chain(lengths).chain(std::iter::once(Role::Exponent)).collect()
            }
            Self::Periodic => vec![Role::Amplitude, Role::Roughness, Role::Period],
            Self::Sum(a, b) | Self::Product(a, b) => {
                let mut roles = a.roles(dimension);
                roles.extend(b.roles(dimension));
                roles
            }
        }
    }

    /// Whether the process has a derivative in the mean-square sense, so that a derivative
    /// posterior exists. Anything that holds a `Matern12` has none.
    pub fn differentiable(&self) -> bool {
        match self {
            Self::Matern12 => false,
            Self::Sum(a, b) | Self::Product(a, b) => a.differentiable() && b.differentiable(),
            _ => true,
        }
    }

    /// Multiplies the process by `exp(log_factor)`: a sum is scaled on both sides, a product on its left.
    pub(crate) fn rescale(&self, dimension: usize, hyper: &mut [f64], log_factor: f64) {
        match self {
            Self::Sum(a, b) => {
                let (left, right) = hyper.split_at_mut(a.n_hyper(dimension));
                a.rescale(dimension, left, log_factor);
                b.rescale(dimension, right, log_factor);
            }
            Self::Product(a, _) => a.rescale(dimension, &mut hyper[..a.n_hyper(dimension)], log_factor),
            _ => hyper[0] += log_factor,
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SquaredExponential => f.write_str("se"),
            Self::Matern12 => f.write_str("matern12"),
            Self::Matern32 => f.write_str("matern32"),
            Self::Matern52 => f.write_str("matern52"),
            Self::Periodic => f.write_str("periodic"),
            Self::RationalQuadratic => f.write_str("rq"),
            Self::Sum(a, b) => write!(f, "{a}+{b}"),
            Self::Product(a, b) => {
                for (i, factor) in [a, b].into_iter().enumerate() {
                    let sum = matches!(**factor, Self::Sum(..));
                    let (open, close) = if sum { ("(", ")") } else { ("", "") };
                    write!(f, "{}{open}{factor}{close}", if i == 1 { "*" } else { "" })?;
                }
                Ok(())
            }
        }
    }
}

impl std::str::FromStr for Kernel {
    type Err = crate::Error;

    /// Reads `se`, `matern12`, `matern32`, `matern52`, `periodic`, `rq` and sums and products of them
    /// (`se+periodic`, `matern52*periodic`, without parentheses).
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut sum: Option<Self> = None;
        for part in text.split('+') {
            let mut product: Option<Self> = None;
            for name in part.split('*') {
                let leaf = match name.trim().to_ascii_lowercase().as_str() {
                    "se" => Self::SquaredExponential,
                    "matern12" => Self::Matern12,
                    "matern32" => Self::Matern32,
                    "matern52" => Self::Matern52,
                    "periodic" => Self::Periodic,
                    "rq" => Self::RationalQuadratic,
                    other => {
                        let known = ["se", "matern12", "matern32", "matern52", "periodic", "rq"];
                        return Err(crate::Error::unknown("kernel", other, known));
                    }
                };
                product = Some(match product {
                    Some(p) => p.times(leaf),
                    None => leaf,
                });
            }
            if let Some(part) = product {
                sum = Some(match sum {
                    Some(s) => s.plus(part),
                    None => part,
                });
            }
        }
        sum.ok_or_else(|| crate::Error::settings("the kernel's name is empty; write for example `se` or `se*periodic`"))
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Amplitude => f.write_str("amplitude"),
            Self::Length(0) => f.write_str("length"),
            Self::Length(d) => write!(f, "length_{}", d + 1),
            Self::Roughness => f.write_str("periodic length"),
            Self::Period => f.write_str("period"),
            Self::Exponent => f.write_str("alpha"),
        }
    }
}
