//! `gpsindy identify` as a user runs it.
#![allow(clippy::unwrap_used)]

mod common;
use common::{Folder, data};

/// Terms of an equation, in order, of a model written as JSON.
fn terms(result: &serde_json::Value, state: usize) -> Vec<String> {
    serde_json::from_value(result["states"][state]["terms"].clone()).unwrap()
}

#[test]
fn lotka_volterra_has_its_four_terms_and_no_other() {
    let folder = Folder::new();
    for extra in ["", "--derivative x1=dx1 --derivative x2=dx2 --trig --products --degree 2"] {
        let ran = folder.run(&format!("identify {} --state x1,x2 {extra} --json", data("lotka_volterra.csv"))).done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(terms(&result, 0), ["x1", "x1*x2"], "{extra}");
        assert_eq!(terms(&result, 1), ["x2", "x1*x2"], "{extra}");
        assert_eq!(result["model"]["identification"]["terms"][1], "x1");
    }
}

#[test]
fn the_unicycle_has_its_four_terms_and_no_other() {
    let folder = Folder::new();
    let derivatives = "--derivative x1=dx1 --derivative x2=dx2 --derivative x3=dx3 --derivative x4=dx4";
    let library = "--degree 1 --trig --products --hold linear";
    let ran = folder
        .run(&format!(
            "identify {} --state x1,x2,x3,x4 --control u1,u2 {derivatives} {library} --json",
            data("unicycle.csv")
        ))
        .done();
    let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let found: Vec<Vec<String>> = (0..4).map(|s| terms(&result, s)).collect();
    assert_eq!(found, [["x3*cos(x4)"], ["x3*sin(x4)"], ["u1"], ["u2"]]);
}

#[test]
fn the_model_goes_to_the_file_and_the_summary_to_the_screen() {
    let folder = Folder::new();
    let arguments = format!("identify {} --state hare,lynx --degree 2", data("hare_lynx.csv"));
    let ran = folder.run(&format!("{arguments} --out m.toml")).done();
    assert!(ran.stdout.starts_with("equations from 1 run, 21 samples:\n\n  hare' = "), "{}", ran.stdout);
    assert!(ran.stdout.contains("hare': hare*lynx") && ran.stdout.contains("lynx': hare*lynx"), "{}", ran.stdout);
    assert!(ran.stdout.ends_with("\nmodel: m.toml\n") && ran.stderr.contains("columns ignored: year\n"), "{ran:?}");
    // Without --out the same model goes to stdout, so that it can be piped.
    let piped = folder.run(&arguments).done();
    assert_eq!(piped.stdout, folder.read("m.toml"));
    assert!(piped.stderr.contains("equations from 1 run"), "{}", piped.stderr);
    let rollout = folder.run_with(&format!("simulate - --data {}", data("hare_lynx.csv")), &piped.stdout).done();
    assert_eq!(rollout.stdout.lines().count(), 22);
    folder.run(&format!("{arguments} --out m.json --quiet")).done();
    assert_eq!(
        folder.run("export m.json --to sympy").done().stdout,
        folder.run("export m.toml --to sympy").done().stdout
    );
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    let arguments = format!("identify {} --state x1,x2 --degree 2 --ensemble 20 --seed 3", data("lotka_volterra.csv"));
    let one = folder.run(&format!("{arguments} --threads 1")).done().stdout;
    for threads in [2, 5] {
        assert_eq!(folder.run(&format!("{arguments} --threads {threads}")).done().stdout, one);
    }
}

#[test]
fn what_is_known_beforehand_is_kept() {
    let folder = Folder::new();
    let ran = folder.run_list(&[
        "identify",
        &data("pendulum.csv"),
        "--run",
        "run",
        "--state",
        "phi,omega",
        "--control",
        "u",
        "--degree",
        "1",
        "--fix",
        "phi' = omega",
        "--forbid",
        "omega:phi",
        "--forbid",
        "omega:1",
        "--term",
        "sin(phi)",
        "--term",
        "sign(omega)",
        "--sign",
        "omega:omega=-",
        "--json",
    ]);
    let result: serde_json::Value = serde_json::from_str(&ran.done().stdout).unwrap();
    assert_eq!(result["model"]["state"][0]["equation"], "omega");
    assert_eq!(terms(&result, 1), ["omega", "u", "sin(phi)", "sign(omega)"]);
}

#[test]
fn every_method_of_the_contract_runs() {
    let folder = Folder::new();
    let log = data("lotka_volterra.csv");
    for options in [
        "--regressor lasso",
        "--regressor sqrt-lasso",
        "--regressor stlsq",
        "--regressor ssr-coefficient",
        "--regressor ssr-residual",
        "--derivative-method gp-time",
        "--derivative-method difference --smoother none",
        "--derivative-method weak",
        "--derivative-method given --derivative x1=dx1 --derivative x2=dx2",
        "--kernel matern52",
        "--select bic",
        "--select rollout",
        "--lambda 2",
        "--standardize",
        "--preset paper",
        "--preset paper --regressor stlsq --lambda 0.1",
        "--train-fraction 0.5",
    ] {
        let ran = folder.run(&format!("identify {log} --state x1,x2 --degree 2 --no-refine --quiet {options}")).done();
        assert!(ran.stdout.starts_with("schema = \"gpsindy.model/1\""), "{options}: {ran:?}");
    }
}

#[test]
fn a_velocity_that_no_log_carries_is_taken_from_its_position() {
    let folder = Folder::new();
    // x'' = -4 x, exactly.
    let rows: String = (0..200).map(|i| 0.05 * f64::from(i)).map(|t| format!("{t},{}\n", (2.0 * t).cos())).collect();
    folder.write("log.csv", &format!("t,x [m]\n{rows}"));
    for states in [vec!["--state", "x,v"], vec![]] {
        let mut arguments = vec!["identify", "log.csv", "--fix", "x' = v", "--degree", "1", "--kernel", "se", "--json"];
        arguments.extend(states);
        let ran = folder.run_list(&arguments).done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(terms(&result, 1), ["x"], "{ran:?}");
        assert!(result["model"]["state"][1]["equation"].as_str().unwrap().starts_with("-4"), "{ran:?}");
        assert_eq!(result["model"]["state"][1]["unit"], "m/s");
        assert!(result["notes"][0].as_str().unwrap().contains("`v` is not in the logs"), "{ran:?}");
    }
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("log.csv", "t,x,u,word\n0,1,0,a\n1,2,0,b\n2,1,1,c\n3,0,1,d\n4,1,0,e\n5,2,0,f\n");
    for (arguments, expected) in [
        ("--state y", "log.csv: column `y` is not in the file; found: x, u, word"),
        ("--state x --control x", "column `x` has two roles; name it in one option"),
        ("--state x --derivative y=u", "log.csv: column `y` is not in the file"),
        ("--state x --term v", "in term `v` the name `v` is unknown; known: x"),
        (
            "--state x,v",
            "log.csv: column `v` is not in the file; found: x, u, word; a velocity that is not logged needs",
        ),
        ("--state x --fix 'x = u'", "--fix: "),
        ("--state x --forbid x", "--forbid: "),
        ("--state x --sign x:u", "--sign: "),
        ("--state x --degree 12", "`degree` must be from 0 to 9, found 12"),
        ("--state x --lambda much", "--lambda must be auto or a number, found `much`"),
        ("--state x --lambda -1", "--lambda must be at least 0, found -1"),
        ("--state x --control u --delay u=soon", "--delay u=soon: expected auto, auto:SECONDS or a number of seconds"),
        ("--state x --train-fraction 0", "`train-fraction` must be above 0 and at most 1, found 0"),
        ("--state word", "log.csv:2: column `word`: not a number: \"a\""),
        ("--state x --out no/m.toml", "--out: folder no does not exist; create it first"),
        ("--state x --kernel gauss", "--kernel: "),
        ("--state x --regressor ridge", "invalid value 'ridge' for '--regressor <REGRESSOR>'"),
    ] {
        let ran = folder.run(&format!("identify log.csv {arguments} --quiet"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    let ran = folder.run_with("identify -", "t,x\n0,1\n1,inf\n");
    assert!(ran.refused().contains("stdin:3: column `x`: "), "{ran:?}");
    let ran = folder.run_list(&["identify", "log.csv", "--state", "x", "--control", "u", "--fix", "x' = w + u"]);
    let expected = "in the equation given for `x` the name `w` is unknown; known: x, u";
    assert!(ran.refused().starts_with(expected), "{ran:?}");
    assert_eq!(folder.names(), ["log.csv"]);
}

#[test]
fn the_authors_pipeline_runs_on_one_log_and_refuses_what_it_lacks() {
    let folder = Folder::new();
    let common = format!("identify {} --state x1,x2 --preset author --degree 2", data("lotka_volterra.csv"));
    let given = "--derivative x1=dx1 --derivative x2=dx2 --lambda 0.1 --train-fraction 0.8";
    for (smoother, kernel) in [("--smoother none", ""), ("", "--kernel se")] {
        let ran = folder.run(&format!("{common} {given} {smoother} {kernel} --json")).done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!((result["lambda"].as_f64(), result["model"]["state"][0]["name"].as_str()), (Some(0.1), Some("x1")));
        // Forward Euler at 0.1 s leaves the cycle within 24 s, with whatever coefficients; over 6 s it stays.
        let error = |name: &str| result[name].as_f64().unwrap();
        assert!(error("train_error") > 50.0 && error("test_error") < 15.0, "{}", ran.stdout);
        let record = &result["model"]["identification"];
        let at = record["terms"].as_array().unwrap().iter().position(|t| t == "x1*x2").unwrap();
        let found = record["coefficients"][1][at].as_f64().unwrap();
        assert!((found - 0.4).abs() < 0.05, "{found}");
    }
    for (option, word) in [
        ("--refine", "--refine"),
        ("--regressor stlsq", "--regressor"),
        ("--smoother none --gp-input x1=x2", "--gp-input"),
        ("--gp-input dx1=x2", "no state"),
    ] {
        let ran = folder.run(&format!("{common} {option}"));
        assert!(ran.refused().contains(word), "{option}: {ran:?}");
    }
    let alone = folder.run(&format!("identify {} --state x1,x2 --gp-input x1=x2", data("lotka_volterra.csv")));
    assert!(alone.refused().contains("--preset author"), "{alone:?}");
}
