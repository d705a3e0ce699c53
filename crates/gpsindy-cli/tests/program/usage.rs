//! Usage of the program as a whole: help, completions, manual, wrong options, closed pipes.

use crate::common::Folder;
use std::process::{Command, Stdio};

const COMMANDS: &[&str] = &[
    "inspect",
    "identify",
    "export",
    "smooth",
    "simulate",
    "score",
    "diagnose",
    "design",
    "exam",
    "effects",
    "fleet",
    "demo",
    "completions",
    "man",
    "mcp",
];

#[test]
fn help_of_every_command_begins_with_an_example() {
    let folder = Folder::new();
    let top = folder.run("--help").done().stdout;
    assert!(top.starts_with("Example: gpsindy"), "{top}");
    for command in COMMANDS {
        assert!(top.contains(&format!("  {command}")), "{command} is not in the list:\n{top}");
        let help = folder.run(&format!("{command} --help")).done().stdout;
        assert!(help.starts_with(&format!("Example: gpsindy {command}")), "{help}");
        assert!(help.lines().all(|line| line.chars().count() <= 110), "{help}");
    }
}

#[test]
fn a_wrong_usage_is_one_line_and_status_2() {
    let folder = Folder::new();
    for (arguments, expected) in [
        ("smoth x.csv", "unrecognized subcommand 'smoth'"),
        ("smooth x.csv --stat v", "unexpected argument '--stat' found"),
        ("smooth", "the following required arguments were not provided: <LOG>"),
        ("smooth x.csv --threads 0", "invalid value '0' for '--threads <N>'"),
        ("smooth x.csv --rename v", "invalid value 'v' for '--rename <COLUMN=NAME>': expected A=B"),
        ("simulate m.toml", "m.toml: cannot be read: there is no such file"),
        (
            "simulate m.toml --data x.csv --initial x",
            "invalid value 'x' for '--initial <STATE=VALUE>': expected name=number",
        ),
        ("completions csh", "invalid value 'csh'"),
    ] {
        let ran = folder.run(arguments);
        assert!(ran.refused().starts_with(expected), "{arguments}: {ran:?}");
        assert_eq!(ran.stderr.lines().count(), 1, "{arguments}: {ran:?}");
    }
}

#[test]
fn every_exit_status_is_in_the_help() {
    let top = Folder::new().run("--help").done().stdout;
    let words = top.split_whitespace().collect::<Vec<_>>().join(" ");
    let stated = "Exit status: 0 success, 1 the computation failed, 2 bad input or usage, 3 a verdict that --fail-if names, 4 some units of a fleet failed.";
    assert!(words.ends_with(stated), "{top}");
}

#[test]
fn options_of_results_are_refused_where_there_is_no_result() {
    let folder = Folder::new();
    for command in ["completions bash", "man", "mcp"] {
        for option in ["--json", "--threads", "--seed"] {
            let value = if option == "--json" { "" } else { "1" };
            let ran = folder.run(&format!("{command} {option} {value}"));
            assert_eq!(
                ran.refused(),
                format!("{option}: the command computes nothing; remove the option"),
                "{command}"
            );
        }
    }
}

#[test]
fn the_help_of_diagnose_names_every_file_that_it_may_write() {
    let help = Folder::new().run("diagnose --help").done().stdout;
    for name in [
        "report.json",
        "report.html",
        "augmented.toml",
        "augmented.xml",
        "augmented.ssv",
        "randomization.py",
        "open.json",
    ] {
        assert!(help.contains(name), "{name} is not in the help:\n{help}");
    }
}

/// A folder with a program `gpsindy-mcp` that says what it was handed and ends with a status.
#[cfg(unix)]
fn with_server(folder: &Folder, name: &str, status: i32) -> std::path::PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let place = folder.path().join(name);
    std::fs::create_dir(&place).unwrap();
    let server = place.join("gpsindy-mcp");
    std::fs::write(&server, format!("#!/bin/sh\necho \"{name} $*\" >&2\nexit {status}\n")).unwrap();
    std::fs::set_permissions(&server, PermissionsExt::from_mode(0o755)).unwrap();
    place
}

/// As the command of a Python package is started: under the name of a script in the folder of the server, by another program.
#[cfg(unix)]
#[test]
fn the_server_is_looked_for_beside_the_program_and_then_on_the_path() {
    use std::os::unix::process::CommandExt;
    let folder = Folder::new();
    let (beside, path) = (with_server(&folder, "beside", 2), with_server(&folder, "path", 0));
    let run = |name: std::path::PathBuf| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gpsindy"));
        command.arg0(name).args(["mcp", "logs"]).env("PATH", format!("{}:/usr/bin:/bin", path.display()));
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // Its own words are the only ones, and its status is the command's.
    assert_eq!(run(beside.join("gpsindy")), (Some(2), "beside logs\n".into()));
    assert_eq!(run("gpsindy".into()), (Some(0), "path logs\n".into()));
    let mut alone = Command::new(env!("CARGO_BIN_EXE_gpsindy"));
    let output = alone.arg("mcp").env("PATH", folder.path()).output().unwrap();
    let stated = String::from_utf8(output.stderr).unwrap();
    assert!(
        stated.starts_with("error: the program gpsindy-mcp was not found; install it") && stated.lines().count() == 1,
        "{stated}"
    );
}

#[test]
fn no_command_shows_the_help_and_is_a_wrong_usage() {
    let ran = Folder::new().run("");
    assert_eq!((ran.status, ran.stdout.as_str()), (2, ""));
    assert!(ran.stderr.starts_with("Example: "), "{ran:?}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let ran = Folder::new().run("smooth nothing.csv");
    assert_eq!(ran.refused(), "nothing.csv: cannot be read: there is no such file");
}

#[test]
fn completions_and_manual_know_the_commands() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let text = folder.run(&format!("completions {shell}")).done().stdout;
        assert!(COMMANDS.iter().all(|command| text.contains(command)), "{shell}");
    }
    assert!(folder.run("man").done().stdout.contains(".TH gpsindy 1"));
    folder.run("man --out .").done();
    for command in COMMANDS {
        assert!(folder.names().contains(&format!("gpsindy-{command}.1")), "{:?}", folder.names());
    }
}

#[test]
fn a_closed_pipe_is_silent() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gpsindy"))
        .args(["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(output.stderr, b"");
}
