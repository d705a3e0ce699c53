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
    if only.is_none() {
        let pages = everywhere()?;
        let pages = pages.iter().map(|page| page.to_string_lossy().into_owned());
        run(&tools.python, std::iter::once("xtask/site/configurations.py".to_string()).chain(pages), &[])?;
    }
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

/// All pages for users. Those of experiments and benchmarks are not among them: their commands take hours.
fn everywhere() -> Result<Vec<PathBuf>, String> {
    let mut pages = vec![root().join("README.md")];
    pages.extend(files(&root().join("crates"), "md")?.into_iter().filter(|page| page.ends_with("README.md")));
    pages.extend(files(&root().join("docs"), "md")?);
    Ok(pages)
}

/// The pages with a block that is run; an error where `only` is none of them.
fn chosen(only: Option<&str>) -> Result<Vec<PathBuf>, String> {
    let mut chosen = Vec::new();
    for page in everywhere()?.into_iter().filter(|page| !page.starts_with(root().join(GALLERY))) {
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

    #[test]
    fn the_first_screens_say_what_comes_back_for_which_simulator() {
        for page in ["README.md", "docs/index.md", "docs/start/robot.md", "crates/gpsindy-py/README.md"] {
            let text = read(&root().join(page)).unwrap();
            let first: Vec<&str> = text.lines().take(46).collect();
            let row =
                |command: &str, back: &str| first.iter().any(|line| line.contains(command) && line.contains(back));
            assert!(row("gpsindy diagnose robot.xml run_*.csv", "`augmented.xml`"), "{page}: MuJoCo");
            assert!(row("gpsindy diagnose plant.fmu run_*.csv", "`augmented.ssv`"), "{page}: FMU");
        }
    }

    /// Figures of the README's "Measured" table that results.md must have, so that one of them is not of an older version.
    #[test]
    fn what_the_readme_says_was_measured_is_in_the_results() {
        let (readme, results) =
            (read(&root().join("README.md")).unwrap(), read(&root().join("docs/results.md")).unwrap());
        let measured = readme.split("## Measured").nth(1).unwrap().split("\n## ").next().unwrap();
        for (label, machines) in [("unseen", "unseen machines"), ("run again", "drawn machines")] {
            let rows = results.lines().filter(|line| line.starts_with(&format!("| {label} |")));
            let cells: Vec<Vec<u32>> =
                rows.map(|line| line.split('|').filter_map(|cell| cell.trim().parse().ok()).collect()).collect();
            let sum = |column: usize| cells.iter().map(|row| row[column]).sum::<u32>();
            for stated in [format!("[{} {machines}]", sum(0)), format!("verdict right in {}", sum(1))] {
                assert!(measured.contains(&stated), "{stated}");
            }
        }
        for (stated, found) in [
            ("120 of 124 right", "120 of 124 are right"),
            ("55 of 59 right", "55 of 59 causes stated with 0.9 or more"),
            (
                "in 17 cases by ones that miss the held-out logs",
                "By the last column 17 of the 120 are explained wrongly",
            ),
            ("0.1499981 N m (0.1499938 to 0.1500024)", "0.1499981 N m (0.1499938 to 0.1500024)"),
            ("93.7 %", "93.7 %"),
            ("71.4 %", "71.4 %"),
            ("40 named with the right size", "40 named with the right size"),
        ] {
            assert!(measured.contains(stated) && results.contains(found), "{stated}");
        }
    }

    #[test]
    fn pages_and_comments_use_the_words_of_the_glossary() {
        let mut pages = files(&root().join("docs"), "md").unwrap();
        pages.extend(["README.md", "CHANGELOG.md"].map(|page| root().join(page)));
        for page in pages.iter().filter(|page| !page.ends_with("notation.md")) {
            assert_eq!(avoided(&read(page).unwrap()), None, "{}", page.display());
        }
        for source in files(&root().join("crates"), "rs").unwrap() {
            let text = read(&source).unwrap();
            let comments = text.lines().map(str::trim_start).filter(|line| line.starts_with("//"));
            assert_eq!(avoided(&comments.collect::<Vec<_>>().join("\n")), None, "{}", source.display());
        }
    }

    /// A word of the house that a reader does not know, where the text has one.
    fn avoided(text: &str) -> Option<&'static str> {
        let words: Vec<&str> = text.split(|c: char| !c.is_alphabetic()).collect();
        let found = ["told", "tell", "tells", "parted", "bears"].into_iter().find(|word| words.contains(word));
        found.or_else(|| text.contains("by itself").then_some("by itself"))
    }

    /// GitHub nests a list that is indented by three, the site's Markdown only one that is indented by four.
    #[test]
    fn nested_lists_are_nested_on_the_site_too() {
        for page in files(&root().join("docs"), "md").unwrap() {
            let text = read(&page).unwrap();
            let prose = text.split("```").step_by(2).flat_map(str::lines);
            let shallow = |line: &&str| line.starts_with("- ") || line.starts_with("* ");
            let found = prose
                .map(|line| (line, line.trim_start()))
                .find(|(line, item)| (1..4).contains(&(line.len() - item.len())) && shallow(item));
            assert!(found.is_none(), "{}: {found:?}", page.display());
        }
    }
}
