//! The blocks of a page that a reader may copy: `sh`, `python` and `rust`. They are run in order, in a folder that has the files they name.

use crate::files::{copy, read, write};
use crate::shell::{complain, root};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What Python prints between the blocks of one program, so that each has its own output.
const BETWEEN: char = '\u{1f}';

/// The programs that blocks are run with.
pub(crate) struct Tools {
    pub(crate) gpsindy: PathBuf,
    pub(crate) python: PathBuf,
}

/// A page's blocks, each with what it printed; in the order of the page.
pub(crate) struct Ran {
    pub(crate) folder: PathBuf,
    /// One for each of [`blocks`].
    pub(crate) printed: Vec<String>,
}

/// Runs the blocks of a page in the folder `name` below `target/site/snippets`, with `data/` and the files of `given`. The first block that
/// fails ends it with an error: page, block, what it wrote to stderr, where it ran.
pub(crate) fn run_page(page: &Path, name: &str, given: Option<&Path>, tools: &Tools) -> Result<Ran, String> {
    let start = Instant::now();
    let folder = root().join("target/site/snippets").join(name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    copy(&root().join("data"), &folder.join("data"))?;
    given.map(|given| copy(given, &folder)).transpose()?;
    let text = read(page)?;
    let mut printed = Vec::new();
    for (language, program) in &steps(&text) {
        let output = run_step(language, program, &folder, tools).map_err(|e| {
            let page = page.strip_prefix(root()).unwrap_or(page).display();
            let program = program.replace(&format!("print('\\x{:02x}', flush=True)\n", BETWEEN as u32), "");
            format!(
                "{page}: a block of {language} failed, the blocks after it were not run\n\n{program}\n{e}\nit ran in {}",
                folder.display()
            )
        })?;
        // A program of several blocks printed a mark between them.
        printed.extend(output.split(BETWEEN).map(|part| part.trim_matches('\n').to_string()));
    }
    complain(&format!("  {name}: {} blocks in {:.0} s", printed.len(), start.elapsed().as_secs_f64()));
    Ok(Ran { folder, printed })
}

fn run_step(language: &str, program: &str, folder: &Path, tools: &Tools) -> Result<String, String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    // The command of the Python package first, which also reads MuJoCo models and FMUs.
    let own = [&tools.python, &tools.gpsindy].into_iter().filter_map(|tool| tool.parent()).map(Path::to_path_buf);
    let path = std::env::join_paths(own.chain(std::env::split_paths(&path))).map_err(|e| e.to_string())?;
    let mut command = match language {
        "sh" => Command::new("sh"),
        "python" => Command::new(&tools.python),
        _ => return run_rust(program, folder),
    };
    command.args([if language == "sh" { "-ec" } else { "-c" }, program]);
    let ran = command.current_dir(folder).env("PATH", &path).env("NO_COLOR", "1").output();
    let ran = ran.map_err(|e| format!("{language}: {e}"))?;
    if !ran.status.success() {
        return Err(format!("{}{}", String::from_utf8_lossy(&ran.stderr), ran.status));
    }
    Ok(String::from_utf8_lossy(&ran.stdout).into_owned())
}

/// Rust is compiled and run by rustdoc, against the libraries of this tree.
fn run_rust(program: &str, folder: &Path) -> Result<String, String> {
    let page = folder.join("block.md");
    let body = format!("fn main() -> Result<(), Box<dyn std::error::Error>> {{\n{program}\nOk(())\n}}\n");
    write(&page, &format!("```rust\n{body}```\n"))?;
    let built = root().join("target/release");
    let mut command = Command::new("rustdoc");
    command.args(["--test", "--edition", "2024"]).arg(&page).arg("-L").arg(built.join("deps"));
    for name in ["gpsindy_core", "gpsindy_files"] {
        command.arg("--extern").arg(format!("{name}={}", built.join(format!("lib{name}.rlib")).display()));
    }
    let ran = command.current_dir(folder).output().map_err(|e| format!("rustdoc: {e}"))?;
    if !ran.status.success() {
        let (out, err) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
        return Err(format!("{out}{err}"));
    }
    Ok(String::new())
}

/// What a page runs, in order: Python blocks that follow each other are one program, since they share their variables.
fn steps(text: &str) -> Vec<(&str, String)> {
    let mut steps: Vec<(&str, String)> = Vec::new();
    for (language, block) in blocks(text) {
        match steps.last_mut() {
            Some((last, program)) if language == "python" && *last == language => {
                *program += "\nprint('\\x1f', flush=True)\n";
                program.push_str(block);
            }
            _ => steps.push((language, block.into())),
        }
    }
    steps
}

/// The fenced blocks of a page in `sh`, `python` and `rust`, in order. Those in `console` are shown and not run: they install, serve, or need
/// a log that is not here.
///
/// Blocks within a comment of HTML are run and not shown: they make what the page takes as given.
pub(crate) fn blocks(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|block| block.split_once('\n'))
        .filter(|(language, _)| ["sh", "python", "rust"].contains(language))
}

/// The page with what each block printed below it, in place of what an earlier run left.
pub(crate) fn with_outputs(text: &str, printed: &[String]) -> String {
    let mut page = String::new();
    let mut parts = without_outputs(text);
    let mut printed = printed.iter();
    while let Some((before, rest)) = parts.split_once("```") {
        let Some((block, after)) = rest.split_once("```") else { break };
        page += &format!("{before}```{block}```");
        let language = block.split('\n').next().unwrap_or_default();
        if ["sh", "python", "rust"].contains(&language)
            && let Some(output) = printed.next().filter(|output| !output.is_empty())
        {
            let kind = if block.contains("\ndiff ") { "diff" } else { "text" };
            page += &format!("\n\n{MARK}\n\n```{kind}\n{output}\n```");
        }
        parts = after.to_string();
    }
    page + &parts
}

/// The mark before an output that a run left on its page.
const MARK: &str = "<!-- printed -->";

fn without_outputs(text: &str) -> String {
    let mut page = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(&format!("\n\n{MARK}\n\n```")) {
        page += before;
        rest = after.split_once("\n```").map_or("", |(_, after)| after);
    }
    page + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_run_are_those_of_a_shell_of_python_and_of_rust() {
        let page = "```sh\na\n```\ntext\n```console\nb\n```\n```python\nc\nd\n```\n```rust\ne\n```\n";
        assert_eq!(blocks(page).collect::<Vec<_>>(), [("sh", "a\n"), ("python", "c\nd\n"), ("rust", "e\n")]);
        let split = "```python\na\n```\ntext\n```python\nb\n```\n```sh\nc\n```\n```sh\nd\n```\n```python\ne\n```\n";
        let joined = "a\n\nprint('\\x1f', flush=True)\nb\n";
        let expected = [("python", joined), ("sh", "c\n"), ("sh", "d\n"), ("python", "e\n")];
        assert_eq!(steps(split).iter().map(|(l, t)| (*l, t.as_str())).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn outputs_stand_beneath_their_blocks_and_a_second_run_replaces_them() {
        let page = "# A\n\n```python\nprint(1)\n```\n\nWords.\n\n```toml\nx = 1\n```\n\n```sh\ndiff a b\n```\n\nEnd.\n";
        let first = with_outputs(page, &["1".into(), "-a\n+b".into()]);
        assert!(first.contains("```\n\n<!-- printed -->\n\n```text\n1\n```\n\nWords."), "{first}");
        assert!(first.contains("<!-- printed -->\n\n```diff\n-a\n+b\n```\n\nEnd."), "{first}");
        assert_eq!(with_outputs(&first, &["1".into(), "-a\n+b".into()]), first);
        assert_eq!(with_outputs(&first, &[String::new(), String::new()]), page);
    }
}
