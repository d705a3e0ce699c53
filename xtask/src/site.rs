//! The site of the documentation: pages of docs/, references made from the program, formulas as MathML, links checked.
//!
//! Zensical builds it: pages stay plain Markdown, search works without a server, and one wheel from the package index is all it needs.

use crate::files::{copy, files, read, write};
use crate::shell::{complain, root, run};
use crate::snippets::Tools;
use crate::tools::needs;
use crate::{gallery, pages, python};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What builds the site, besides what tests the Python package.
const BUILDERS: [&str; 3] = ["zensical==0.0.*", "latex2mathml>=3.77", "griffe2md>=1.2"];

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

/// Builds `target/site/public` and checks its links, then runs the blocks of the pages and builds it once more with what the gallery printed.
///
/// What takes seconds comes first: a link that leads nowhere ends it before a block is run. With `only` the blocks of that page are run and
/// nothing is built.
pub(crate) fn build(only: Option<&str>) -> Result<(), String> {
    let start = Instant::now();
    // One block of the pages builds an FMU.
    needs("cc", &["--version"], "apt-get install gcc, xcode-select --install, or another C compiler called cc")?;
    let tools = tools()?;
    if only.is_some() {
        return pages::run_all(only, &tools);
    }
    let own = root().join("target/site/pages");
    anew(&root().join("docs"), &own)?;
    write(&own.join("reference/cli.md"), &commands(&tools.gpsindy)?)?;
    let reference = own.join("reference/python.md");
    let source = "crates/gpsindy-py/python";
    run(&tools.python, ["xtask/site/reference.py", source, &reference.to_string_lossy()], &[])?;
    publish(&own, &tools)?;
    complain("the links are good; now every block of every page");
    let ran = [pages::run_all(None, &tools), gallery::run(&own.join("gallery"), None, &tools, true)];
    pages::all_of(ran.into_iter())?;
    let public = publish(&own, &tools)?;
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    complain(&format!("site: {}, in {minutes:.0} minutes", public.join("index.html").display()));
    Ok(())
}

/// The site of the pages in `own`: drawn by Zensical, its links checked, each page also as it was written.
fn publish(own: &Path, tools: &Tools) -> Result<PathBuf, String> {
    let site = root().join("target/site");
    write(&own.join("llms.txt"), &overview(own)?)?;
    // Formulas are replaced in a copy: `own` stays as it was written.
    let drawn = site.join("docs");
    anew(own, &drawn)?;
    let settings = drawn.join("zensical.toml");
    std::fs::rename(&settings, site.join("zensical.toml")).map_err(|e| format!("{}: {e}", settings.display()))?;
    run(&tools.python, ["xtask/site/formulas.py", &drawn.to_string_lossy()], &[])?;
    let built = Command::new(&tools.python).args(["-m", "zensical", "build", "--clean"]).current_dir(&site).status();
    if !built.map_err(|e| format!("zensical: {e}"))?.success() {
        return Err("zensical did not build the site".into());
    }
    let public = site.join("public");
    check_links(&public)?;
    // Readers that are programs take the pages as they were written; llms.txt lists them.
    for page in files(own, "md")? {
        let name = page.strip_prefix(own).unwrap_or(&page);
        copy(&page, &public.join(name))?;
    }
    Ok(public)
}

/// A copy of a folder in place of what was there.
fn anew(from: &Path, to: &Path) -> Result<(), String> {
    if to.exists() {
        std::fs::remove_dir_all(to).map_err(|e| format!("{}: {e}", to.display()))?;
    }
    copy(from, to)
}

/// The program, the libraries that Rust blocks link, and a Python with the wheel of this tree.
fn tools() -> Result<Tools, String> {
    // With all packages at once: other features of a dependency would build it anew. The extension module is built with its wheel.
    run("cargo", "build --release --workspace --exclude gpsindy-benches --exclude gpsindy-py".split(' '), &[])?;
    let gpsindy = root().join("target/release").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX));
    Ok(Tools { gpsindy, python: python::environment("release", &BUILDERS)? })
}

/// One page with the help of every command.
fn commands(program: &Path) -> Result<String, String> {
    let all = help(program, &[])?;
    let mut page = format!("# Commands\n\nMade from the program itself.\n\n```text\n{all}```\n");
    for name in listed(&all) {
        let own = help(program, &[name])?;
        let _ = write!(page, "\n## gpsindy {name}\n\n```text\n{own}```\n");
        for second in listed(&own) {
            let _ = write!(page, "\n### gpsindy {name} {second}\n\n```text\n{}```\n", help(program, &[name, second])?);
        }
    }
    Ok(page)
}

fn help(program: &Path, arguments: &[&str]) -> Result<String, String> {
    let ran = Command::new(program).args(arguments).arg("--help").output();
    ran.map(|r| String::from_utf8_lossy(&r.stdout).into_owned()).map_err(|e| format!("{}: {e}", program.display()))
}

/// The commands of a help: the first words of the lines between `Commands:` and the next empty line.
fn listed(help: &str) -> Vec<&str> {
    let list = help.split("Commands:\n").nth(1).unwrap_or_default();
    let lines = list.lines().take_while(|line| !line.trim().is_empty());
    let names = lines.filter_map(|line| line.strip_prefix("  ").filter(|l| !l.starts_with(' '))?.split(' ').next());
    names.filter(|name| *name != "help").collect()
}

/// `llms.txt`: the pages with their first sentences, below that of the README.
fn overview(pages: &Path) -> Result<String, String> {
    let about = first_sentence(&read(&root().join("README.md"))?);
    let mut text = format!("# gpsindy\n\n> {about}\n\n");
    for page in files(pages, "md")? {
        let content = read(&page)?;
        let title = content.lines().find_map(|l| l.strip_prefix("# ")).unwrap_or("");
        let first = first_sentence(&content);
        let path = page.strip_prefix(pages).unwrap_or(&page).to_string_lossy().replace('\\', "/");
        let _ = writeln!(text, "- [{title}]({path}): {first}");
    }
    Ok(text)
}

/// The first sentence of the first paragraph of a page, in one line.
fn first_sentence(page: &str) -> String {
    let is_prose = |part: &&str| part.starts_with(|c: char| c.is_alphabetic() || c == '`');
    let prose = page.split("\n\n").find(|part| is_prose(part) && !part.starts_with("```")).unwrap_or_default();
    let line = prose.split_whitespace().collect::<Vec<_>>().join(" ");
    let end = line.match_indices(['.', '?']).map(|(at, _)| at + 1);
    let end = end.into_iter().find(|&at| line[at..].is_empty() || line[at..].starts_with(' '));
    let sentence = &line[..end.unwrap_or(line.len())];
    // What leads to a block ends with a colon.
    sentence.strip_suffix(':').map_or(sentence.to_string(), |stem| format!("{stem}."))
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
    fn a_help_lists_its_commands_in_order() {
        let help = "Usage\n\nCommands:\n  watch  Diagnose new logs\n         as they come\n  help   Print\n\nOptions:\n  -h  Print\n";
        assert_eq!(listed(help), ["watch"]);
        assert!(listed("Usage\n\nOptions:\n  -h\n").is_empty());
    }

    #[test]
    fn the_first_sentence_of_a_page_is_whole() {
        let page = "# Logs\n\n![a picture](a.svg)\n\nA log is a\ntable of 1.5 MB. It has rows.\n";
        assert_eq!(first_sentence(page), "A log is a table of 1.5 MB.");
        assert_eq!(first_sentence("# Logs\n\nNo stop"), "No stop");
        assert_eq!(first_sentence("# Logs\n"), "");
        assert_eq!(first_sentence("# Play\n\nPlay: it lags. More.\n"), "Play: it lags.");
        assert_eq!(first_sentence("# CI\n\n```sh\nls\n```\n\n`ls` lists files:\n"), "`ls` lists files.");
    }

    #[test]
    fn a_link_without_a_target_is_stated() {
        let public = root().join("target/site-test");
        write(&public.join("index.html"), "<a href=\"other/#there\"></a><h1 id=\"here\"></h1>").unwrap();
        write(&public.join("other/index.html"), "<h1 id=\"there\"></h1><a href=\"../#here\"></a>").unwrap();
        check_links(&public).unwrap();
        write(&public.join("other/index.html"), "<a href=\"../#gone\"></a><img src=\"none.svg\">").unwrap();
        let stated = check_links(&public).unwrap_err();
        assert!(
            stated.contains("index.html: other/#there") && stated.contains("../#gone") && stated.contains("none.svg"),
            "{stated}"
        );
        std::fs::remove_dir_all(&public).unwrap();
    }
}
