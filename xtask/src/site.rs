//! The site of the documentation: pages of docs/, references made from the program, formulas as MathML, links checked.
//!
//! Zensical builds it: pages stay plain Markdown, search works without a server, and one wheel from the package index is all it needs.

use crate::shell::{complain, root, run};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Formulas between dollars become MathML, which browsers draw without script.
const FORMULAS: &str = r#"
import pathlib, re, sys
from latex2mathml.converter import convert
for page in pathlib.Path(sys.argv[1]).rglob("*.md"):
    text = page.read_text(encoding="utf-8")
    parts = re.split(r"(```.*?```|`[^`\n]*`)", text, flags=re.S)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"\$\$(.+?)\$\$", lambda m: convert(m[1].strip(), display="block"), parts[k], flags=re.S)
        parts[k] = re.sub(r"\$([^$\n]+(?:\n[^$\n]+)?)\$", lambda m: convert(m[1]), parts[k])
    page.write_text("".join(parts), encoding="utf-8")
"#;

/// Builds `target/site/public` and checks its links; with `snippets` every `sh` block of the pages under `start/` is run as well.
pub(crate) fn build(snippets: bool) -> Result<(), String> {
    let site = root().join("target/site");
    let pages = site.join("docs");
    if pages.exists() {
        std::fs::remove_dir_all(&pages).map_err(|e| format!("{}: {e}", pages.display()))?;
    }
    copy(&root().join("docs"), &pages)?;
    run("cargo", "build --release --package gpsindy-cli".split(' '), &[])?;
    let program = root().join("target/release").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX));
    write(&pages.join("reference/cli.md"), &commands(&program)?)?;
    if snippets {
        run_snippets(&pages.join("start"), &program)?;
    }
    write(&pages.join("llms.txt"), &overview(&pages)?)?;
    copy(&root().join("docs/zensical.toml"), &site.join("zensical.toml"))?;
    let python = environment(&site)?;
    run(&python, ["-c", FORMULAS, &pages.to_string_lossy()], &[])?;
    let built = Command::new(&python).args(["-m", "zensical", "build", "--clean"]).current_dir(&site).status();
    if !built.map_err(|e| format!("zensical: {e}"))?.success() {
        return Err("zensical did not build the site".into());
    }
    check_links(&site.join("public"))?;
    complain(&format!("site: {}", site.join("public/index.html").display()));
    Ok(())
}

/// Python with what builds the site, made once.
fn environment(site: &Path) -> Result<PathBuf, String> {
    let venv = site.join("venv");
    let python = if cfg!(windows) { venv.join("Scripts/python.exe") } else { venv.join("bin/python") };
    if !python.exists() {
        let system = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        run(system, ["-m", "venv", &venv.to_string_lossy()], &[])?;
        let install = "-m pip install --quiet --disable-pip-version-check zensical latex2mathml";
        run(&python, install.split(' '), &[])?;
    }
    Ok(python)
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
        let content = std::fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
        let title = content.lines().find_map(|l| l.strip_prefix("# ")).unwrap_or("");
        let first = content.lines().find(|l| l.starts_with(|c: char| c.is_alphabetic())).unwrap_or("");
        let path = page.strip_prefix(pages).unwrap_or(&page).to_string_lossy().replace('\\', "/");
        let _ = writeln!(text, "- [{title}]({path}): {first}");
    }
    Ok(text)
}

/// Runs the `sh` blocks of each page in a folder that holds the repository's data, in order; a block that fails is an error.
fn run_snippets(folder: &Path, program: &Path) -> Result<(), String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let own = program.parent().map(Path::to_path_buf).into_iter();
    let path = std::env::join_paths(own.chain(std::env::split_paths(&path))).map_err(|e| e.to_string())?;
    for page in files(folder, "md")? {
        let work = root().join("target/site/snippets").join(page.file_stem().unwrap_or_default());
        if work.exists() {
            std::fs::remove_dir_all(&work).map_err(|e| format!("{}: {e}", work.display()))?;
        }
        copy(&root().join("data"), &work.join("data"))?;
        let text = std::fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
        for block in text.split("```sh\n").skip(1).filter_map(|rest| rest.split("```").next()) {
            complain(&format!("\n$ {}", block.trim()));
            let ran = Command::new("sh").args(["-ec", block]).current_dir(&work).env("PATH", &path).output();
            let ran = ran.map_err(|e| format!("sh: {e}"))?;
            if !ran.status.success() {
                return Err(format!("{}: {block}{}", page.display(), String::from_utf8_lossy(&ran.stderr)));
            }
        }
    }
    Ok(())
}

/// Every link of a page to a file of the site must lead to one.
fn check_links(public: &Path) -> Result<(), String> {
    let mut broken = String::new();
    for page in files(public, "html")? {
        let text = std::fs::read_to_string(&page).map_err(|e| format!("{}: {e}", page.display()))?;
        for link in ["href=\"", "src=\""].iter().flat_map(|mark| text.split(*mark).skip(1)) {
            let link = link.split('"').next().unwrap_or_default();
            let target = link.split(['#', '?']).next().unwrap_or_default();
            // The error page alone is written for the root of a server.
            if target.is_empty() || target.contains(':') || target.starts_with('/') {
                continue;
            }
            let path = page.parent().unwrap_or(public).join(target);
            if !path.exists() {
                let _ = writeln!(broken, "{}: {link}", page.strip_prefix(public).unwrap_or(&page).display());
            }
        }
    }
    if broken.is_empty() { Ok(()) } else { Err(format!("links that lead nowhere:\n{broken}")) }
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
