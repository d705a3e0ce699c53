//! The import direction of docs/architecture.md: in `gpsindy-core` an arrow is only ever drawn downward, from module to
//! module, and inside the diagnosis from floor to floor.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

/// Top-level modules of the core and the layer of each.
const LAYERS: &[(u8, &[&str])] = &[
    (1, &["data", "error", "excitation", "progress", "parallel", "expression", "optimise"]),
    (2, &["gp", "regress", "library", "model"]),
    (3, &["clock", "smooth", "differentiate", "refine", "simulate", "score", "systems"]),
    (4, &["identify", "diagnose"]),
    (5, &["paired", "fleet"]),
];

/// Modules that must not import each other although they share a layer.
const STRANGERS: &[(&str, &str)] =
    &[("identify", "diagnose"), ("gp", "regress"), ("gp", "model"), ("regress", "model")];

/// The floors of a method, lowest first: its folders, and the files next to them. What is on none is the body on top.
const FLOORS: &[(&str, &[&[&str]])] = &[
    (
        "diagnose",
        &[
            &["handed", "limits", "notes", "parts", "report"],
            &["run"],
            &["catalogue"],
            &["fit"],
            &["steps"],
            &["power", "design"],
            &["mod", "fixture"],
        ],
    ),
    (
        "identify",
        &[
            &["limits", "notes", "settings", "result", "names", "equations", "evidence"],
            &["excerpt", "prepare"],
            &["algorithm1"],
            &["velocities", "report"],
            &["support"],
            &["online", "author"],
            &["mod", "tests"],
        ],
    ),
];

/// Steps that other steps may know: what they build on, and what they pass on.
const SHARED_STEPS: &[&str] =
    &["contest", "findings", "noise", "prepare", "round", "screen", "survey", "suspects", "windows"];

/// Steps that are parts of another one, which alone may know them.
const PARTS: &[(&str, &[&str])] = &[
    ("round", &["moves"]),
    ("moves", &["contained"]),
    ("screen", &["pairs"]),
    ("places", &["contained"]),
    ("prepare", &["check"]),
    ("attribute", &["search", "simplify", "lengthen", "charge", "places", "detect"]),
    ("simplify", &["detect"]),
    ("hold", &["attribute", "detect"]),
    ("verify", &["curves", "floor", "spread", "start"]),
    ("spread", &["start"]),
    ("floor", &["start", "verify"]),
    ("causes", &["stability"]),
    ("stability", &["between"]),
    ("checks", &["stability", "typicality", "verify"]),
    ("weigh", &["augment", "causes", "checks", "curves", "localise", "stability", "typicality", "verify"]),
];

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

/// What `crate::<method>::` paths of a source name, part by part: `crate::diagnose::fit::{a::B, c}` gives `fit::a::B` and
/// `fit::c`. Tests at the end of a file may look anywhere.
fn paths(source: &str, method: &str) -> Vec<Vec<String>> {
    let code: String = source.split("mod tests {").next().unwrap_or_default().to_string();
    let code = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let start = format!("crate::{method}::");
    code.match_indices(&start).flat_map(|(at, _)| leaves(&code[at + start.len()..])).collect()
}

/// The leaves of one tree of imports, up to where it ends.
fn leaves(tree: &str) -> Vec<Vec<String>> {
    let name: String = tree.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let rest = &tree[name.len()..];
    if let Some(inside) = rest.strip_prefix("::").filter(|_| !name.is_empty()) {
        return leaves(inside).into_iter().map(|leaf| [vec![name.clone()], leaf].concat()).collect();
    }
    let Some(inside) = rest.strip_prefix('{').filter(|_| name.is_empty()) else { return vec![vec![name]] };
    let (mut depth, mut items) = (0, vec![String::new()]);
    for character in inside.chars() {
        match character {
            '}' if depth == 0 => break,
            ',' if depth == 0 => {
                items.push(String::new());
                continue;
            }
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        items.last_mut().unwrap().push(character);
    }
    items.iter().map(|item| item.trim()).filter(|item| !item.is_empty()).flat_map(leaves).collect()
}

/// One file of a method, as `steps/detect`, and the files that it imports.
type Arrows = Vec<(String, Vec<String>)>;

/// The arrows between the files of a method; what its `mod.rs` shows counts as the file's that it comes from.
fn arrows(method: &str) -> Arrows {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../gpsindy-core/src").join(method);
    let shown = face(&std::fs::read_to_string(root.join("mod.rs")).unwrap());
    let mut files = Vec::new();
    sources(&root, &mut files);
    let name =
        |file: &PathBuf| file.strip_prefix(&root).unwrap().with_extension("").to_string_lossy().replace('\\', "/");
    let names: Vec<String> = files.iter().map(name).collect();
    let file_of = |path: &[String]| -> String {
        let known = |candidate: &str| names.iter().find(|n| **n == candidate).cloned();
        let folder = known(&format!("{}/mod", path[0]));
        let inner = path.get(1).and_then(|second| known(&format!("{}/{second}", path[0])));
        let inner = inner.or_else(|| path.get(1).and_then(|second| known(&format!("{}/{second}/mod", path[0]))));
        let home = shown
            .iter()
            .find(|(shown, _)| *shown == path[0])
            .and_then(|(_, home)| known(home).or_else(|| known(&format!("{home}/mod"))));
        inner.or(folder).or_else(|| known(&path[0])).or(home).unwrap_or_else(|| "mod".into())
    };
    let imported = |file: &PathBuf| {
        let own = name(file);
        let source = std::fs::read_to_string(file).unwrap();
        let mut found: Vec<String> = paths(&source, method).iter().map(|path| file_of(path)).collect();
        found.retain(|other| *other != own);
        found.sort();
        found.dedup();
        (own, found)
    };
    files.iter().map(imported).collect()
}

/// The floor of a file; the body where it is on none.
fn floor(floors: &[&[&str]], file: &str) -> usize {
    let first = file.split('/').next().unwrap_or_default();
    floors.iter().position(|names| names.contains(&first)).unwrap_or(floors.len())
}

/// Arrows that point to a higher floor.
fn climbing(floors: &[&[&str]], arrows: &Arrows) -> Vec<String> {
    let of = |(file, imports): &(String, Vec<String>)| {
        let up = imports.iter().filter(|import| floor(floors, import) > floor(floors, file));
        up.map(|import| format!("{file} imports {import} of a higher floor")).collect::<Vec<_>>()
    };
    arrows.iter().flat_map(of).collect()
}

/// A file from which imports lead back to itself.
fn circle(arrows: &Arrows) -> Option<String> {
    let next = |file: &str| arrows.iter().find(|(name, _)| name == file).map_or(&[][..], |(_, imports)| imports);
    arrows.iter().map(|(file, _)| file).find_map(|start| {
        let mut reached: Vec<String> = next(start).to_vec();
        let mut place = 0;
        while place < reached.len() {
            for import in next(&reached[place]) {
                if !reached.contains(import) {
                    reached.push(import.clone());
                }
            }
            place += 1;
        }
        reached.contains(start).then(|| format!("{start}: its imports lead back to it"))
    })
}

#[test]
fn inside_a_method_arrows_point_to_lower_floors_and_never_in_a_circle() {
    for (method, floors) in FLOORS {
        let arrows = arrows(method);
        let climbing = climbing(floors, &arrows);
        assert!(climbing.is_empty(), "{method}:\n{}", climbing.join("\n"));
        assert_eq!(circle(&arrows), None, "{method}");
    }
}

#[test]
fn steps_know_no_others_but_the_stated_ones() {
    // The files of a step's own folder are that step.
    let step = |file: &str| file.strip_prefix("steps/")?.split('/').next().map(str::to_string);
    let mut wrong = Vec::new();
    for (file, imports) in arrows("diagnose") {
        let Some(own) = step(&file) else { continue };
        for other in imports.iter().filter_map(|import| step(import)) {
            let is_part = PARTS.iter().any(|(whole, parts)| *whole == own && parts.contains(&other.as_str()));
            if other != own && !is_part && !SHARED_STEPS.contains(&other.as_str()) {
                wrong.push(format!("step {own} knows step {other}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_arrow_between_floors_and_a_circle_would_be_seen() {
    let source = "use crate::diagnose::fit::{a::B, c};\nuse crate::diagnose::{Note, run::Run};\nmod tests { crate::diagnose::x }";
    let found: Vec<String> = paths(source, "diagnose").iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["fit::a::B", "fit::c", "Note", "run::Run"]);
    let one = |file: &str, imports: &[&str]| (file.to_string(), imports.iter().map(|i| (*i).to_string()).collect());
    let floors: &[&[&str]] = &[&["low"], &["high"]];
    assert_eq!(climbing(floors, &vec![one("low/a", &["high/b"]), one("high/b", &["low/c"])]).len(), 1);
    assert!(circle(&vec![one("a", &["b"]), one("b", &["c"]), one("c", &["a"])]).is_some());
    assert!(circle(&vec![one("a", &["b", "c"]), one("b", &["c"]), one("c", &[])]).is_none());
}
