//! The site of the documentation: pages of docs/, references made from the program, formulas as MathML, links checked.
//!
//! Zensical builds it: pages stay plain Markdown, search works without a server, and one wheel from the package index is all it needs.

use crate::files::{copy, files, read, write};
use crate::shell::{complain, root, run};
use crate::snippets::{Tools, run_page};
use crate::{gallery, python};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// What builds the site, beside what tests the Python package.
const BUILDERS: [&str; 3] = ["zensical==0.0.*", "latex2mathml>=3.77", "griffe2md>=1.2"];

/// Pages and folders of pages whose blocks are run, from the root of the repository. The gallery is run apart.
const RUN: [&str; 8] = [
    "README.md",
    "crates/gpsindy-cli/README.md",
    "crates/gpsindy-py/README.md",
    "docs/formats.md",
    "docs/effects/README.md",
    "docs/start",
    "docs/logs",
    "docs/simulators.md",
];

/// Writes `docs/effects` from the catalogue.
pub(crate) fn effects() -> Result<(), String> {
    // Built with all packages at once, for the same reason as below.
    run(
        "cargo",
        "build --release --workspace --exclude gpsindy-benches --exclude gpsindy-py --example effects".split(' '),
        &[],
    )?;
    let program = root().join("target/release/examples").join(format!("effects{}", std::env::consts::EXE_SUFFIX));
    run(program, ["docs/effects", "docs/gallery"], &[])
}

/// Runs the gallery and keeps in `docs/gallery` what comes out.
pub(crate) fn write_gallery(only: Option<&str>) -> Result<(), String> {
    gallery::write_all(only, &tools()?)
}

/// Builds `target/site/public` and checks its links. The blocks of the pages are run first.
pub(crate) fn build() -> Result<(), String> {
    let site = root().join("target/site");
    let pages = site.join("docs");
    if pages.exists() {
        std::fs::remove_dir_all(&pages).map_err(|e| format!("{}: {e}", pages.display()))?;
    }
    copy(&root().join("docs"), &pages)?;
    let tools = tools()?;
    let python = &tools.python;
    write(&pages.join("reference/cli.md"), &commands(&tools.gpsindy)?)?;
    let reference = pages.join("reference/python.md");
    let source = "crates/gpsindy-py/python";
    run(python, ["xtask/site/reference.py", source, &reference.to_string_lossy()], &[])?;
    run_blocks(&tools)?;
    gallery::run(&pages.join("gallery"), None, &tools, true)?;
    write(&pages.join("llms.txt"), &overview(&pages)?)?;
    let settings = pages.join("zensical.toml");
    std::fs::rename(&settings, site.join("zensical.toml")).map_err(|e| format!("{}: {e}", settings.display()))?;
    let plain = site.join("plain");
    if plain.exists() {
        std::fs::remove_dir_all(&plain).map_err(|e| format!("{}: {e}", plain.display()))?;
    }
    copy(&pages, &plain)?;
    run(python, ["xtask/site/formulas.py", &pages.to_string_lossy()], &[])?;
    let built = Command::new(python).args(["-m", "zensical", "build", "--clean"]).current_dir(&site).status();
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

/// The program, the libraries that Rust blocks link, and a Python with the wheel of this tree.
fn tools() -> Result<Tools, String> {
    // With all packages at once: other features of a dependency would build it anew. The extension module is built with its wheel.
    run("cargo", "build --release --workspace --exclude gpsindy-benches --exclude gpsindy-py".split(' '), &[])?;
    let gpsindy = root().join("target/release").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX));
    Ok(Tools { gpsindy, python: python::environment(&BUILDERS)? })
}

/// Runs the blocks of the pages in folders that have the files they name; see `xtask/site/given.py`.
fn run_blocks(tools: &Tools) -> Result<(), String> {
    let given = root().join("target/site/given");
    if given.exists() {
        std::fs::remove_dir_all(&given).map_err(|e| format!("{}: {e}", given.display()))?;
    }
    std::fs::create_dir_all(&given).map_err(|e| format!("{}: {e}", given.display()))?;
    run(&tools.python, ["xtask/site/given.py", &given.to_string_lossy()], &[])?;
    for path in RUN.map(|path| root().join(path)) {
        let pages = if path.is_dir() { files(&path, "md")? } else { vec![path] };
        for page in pages {
            let name = page.strip_prefix(root()).unwrap_or(&page).with_extension("");
            run_page(&page, &name.to_string_lossy(), Some(&given), tools)?;
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

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
