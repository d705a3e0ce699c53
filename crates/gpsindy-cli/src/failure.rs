//! Why a command stopped, by exit status: 1 the computation failed, 2 bad input or usage, 3 a verdict named by `--fail-if`, 4 only some units
//! of a fleet have a diagnosis.

use gpsindy_files::shortened;
use std::fmt;

/// Why a command stopped; displays as one line.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input or the usage is wrong: status 2.
    Input(String),
    /// The input is fine and the work failed: status 1.
    Work(String),
    /// The work is done, and its verdict is one that the user asked to fail: status 3.
    Verdict(String),
    /// The work is done except for some of its parts: status 4.
    Partly(String),
    /// Another program failed and said why: silent, its status.
    Exited(u8),
    /// Nobody reads the output any more: silent, status 0.
    ClosedPipe,
}

/// Result of a command.
pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Input(message.into())
    }

    /// The same with a remedy behind the message.
    pub(crate) fn with(self, remedy: &str) -> Self {
        match self {
            Self::Input(message) => Self::Input(message + remedy),
            Self::Work(message) => Self::Work(message + remedy),
            Self::Verdict(_) | Self::Partly(_) | Self::Exited(_) | Self::ClosedPipe => self,
        }
    }

    pub(crate) fn status(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Work(_) => 1,
            Self::Verdict(_) => 3,
            Self::Partly(_) => 4,
            Self::Exited(status) => *status,
            Self::ClosedPipe => 0,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(message) | Self::Work(message) | Self::Verdict(message) | Self::Partly(message) => {
                // What a file holds may be in a message, and must not command the terminal or fill it.
                let words: Vec<_> = message.split(|c: char| c.is_whitespace() || c.is_control()).collect();
                let line = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
                write!(f, "{}", shortened(line))
            }
            Self::Exited(status) => write!(f, "a program ended with status {status}"),
            Self::ClosedPipe => write!(f, "the output was closed"),
        }
    }
}

/// Whether the numbers refused, as opposed to the input being wrong.
fn is_work(error: &gpsindy_core::Error) -> bool {
    use gpsindy_core::Error;
    matches!(
        error,
        Error::NotPositiveDefinite { .. }
            | Error::Diverged { .. }
            | Error::NotConverged { .. }
            | Error::Callback(_)
            | Error::Cancelled
    )
}

impl From<gpsindy_core::Error> for Failure {
    fn from(error: gpsindy_core::Error) -> Self {
        if is_work(&error) { Self::Work(error.to_string()) } else { Self::Input(error.to_string()) }
    }
}

impl From<gpsindy_files::Error> for Failure {
    fn from(error: gpsindy_files::Error) -> Self {
        use gpsindy_files::Error;
        match &error {
            Error::Write { .. } => Self::Work(error.to_string()),
            Error::Core(source) | Error::Content { source, .. } if is_work(source) => Self::Work(error.to_string()),
            _ => Self::Input(error.to_string()),
        }
    }
}
