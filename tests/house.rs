//! The house stays one in which a stranger finds the way: folders of few files, files of one screenful of ideas, and an effect that is
//! one file and one line.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Sources of a folder, at most: more get floors of their own.
const MOST_FILES: usize = 20;

/// Lines of a source, at most.
const MOST_LINES: usize = 400;

/// Longer ones, and why.
const LONG: [(&str, &str); 2] = [
    (
        "crates/gpsindy-py/python/gpsindy/identifying/estimator.py",
        "one class, of which a third is the table of its settings",
    ),
    (
        "crates/gpsindy-core/src/diagnose/steps/attribution/forcing/account.rs",
        "one account, whose climb would have to know it, and it the climb",
    ),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Sources of Rust and Python below a folder.
fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs" || e == "py") {
            found.push(path);
        }
    }
}

/// Folders with too many sources, and sources that are too long.
fn crowded(sources: &[(String, usize)]) -> Vec<String> {
    let mut folders = BTreeMap::<&str, usize>::new();
    for (file, _) in sources {
        *folders.entry(file.rsplit_once('/').map_or("", |(folder, _)| folder)).or_default() += 1;
    }
    let folders = folders.iter().filter(|(_, count)| **count > MOST_FILES);
    let folders = folders.map(|(folder, count)| format!("{folder} has {count} files; give it floors"));
    let long = sources.iter().filter(|(_, lines)| *lines > MOST_LINES);
    folders.chain(long.map(|(file, lines)| format!("{file} has {lines} lines; split it by noun"))).collect()
}

#[test]
fn no_folder_is_crowded_and_no_file_is_long() {
    let mut files = Vec::new();
    ["crates", "tests", "xtask"].iter().for_each(|folder| collect(&root().join(folder), &mut files));
    let named = |path: &PathBuf| {
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        (name, std::fs::read_to_string(path).unwrap().lines().count())
    };
    let is_known = |file: &str| LONG.iter().any(|(known, why)| *known == file && !why.is_empty());
    let sources: Vec<(String, usize)> = files.iter().map(named).filter(|(file, _)| !is_known(file)).collect();
    assert!(sources.len() > 500);
    let wrong = crowded(&sources);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_effect_is_one_file_and_one_line() {
    let catalogue = root().join("crates/gpsindy-core/src/diagnose/catalogue");
    let list = std::fs::read_to_string(catalogue.join("list.rs")).unwrap();
    let mut files = Vec::new();
    collect(&catalogue.join("effects"), &mut files);
    let named =
        |path: &PathBuf| path.strip_prefix(catalogue.join("effects")).unwrap().to_string_lossy().replace('\\', "/");
    let effects: Vec<String> = files.iter().map(named).filter(|file| file != "mod.rs").collect();
    assert!(effects.len() > 40);
    for file in &effects {
        assert_eq!(list.matches(&format!("\"{file}\"")).count(), 1, "{file} is no line of list.rs");
    }
    assert_eq!(list.matches(".rs\"").count(), effects.len());
    // What makes an effect known is in no other place: the folder's own file names none.
    let folder = std::fs::read_to_string(catalogue.join("effects/mod.rs")).unwrap();
    let id = |file: &String| file.rsplit('/').next().unwrap().trim_end_matches(".rs").to_string();
    assert!(effects.iter().all(|file| !folder.contains(&id(file))));
}

#[test]
fn a_crowded_folder_and_a_long_file_would_be_seen() {
    let few: Vec<(String, usize)> = (0..MOST_FILES).map(|i| (format!("a/b{i}.rs"), MOST_LINES)).collect();
    assert!(crowded(&few).is_empty());
    let more = [few.clone(), vec![("a/more.rs".into(), 1)]].concat();
    assert_eq!(crowded(&more), ["a has 21 files; give it floors"]);
    let long = [few, vec![("c/long.rs".into(), MOST_LINES + 1)]].concat();
    assert_eq!(crowded(&long), ["c/long.rs has 401 lines; split it by noun"]);
}
