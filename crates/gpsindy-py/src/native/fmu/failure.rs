//! Why an FMU made no step.

use std::ffi::c_int;
use std::fmt;

/// What a step or an initialisation failed at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Failure {
    /// The library has no such function.
    Missing(&'static str),
    /// The function returned more than a warning.
    Status { function: &'static str, status: c_int },
    /// An event at a set time: a step that begins anywhere knows no time.
    TimeEvent,
    /// A co-simulation whose own steps are longer, s.
    Short { asked: f64, reached: f64 },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Missing(function) => write!(f, "its library has no function {function}; export the FMU anew"),
            Self::Status { function, status } => {
                let label = match status {
                    2 => "discard",
                    3 => "error",
                    4 => "fatal",
                    5 => "pending",
                    _ => "illegal return code",
                };
                write!(f, "{function} failed with status {status} ({label})")
            }
            Self::TimeEvent => {
                f.write_str("has events at set times, which a step from any state does not know; export it without")
            }
            Self::Short { asked, reached } => write!(
                f,
                "asked for a step of {} s, the FMU went {} s: its own steps are longer. Hand in dt as a whole number of them, logs \
                 whose period is a whole number of dt, or use the FMU as model exchange",
                rounded(asked),
                rounded(reached)
            ),
        }
    }
}

/// To six significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
