//! The pages whose blocks a reader may copy, and their run.

use crate::files::{files, read};
use crate::shell::{complain, root, run};
use crate::snippets::{Tools, blocks, run_page};
use std::path::{Path, PathBuf};

/// The gallery, whose pages keep what they print.
const GALLERY: &str = "docs/gallery";

/// Runs the blocks of all pages but the gallery's, or of the one that is `only`, in folders that have the files they name; see
/// `xtask/site/given.py`.
pub(crate) fn run_all(only: Option<&str>, tools: &Tools) -> Result<(), String> {
    let given = root().join("target/site/given");
    if given.exists() {
        std::fs::remove_dir_all(&given).map_err(|e| format!("{}: {e}", given.display()))?;
    }
    std::fs::create_dir_all(&given).map_err(|e| format!("{}: {e}", given.display()))?;
    run(&tools.python, ["xtask/site/given.py", &given.to_string_lossy()], &[])?;
    // A page that fails does not keep the others from running: one run finds all that is wrong.
    all_of(chosen(only)?.iter().map(|page| {
        let name = page.strip_prefix(root()).unwrap_or(page).with_extension("");
        run_page(page, &name.to_string_lossy(), Some(&given), tools).map(|_| ())
    }))
}

/// Every outcome, and the errors of all that failed as one.
pub(crate) fn all_of(outcomes: impl Iterator<Item = Result<(), String>>) -> Result<(), String> {
    let failed: Vec<String> = outcomes.filter_map(Result::err).inspect(|error| complain(error)).collect();
    match failed.len() {
        0 => Ok(()),
        1 => Err(failed.join("")),
        n => Err(format!("{n} pages failed:\n\n{}", failed.join("\n\n"))),
    }
}

/// The pages with a block that is run; an error where `only` is none of them.
fn chosen(only: Option<&str>) -> Result<Vec<PathBuf>, String> {
    // Pages of experiments and benchmarks are not among them: their commands take hours.
    let mut pages = vec![root().join("README.md")];
    pages.extend(files(&root().join("crates"), "md")?.into_iter().filter(|page| page.ends_with("README.md")));
    pages.extend(files(&root().join("docs"), "md")?);
    let mut chosen = Vec::new();
    for page in pages.into_iter().filter(|page| !page.starts_with(root().join(GALLERY))) {
        if only.is_none_or(|only| page == root().join(only)) && has_blocks(&page)? {
            chosen.push(page);
        }
    }
    match only {
        Some(only) if chosen.is_empty() => {
            Err(format!("`{only}` is no page with a block to run; pages of the gallery: `cargo xtask gallery`"))
        }
        _ => Ok(chosen),
    }
}

fn has_blocks(page: &Path) -> Result<bool, String> {
    Ok(blocks(&read(page)?).next().is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_pages_run_although_one_fails() {
        let mut ran = 0;
        let outcomes = [Err("a"), Ok(()), Err("b")].into_iter().map(|outcome: Result<(), &str>| {
            ran += 1;
            outcome.map_err(str::to_string)
        });
        assert_eq!(all_of(outcomes), Err("2 pages failed:\n\na\n\nb".into()));
        assert_eq!(ran, 3);
        assert_eq!(all_of([Ok(()), Ok(())].into_iter()), Ok(()));
    }

    #[test]
    fn the_pages_that_run_are_those_with_blocks_outside_the_gallery() {
        let all = chosen(None).unwrap();
        let has = |page: &str| all.contains(&root().join(page));
        assert!(has("README.md") && has("docs/simulators/mujoco.md") && has("crates/gpsindy-py/README.md"), "{all:?}");
        assert!(!has("docs/gallery/arm.md") && !has("docs/method.md"), "{all:?}");
        assert_eq!(chosen(Some("docs/logs/csv.md")).unwrap(), [root().join("docs/logs/csv.md")]);
        assert!(chosen(Some("docs/method.md")).unwrap_err().contains("is no page with a block to run"));
    }
}
