//! Ctrl-C and SIGTERM in the middle of the work.

#![cfg(target_os = "linux")]

use crate::common::Folder;
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, Stdio};

const SIGINT: i32 = 2;
const SIGTERM: i32 = 15;

/// Whether the process has a handler of its own for a signal.
fn listens(child: &Child, signal: i32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
    u64::from_str_radix(caught.trim(), 16).unwrap() >> (signal - 1) & 1 == 1
}

#[test]
fn ctrl_c_ends_a_command_with_a_word_and_leaves_the_old_file() {
    let told = stopped_by(SIGINT);
    assert_eq!(told, "error: stopped by Ctrl-C; no file was left half-written\n");
}

#[test]
fn so_does_a_request_of_the_system() {
    let told = stopped_by(SIGTERM);
    assert_eq!(told, "error: stopped by the system or another program (SIGTERM); no file was left half-written\n");
}

/// What a command says that a signal ends.
fn stopped_by(signal: i32) -> String {
    let folder = Folder::new();
    folder.write("out.csv", "old");
    // Its log never ends: standard input stays open.
    let mut child = Command::new(env!("CARGO_BIN_EXE_gpsindy"))
        .args(["smooth", "-", "--out", "out.csv"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let open = child.stdin.take();
    while !listens(&child, SIGTERM) {
        std::thread::yield_now();
    }
    let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let mut told = String::new();
    child.stderr.take().unwrap().read_to_string(&mut told).unwrap();
    assert_eq!(child.wait().unwrap().signal(), Some(signal));
    assert_eq!((folder.names(), folder.read("out.csv")), (vec!["out.csv".into()], "old".into()));
    drop(open);
    told
}
