//! The header row: what separates its cells, the names in it after renaming and mapping.

use super::{Row, number};
use crate::error::{Error, Result};
use crate::header::Header;
use crate::near::{hint, listed};
use crate::options::LogOptions;
use std::collections::HashMap;

/// What separates the cells: a comma, or where the header has none, a semicolon or a tab.
pub(crate) fn separator(header: &str) -> u8 {
    let outside: String = header.split('"').step_by(2).collect();
    if outside.contains(';') && (!outside.contains(',') || outside.matches(';').count() > outside.matches(',').count())
    {
        return b';';
    }
    if outside.contains('\t') && !outside.contains(',') { b'\t' } else { b',' }
}

/// Headers of the first row, renamed, each name once.
pub(super) fn headers(file: &str, first: &Row, options: &LogOptions) -> Result<Vec<Header>> {
    options.check(file, true)?;
    let wrong = |message: String| Error::line(file, first.line, None, message);
    if first.cells.len() == 1 && first.cells[0].contains('|') {
        return Err(wrong("the cells look separated by bars; separate them by commas, semicolons or tabs".into()));
    }
    if first.cells.get(0).is_some_and(|cell| cell.starts_with("schema") && cell.contains("gpsindy.model/")) {
        return Err(wrong("this is a model, not a log; a log has a header row and then one sample per row".into()));
    }
    if first.cells.iter().all(|c| number(c).is_ok()) {
        return Err(wrong("no header: the first row holds only numbers; put a row of column names before it".into()));
    }
    let mut headers: Vec<Header> = first.cells.iter().map(Header::parse).collect();
    for (i, header) in headers.iter_mut().enumerate() {
        if header.name.is_empty() {
            header.name = format!("column_{}", i + 1);
        }
    }
    for (old, new) in &options.renames(&headers) {
        // The whole header is looked for first, which distinguishes two columns of one name.
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        let Some(at) = at else { return Err(missing(file, "--rename: column", old, &headers)) };
        headers[at].name.clone_from(new);
    }
    for (new, old) in &options.map {
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        match at {
            Some(at) => headers[at].name.clone_from(new),
            // A map may serve logs of several kinds: this one has the name already.
            None if headers.iter().any(|h| h.name == *new) => {}
            None => return Err(missing(file, &format!("--map {new}: column"), old, &headers)),
        }
    }
    let mut seen: HashMap<&str, &Header> = HashMap::with_capacity(headers.len());
    for header in &headers {
        if let Some(other) = seen.insert(&header.name, header) {
            let message = format!(
                "column appears twice, as `{}` and as `{}`; remove one or name one otherwise with --rename '{}=...'",
                other.text, header.text, header.text
            );
            return Err(Error::line(file, first.line, Some(&header.name), message));
        }
    }
    Ok(headers)
}

pub(super) fn missing(file: &str, kind: &str, name: &str, headers: &[Header]) -> Error {
    let found = hint(name, headers.iter().map(|h| h.name.as_str()));
    Error::file(file, format!("{kind} `{name}` is not in the file{found}"))
}

pub(super) fn names(headers: &[Header]) -> String {
    listed(&headers.iter().map(|h| h.name.as_str()).collect::<Vec<_>>())
}
