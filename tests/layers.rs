//! The import direction of docs/architecture.md: in `gpsindy-core` an arrow is only ever drawn downward, from module to
//! module, and inside the diagnosis from floor to floor; nowhere do imports lead back to where they started.
#![allow(clippy::unwrap_used)]

#[path = "layers/imports.rs"]
mod imports;

use imports::{Arrows, Sources, circle, leaves};
use std::path::Path;

/// Top-level modules of the core and the layer of each.
const LAYERS: &[(u8, &[&str])] = &[
    (1, &["data", "error", "excitation", "progress", "parallel", "random", "expression", "optimise"]),
    (2, &["excerpt", "gp", "regress", "library", "model"]),
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
            &["power", "design", "conformal"],
            &["mod", "fixture"],
        ],
    ),
    (
        "identify",
        &[
            &["limits", "notes", "outlook", "settings", "result", "names", "equations", "evidence"],
            &["excerpt", "prepare"],
            &["algorithm1"],
            &["velocities", "report"],
            &["support"],
            &["online", "author"],
            &["mod", "tests"],
        ],
    ),
];

/// The rooms of the steps.
const ROOMS: [&str; 3] = ["logs", "attribution", "verdict"];

/// Steps that other steps may know: what they build on, and what they pass on.
const SHARED_STEPS: &[&str] =
    &["contest", "findings", "noise", "prepare", "round", "sampled", "screen", "survey", "suspects", "windows"];

/// Steps that are parts of another one, which alone may know them.
const PARTS: &[(&str, &[&str])] = &[
    ("round", &["moves"]),
    ("moves", &["contained", "gross"]),
    ("screen", &["pairs"]),
    ("places", &["contained"]),
    ("prepare", &["affordable", "check"]),
    ("attribute", &["search", "simplify", "settle", "places", "detect", "moves"]),
    ("settle", &["lengthen", "simplify", "detect"]),
    ("search", &["lengthen", "moves", "simplify"]),
    ("simplify", &["detect"]),
    ("hold", &["attribute", "detect"]),
    ("verify", &["curves", "floor", "own_size", "spread", "start"]),
    ("spread", &["start"]),
    ("floor", &["start", "verify"]),
    ("causes", &["stability"]),
    ("stability", &["between"]),
    ("checks", &["stability", "typicality", "verify"]),
    ("weigh", &["augment", "causes", "checks", "curves", "localise", "stability", "typicality", "verify"]),
];

/// Folders of crates, each with `""` for all of it, in which no imports lead back to where they started.
const WITHOUT_CIRCLES: &[(&str, &[&str])] = &[
    (
        "gpsindy-core",
        &[
            "diagnose",
            "identify",
            "refine",
            "gp",
            "regress",
            "library",
            "clock",
            "simulate",
            "expression",
            "fleet",
            "optimise",
        ],
    ),
    ("gpsindy-files", &[""]),
    ("gpsindy-report", &[""]),
    ("gpsindy-fleet", &[""]),
    ("gpsindy-py", &[""]),
];

fn layer(module: &str) -> Option<u8> {
    LAYERS.iter().find(|(_, names)| names.contains(&module)).map(|(layer, _)| *layer)
}

/// The sources of one crate, by its folder in `crates`.
fn sources(krate: &str) -> Sources {
    Sources::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(krate).join("src"))
}

/// The top-level module of a file.
fn top(file: &str) -> &str {
    file.split('/').next().unwrap_or_default()
}

/// What is wrong with arrows between top-level modules.
fn upward(arrows: &Arrows) -> Vec<String> {
    let mut wrong = Vec::new();
    for (file, imports) in arrows.iter().filter(|(file, _)| file != "lib") {
        let module = top(file);
        let Some(own) = layer(module) else {
            wrong.push(format!(
                "{file}: module `{module}` has no layer; add it to tests/layers.rs and docs/architecture.md"
            ));
            continue;
        };
        for import in imports {
            let Some(other) = layer(top(import)) else {
                wrong.push(format!("{file}: imports `{import}`, which is on no layer"));
                continue;
            };
            let strangers = |&(a, b): &(&str, &str)| (a, b) == (module, top(import)) || (b, a) == (module, top(import));
            if other > own || STRANGERS.iter().any(strangers) {
                wrong.push(format!("{file}: layer {own} imports `{import}` of layer {other}"));
            }
        }
    }
    wrong
}

#[test]
fn nothing_in_the_core_imports_upward() {
    let wrong = upward(&sources("gpsindy-core").arrows());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The floor of a file; the body where it is on none.
fn floor(floors: &[&[&str]], file: &str) -> usize {
    floors.iter().position(|names| names.contains(&top(file))).unwrap_or(floors.len())
}

/// Arrows that point to a higher floor.
fn climbing(floors: &[&[&str]], arrows: &Arrows) -> Vec<String> {
    let of = |(file, imports): &(String, Vec<String>)| {
        let up = imports.iter().filter(|import| floor(floors, import) > floor(floors, file));
        up.map(|import| format!("{file} imports {import} of a higher floor")).collect::<Vec<_>>()
    };
    arrows.iter().flat_map(of).collect()
}

#[test]
fn inside_a_method_arrows_point_to_lower_floors() {
    let core = sources("gpsindy-core");
    for (method, floors) in FLOORS {
        let climbing = climbing(floors, &core.arrows_in(method));
        assert!(climbing.is_empty(), "{method}:\n{}", climbing.join("\n"));
    }
}

#[test]
fn no_imports_lead_back_to_where_they_started() {
    let mut wrong = Vec::new();
    for (krate, folders) in WITHOUT_CIRCLES {
        let sources = sources(krate);
        for folder in *folders {
            let arrows = if folder.is_empty() { sources.arrows() } else { sources.arrows_in(folder) };
            assert!(arrows.len() > 1, "{krate}/{folder} has no sources");
            wrong.extend(circle(&arrows).map(|files| format!("{krate}/{folder}: {}", files.join(" -> "))));
        }
    }
    assert!(wrong.is_empty(), "imports lead back:\n{}", wrong.join("\n"));
}

#[test]
fn steps_know_no_others_but_the_stated_ones() {
    // A step is in a room; the files of its own folder are that step.
    let step = |file: &str| {
        let inside = file.strip_prefix("steps/")?;
        let step = ROOMS.iter().find_map(|room| inside.strip_prefix(room)?.strip_prefix('/')).unwrap_or(inside);
        step.split('/').next().map(str::to_string)
    };
    let mut wrong = Vec::new();
    for (file, imports) in sources("gpsindy-core").arrows_in("diagnose") {
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

/// Sources of a few lines.
fn written(files: &[(&str, &str)]) -> Sources {
    Sources::new(files.iter().map(|(name, text)| ((*name).to_string(), (*text).to_string())))
}

/// What one of several files imports.
fn of(arrows: &Arrows, file: &str) -> Vec<String> {
    arrows.iter().find(|(name, _)| name == file).map(|(_, imports)| imports.clone()).unwrap()
}

#[test]
fn an_upward_import_would_be_seen() {
    let core = written(&[
        ("lib", "pub use identify::Identify;"),
        ("data", "use crate::{error::{Error, Result}, gp};"),
        ("error", "fn f() -> crate::Identify {}"),
        ("gp/mod", "// crate::identify\n$crate::x"),
        ("identify/mod", "mod tests { use crate::gp; }"),
    ]);
    assert_eq!(of(&core.arrows(), "data"), ["error", "gp/mod"]);
    assert_eq!(of(&core.arrows(), "error"), ["identify/mod"]);
    assert_eq!(upward(&core.arrows()).len(), 2);
}

#[test]
fn paths_from_the_module_above_are_read() {
    let leaf = |tree: &str| leaves(tree).iter().map(|path| path.join("::")).collect::<Vec<_>>();
    assert_eq!(leaf("super::{a::B, c, d::{self, E}};"), ["super::a::B", "super::c", "super::d", "super::d::E"]);
    let gp = written(&[
        ("gp/mod", "pub(crate) use fit::{Fit, Settings as FitSettings};"),
        ("gp/fit", "use super::{Kernel, kernel::Role};"),
        ("gp/kernel/mod", "use super::Fit;"),
        ("gp/kernel/matern", "use super::super::fit::run;"),
    ]);
    let arrows = gp.arrows_in("gp");
    assert_eq!(of(&arrows, "fit"), ["kernel/mod", "mod"]);
    assert_eq!(of(&arrows, "kernel/mod"), ["fit"]);
    assert_eq!(of(&arrows, "kernel/matern"), ["fit"]);
    assert_eq!(circle(&arrows).unwrap().join(" "), "fit kernel/mod fit");
}

#[test]
fn an_arrow_between_floors_and_a_circle_would_be_seen() {
    let one = |file: &str, imports: &[&str]| (file.to_string(), imports.iter().map(|i| (*i).to_string()).collect());
    let floors: &[&[&str]] = &[&["low"], &["high"]];
    assert_eq!(climbing(floors, &vec![one("low/a", &["high/b"]), one("high/b", &["low/c"])]).len(), 1);
    let round = vec![one("a", &["b"]), one("b", &["c"]), one("c", &["a"])];
    assert_eq!(circle(&round).unwrap(), ["a", "b", "c", "a"]);
    assert!(circle(&vec![one("a", &["b", "c"]), one("b", &["c"]), one("c", &[])]).is_none());
}
