//! The Python part of the check: a virtual environment of its own, the wheel, pytest, the stubs.

use crate::shell::{complain, root, run};
use std::path::{Path, PathBuf};

const MATURIN: &str = "maturin>=1.9,<2";

/// Packages are compiled to bytecode as they are imported: most of their modules never are.
const PIP: [&str; 6] = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile"];

/// Where packages come from, by the names under which pip and uv read it in the environment.
const INDEXES: [(&str, &str); 3] =
    [("PIP_INDEX_URL", "UV_DEFAULT_INDEX"), ("PIP_EXTRA_INDEX_URL", "UV_INDEX"), ("PIP_FIND_LINKS", "UV_FIND_LINKS")];

/// Installs packages, those that are there already again where `is_again`: by uv, which takes a tenth of pip's time; by pip where uv can't, as from
/// an index that only pip's own file names.
fn install(python: &Path, what: &[&str], is_again: bool) -> Result<(), String> {
    let indexes: Vec<(&str, String)> =
        INDEXES.iter().filter_map(|(pip, uv)| Some((*uv, std::env::var(pip).ok()?))).collect();
    let indexes: Vec<(&str, &str)> = indexes.iter().map(|(name, value)| (*name, value.as_str())).collect();
    let of = python.to_string_lossy();
    let uv = ["-m", "uv", "pip", "install", "--quiet", "--python", &*of];
    let (by_uv, by_pip) = if is_again { (Some("--reinstall"), Some("--force-reinstall")) } else { (None, None) };
    run(python, uv.iter().chain(&by_uv).chain(what), &indexes).or_else(|message| {
        complain(&format!("  {message}; pip instead"));
        run(python, PIP.iter().chain(&by_pip).chain(what), &[])
    })
}

/// Runs pytest with the wheel that `python` has, and meanwhile checks its types and compares its stubs with the module.
pub(crate) fn test(python: &Path) -> Result<(), String> {
    let checking = {
        let python = python.to_path_buf();
        std::thread::spawn(move || types(&python))
    };
    // Side by side on all cores: most tests wait for a program or a simulator of their own. One after the other: modules of both have the same names.
    let pytest = ["-m", "pytest", "-q", "-rs", "-n", "auto", "--dist", "worksteal"];
    let tests = |folder: &str| run(python, pytest.iter().chain(&[folder]), &[]);
    let tested = tests("crates/gpsindy-py").and_then(|()| tests("experiments"));
    let checked = checking.join().unwrap_or_else(|_| Err("the thread that checks types ended early".into()));
    tested.and(checked)
}

/// The package carries its types; the compiled part has a stub by hand, which is compared with the module itself.
fn types(python: &Path) -> Result<(), String> {
    let package = "crates/gpsindy-py";
    let configuration = format!("{package}/pyproject.toml");
    run(python, ["-m", "mypy", "--config-file", &configuration, &format!("{package}/python/gpsindy")], &[])?;
    run(python, ["-m", "mypy.stubtest", "gpsindy._gpsindy"], &[])
}

/// Installs what the wheel's build and tests require, which needs the network and no compiled crate: it can be done beside the Rust part.
pub(crate) fn fetch() -> Result<(), String> {
    let python = interpreter()?;
    let manifest = root().join("crates/gpsindy-py/pyproject.toml");
    let text = std::fs::read_to_string(&manifest).map_err(|e| format!("{}: {e}", manifest.display()))?;
    let lines = text.lines().skip_while(|line| *line != "test = [").skip(1).take_while(|line| *line != "]");
    let wanted: Vec<&str> = lines.map(|line| line.trim().trim_matches(|c| c == '"' || c == ',')).collect();
    if wanted.is_empty() {
        return Err(format!(
            "{}: no requirements of the tests, a list that begins with the line `test = [`",
            manifest.display()
        ));
    }
    install(&python, &[&[MATURIN], &wanted[..]].concat(), false)
}

/// The Python of `target/venv`, which is made where it is not there.
fn interpreter() -> Result<PathBuf, String> {
    let environment = root().join("target/venv");
    let programs = environment.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let python = programs.join("python");
    if !python.exists() {
        let system = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
        run(system, ["-m", "venv", &environment.to_string_lossy()], &[])?;
        run(&python, PIP.iter().chain(&["uv"]), &[])?;
    }
    Ok(python)
}

/// The Python that has the wheel of this tree with its test requirements, and `more` packages.
///
/// Everything lives under `target/`: `target/venv` is made once and used again, `target/wheels` holds the wheel, built with a `profile`.
pub(crate) fn environment(profile: &str, more: &[&str]) -> Result<PathBuf, String> {
    let python = interpreter()?;
    install(&python, &[MATURIN], false)?;

    let wheels = root().join("target/wheels");
    if wheels.exists() {
        std::fs::remove_dir_all(&wheels).map_err(|e| format!("{}: {e}", wheels.display()))?;
    }
    let manifest = ["--manifest-path", "crates/gpsindy-py/Cargo.toml", "--out", "target/wheels"];
    run(&python, ["-m", "maturin", "build", "--profile", profile].iter().chain(&manifest), &[])?;
    let wheel = std::fs::read_dir(&wheels)
        .map_err(|e| format!("{}: {e}", wheels.display()))?
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .find(|path| path.extension().is_some_and(|e| e == "whl"))
        .ok_or_else(|| format!("{}: maturin left no wheel here", wheels.display()))?;

    // The wheel itself first and without asking an index, so that a new build of the same version replaces the old one.
    let wheel = wheel.to_string_lossy();
    install(&python, &["--no-deps", &wheel], true)?;
    install(&python, &[&[&*format!("{wheel}[test]")], more].concat(), false)?;
    Ok(python)
}
