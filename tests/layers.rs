//! The import direction of docs/architecture.md: in `gpsindy-core` an arrow is only ever drawn downward.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

/// Top-level modules of the core and the layer each stands in.
const LAYERS: &[(u8, &[&str])] = &[
    (1, &["data", "error", "progress", "expression"]),
    (2, &["gp", "regress", "library", "model"]),
    (3, &["smooth", "differentiate", "weak", "refine", "simulate", "score", "systems"]),
    (4, &["identify", "diagnose", "exam"]),
    (5, &["paired", "fleet"]),
];

/// Modules that must not import each other although they share a layer.
const STRANGERS: &[(&str, &str)] =
    &[("identify", "diagnose"), ("gp", "regress"), ("gp", "model"), ("regress", "model")];

fn layer(module: &str) -> Option<u8> {
    LAYERS.iter().find(|(_, names)| names.contains(&module)).map(|(layer, _)| *layer)
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The modules that `crate::` paths of a source name, also those in braces: `use crate::{data, error::Error}`.
fn imports(source: &str) -> Vec<String> {
    let identifier =
        |text: &str| -> String { text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect() };
    let mut found = Vec::new();
    let code = source.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    for (start, _) in code.match_indices("crate::") {
        let before = code[..start].chars().next_back();
        if before.is_some_and(|c| c == '$' || c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[start + "crate::".len()..];
        let Some(inside) = rest.strip_prefix('{') else {
            found.push(identifier(rest));
            continue;
        };
        let (mut depth, mut item) = (0, String::new());
        for character in inside.chars() {
            match character {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => found.push(identifier(&std::mem::take(&mut item))),
                _ => {}
            }
            if !(character == ',' && depth == 0) {
                item.push(character);
            }
        }
        found.push(identifier(&item));
    }
    found.retain(|name| !name.is_empty());
    found
}

/// Module of each name that `lib.rs` shows: `pub use data::{Channel, Run};` gives `Channel -> data`.
fn face(lib: &str) -> Vec<(String, String)> {
    let mut shown = Vec::new();
    for statement in lib.split(';') {
        let Some((_, path)) = statement.split_once("pub use ") else { continue };
        let Some((module, names)) = path.split_once("::") else { continue };
        for name in names.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|n| !n.is_empty()) {
            shown.push((name.to_string(), module.trim().to_string()));
        }
    }
    shown
}

#[test]
fn nothing_in_the_core_imports_upward() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../gpsindy-core/src");
    let face = face(&std::fs::read_to_string(root.join("lib.rs")).unwrap());
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut wrong = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&root).unwrap();
        let module = relative.iter().next().unwrap().to_string_lossy().trim_end_matches(".rs").to_string();
        if module == "lib" {
            continue;
        }
        let Some(own) = layer(&module) else {
            wrong.push(format!(
                "{}: module `{module}` has no layer; add it to tests/layers.rs and docs/architecture.md",
                relative.display()
            ));
            continue;
        };
        for import in imports(&std::fs::read_to_string(&file).unwrap()) {
            // A name that lib.rs shows (`crate::Error`) counts as its module's.
            let import = face.iter().find(|(name, _)| *name == import).map_or(import, |(_, module)| module.clone());
            let Some(other) = layer(&import) else {
                wrong.push(format!("{}: `crate::{import}` stands in no layer", relative.display()));
                continue;
            };
            let strangers =
                STRANGERS.iter().any(|&(a, b)| (a, b) == (&module, &import) || (b, a) == (&module, &import));
            if other > own || strangers {
                wrong.push(format!("{}: layer {own} imports `{import}` of layer {other}", relative.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_upward_import_would_be_seen() {
    assert_eq!(imports("use crate::{data::Run, error::{Error, Result}, gp};"), ["data", "error", "gp"]);
    assert_eq!(imports("fn f() -> crate::identify::X {}"), ["identify"]);
    assert!(imports("// crate::identify\n$crate::x").is_empty());
}
