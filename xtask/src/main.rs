//! What a developer runs: `cargo xtask test` checks everything, `cargo xtask data` writes `data/` again,
//! `cargo xtask picture` the picture of docs/, `cargo xtask site` the site.
#![forbid(unsafe_code)]

mod data;
mod picture;
mod python;
mod shell;
mod site;

use std::process::ExitCode;

const HELP: &str = "\
cargo xtask test     formatting, clippy as errors, Rust tests, documentation, wheel, Python tests, stub check
cargo xtask rust     the Rust part of it
cargo xtask python   the Python part of it
cargo xtask data     write the generated logs of data/ again (same seed, same files)
cargo xtask picture  draw docs/hare_lynx.svg again
cargo xtask site     build the site of docs/ into target/site/public, run its snippets, check its links
";

fn main() -> ExitCode {
    let task = std::env::args().nth(1).unwrap_or_default();
    let done = match task.as_str() {
        "test" => rust().and_then(|()| python::test()),
        "rust" => rust(),
        "python" => python::test(),
        "data" => data::write(&shell::root().join("data")),
        "picture" => picture::hare_lynx(),
        "site" => site::build(true),
        "" | "help" | "-h" | "--help" => {
            shell::say(HELP);
            Ok(())
        }
        other => Err(format!("unknown task `{other}`\n\n{HELP}")),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            shell::complain(&format!("xtask: {message}"));
            ExitCode::FAILURE
        }
    }
}

/// Formatting, clippy, tests with documentation tests, documentation: one profile, so that dependencies are built once.
fn rust() -> Result<(), String> {
    let cargo = |arguments: &str| shell::run("cargo", arguments.split(' '), &[]);
    cargo("fmt --all --check")?;
    cargo("clippy --release --workspace --all-targets -- -D warnings")?;
    // The extension module is tested from Python: linking it into a test binary would need libpython.
    if python::present() {
        cargo("test --release --workspace --exclude gpsindy-py")?;
    } else {
        cargo("test --release --workspace")?;
    }
    shell::run("cargo", "doc --release --workspace --no-deps".split(' '), &[("RUSTDOCFLAGS", "-D warnings")])
}
