//! `gpsindy identify --follow` as a user runs it.

use crate::common::{Folder, data};
use serde_json::Value;
use std::io::Write;
use std::time::Duration;

fn lotka_volterra() -> String {
    std::fs::read_to_string(data("lotka_volterra.csv")).unwrap()
}

/// The lines of stdout, each a JSON object.
fn lines(stdout: &str) -> Vec<Value> {
    stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn terms(result: &Value, state: usize) -> Vec<String> {
    serde_json::from_value(result["states"][state]["terms"].clone()).unwrap()
}

#[test]
fn standard_input_is_followed_and_the_last_line_is_the_model_of_all() {
    let folder = Folder::new();
    let ran = folder
        .run_with(
            "identify - --follow --state x1,x2 --degree 2 --json --every 100 --out m.json --quiet",
            &lotka_volterra(),
        )
        .done();
    let stated = lines(&ran.stdout);
    let samples: Vec<u64> = stated.iter().map(|line| line["samples"].as_u64().unwrap()).collect();
    assert_eq!(samples, [100, 200, 300, 301]);
    assert_eq!(
        stated.iter().map(|line| line["final"].as_bool().unwrap()).collect::<Vec<_>>(),
        [false, false, false, true]
    );
    let last = stated.last().unwrap();
    assert_eq!(
        (terms(last, 0), terms(last, 1)),
        (vec!["x1".into(), "x1*x2".into()], vec!["x2".into(), "x1*x2".into()])
    );
    assert_eq!(last["t"], 30.0);
    let written: Value = serde_json::from_str(&folder.read("m.json")).unwrap();
    assert_eq!(written["identification"]["coefficients"], last["model"]["identification"]["coefficients"]);
    let growth = written["identification"]["coefficients"][0][1].as_f64().unwrap();
    // Four standard errors of 0.0013.
    assert!((growth - 1.1).abs() < 0.005, "{growth}");
}

#[test]
fn without_json_changes_are_told_on_stderr_and_the_model_can_be_piped() {
    let folder = Folder::new();
    let ran = folder.run_with("identify - --follow --state x1,x2 --degree 2", &lotka_volterra()).done();
    assert!(ran.stderr.contains("samples: x1' = "), "{}", ran.stderr);
    assert!(ran.stderr.contains("equations from 301 samples:"), "{}", ran.stderr);
    let latex = folder.run_with("export - --to latex", &ran.stdout).done();
    assert!(latex.stdout.contains("dot{x_{1}}"), "{}", latex.stdout);
}

#[test]
fn a_file_is_followed_while_it_grows() {
    let folder = Folder::new();
    let text = lotka_volterra();
    // Cut in the middle of a line.
    let (first, rest) = text.split_at(text.len() / 2);
    folder.write("log.csv", first);
    let path = folder.path().join("log.csv");
    let rest = rest.to_string();
    let writer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(300));
        let mut file = std::fs::OpenOptions::new().append(true).open(path).unwrap();
        file.write_all(rest.as_bytes()).unwrap();
    });
    // Ten times the pause.
    let ran = folder.run("identify log.csv --follow --idle 3 --state x1,x2 --degree 2 --json --quiet").done();
    writer.join().unwrap();
    assert_eq!(lines(&ran.stdout).last().unwrap()["samples"], 301);
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_it_in_good_order() {
    let folder = Folder::new();
    folder.write("log.csv", &lotka_volterra());
    let child = std::process::Command::new(env!("CARGO_BIN_EXE_gpsindy"))
        .args(
            "identify log.csv --follow --idle 600 --state x1,x2 --degree 2 --json --every 300 --out m.toml".split(' '),
        )
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let id = child.id().to_string();
    let mut child = child;
    let mut first = String::new();
    let mut stdout = std::io::BufReader::new(child.stdout.take().unwrap());
    std::io::BufRead::read_line(&mut stdout, &mut first).unwrap();
    assert_eq!(lines(&first)[0]["samples"], 300);
    // The file has the model of the newest line, not only that of the last one.
    assert!(folder.read("m.toml").contains("x1"));
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert!(child.wait().unwrap().success());
    assert!(folder.read("m.toml").contains("x1"));
}

#[test]
fn runs_of_a_file_follow_each_other() {
    let folder = Folder::new();
    let text = std::fs::read_to_string(data("pendulum.csv")).unwrap();
    let options = "--run run --state phi,omega --control u --degree 1 --term sin(phi) --term sign(omega)";
    let mut arguments: Vec<&str> = vec!["identify", "log.csv", "--follow", "--idle", "0.2", "--json", "--quiet"];
    arguments.extend(options.split(' '));
    arguments.extend(["--fix", "phi' = omega"]);
    folder.write("log.csv", &text);
    let ran = folder.run_list(&arguments).done();
    let stated = lines(&ran.stdout);
    let last = stated.last().unwrap();
    assert_eq!(terms(last, 1), ["omega", "u", "sin(phi)", "sign(omega)"]);
    assert_eq!(last["model"]["state"][0]["equation"], "omega");
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    let mut text = String::from("t,x,u,word\n");
    (0..40).for_each(|i| text += &format!("{},{},{},a\n", 0.1 * f64::from(i), f64::from(i % 7), i % 2));
    for (arguments, tail, expected) in [
        ("--state y", "", "stdin: column `y` is not in the file; found: x, u, word"),
        ("--state x --control x", "", "column `x` appears twice"),
        ("--state word", "", "stdin:2: column `word`: not a number: \"a\""),
        ("--state x", "9,1\n", "stdin:42: 2 cells where the header has 4 cells"),
        ("--state x", "0,1,2,a\n", "stdin:42: column `t`: time goes back, from 3.9000000000000004 to 0"),
        ("--state x", "9,inf,2,a\n", "stdin:42: column `x`: infinite value \"inf\""),
        ("--state x --memory 0", "", "`memory` must be above 0 and finite, in s, found 0"),
        ("--state x --window 10", "", "`window` must be at least 64 samples, found 10"),
        ("--state x --kernel se", "", "--kernel se does not go with --follow: take matern32 or matern52"),
        ("--state x --ensemble 5", "", "--ensemble does not go with --follow"),
        ("--state x --refine", "", "--refine does not go with --follow"),
        ("--state x --train-fraction 0.5", "", "--train-fraction does not go with --follow"),
        ("--state x --select rollout", "", "--select rollout does not go with --follow"),
        ("--state x --derivative x=u", "", "--derivative does not go with --follow"),
        ("--state x --preset paper", "", "--derivative-method or --preset does not go with --follow"),
        ("--state x --preset author", "", "--preset author does not go with --follow: it needs the whole log"),
        ("--state x --control u --delay u=auto", "", "--delay u=auto does not go with --follow"),
        ("--state x --idle 0", "", "--idle must be above 0, found 0"),
        ("--state x --every 0", "", "invalid value '0' for '--every <N>'"),
    ] {
        // Behind some samples the file would have the model of these.
        let out = if tail.is_empty() { " --out m.toml" } else { "" };
        let ran = folder.run_with(&format!("identify - --follow {arguments} --quiet{out}"), &format!("{text}{tail}"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    let alone = folder.run("identify log.csv --state x --every 10");
    assert!(alone.refused().contains("--follow"), "{alone:?}");
    assert!(folder.run("identify no.csv --follow").refused().starts_with("no.csv: cannot be read"));
    assert!(folder.run("identify a.csv b.csv --follow").refused().starts_with("--follow takes one log, found 2"));
    let few = folder.run_with("identify - --follow --state x --quiet", "t,x\n0,1\n1,2\n");
    assert_eq!(few.refused(), "online identification: needs at least 16 samples, found 2");
    assert!(folder.names().is_empty());
}
