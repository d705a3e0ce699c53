//! The columns of a table by their names: elements of lists, renames and maps.

use super::Place;
use super::leaf::Leaf;
use crate::error::{Error, Result};
use crate::header::Header;
use crate::near::hint;
use crate::options::LogOptions;
use std::collections::HashMap;

/// The columns of a leaf: itself, or the elements of a list by name or number.
pub(super) fn columns(leaf: &Leaf, width: usize, names: Option<&Vec<String>>) -> Vec<(Header, Option<usize>)> {
    if !leaf.listed {
        return vec![(Header::parse(&leaf.name), None)];
    }
    let plain =
        |text: &str| text.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' }).collect::<String>();
    let element = |i: usize| {
        let item = names.and_then(|n| n.get(i)).cloned().unwrap_or_else(|| i.to_string());
        let name = format!("{}_{}", plain(&leaf.name), plain(&item));
        (Header { text: format!("{}[{item}]", leaf.name), name, unit: String::new() }, Some(i))
    };
    (0..width).map(element).collect()
}

/// Renames and maps the columns of a table; each name once.
pub(super) fn names(file: &str, headers: &mut [Header], places: &[Place], options: &LogOptions) -> Result<()> {
    let known: Vec<String> = headers.iter().map(|h| h.text.clone()).collect();
    let given = options.renames(headers);
    let renames = given.iter().map(|(old, new)| (old, new, false));
    let maps = options.map.iter().map(|(new, old)| (old, new, true));
    for (old, new, mapped) in renames.chain(maps) {
        let at =
            headers.iter().position(|h| h.text == old.trim()).or_else(|| headers.iter().position(|h| h.name == *old));
        // An element may be named by its number where it has a name, too.
        let at = at.or_else(|| {
            let (list, number) = old.trim().strip_suffix(']')?.rsplit_once('[')?;
            let element = number.parse().ok()?;
            places.iter().position(|p| p.leaf.name == list && p.element == Some(element))
        });
        match at {
            Some(at) => headers[at].name.clone_from(new),
            None if mapped && headers.iter().any(|h| h.name == *new) => {}
            None => {
                let option = if mapped { format!("--map {new}={old}") } else { format!("--rename {old}={new}") };
                let found = hint(old, known.iter().map(String::as_str));
                return Err(Error::file(file, format!("{option}: there is no column `{old}`{found}")));
            }
        }
    }
    for (name, unit) in &options.unit {
        headers.iter_mut().filter(|h| h.name == *name).for_each(|h| h.unit.clone_from(unit));
    }
    let mut seen: HashMap<&str, &Header> = HashMap::with_capacity(headers.len());
    for header in headers.iter() {
        if let Some(other) = seen.insert(&header.name, header) {
            let message = format!(
                "the columns `{}` and `{}` have the same name, `{}`; name one otherwise with --rename '{}=...'",
                other.text, header.text, header.name, header.text
            );
            return Err(Error::file(file, message));
        }
    }
    Ok(())
}
