//! The error type: its variants differ in what the caller can do.

/// Result with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, in the words of the user.
///
/// The first group says that the input is wrong, the second that the numbers refuse, the third
/// that somebody else's code failed or asked to stop. A weak but usable result is never an error:
/// it is data in the result (`converged`, `equivalent`, ...).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Two sizes that must agree do not.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// The argument, as the caller names it.
        what: String,
        /// The size that was needed.
        expected: String,
        /// The size that came.
        found: String,
    },
    /// A setting lies outside its range.
    #[error("`{name}` must be {expected}, found {found}")]
    Range {
        /// The setting, as the caller names it.
        name: String,
        /// The range in words.
        expected: String,
        /// The value that came.
        found: String,
    },
    /// A value is infinite or not a number where that can't be.
    #[error("{what}: not a finite number; remove the sample or leave the cell empty")]
    NotFinite {
        /// Where the value appears.
        what: String,
    },
    /// There are fewer samples than the step can work with.
    #[error("{}", too_few(what, *needed, *found))]
    TooFewSamples {
        /// The run, channel or step.
        what: String,
        /// The smallest number that works.
        needed: usize,
        /// The number that came.
        found: usize,
    },
    /// An expression or a setting written as text can't be read.
    #[error("`{}`, at character {position}: {message}", excerpt(.text, *.position))]
    Parse {
        /// The whole text.
        text: String,
        /// Counted from 1, in characters.
        position: usize,
        /// What was found, and what was expected there.
        message: String,
    },
    /// A name that nothing carries.
    #[error("{kind} `{name}` is unknown{}", known_names(.known))]
    UnknownName {
        /// What the name was taken for: "state", "column", "term", ...
        kind: String,
        /// The name.
        name: String,
        /// The names that would have been understood.
        known: Vec<String>,
    },
    /// A name that appears twice where it may appear once.
    #[error("{kind} `{name}` appears twice; rename one of them")]
    Duplicate {
        /// What carries the name.
        kind: String,
        /// The name.
        name: String,
    },
    /// A name that a model can't use.
    #[error("`{name}` {why}")]
    BadName {
        /// The name.
        name: String,
        /// Why not, and what to use.
        why: String,
    },
    /// A character in a name or a unit that does not show on paper: a line break, a null, a change of direction.
    #[error("{what}: character {position} is U+{:04X}, which does not show; write one line of plain text", *.character as u32)]
    HiddenCharacter {
        /// Whose text it is.
        what: String,
        /// Counted from 1, in characters.
        position: usize,
        /// The character.
        character: char,
    },
    /// A file follows another schema than this version reads.
    #[error("schema is `{found}`, but this version reads `{supported}`")]
    Schema {
        /// The schema that the file names.
        found: String,
        /// The schema that is read.
        supported: String,
    },
    /// An expression that can be read but makes no sense in its place.
    #[error("{place}, `{expression}`: {why}")]
    Equation {
        /// Where the expression appears.
        place: String,
        /// The expression.
        expression: String,
        /// What is wrong with it.
        why: String,
    },
    /// A model that a language can't say.
    #[error("{what} can't be exported: {why}")]
    NotExportable {
        /// The part.
        what: String,
        /// Why, and what to do.
        why: String,
    },
    /// Settings that contradict each other or leave nothing to do; the text says what is wrong and what to do.
    #[error("{message}")]
    Settings {
        /// What is wrong and what to do.
        message: String,
    },
    /// Logs that nothing can be made of; the text says what is wrong and what to do.
    #[error("{message}")]
    Data {
        /// What is wrong and what to do.
        message: String,
    },
    /// A model that can't be simulated, or not as asked; the text says what is wrong and what to do.
    #[error("{message}")]
    Model {
        /// What is wrong and what to do.
        message: String,
    },
    /// A file, neither log nor model, that is not what it should be; the text says what is wrong and what to do.
    #[error("{message}")]
    File {
        /// What is wrong and what to do.
        message: String,
    },
    /// A matrix that must be positive definite is not, whatever small jitter is added.
    #[error(
        "{what} of {size} points stays indefinite with jitter {jitter:.0e}; raise the noise floor or thin the data"
    )]
    NotPositiveDefinite {
        /// The matrix.
        what: String,
        /// Its size.
        size: usize,
        /// The largest jitter tried, relative to the diagonal.
        jitter: f64,
    },
    /// A trajectory left all bounds.
    #[error("{what} diverged at t = {time} s: {state} {}", left(*value))]
    Diverged {
        /// The model or run.
        what: String,
        /// Time of the first value out of bounds, s.
        time: f64,
        /// The state that left.
        state: String,
        /// Its value there.
        value: f64,
    },
    /// A search found nothing usable.
    #[error("{what} found no usable solution: {why}")]
    NotConverged {
        /// The step.
        what: String,
        /// Why, and what to try.
        why: String,
    },
    /// The user's own function failed; its error is passed on unchanged.
    #[error(transparent)]
    Callback(Box<dyn std::error::Error + Send + Sync>),
    /// The progress callback asked to stop.
    #[error("stopped on request")]
    Cancelled,
}

/// What is around a place of a text, all of it where it is short.
fn excerpt(text: &str, position: usize) -> String {
    const BEFORE: usize = 60;
    const SHOWN: usize = 120;
    let length = text.chars().count();
    if length <= SHOWN {
        return text.into();
    }
    let first = position.saturating_sub(BEFORE).min(length - SHOWN);
    let part: String = text.chars().skip(first).take(SHOWN).collect();
    let dots = |is_cut: bool| if is_cut { "..." } else { "" };
    format!("{}{part}{}", dots(first > 0), dots(first + SHOWN < length))
}

fn known_names(known: &[String]) -> String {
    if known.is_empty() {
        return String::new();
    }
    format!("; known: {}", known.join(", "))
}

/// What has too few samples: of a column without a value, which can't be meant, that it has none.
fn too_few(what: &str, needed: usize, found: usize) -> String {
    match (needed, found) {
        (1, 0) => format!("{what}: has no value at all; leave it out, or give a log that has some"),
        _ => format!("{what}: needs at least {needed} samples, found {found}"),
    }
}

/// What became of a state that left all bounds, and what to look at.
fn left(value: f64) -> String {
    match value.is_finite() {
        true => format!("is {value:e}"),
        false => "is no number any more; check the parameters (a division by 0, a root or logarithm below 0?) and the \
                  initial values"
            .into(),
    }
}

/// Nothing where something failed; a request to stop stays an error.
pub(crate) fn unless_cancelled<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Error::Cancelled) => Err(Error::Cancelled),
        Err(_) => Ok(None),
    }
}

impl Error {
    /// An [`Error::Settings`] with this message.
    pub fn settings(message: impl Into<String>) -> Self {
        Self::Settings { message: message.into() }
    }

    /// An [`Error::Data`] with this message.
    pub fn data(message: impl Into<String>) -> Self {
        Self::Data { message: message.into() }
    }

    /// An [`Error::Model`] with this message.
    pub fn model(message: impl Into<String>) -> Self {
        Self::Model { message: message.into() }
    }

    /// An [`Error::File`] with this message.
    pub fn file(message: impl Into<String>) -> Self {
        Self::File { message: message.into() }
    }

    /// An [`Error::UnknownName`] that lists what would have been understood.
    pub fn unknown<S: AsRef<str>>(kind: &str, name: &str, known: impl IntoIterator<Item = S>) -> Self {
        Self::UnknownName {
            kind: kind.into(),
            name: name.into(),
            known: known.into_iter().map(|k| k.as_ref().to_string()).collect(),
        }
    }

    /// An [`Error::Range`] for the setting `name`.
    pub fn range(name: &str, expected: &str, found: impl std::fmt::Display) -> Self {
        Self::Range { name: name.into(), expected: expected.into(), found: found.to_string() }
    }

    /// An [`Error::Shape`] for the argument `what`.
    pub fn shape(what: impl Into<String>, expected: impl std::fmt::Display, found: impl std::fmt::Display) -> Self {
        Self::Shape { what: what.into(), expected: expected.to_string(), found: found.to_string() }
    }
}

/// Nothing where the numbers refuse; any other error stays one.
pub(crate) fn unless_refused<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Error::Diverged { .. } | Error::NotPositiveDefinite { .. } | Error::NotConverged { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
