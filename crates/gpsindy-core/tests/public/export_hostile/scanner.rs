//! Strips an exported source of comments and strings, without knowing anything of the export.

use gpsindy_core::{Language, Model};
use std::collections::BTreeSet;

/// Rules of a language for the scanner.
pub(crate) struct Marks {
    line: &'static str,
    /// Opening, closing, and whether they nest.
    block: Option<(&'static str, &'static str, bool)>,
    /// Quotes of strings, the longest first, in which `\` hides the next character.
    quotes: &'static [&'static str],
    /// Whether `$` in a string begins code.
    interpolates: bool,
}

pub(crate) fn marks(language: Language) -> Marks {
    match language {
        Language::Python | Language::Sympy => {
            Marks { line: "#", block: None, quotes: &["\"\"\"", "'''", "\"", "'"], interpolates: false }
        }
        Language::C => {
            Marks { line: "//", block: Some(("/*", "*/", false)), quotes: &["\"", "'"], interpolates: false }
        }
        Language::Rust => Marks { line: "//", block: Some(("/*", "*/", true)), quotes: &["\""], interpolates: false },
        Language::Julia => {
            Marks { line: "#", block: Some(("#=", "=#", true)), quotes: &["\"\"\"", "\"", "`"], interpolates: true }
        }
        Language::Modelica => {
            Marks { line: "//", block: Some(("/*", "*/", false)), quotes: &["\""], interpolates: false }
        }
        _ => panic!("{language:?} has no comments that the scanner knows"),
    }
}

/// The source without comments and without the content of strings; nothing may be left open at its end.
pub(crate) fn stripped(source: &str, marks: &Marks) -> Result<String, String> {
    let mut code = String::new();
    let mut rest = source;
    'next: while let Some(character) = rest.chars().next() {
        if let Some((open, close, nests)) = marks.block
            && let Some(inside) = rest.strip_prefix(open)
        {
            let (mut depth, mut at) = (1, inside);
            while depth > 0 {
                if let Some(after) = at.strip_prefix(close) {
                    (depth, at) = (depth - 1, after);
                } else if let Some(after) = at.strip_prefix(open).filter(|_| nests) {
                    (depth, at) = (depth + 1, after);
                } else {
                    let c = at.chars().next().ok_or("a comment stays open")?;
                    at = &at[c.len_utf8()..];
                }
            }
            rest = at;
            continue;
        }
        if rest.starts_with(marks.line) {
            rest = rest.find(['\n', '\r']).map_or("", |end| &rest[end..]);
            continue;
        }
        for quote in marks.quotes {
            let Some(mut at) = rest.strip_prefix(quote) else { continue };
            while !at.starts_with(quote) {
                let c = at.chars().next().ok_or("a string stays open")?;
                if c == '\n' && quote.len() == 1 {
                    return Err(format!("a string is cut by its line: {rest:.60}"));
                }
                if c == '$' && marks.interpolates {
                    return Err(format!("a string is interpolated: {rest:.60}"));
                }
                at = &at[c.len_utf8()..];
                if c == '\\' {
                    at = &at[at.chars().next().ok_or("a string ends in a backslash")?.len_utf8()..];
                }
            }
            code += "\"\"";
            rest = &at[quote.len()..];
            continue 'next;
        }
        code.push(character);
        rest = &rest[character.len_utf8()..];
    }
    // Spaces in front of a comment and lines of comments alone don't matter.
    Ok(code.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n"))
}

/// Words of a source: letters, digits and `_`.
pub(crate) fn words(code: &str) -> BTreeSet<&str> {
    code.split(|c: char| !c.is_alphanumeric() && c != '_').collect()
}

/// What a model calls itself in C and in Modelica is one plain identifier; `OWN` takes its place.
pub(crate) fn with_own_name(code: &str, language: Language) -> String {
    let own = match language {
        Language::C => code.split("_n_states").next().unwrap().rsplit(' ').next().unwrap(),
        Language::Modelica => code.split_whitespace().nth(1).unwrap(),
        _ => return code.into(),
    };
    assert!(own.starts_with(|c: char| c.is_ascii_alphabetic()), "{own}");
    assert!(own.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{own}");
    if language == Language::Modelica {
        return code.replacen(&format!("model {own}"), "model OWN", 1).replace(&format!("end {own};"), "end OWN;");
    }
    // What the program itself is made of; a state may be called as the model is.
    let parts = "n_ parameters_t nominal initial_state record_t sample_at signal_ history_ rates outputs simulate";
    let is_own = |word: &str| parts.split(' ').any(|part| word.starts_with(&format!("{own}_{part}")));
    let longest_first = words(code).into_iter().rev().filter(|word| is_own(word));
    longest_first.fold(code.to_string(), |code, word| code.replace(word, &word.replacen(own, "OWN", 1)))
}

/// What is left of a source when nothing of the user's free text is left.
pub(crate) fn skeleton(model: &Model, language: Language) -> String {
    let source = model.export(language).unwrap();
    let code = stripped(&source, &marks(language)).unwrap_or_else(|e| panic!("{language:?}: {e}\n{source}"));
    // Modelica has units as attributes, where it can say them.
    with_own_name(&code, language).replace("(unit=\"\")", "").replace("unit=\"\", ", "")
}
