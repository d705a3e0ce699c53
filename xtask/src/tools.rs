//! Checks that need a tool or a toolchain of their own; each says how to get it where it is missing.

use crate::shell::{complain, root, run};
use std::process::{Command, Stdio};

/// The crates that are published, in the order in which they need each other.
pub(crate) const PUBLISHED: [&str; 5] =
    ["gpsindy-core", "gpsindy-files", "gpsindy-report", "gpsindy-fleet", "gpsindy-cli"];

/// Licences, doubles, sources, then yanked crates and advisories where their data base can be had.
pub(crate) fn deny() -> Result<(), String> {
    needs("cargo", &["deny", "--version"], "cargo install cargo-deny --locked")?;
    run("cargo", ["deny", "check", "licenses", "bans", "sources"], &[])?;
    // The data base of advisories is a repository of its own; without a way to it the rest of the check still counts.
    if run("cargo", ["deny", "fetch", "db"], &[]).is_err() {
        complain(
            "  the data base of advisories can't be had here: known weaknesses and yanked crates were NOT checked",
        );
        return Ok(());
    }
    run("cargo", ["deny", "check", "advisories"], &[])
}

/// The public interface of the published libraries against `revision`, or the latest tag.
pub(crate) fn semver(revision: Option<&str>) -> Result<(), String> {
    needs("cargo", &["semver-checks", "--version"], "cargo install cargo-semver-checks --locked")?;
    let revision = match revision {
        Some(revision) => revision.to_string(),
        None => latest_tag()?,
    };
    for name in PUBLISHED.iter().filter(|name| **name != "gpsindy-cli") {
        run("cargo", ["semver-checks", "--package", name, "--baseline-rev", &revision], &[])?;
    }
    Ok(())
}

fn latest_tag() -> Result<String, String> {
    let found = Command::new("git").args(["describe", "--tags", "--abbrev=0"]).current_dir(root()).output();
    let tag = found.map_err(|e| format!("git did not start: {e}"))?;
    if !tag.status.success() {
        return Err("nothing was released yet: name a commit, `cargo xtask semver main`".into());
    }
    Ok(String::from_utf8_lossy(&tag.stdout).trim().to_string())
}

/// Everything with the oldest promised compiler; the core without its features; the core for a machine of 32 bits.
pub(crate) fn msrv() -> Result<(), String> {
    const FOR_32_BITS: &str = "i686-unknown-linux-gnu";
    let version = promised()?;
    let install = format!("rustup toolchain install {version} --profile minimal --target {FOR_32_BITS}");
    needs("rustup", &["run", &version, "cargo", "--version"], &install)?;
    // A folder of its own: another compiler would throw away what the usual one built.
    let folder = root().join("target/msrv");
    let environment = [("CARGO_TARGET_DIR", &*folder.to_string_lossy())];
    let check = |arguments: &str| {
        let start = ["run", &version, "cargo", "check"];
        run("rustup", start.into_iter().chain(arguments.split(' ')), &environment)
    };
    check("--workspace --all-targets")?;
    check("--package gpsindy-core --no-default-features")?;
    check(&format!("--package gpsindy-core --no-default-features --target {FOR_32_BITS}"))
}

/// Nothing is unused whatever formats of logs are left out: each alone, and none.
pub(crate) fn features() -> Result<(), String> {
    for formats in ["", "mcap", "parquet", "ulog"] {
        // The other crates only hand the features on.
        let start = ["clippy", "--release", "--package", "gpsindy-files", "--lib", "--no-default-features"];
        run("cargo", start.into_iter().chain(["--features", formats, "--", "-D", "warnings"]), &[])?;
    }
    Ok(())
}

/// `rust-version` of the workspace.
fn promised() -> Result<String, String> {
    let path = root().join("Cargo.toml");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let version = text.lines().find_map(|line| line.strip_prefix("rust-version = "));
    version.map(|v| v.trim_matches('"').to_string()).ok_or_else(|| format!("{}: no rust-version", path.display()))
}

/// Refuses where a tool does not start, with the command that gets it.
pub(crate) fn needs(program: &str, arguments: &[&str], install: &str) -> Result<(), String> {
    let started = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    if started.is_ok_and(|status| status.success()) {
        return Ok(());
    }
    Err(format!("`{program} {}` does not run; get it with `{install}`", arguments.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tool_that_is_missing_is_told_with_its_remedy() {
        let stated = needs("cargo", &["no-such-tool"], "cargo install no-such-tool").unwrap_err();
        assert_eq!(stated, "`cargo no-such-tool` does not run; get it with `cargo install no-such-tool`");
        needs("cargo", &["--version"], "").unwrap();
    }

    #[test]
    fn the_promised_version_is_a_version() {
        assert!(promised().unwrap().split('.').all(|part| part.parse::<u32>().is_ok()));
    }
}
