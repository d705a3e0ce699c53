//! Tasks of a developer: `cargo xtask test` runs all checks; the other tasks are in [`HELP`].
#![forbid(unsafe_code)]

#[cfg(feature = "data")]
mod bag;
#[cfg(feature = "data")]
mod data;
mod files;
mod gallery;
mod long;
mod package;
mod pages;
mod picture;
mod plot;
mod python;
mod shell;
mod site;
mod skipped;
mod snippets;
mod tools;
mod wheel;

use std::process::ExitCode;

const HELP: &str = "\
cargo xtask test          formatting, Rust tests, wheel, Python tests, types and stubs of the package
cargo xtask rust          the Rust part of it
cargo xtask python        the Python part of it
cargo xtask lint          clippy and rustdoc over everything, warnings as errors
cargo xtask package       every crate packs with its licences, builds from its package, and the packed program runs its demo
cargo xtask wheel         wheel and source package: twine, auditwheel, and each installed and used in a bare environment
cargo xtask deny          licences, doubles, sources and advisories of all dependencies (cargo-deny)
cargo xtask semver [REV]  the public interface against a tag or commit; without REV the latest tag (cargo-semver-checks)
cargo xtask msrv          everything compiles with the oldest Rust that Cargo.toml promises, and for 32 bits
cargo xtask fmt           format everything, also the files of effects, which a macro names
cargo xtask long [TASK]   what takes too long for every change, all of it or one task: design (of 24 drawn pairs, how many one designed
                          run distinguishes; kept in tests/records), faults (kills, a full disk, two runs in one folder), levels (the tests
                          of rates of alarm and of intervals with all of their draws), features (the readers of logs with each format
                          alone and with none, warnings as errors), package, wheel, site; and only by its name mjlab (more
                          than 6 GB from the package index: the generated events in the real mjlab)
cargo xtask data          write the generated logs of data/ again (same seed, same files)
cargo xtask picture       draw docs/hare_lynx.svg and docs/pendulum.svg again
cargo xtask effects       write docs/effects again from the catalogue, pages and pictures
cargo xtask gallery [PAGE] run a page of docs/gallery, or all, and keep what it prints, draws and reports; `effects` afterwards
cargo xtask site [PAGE]   build the site of docs/ into target/site/public and check its links, then run every block of every page and
                          build it with what the gallery printed; with PAGE, such as docs/logs/csv.md, run only the blocks of that page
";

fn main() -> ExitCode {
    let task = std::env::args().nth(1).unwrap_or_default();
    let argument = std::env::args().nth(2);
    let done = match task.as_str() {
        "test" => test(),
        "rust" => rust(),
        "python" => python::environment(CHECKS, &[]).and_then(|python| python::test(&python)),
        "lint" => lint(),
        "package" => package::check(),
        "wheel" => wheel::check(),
        "deny" => tools::deny(),
        "fmt" => format(&[]),
        "semver" => tools::semver(argument.as_deref()),
        "msrv" => tools::msrv(),
        "long" => long::run(argument.as_deref()),
        "data" => data(),
        "picture" => picture::all(),
        "effects" => site::effects(),
        "gallery" => site::write_gallery(argument.as_deref()),
        "site" => site::build(argument.as_deref()),
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

#[cfg(feature = "data")]
fn data() -> Result<(), String> {
    data::write()
}

/// Starts itself again, built with what writes the logs.
#[cfg(not(feature = "data"))]
fn data() -> Result<(), String> {
    shell::run("cargo", "run --package xtask --features data -- data".split(' '), &[])
}

/// Formats the sources, or only looks. `cargo fmt` follows `mod` lines; the files of effects are named by a macro.
fn format(how: &[&str]) -> Result<(), String> {
    shell::run("cargo", ["fmt", "--all"].iter().chain(if how.is_empty() { &[][..] } else { &["--"] }).chain(how), &[])?;
    let effects = files::files(&shell::root().join("crates/gpsindy-core/src/diagnose/catalogue/effects"), "rs")?;
    let effects: Vec<String> = effects.iter().map(|path| path.to_string_lossy().into_owned()).collect();
    let edition = ["--edition", "2024"].into_iter();
    shell::run("rustfmt", edition.chain(how.iter().copied()).chain(effects.iter().map(String::as_str)), &[])
}

/// Both parts. What the second one needs from the package index comes while the first one compiles. Then its tests run beside those of the first
/// one, and while the unit tests of the core compile, which keep one core busy.
fn test() -> Result<(), String> {
    let fetching = std::thread::spawn(python::fetch);
    format(&["--check"])?;
    cargo_test(&["--exclude", "gpsindy-core", "--tests", "--no-run"], &[])?;
    joined(fetching, "installs Python packages")?;
    // Cargo lets one at a time build: the wheel comes before the rest of the tests.
    let environment = python::environment(CHECKS, &[])?;
    let python = std::thread::spawn(move || python::test(&environment));
    // Side by side to their ends: neither alone keeps all cores busy, and who mends one wants to know of the other.
    match (tests(), joined(python, "tests the Python package")) {
        (Err(one), Err(other)) => Err(format!("{one}\n{other}")),
        (one, other) => one.and(other),
    }
}

/// What a thread came to.
fn joined<T>(thread: std::thread::JoinHandle<Result<T, String>>, what: &str) -> Result<T, String> {
    thread.join().unwrap_or_else(|_| Err(format!("the thread that {what} ended early")))
}

/// Formatting and tests.
fn rust() -> Result<(), String> {
    format(&["--check"])?;
    tests()
}

/// The profile of all that is tested, the wheel included: dependencies are built once.
const CHECKS: &str = "checks";

/// What is tested.
const TESTS: &str = "test --profile checks --workspace --exclude gpsindy-benches --features xtask/data";

/// Some of the tests of Rust, by the arguments that choose them.
fn cargo_test(which: &[&str], environment: &[(&str, &str)]) -> Result<(), String> {
    shell::run("cargo", TESTS.split(' ').chain(which.iter().copied()), environment)
}

/// Tests with documentation tests. The examples, which `lint` compiles, are left out: to link each of them takes a minute in all.
fn tests() -> Result<(), String> {
    skipped::counted(|environment| cargo_test(&["--tests"], environment))?;
    cargo_test(&["--doc"], &[])
}

/// Clippy and rustdoc, warnings as errors.
fn lint() -> Result<(), String> {
    let clippy = "clippy --release --workspace --all-targets --features xtask/data -- -D warnings";
    shell::run("cargo", clippy.split(' '), &[])?;
    shell::run("cargo", "doc --release --workspace --no-deps".split(' '), &[("RUSTDOCFLAGS", "-D warnings")])
}
