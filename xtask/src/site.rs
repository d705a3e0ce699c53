//! The site of the documentation: pages of docs/, references made from the program, formulas as MathML, links checked.
//!
//! Zensical builds it: pages stay plain Markdown, search works without a server, and one wheel from the package index is all it needs.

use crate::python;
use crate::shell::{complain, root, run};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What builds the site, beside what tests the Python package.
const BUILDERS: [&str; 3] = ["zensical==0.0.*", "latex2mathml>=3.77", "griffe2md>=1.2"];

/// Folders of pages whose `sh` and `python` blocks are run.
const RUN: [&str; 3] = ["start", "logs", "gallery"];

/// Writes `docs/effects` from the catalogue.
pub(crate) fn effects() -> Result<(), String> {
    // Built with all packages at once, for the same reason as below.
    run("cargo", "build --release --workspace --exclude gpsindy-py --example effects".split(' '), &[])?;
    let program = root().join("target/release/examples").join(format!("effects{}", std::env::consts::EXE_SUFFIX));
    run(program, ["docs/effects"], &[])
}

/// Builds `target/site/public` and checks its links; with `snippets` the commands and programs of the pages are run first.
pub(crate) fn build(snippets: bool) -> Result<(), String> {
    let site = root().join("target/site");
    let pages = site.join("docs");
    if pages.exists() {
        std::fs::remove_dir_all(&pages).map_err(|e| format!("{}: {e}", pages.display()))?;
    }
    copy(&root().join("docs"), &pages)?;
    // With all packages at once, as everything else here is built: other features of a dependency would build it anew.
    run("cargo", "build --release --workspace --exclude gpsindy-py --bins".split(' '), &[])?;
    let program = root().join("target/release").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX));
    let python = python::environment(&BUILDERS)?;
    write(&pages.join("reference/cli.md"), &commands(&program)?)?;
    let reference = pages.join("reference/python.md");
    let source = "crates/gpsindy-py/python";
    run(&python, ["xtask/site/reference.py", source, &reference.to_string_lossy()], &[])?;
    if snippets {
        for folder in RUN.map(|name| pages.join(name)).iter().filter(|folder| folder.exists()) {
            run_snippets(folder, &program, &python)?;
        }
    }
    write(&pages.join("llms.txt"), &overview(&pages)?)?;
    let settings = pages.join("zensical.toml");
    std::fs::rename(&settings, site.join("zensical.toml")).map_err(|e| format!("{}: {e}", settings.display()))?;
    let plain = site.join("plain");
    if plain.exists() {
        std::fs::remove_dir_all(&plain).map_err(|e| format!("{}: {e}", plain.display()))?;
    }
    copy(&pages, &plain)?;
    run(&python, ["xtask/site/formulas.py", &pages.to_string_lossy()], &[])?;
    let built = Command::new(&python).args(["-m", "zensical", "build", "--clean"]).current_dir(&site).status();
    if !built.map_err(|e| format!("zensical: {e}"))?.success() {
        return Err("zensical did not build the site".into());
    }
    let public = site.join("public");
    check_links(&public)?;
    // Readers that are programs take the pages as they were written; llms.txt lists them.
    for page in files(&plain, "md")? {
        let name = page.strip_prefix(&plain).unwrap_or(&page);
        copy(&page, &public.join(name))?;
    }
    complain(&format!("site: {}", public.join("index.html").display()));
    Ok(())
}

/// One page with the help of every command.
fn commands(program: &Path) -> Result<String, String> {
    let help = |arguments: &[&str]| {
        let ran = Command::new(program).args(arguments).arg("--help").output();
        ran.map(|r| String::from_utf8_lossy(&r.stdout).into_owned()).map_err(|e| format!("{}: {e}", program.display()))
    };
    let all = help(&[])?;
    let mut page = format!("# Commands\n\nMade from the program itself.\n\n```text\n{all}```\n");
    // The list of commands stands between its heading and the next empty line.
    let list = all.split("Commands:").nth(1).unwrap_or_default();
    for line in list.lines().skip(1).take_while(|line| !line.trim().is_empty()) {
        let Some(name) = line.strip_prefix("  ").filter(|l| !l.starts_with(' ')).and_then(|l| l.split(' ').next())
        else {
            continue;
        };
        if name != "help" {
            let _ = write!(page, "\n## gpsindy {name}\n\n```text\n{}```\n", help(&[name])?);
        }
    }
    Ok(page)
}

/// `llms.txt`: the pages with their first sentences.
fn overview(pages: &Path) -> Result<String, String> {
    let mut text = String::from(
        "# gpsindy\n\n> Equations from sparse, noisy logs, and a diagnosis of where a simulator is wrong.\n\n",
    );
    for page in files(pages, "md")? {
        let content = read(&page)?;
        let title = content.lines().find_map(|l| l.strip_prefix("# ")).unwrap_or("");
        let first = content.lines().find(|l| l.starts_with(|c: char| c.is_alphabetic())).unwrap_or("");
        let path = page.strip_prefix(pages).unwrap_or(&page).to_string_lossy().replace('\\', "/");
        let _ = writeln!(text, "- [{title}]({path}): {first}");
    }
    Ok(text)
}

/// Runs the `sh` and `python` blocks of each page in a folder that holds the repository's data, in order; one that fails is an error.
fn run_snippets(folder: &Path, program: &Path, python: &Path) -> Result<(), String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let own = [program, python].into_iter().filter_map(Path::parent).map(Path::to_path_buf);
    let path = std::env::join_paths(own.chain(std::env::split_paths(&path))).map_err(|e| e.to_string())?;
    for page in files(folder, "md")? {
        let name = page.strip_prefix(root().join("target/site/docs")).unwrap_or(&page).with_extension("");
        let work = root().join("target/site/snippets").join(name);
        if work.exists() {
            std::fs::remove_dir_all(&work).map_err(|e| format!("{}: {e}", work.display()))?;
        }
        copy(&root().join("data"), &work.join("data"))?;
        let text = read(&page)?;
        for (language, block) in &steps(&text) {
            complain(&format!("\n$ {}", block.trim()));
            let mut command = if *language == "sh" { Command::new("sh") } else { Command::new(python) };
            command.args([if *language == "sh" { "-ec" } else { "-c" }, block]);
            let ran = command.current_dir(&work).env("PATH", &path).output().map_err(|e| format!("{language}: {e}"))?;
            if !ran.status.success() {
                return Err(format!("{}: {block}{}", page.display(), String::from_utf8_lossy(&ran.stderr)));
            }
        }
        // The pictures that a page makes stand beside it, and so does its program.
        for picture in std::fs::read_dir(&work).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if let (Some("svg"), Some(name)) = (picture.extension().and_then(|e| e.to_str()), picture.file_name()) {
                copy(&picture, &folder.join(name))?;
            }
        }
        let program: Vec<&str> = blocks(&text).filter(|(l, _)| *l == "python").map(|(_, block)| block).collect();
        if !program.is_empty() {
            write(&page.with_extension("py"), &program.join("\n"))?;
        }
    }
    Ok(())
}

/// What a page runs, in order: Python blocks that follow each other are one program, since they share their variables.
fn steps(text: &str) -> Vec<(&str, String)> {
    let mut steps: Vec<(&str, String)> = Vec::new();
    for (language, block) in blocks(text) {
        match steps.last_mut() {
            Some((last, program)) if language == "python" && *last == language => {
                program.push('\n');
                program.push_str(block);
            }
            _ => steps.push((language, block.into())),
        }
    }
    steps
}

/// The fenced blocks of a page in `sh` and `python`, in order. Those in `console` are shown and not run.
fn blocks(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|block| block.split_once('\n'))
        .filter(|(l, _)| ["sh", "python"].contains(l))
}

/// Every link of a page to a file of the site must lead to one, and to a heading of it where it names one.
fn check_links(public: &Path) -> Result<(), String> {
    let mut broken = String::new();
    for page in files(public, "html")? {
        let text = read(&page)?;
        for link in ["href=\"", "src=\""].iter().flat_map(|mark| text.split(*mark).skip(1)) {
            let link = link.split('"').next().unwrap_or_default();
            let (target, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = target.split('?').next().unwrap_or_default();
            // The error page alone is written for the root of a server.
            if target.contains(':') || target.starts_with('/') {
                continue;
            }
            let mut path = if target.is_empty() { page.clone() } else { page.parent().unwrap_or(public).join(target) };
            if path.is_dir() {
                path = path.join("index.html");
            }
            let is_page = path.extension().is_some_and(|e| e == "html");
            let known = || read(&path).is_ok_and(|text| text.contains(&format!("id=\"{heading}\"")));
            if !path.exists() || is_page && !heading.is_empty() && !known() {
                let _ = writeln!(broken, "{}: {link}", page.strip_prefix(public).unwrap_or(&page).display());
            }
        }
    }
    if broken.is_empty() { Ok(()) } else { Err(format!("links that lead nowhere:\n{broken}")) }
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Files with an ending below a folder, sorted.
fn files(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))? {
        let path = entry.map_err(|e| e.to_string())?.path();
        if path.is_dir() {
            found.extend(files(&path, ending)?);
        } else if path.extension().is_some_and(|e| e == ending) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Copies a file or a whole folder.
fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", from.display());
    if from.is_dir() {
        std::fs::create_dir_all(to).map_err(failed)?;
        for entry in std::fs::read_dir(from).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    std::fs::copy(from, to).map(|_| ()).map_err(failed)
}

/// Writes a text, with the folders that it needs.
fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().unwrap_or(path);
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_run_are_those_of_a_shell_and_of_python() {
        let page = "```sh\na\n```\ntext\n```console\nb\n```\n```python\nc\nd\n```\n";
        assert_eq!(blocks(page).collect::<Vec<_>>(), [("sh", "a\n"), ("python", "c\nd\n")]);
        let split = "```python\na\n```\ntext\n```python\nb\n```\n```sh\nc\n```\n```sh\nd\n```\n```python\ne\n```\n";
        let expected = [("python", "a\n\nb\n"), ("sh", "c\n"), ("sh", "d\n"), ("python", "e\n")];
        assert_eq!(steps(split).iter().map(|(l, t)| (*l, t.as_str())).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_link_without_a_target_is_told() {
        let public = root().join("target/site-test");
        write(&public.join("index.html"), "<a href=\"other/#there\"></a><h1 id=\"here\"></h1>").unwrap();
        write(&public.join("other/index.html"), "<h1 id=\"there\"></h1><a href=\"../#here\"></a>").unwrap();
        check_links(&public).unwrap();
        write(&public.join("other/index.html"), "<a href=\"../#gone\"></a><img src=\"none.svg\">").unwrap();
        let told = check_links(&public).unwrap_err();
        assert!(
            told.contains("index.html: other/#there") && told.contains("../#gone") && told.contains("none.svg"),
            "{told}"
        );
        std::fs::remove_dir_all(&public).unwrap();
    }
}
