//! Errors in files, with file, line and column.

use std::io;

/// Result with the crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong with a file; each displays as one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file can't be opened or read.
    #[error("{file}: cannot be read: {}", reason(.source))]
    Read {
        /// The file, as the user named it.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// A file can't be written.
    #[error("{file}: cannot be written: {}", unwritten(.source))]
    Write {
        /// The file, as the user named it.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// A line of a file can't be understood.
    #[error("{file}:{line}: {}{message}", in_column(.column))]
    Line {
        /// The file, as the user named it.
        file: String,
        /// Line of the file, the first is 1.
        line: u64,
        /// The column's name, where one is at fault.
        column: Option<String>,
        /// What was found and what to do.
        message: String,
    },
    /// A file as a whole does not fit.
    #[error("{file}: {message}")]
    File {
        /// The file, as the user named it.
        file: String,
        /// What was found and what to do.
        message: String,
    },
    /// The content reads well but means nothing to the library.
    #[error("{file}: {source}")]
    Content {
        /// The file, as the user named it.
        file: String,
        /// What the library says.
        source: gpsindy_core::Error,
    },
    /// The logs together do not make a dataset.
    #[error(transparent)]
    Core(#[from] gpsindy_core::Error),
}

impl Error {
    pub(crate) fn file(file: &str, message: impl Into<String>) -> Self {
        Self::File { file: file.into(), message: shortened(message.into()) }
    }

    pub(crate) fn line(file: &str, line: u64, column: Option<&str>, message: impl Into<String>) -> Self {
        let column = column.map(|name| shortened(name.into()));
        Self::Line { file: file.into(), line, column, message: shortened(message.into()) }
    }
}

/// Characters of a message that are shown.
const SHOWN: usize = 1000;

/// And of those that come from its end, where the remedy is.
const END: usize = 300;

/// A message without its middle where that is long: it may quote what a file holds, a name of megabytes for one.
///
/// ```
/// assert_eq!(gpsindy_files::shortened("short".into()), "short");
/// assert_eq!(gpsindy_files::shortened("x".repeat(5000)).len(), 1005);
/// ```
pub fn shortened(message: String) -> String {
    let length = message.chars().count();
    if length <= SHOWN {
        return message;
    }
    let first: String = message.chars().take(SHOWN - END).collect();
    let last: String = message.chars().skip(length - END).collect();
    format!("{first} ... {last}")
}

fn in_column(column: &Option<String>) -> String {
    column.as_ref().map(|name| format!("column `{name}`: ")).unwrap_or_default()
}

/// Why a file can't be written.
fn unwritten(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "there is no such folder".into(),
        io::ErrorKind::IsADirectory => "it is a folder; name a file in it".into(),
        _ => reason(source),
    }
}

/// The system's words without its error number.
fn reason(source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::NotFound => "there is no such file".into(),
        io::ErrorKind::PermissionDenied => "permission denied".into(),
        io::ErrorKind::IsADirectory => "it is a folder; name the files in it".into(),
        _ => {
            let text = source.to_string();
            text.split(" (os error").next().unwrap_or_default().to_string()
        }
    }
}
