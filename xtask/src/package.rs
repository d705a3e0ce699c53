//! The published packages: their content, that they build on their own, and that the packed program works.

use crate::shell::{complain, root, run};
use crate::tools::PUBLISHED;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Files that every package carries.
const CARRIED: [&str; 4] = ["LICENSE-APACHE", "LICENSE-MIT", "NOTICE", "README.md"];

/// Packs, looks at the lists, builds from the packages alone in the order of need, and runs the packed program's demo.
pub(crate) fn check() -> Result<(), String> {
    check_keywords()?;
    for name in PUBLISHED {
        check_list(name)?;
    }
    // A folder of its own, outside this workspace's build: what is not in a package can't be found by accident. The demo
    // computes for minutes without optimisation.
    let target = root().join("target/packed");
    let environment = [
        ("CARGO_TARGET_DIR", &*target.to_string_lossy()),
        ("CARGO_PROFILE_DEV_OPT_LEVEL", "2"),
        ("CARGO_PROFILE_DEV_DEBUG", "false"),
    ];
    forget_unpacked(&target)?;
    let packages = PUBLISHED.iter().flat_map(|name| ["--package", name]);
    run("cargo", ["publish", "--dry-run", "--allow-dirty"].into_iter().chain(packages), &environment)?;
    demo(&target)
}

/// Removes what an earlier dry run unpacked and built: cargo keeps both by name and version, and would build the next package on
/// them in place of the present ones.
///
/// A registry without a host, as the dry run makes one, has a folder whose name begins with a dash.
fn forget_unpacked(target: &Path) -> Result<(), String> {
    forget(&target.join("debug/.fingerprint"))?;
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let Some(home) = home.or_else(|| Some(std::env::home_dir()?.join(".cargo"))) else { return Ok(()) };
    for kind in ["src", "cache"] {
        let Ok(registries) = std::fs::read_dir(home.join("registry").join(kind)) else { continue };
        for registry in registries.flatten().filter(|r| r.file_name().to_string_lossy().starts_with('-')) {
            forget(&registry.path())?;
        }
    }
    Ok(())
}

/// Removes what has the names of our packages from a folder, where there is one.
fn forget(folder: &Path) -> Result<(), String> {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if PUBLISHED.iter().any(|own| name.to_string_lossy().starts_with(&format!("{own}-"))) {
            let removed = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
            removed.map_err(|e| format!("{}: {e}", path.display()))?;
        }
    }
    Ok(())
}

/// The registry's limits, which a dry run does not look at: at most five keywords of at most 20 characters.
fn check_keywords() -> Result<(), String> {
    let path = root().join("Cargo.toml");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let line = text.lines().find_map(|l| l.strip_prefix("keywords = ")).ok_or("no keywords in Cargo.toml")?;
    let words: Vec<&str> = line.trim_matches(['[', ']']).split(", ").map(|w| w.trim_matches('"')).collect();
    match words.iter().find(|w| w.len() > 20) {
        Some(word) => Err(format!("keyword `{word}` is longer than 20 characters")),
        None if words.len() > 5 => Err(format!("{} keywords; at most 5 are taken", words.len())),
        None => Ok(()),
    }
}

fn check_list(name: &str) -> Result<(), String> {
    let arguments = ["package", "--list", "--allow-dirty", "--package", name];
    let listed = Command::new("cargo").args(arguments).current_dir(root()).output();
    let listed = listed.map_err(|e| format!("cargo did not start: {e}"))?;
    if !listed.status.success() {
        return Err(format!("{name} does not pack: {}", String::from_utf8_lossy(&listed.stderr).trim()));
    }
    let files = String::from_utf8_lossy(&listed.stdout).into_owned();
    for wanted in CARRIED {
        if !files.lines().any(|file| file == wanted) {
            return Err(format!("the package of {name} lacks {wanted}"));
        }
    }
    if let Some(other) = files.lines().find(|file| ["tests/", "examples/"].iter().any(|start| file.starts_with(start)))
    {
        return Err(format!("the package of {name} holds {other}, which needs the repository"));
    }
    complain(&format!("  {name}: {} files", files.lines().count()));
    Ok(())
}

/// Runs the program that was built from the packages in an empty folder.
fn demo(target: &Path) -> Result<(), String> {
    let folder = target.join("demo");
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(failed)?;
    }
    let program = target.join("debug").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX));
    run(&program, ["demo", "--quiet", "--out", &folder.to_string_lossy()], &[])?;
    match folder.join("diagnosis/report.html").is_file() {
        true => Ok(()),
        false => Err(format!("{}: the demo left no report here", folder.display())),
    }
}
