//! Model files: one schema, as TOML or JSON.

use crate::error::{Error, Result};
use crate::output::write_whole;
use gpsindy_core::Model;
use std::io::Read;
use std::path::Path;

/// Reads and checks a model file; `-` is standard input.
///
/// JSON where the name ends in `.json` or the text begins with `{`, else TOML.
///
/// # Errors
/// [`Error::Read`]; a key that the schema lacks, a bad expression (with its line), an unknown name.
pub fn read_model(path: &Path) -> Result<Model> {
    let (file, text) = read_text(path)?;
    parse_model(&file, &text)
}

/// Reads and checks a model from text; `file` names it in messages.
///
/// ```
/// let text = "schema = 'gpsindy.model/1'\n[[state]]\nname = 'x'\nequation = '-2*x'\n";
/// let model = gpsindy_files::parse_model("decay.toml", text)?;
/// assert_eq!(model.states[0].name, "x");
/// # Ok::<(), gpsindy_files::Error>(())
/// ```
///
/// # Errors
/// As [`read_model`].
pub fn parse_model(file: &str, text: &str) -> Result<Model> {
    if file.ends_with(".csv") {
        return Err(Error::file(file, "not a model; a model is TOML or JSON, a log is CSV"));
    }
    if text.trim_start().starts_with('<') {
        return Err(Error::file(
            file,
            "a simulator's own file (MJCF, URDF), not equations; diagnose, simulate and score of the Python package's command take it, \
             in Python gpsindy.mujoco.Simulator; other commands take model files (TOML or JSON)",
        ));
    }
    let json = file.ends_with(".json") || text.trim_start().starts_with('{');
    let model: Model = if json { from_json(file, text)? } else { from_toml(file, text)? };
    model.check().map_err(|source| Error::Content { file: file.into(), source })?;
    Ok(model)
}

/// The model as TOML.
///
/// # Errors
/// None that a checked model can cause.
pub fn model_to_toml(model: &Model) -> Result<String> {
    toml::to_string(model).map_err(|e| Error::file("model.toml", one_line(&e.to_string())))
}

/// The model as JSON.
///
/// # Errors
/// None that a checked model can cause.
pub fn model_to_json(model: &Model) -> Result<String> {
    let text = serde_json::to_string_pretty(model).map_err(|e| Error::file("model.json", one_line(&e.to_string())))?;
    Ok(text + "\n")
}

/// Writes a model, as JSON where the name ends in `.json`, else as TOML; the file appears whole or not at all.
///
/// # Errors
/// [`Error::Write`].
pub fn write_model(path: &Path, model: &Model) -> Result<()> {
    let json = path.extension().is_some_and(|e| e == "json");
    let text = if json { model_to_json(model)? } else { model_to_toml(model)? };
    write_whole(path, text.as_bytes())
}

/// The text of a file or, for `-`, of standard input, with the name to call it by.
pub(crate) fn read_text(path: &Path) -> Result<(String, String)> {
    let stdin = path.as_os_str() == "-";
    let file = if stdin { "stdin".to_string() } else { path.display().to_string() };
    let mut bytes = Vec::new();
    let read = if stdin {
        std::io::stdin().read_to_end(&mut bytes).map(|_| ())
    } else {
        std::fs::read(path).map(|all| bytes = all)
    };
    read.map_err(|source| Error::Read { file: file.clone(), source })?;
    match String::from_utf8(bytes) {
        Ok(text) => Ok((file, text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text))),
        Err(e) => {
            let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
            let line = 1 + before.iter().filter(|b| **b == b'\n').count() as u64;
            Err(Error::line(&file, line, None, "not UTF-8; save the file as UTF-8"))
        }
    }
}

/// Reads TOML; an error has the line it points at.
pub(crate) fn from_toml<T: serde::de::DeserializeOwned>(file: &str, text: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| {
        let at = e.span().map_or(0, |span| span.start).min(text.len());
        let line = 1 + text.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() as u64;
        Error::line(file, line, None, plain(e.message()))
    })
}

fn from_json<T: serde::de::DeserializeOwned>(file: &str, text: &str) -> Result<T> {
    serde_json::from_str(text).map_err(|e| {
        let message = plain(&e.to_string());
        // serde_json says the place at the end of its message, and we say it at the beginning.
        let message = message.split(" at line ").next().unwrap_or_default().to_string();
        Error::line(file, e.line() as u64, None, message)
    })
}

/// A parser's message on one line, without the names of Rust's types.
fn plain(message: &str) -> String {
    one_line(message).replace("expected f64", "expected a number")
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const CART: &str = r#"schema = "gpsindy.model/1"
name = "cart"

[[state]]
name = "x"
unit = "m"
equation = "v"

[[state]]
name = "v"
unit = "m/s"
equation = "(u - k*x - b*v)/m"
measured = "v + 0.02"

[[control]]
name = "u"
unit = "N"

[[parameter]]
name = "m"
value = 1.2
unit = "kg"
tolerance = 0.05

[[parameter]]
name = "k"
value = 4

[[parameter]]
name = "b"
value = 0.3

[initial]
x = 0.0
v = 0.0
"#;

    #[test]
    fn a_model_survives_both_formats() {
        let model = parse_model("cart.toml", CART).unwrap();
        assert_eq!(model.parameters[1].value, 4.0);
        let toml = parse_model("again.toml", &model_to_toml(&model).unwrap()).unwrap();
        let json = parse_model("again.json", &model_to_json(&model).unwrap()).unwrap();
        assert_eq!(toml, model);
        assert_eq!(json, model);
    }

    #[test]
    fn every_mistake_in_a_model_is_one_line_with_its_place() {
        for (from, to, expected) in [
            ("equation = \"v\"", "equation = \"v +\"", "cart.toml:7: `v +`, at character 4"),
            ("unit = \"m\"", "units = \"m\"", "cart.toml:6: unknown field `units`"),
            (
                "k*x",
                "q*x",
                "cart.toml: `(u - q*x - b*v)/m`, at character 6: name `q` is unknown in the equation of state `v`",
            ),
            ("value = 4", "value = \"four\"", "cart.toml:27: invalid type: string \"four\", expected a number"),
            ("gpsindy.model/1", "gpsindy.model/2", "cart.toml: schema is `gpsindy.model/2`, but this version reads"),
            ("x = 0.0", "z = 0.0", "cart.toml: initial state `z` is unknown; known: x, v"),
            ("name = \"cart\"", "name = cart", "cart.toml:2: "),
            (
                "unit = \"N\"",
                "unit = \"N\\n\"",
                "cart.toml:17: name or unit: character 2 is U+000A, which does not show; write one line of plain text",
            ),
            ("\"cart\"", "\"a\\u001b[31m\"", "cart.toml:2: name or unit: character 2 is U+001B, which does not show"),
            // No width of their own.
            ("\"cart\"", "\"a\\ufeff\"", "cart.toml:2: name or unit: character 2 is U+FEFF, which does not show"),
            ("\"cart\"", "\"a\\u00ad\"", "cart.toml:2: name or unit: character 2 is U+00AD, which does not show"),
            ("[initial]", "[inital]", "cart.toml:33: unknown field `inital`"),
            ("name = \"k\"", "name = \"v\"", "cart.toml: name `v` appears twice"),
        ] {
            let text = CART.replacen(from, to, 1);
            assert_ne!(text, CART, "{from}");
            let error = parse_model("cart.toml", &text).unwrap_err().to_string();
            assert!(error.starts_with(expected), "   found: {error}\nexpected: {expected}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn json_mistakes_have_their_line() {
        let text =
            model_to_json(&parse_model("cart.toml", CART).unwrap()).unwrap().replacen("\"unit\"", "\"units\"", 1);
        let error = parse_model("cart.json", &text).unwrap_err().to_string();
        assert!(error.starts_with("cart.json:7: unknown field `units`"), "{error}");
    }
}
