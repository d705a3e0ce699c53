//! Ctrl-C and SIGTERM in the middle of the work.

#![cfg(target_os = "linux")]

use crate::common::Folder;
use std::io::{BufRead, BufReader, Read};
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
    let stated = stopped_by(SIGINT);
    assert_eq!(stated, "error: stopped by Ctrl-C; no file was left half-written\n");
}

#[test]
fn so_does_a_request_of_the_system() {
    let stated = stopped_by(SIGTERM);
    assert_eq!(stated, "error: stopped by the system or another program (SIGTERM); no file was left half-written\n");
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
    let mut stated = String::new();
    child.stderr.take().unwrap().read_to_string(&mut stated).unwrap();
    assert_eq!(child.wait().unwrap().signal(), Some(signal));
    assert_eq!((folder.names(), folder.read("out.csv")), (vec!["out.csv".into()], "old".into()));
    drop(open);
    stated
}

/// Logs of an oscillator that the model does not explain at once: a drag, a spring that hardens, and two tones that no column carries.
fn oscillator(folder: &Folder) -> Vec<String> {
    let model = "schema = \"gpsindy.model/1\"\nname = \"oscillator\"\n[[state]]\nname = \"x\"\nequation = \"v\"\n[[state]]\nname = \"v\"\n\
        equation = \"u - 4*x - 0.3*v\"\n[[control]]\nname = \"u\"\n";
    folder.write("model.toml", model);
    let name = |run: u32| format!("run_{run}.csv");
    for run in 0..8 {
        let (mut x, mut v, mut text) = (0.5_f64, 0.0_f64, String::from("t,x,v,u,note\n"));
        for i in 0..3000 {
            let t = 0.02 * f64::from(i);
            let u = (f64::from(run + 2) * 0.7 * t).sin() + (2.3 * t).cos();
            let error = 1e-3 * (f64::from(i * i % 9973) * 1.7 + f64::from(run)).sin();
            text += &format!("{t:.2},{:.6},{:.6},{u:.6},x\n", x + error, v - error);
            for part in 0..20 {
                let at = t + 1e-3 * f64::from(part);
                let tones = 0.4 * (3.1 * at).sin() + 0.3 * (7.7 * at + f64::from(run)).sin();
                v += 1e-3 * (u - 4.0 * x - 0.3 * v - 0.5 * v * v.abs() - 2.0 * x.powi(3) + tones);
                x += 1e-3 * v;
            }
        }
        folder.write(&name(run), &text);
    }
    (0..8).map(name).collect()
}

#[test]
fn the_first_request_ends_a_diagnosis_with_the_best_so_far() {
    for (signal, again) in [(SIGINT, "Ctrl-C again"), (SIGTERM, "a second SIGTERM")] {
        ends_with_the_best_so_far(signal, again);
    }
}

fn ends_with_the_best_so_far(signal: i32, again: &str) {
    let folder = Folder::new();
    let logs = oscillator(&folder);
    let mut child = Command::new(env!("CARGO_BIN_EXE_gpsindy"))
        .args(["diagnose", "model.toml", "--threads", "1", "--out", "report"])
        .args(logs)
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stated = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    // The logs are read, and the search begins.
    while !line.starts_with("columns ignored: ") {
        line.clear();
        assert!(stated.read_line(&mut line).unwrap() > 0, "no note about the columns");
    }
    std::thread::sleep(std::time::Duration::from_millis(300));
    let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let mut rest = String::new();
    stated.read_to_string(&mut rest).unwrap();
    assert!(rest.contains(&format!("stopping with the best so far; {again} ends at once")), "{rest}");
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert!(report["interrupted"].as_f64().unwrap() > 0.0, "{report}");
    assert_ne!(report["verdict"], "explained", "{report}");
}
