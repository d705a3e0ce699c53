//! Columns that a map takes from the topics of a log.

use crate::error::{Error, Result};
use crate::formats::message::path::{self, Step};
use crate::header::Header;
use crate::near::hint;
use crate::options::LogOptions;

/// Where a column comes from.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub(crate) topic: String,
    pub(crate) steps: Vec<Step>,
}

impl Place {
    /// The field as text, `pose.position.x`.
    pub(crate) fn path(&self) -> String {
        path::shown(&self.steps)
    }
}

/// The columns of a map: their headers and places. `check` says what is wrong with a field of a topic.
///
/// # Errors
/// No map, a topic that is not there, what `check` says, a name twice, options that only a table has.
pub(crate) fn columns(
    file: &str,
    options: &LogOptions,
    topics: &[&str],
    check: &mut dyn FnMut(&str, &str) -> std::result::Result<(), String>,
) -> Result<(Vec<Header>, Vec<Place>)> {
    options.check(file, false)?;
    if topics.is_empty() {
        return Err(Error::file(file, "the log holds no topic"));
    }
    if let Some(column) = &options.time {
        let message =
            format!("--time {column}: the log has topics, each with its own stamps; choose these with --stamp");
        return Err(Error::file(file, message));
    }
    if let Some(column) = &options.run {
        let message = format!("--run {column}: the log has topics and is one run; only a table has a column of runs");
        return Err(Error::file(file, message));
    }
    let (mut headers, mut places): (Vec<Header>, Vec<Place>) = (Vec::new(), Vec::new());
    for (name, text) in &options.map {
        let wrong = |message: String| Error::file(file, format!("--map {name}={text}: {message}"));
        let (topic, steps) = path::split(text, topics).map_err(wrong)?;
        let place = Place { topic: topic.into(), steps };
        check(topic, &place.path()).map_err(wrong)?;
        headers.push(Header { text: text.clone(), name: name.clone(), unit: options.unit_of(name) });
        places.push(place);
    }
    if headers.is_empty() {
        let shown = if topics.len() > 16 { &topics[..16] } else { topics };
        let more = if topics.len() > 16 { format!(" and {} more", topics.len() - 16) } else { String::new() };
        let message = format!(
            "say where each state and control comes from, --map NAME=TOPIC.FIELD; `gpsindy inspect {file}` lists the fields; \
             topics: {}{more}",
            shown.join(", ")
        );
        return Err(Error::file(file, message));
    }
    for (old, new) in &options.renames(&headers) {
        let Some(header) = headers.iter_mut().find(|h| h.answers_to(old)) else {
            let found = hint(old, headers.iter().map(|h| h.name.as_str()));
            return Err(Error::file(file, format!("--rename: column `{old}` is not in the log{found}")));
        };
        header.name.clone_from(new);
    }
    Ok((headers, places))
}

/// The error that says that `name` is not mapped.
pub(crate) fn lacks(file: &str, headers: &[Header], name: &str) -> Error {
    let found = hint(name, headers.iter().map(|h| h.name.as_str()));
    let cure = format!("say where it comes from with --map {name}=TOPIC.FIELD");
    Error::file(file, format!("column `{name}` is not mapped; {cure}{found}"))
}
