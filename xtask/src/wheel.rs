//! The Python packages as an index would get them: what twine and auditwheel say of them, and each of them installed and used in an
//! environment that has nothing else.

use crate::shell::{complain, root, run};
use std::path::{Path, PathBuf};

const INSTALL: [&str; 5] = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];

/// Builds the wheel and the source package, checks both, and uses both in bare environments.
pub(crate) fn check() -> Result<(), String> {
    let folder = root().join("target/dist");
    let tools = bare(&folder.join("tools"), &["maturin>=1.9,<2", "twine", "auditwheel"])?;
    let made = folder.join("made");
    clear(&made)?;
    let out = made.to_string_lossy();
    for what in [&["build", "--release"][..], &["sdist"]] {
        let manifest = ["--manifest-path", "crates/gpsindy-py/Cargo.toml", "--out", &*out];
        run(&tools, ["-m", "maturin"].iter().chain(what).chain(&manifest), &[])?;
    }
    let wheel = with_ending(&made, "whl")?;
    let source = with_ending(&made, "gz")?;
    run(&tools, ["-m", "twine", "check", "--strict", &*wheel.to_string_lossy(), &*source.to_string_lossy()], &[])?;
    if cfg!(target_os = "linux") {
        run(&tools, ["-m", "auditwheel", "show", &*wheel.to_string_lossy()], &[])?;
    }
    for (name, package) in [("wheel", wheel), ("source", source)] {
        complain(&format!("  {name}: {} kB", std::fs::metadata(&package).map_or(0, |m| m.len() / 1000)));
        let python = bare(&folder.join(name), &[&*package.to_string_lossy()])?;
        run(&python, ["crates/gpsindy-py/tests/bare.py"], &[])?;
        run(&python, ["-m", "gpsindy", "demo", "--quiet", "--out", &*folder.join("demo").to_string_lossy()], &[])?;
    }
    Ok(())
}

/// A new environment with these packages and what they need; its Python.
pub(crate) fn bare(folder: &Path, packages: &[&str]) -> Result<PathBuf, String> {
    clear(folder)?;
    let system = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    run(system, ["-m", "venv", &folder.to_string_lossy()], &[])?;
    let python = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    // A source package is compiled with what this tree has built already.
    let target = root().join("target");
    run(&python, INSTALL.iter().chain(packages), &[("CARGO_TARGET_DIR", &*target.to_string_lossy())])?;
    Ok(python)
}

/// Removes a folder with all that is in it, where there is one.
fn clear(folder: &Path) -> Result<(), String> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    Ok(())
}

fn with_ending(folder: &Path, ending: &str) -> Result<PathBuf, String> {
    crate::files::files(folder, ending)?
        .pop()
        .ok_or_else(|| format!("{}: maturin left no .{ending} here", folder.display()))
}
