//! Custom effects: `[[effect]]` entries of a TOML file.

use crate::error::{Error, Result};
use crate::model::{from_toml, read_text};
use crate::options::plain;
use gpsindy_core::Expression;
use gpsindy_core::diagnose::{CustomEffect, CustomParameter};
use serde::Deserialize;
use std::path::Path;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "effect", default)]
    effects: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    id: String,
    state: String,
    form: Expression,
    parameters: Vec<Range>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Range {
    name: String,
    low: f64,
    high: f64,
    #[serde(default)]
    unit: String,
}

/// Reads effects of the user's own; `-` is standard input.
///
/// # Errors
/// [`Error::Read`], and everything that [`parse_effects`] refuses.
pub fn read_effects(path: &Path) -> Result<Vec<CustomEffect>> {
    let (file, text) = read_text(path)?;
    parse_effects(&file, &text)
}

/// Reads effects of the user's own from text; `file` names it in messages.
///
/// ```
/// let text = "[[effect]]\nid = 'lift'\nstate = 'v'\nform = 'c*w*v'\nparameters = [{ name = 'c', low = -1.0, high = 1.0 }]\n";
/// let effects = gpsindy_files::parse_effects("effects.toml", text)?;
/// assert_eq!(effects[0].id, "lift");
/// # Ok::<(), gpsindy_files::Error>(())
/// ```
///
/// # Errors
/// A key that is unknown or missing, a bad expression (with its line), a range that is empty, no entry, an id that
/// appears twice, or that the catalogue or a report has already.
pub fn parse_effects(file: &str, text: &str) -> Result<Vec<CustomEffect>> {
    let read: File = from_toml(file, text)?;
    if read.effects.is_empty() {
        return Err(Error::file(file, "no effect; add an [[effect]] with id, state, form and parameters"));
    }
    for (i, entry) in read.effects.iter().enumerate() {
        let ranges = entry.parameters.iter().flat_map(|range| [&range.name, &range.unit]);
        for text in [&entry.id, &entry.state].into_iter().chain(ranges) {
            plain(file, &format!("effect {}", i + 1), text)?;
        }
        if read.effects[..i].iter().any(|other| other.id == entry.id) {
            return Err(Error::file(file, format!("effect `{}` appears twice; give one another id", entry.id)));
        }
        if CustomEffect::is_reserved(&entry.id) {
            let message = format!("the id `{}` has a meaning of its own already; give the effect another id", entry.id);
            return Err(Error::file(file, message));
        }
        if entry.parameters.is_empty() {
            return Err(Error::file(
                file,
                format!("effect `{}` has no parameter; at least its size must be free", entry.id),
            ));
        }
        for range in &entry.parameters {
            if !(range.low.is_finite() && range.high.is_finite() && range.low < range.high) {
                let message = format!(
                    "effect `{}`, parameter `{}`: `low` must be below `high`, found {} and {}",
                    entry.id, range.name, range.low, range.high
                );
                return Err(Error::file(file, message));
            }
        }
    }
    Ok(read.effects.into_iter().map(custom).collect())
}

fn custom(entry: Entry) -> CustomEffect {
    let parameter =
        |range: Range| CustomParameter { name: range.name, low: range.low, high: range.high, unit: range.unit };
    CustomEffect {
        id: entry.id,
        state: entry.state,
        form: entry.form,
        parameters: entry.parameters.into_iter().map(parameter).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIFT: &str = "[[effect]]\nid = 'lift'\nstate = 'v'\nform = 'c*w*v'\nparameters = [{ name = 'c', low = -1, high = 1.0, unit = '1/s' }]\n";

    #[test]
    fn an_effect_reads() {
        let effects = parse_effects("e.toml", LIFT).unwrap();
        assert_eq!(effects[0].parameters[0].low, -1.0);
        assert_eq!(effects[0].form.to_string(), "c*w*v");
    }

    #[test]
    fn every_mistake_is_one_line() {
        for (text, expected) in [
            (String::new(), "e.toml: no effect; add an [[effect]]"),
            (LIFT.replace("form", "forms"), "e.toml:4: unknown field `forms`"),
            (LIFT.replace("c*w*v", "c*"), "e.toml:4: `c*`, at character 3"),
            (
                LIFT.replace("-1", "2"),
                "e.toml: effect `lift`, parameter `c`: `low` must be below `high`, found 2 and 1",
            ),
            (LIFT.replace("state = 'v'\n", ""), "e.toml:1: missing field `state`"),
            (format!("{LIFT}{LIFT}"), "e.toml: effect `lift` appears twice"),
            (LIFT.replace("'lift'", "'function'"), "e.toml: the id `function` has a meaning of its own already"),
            (
                LIFT.replace("lift", "li\u{ad}ft"),
                "e.toml: effect 1: character 3 of a name or unit is U+00AD, which does not show; write it without",
            ),
            (
                LIFT.replace("1/s", "\u{feff}1/s"),
                "e.toml: effect 1: character 1 of a name or unit is U+FEFF, which does not show; write it without",
            ),
            (LIFT.replace("'lift'", "'bias'"), "e.toml: the id `bias` has a meaning of its own already"),
        ] {
            let error = parse_effects("e.toml", &text).unwrap_err().to_string();
            assert!(error.starts_with(expected) && !error.contains('\n'), "   found: {error}\nexpected: {expected}");
        }
    }
}
