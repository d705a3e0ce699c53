//! Usage of the program as a whole: help, completions, manual, wrong options, closed pipes.
#![allow(clippy::unwrap_used)]

mod common;
use common::Folder;
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
