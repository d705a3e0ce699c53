//! The imports of a crate, read from its source: which file names which other one by a `crate::` or `super::` path.
//!
//! What a file takes from its own parts by a path from itself (`part::name` in the file that says `mod part;`) is no
//! arrow: a module and its parts are one noun. A part that knows the whole, and parts that know each other, are.

#[path = "sources.rs"]
mod sources;

use sources::{collect, without_tests};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One file of a crate, as `diagnose/steps/detect`, and the files that it imports, sorted.
pub(crate) type Arrows = Vec<(String, Vec<String>)>;

/// The sources of a crate by the paths of their modules.
pub(crate) struct Sources {
    files: BTreeMap<Vec<String>, Source>,
}

struct Source {
    /// The file without its ending, from the folder `src`.
    name: String,
    code: String,
    /// Names that this module shows, and where it takes each from.
    shown: Vec<(String, Vec<String>)>,
}

impl Sources {
    /// Every source below `root`, the folder `src` of a crate.
    pub(crate) fn read(root: &Path) -> Self {
        let mut paths = Vec::new();
        collect(root, &mut paths);
        let named = |path: &PathBuf| {
            let name = path.strip_prefix(root).unwrap().with_extension("").to_string_lossy().replace('\\', "/");
            (name, std::fs::read_to_string(path).unwrap())
        };
        Self::new(paths.iter().map(named))
    }

    /// Of names of files, as `gp/fit`, and what stands in them.
    pub(crate) fn new(files: impl IntoIterator<Item = (String, String)>) -> Self {
        // Files of tests may look anywhere, like tests at the end of a file.
        let files = files.into_iter().filter(|(name, _)| !name.split('/').any(|part| part == "tests"));
        let source = |(name, text): (String, String)| {
            let code = code(&text);
            let shown = shown(&code);
            (module(&name), Source { name, code, shown })
        };
        Self { files: files.map(source).collect() }
    }

    /// The arrows of all files.
    pub(crate) fn arrows(&self) -> Arrows {
        let of = |(module, source): (&Vec<String>, &Source)| {
            let mut found: Vec<String> =
                imported(&source.code, module).iter().filter_map(|path| self.file_of(path)).collect();
            found.retain(|other| *other != source.name);
            found.sort();
            found.dedup();
            (source.name.clone(), found)
        };
        self.files.iter().map(of).collect()
    }

    /// The arrows between the files of one folder, named from it: `steps/detect` in `diagnose`.
    pub(crate) fn arrows_in(&self, folder: &str) -> Arrows {
        let inside = |name: &str| {
            let rest = name.strip_prefix(folder)?;
            if rest.is_empty() { Some("mod".to_string()) } else { rest.strip_prefix('/').map(str::to_string) }
        };
        let all = self.arrows().into_iter();
        all.filter_map(|(file, imports)| Some((inside(&file)?, imports.iter().filter_map(|i| inside(i)).collect())))
            .collect()
    }

    /// The file that a path from the crate's root means: the module that it ends in, or the one that its last name is
    /// taken from where a module only shows it.
    fn file_of(&self, path: &[String]) -> Option<String> {
        let depth = (0..=path.len()).rev().find(|&depth| self.files.contains_key(&path[..depth]))?;
        let source = &self.files[&path[..depth]];
        let (Some(next), rest) = (path.get(depth), path.get(depth + 1..).unwrap_or_default()) else {
            return Some(source.name.clone());
        };
        let from = source.shown.iter().find(|(shown, _)| shown == next).map(|(_, from)| {
            let from = absolute(from, &path[..depth]);
            [from, rest.to_vec()].concat()
        });
        // A name that is shown from another crate is this module's own.
        from.filter(|from| from.len() > 1 && *from != path)
            .and_then(|from| {
                let first = from.first()?;
                self.files.keys().any(|module| module.first() == Some(first)).then(|| self.file_of(&from))?
            })
            .or_else(|| Some(source.name.clone()))
    }
}

/// The path of a file's module: `gp/mod` is `gp`, `lib` and `main` are the root.
fn module(name: &str) -> Vec<String> {
    let mut module: Vec<String> = name.split('/').map(str::to_string).collect();
    if matches!(module.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        module.pop();
    }
    module
}

/// What is compiled without tests: no line of comment, nothing from the tests at the end on, which may look anywhere.
fn code(text: &str) -> String {
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    without_tests(text).lines().filter(is_code).collect::<Vec<_>>().join("\n")
}

/// A path that a module writes, from the root: `super::a` in `gp::fit` is `gp::a`, and `a` without a start is its own.
fn absolute(path: &[String], module: &[String]) -> Vec<String> {
    match path.first().map(String::as_str) {
        Some("crate") => path[1..].to_vec(),
        Some("super") => {
            let up = path.iter().take_while(|name| *name == "super").count();
            [&module[..module.len().saturating_sub(up)], &path[up..]].concat()
        }
        Some("self") => [module, &path[1..]].concat(),
        _ => [module, path].concat(),
    }
}

/// Every path that starts with `crate` or `super`, from the root, item by item.
fn imported(code: &str, module: &[String]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            // A macro's `$crate`, a longer name, and the second `super` of two, which the first one has read.
            if before.is_some_and(|c| c == '$' || c == ':' || c.is_alphanumeric() || c == '_') {
                continue;
            }
            found.extend(leaves(&code[at..]).iter().map(|path| absolute(path, module)));
        }
    }
    found
}

/// The names that a module shows others, with the paths that it takes them from: `pub use fit::{Fit, run as fit};`.
fn shown(code: &str) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for start in ["pub use ", "pub(crate) use ", "pub(super) use "] {
        for (at, _) in code.match_indices(start) {
            let statement = code[at + start.len()..].split(';').next().unwrap_or_default();
            for path in leaves(statement) {
                if let Some(name) = path.last() {
                    found.push((name.clone(), path.clone()));
                }
            }
        }
    }
    found
}

/// The leaves of one tree of imports, up to where it ends: `a::{b::C, d}` gives `a::b::C` and `a::d`.
pub(crate) fn leaves(tree: &str) -> Vec<Vec<String>> {
    let name: String = tree.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let rest = &tree[name.len()..];
    if let Some(inside) = rest.strip_prefix("::").filter(|_| !name.is_empty()) {
        return leaves(inside).into_iter().map(|leaf| [vec![name.clone()], leaf].concat()).collect();
    }
    let Some(inside) = rest.strip_prefix('{').filter(|_| name.is_empty()) else {
        return vec![if name.is_empty() || name == "self" { Vec::new() } else { vec![name] }];
    };
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

/// A circle of imports, as the files from which they lead back to the first.
pub(crate) fn circle(arrows: &Arrows) -> Option<Vec<String>> {
    let next = |file: &str| arrows.iter().find(|(name, _)| name == file).map_or(&[][..], |(_, imports)| imports);
    arrows.iter().find_map(|(start, _)| {
        let mut reached: Vec<(String, Option<usize>)> = next(start).iter().map(|file| (file.clone(), None)).collect();
        let mut place = 0;
        while place < reached.len() {
            let here = reached[place].0.clone();
            if here == *start {
                let mut way = vec![here];
                let mut from = reached[place].1;
                while let Some(before) = from {
                    way.push(reached[before].0.clone());
                    from = reached[before].1;
                }
                way.push(start.clone());
                way.reverse();
                return Some(way);
            }
            for import in next(&here) {
                if !reached.iter().any(|(file, _)| file == import) {
                    reached.push((import.clone(), Some(place)));
                }
            }
            place += 1;
        }
        None
    })
}
