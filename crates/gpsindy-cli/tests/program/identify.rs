//! `gpsindy identify` as a user runs it.

use crate::common::{Folder, data};

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
    assert!(ran.stdout.contains("rollouts over whole training runs"), "{}", ran.stdout);
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
        ("--state x --degree 12", "invalid value '12' for '--degree <N>': expected a whole number from 0 to 9"),
        ("--state x --lambda much", "--lambda must be auto or a number, found `much`"),
        ("--state x --lambda -1", "--lambda must be at least 0, found -1"),
        ("--state x --control u --delay u=soon", "--delay u=soon: expected auto, auto:SECONDS or a number of seconds"),
        ("--state x --train-fraction 0", "--train-fraction must be above 0 and at most 1, found 0"),
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

#[test]
fn a_column_that_counts_the_years_becomes_no_state() {
    let folder = Folder::new();
    let ran = folder.run(&format!("identify {} --degree 2", data("hare_lynx.csv"))).done();
    assert!(
        ran.stderr.contains("not used as a state, because it is a linear function of time: year"),
        "{}",
        ran.stderr
    );
    assert!(!ran.stdout.contains("name = \"year\""), "{}", ran.stdout);
}

#[test]
fn rollouts_that_follow_little_of_the_logs_are_stated() {
    let folder = Folder::new();
    let stated = |degree: u32| {
        folder.run(&format!("identify {} --state hare,lynx --degree {degree}", data("hare_lynx.csv"))).done().stderr
    };
    assert!(
        stated(3).contains("warning: rollouts miss 80 % of the logs' variance; try a lower --degree"),
        "{}",
        stated(3)
    );
    assert!(!stated(2).contains("warning: rollouts miss"), "{}", stated(2));
}

#[test]
#[ignore = "a known miss: from the smoothed start degree 3 follows hare and lynx within the noise as well as degree 2 (relative error \
            0.43 against 0.33), so it stands; from the first count it does not (0.89 against 0.41)"]
fn a_library_that_is_too_large_gives_way_to_one_that_follows_the_logs() {
    let folder = Folder::new();
    let ran = folder.run(&format!("identify {} --state hare,lynx --json", data("hare_lynx.csv"))).done();
    let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(result["rollout"]["pooled"].as_f64().unwrap() < 0.5, "{}", result["rollout"]);
    assert!(ran.stderr.contains("degree 2"), "{}", ran.stderr);
}

#[test]
fn polynomials_that_are_too_few_get_help_unless_the_library_is_given() {
    let folder = Folder::new();
    // Exact motion of x' = x (1 - ln x) from x = 0.1: ln x goes to 1 as exp(-t).
    let x = |t: f64| (1.0 - (1.0 - 0.1_f64.ln()) * (-t).exp()).exp();
    let rows: String = (0..200).map(|i| 0.04 * f64::from(i)).map(|t| format!("{t},{}\n", x(t))).collect();
    folder.write("growth.csv", &format!("t,x\n{rows}"));
    let found = |options: &str| {
        let ran = folder.run(&format!("identify growth.csv --state x {options} --json")).done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        (terms(&result, 0), result["notes"].to_string())
    };
    let (grown, notes) = found("");
    assert_eq!(grown, ["x", "x*log(x)"]);
    assert!(
        notes.contains("a larger library explains the logs better than the terms asked for, with x*log(x)"),
        "{notes}"
    );
    let (given, notes) = found("--library given");
    assert!(given.iter().all(|term| !term.contains("log")) && !notes.contains("larger library"), "{given:?} {notes}");
    // Terms that are named are all there are, unless more are asked for.
    assert!(found("--term sqrt(x)").0.iter().all(|term| !term.contains("log")));
    assert_eq!(found("--term sqrt(x) --library auto").0, ["x", "x*log(x)"]);
}

#[test]
fn terms_that_the_logs_hardly_distinguish_are_in_the_summary() {
    let folder = Folder::new();
    let ran = folder.run(&format!("identify {} --state hare,lynx --out m.toml", data("hare_lynx.csv"))).done();
    assert!(
        ran.stdout.contains("\n  hare': hare*lynx^2 could also be hare*lynx, as far as these logs show\n"),
        "{ran:?}"
    );
    let clear = folder.run(&format!("identify {} --state x1,x2 --out n.toml", data("lotka_volterra.csv"))).done();
    assert!(!clear.stdout.contains("could also be"), "{clear:?}");
}

#[test]
fn the_unit_of_a_column_makes_no_model_poor() {
    let folder = Folder::new();
    for unit in [1e-30, 1.0, 1e12, 1e30] {
        let x = |t: f64, i: u32| unit * ((-t).exp() + 0.002 * ((f64::from(i) * 0.618_034).fract() - 0.5));
        let rows: String =
            (0..200).map(|i| (0.05 * f64::from(i), i)).map(|(t, i)| format!("{t},{:e}\n", x(t, i))).collect();
        folder.write("log.csv", &format!("t,x\n{rows}"));
        let ran = folder.run("identify log.csv --state x --json").done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(terms(&result, 0), ["x"], "{unit}");
        assert!(!ran.stderr.contains("diverge") && !result["notes"].to_string().contains("diverge"), "{unit}: {ran:?}");
    }
}

#[test]
fn a_poor_model_says_so_first_and_ends_with_status_1() {
    let folder = Folder::new();
    // The digits of multiples of the golden ratio: nothing foretells them.
    let value = |i: u32| (f64::from(i) * 0.618_034 * 997.0).fract();
    let rows: String = (0..150).map(|i| format!("{},{}\n", 0.1 * f64::from(i), value(i * i % 151))).collect();
    folder.write("noise.csv", &format!("t,x\n{rows}"));
    let ran = folder.run("identify noise.csv --state x --out m.toml");
    assert_eq!(ran.status, 1, "{ran:?}");
    assert!(ran.stdout.starts_with("POOR: ") && ran.stderr.contains("--accept-poor"), "{ran:?}");
    assert!(folder.read("m.toml").contains("[identification]"));
    let accepted = folder.run("identify noise.csv --state x --accept-poor --json").done();
    let result: serde_json::Value = serde_json::from_str(&accepted.stdout).unwrap();
    assert_eq!(result["poor"], true);
}

#[test]
fn held_out_logs_are_scored_and_not_learnt_from() {
    let folder = Folder::new();
    let log = |offset: f64| -> String {
        let rows = (0..100).map(|i| 0.05 * f64::from(i)).map(|t| format!("{t},{}\n", (offset - 0.7 * t).exp()));
        format!("t,x\n{}", rows.collect::<String>())
    };
    folder.write("a.csv", &log(0.0));
    folder.write("b.csv", &log(0.4));
    let arguments = "identify a.csv --state x --degree 1";
    let alone = folder.run(&format!("{arguments} --json")).done();
    let held_out = folder.run(&format!("{arguments} --holdout b.csv --json")).done();
    let [alone, held_out] =
        [alone, held_out].map(|ran| -> serde_json::Value { serde_json::from_str(&ran.stdout).unwrap() });
    assert_eq!(alone["model"], held_out["model"]);
    assert_eq!([&alone["scored_on"], &held_out["scored_on"]], ["training", "holdout"]);
    let rest = folder.run(&format!("{arguments} --train-fraction 0.5 --out m.toml")).done();
    assert!(rest.stdout.contains("the last part of every run, which was not used for training"), "{}", rest.stdout);
    let same = folder.run(&format!("{arguments} --holdout a.csv"));
    assert!(same.status == 2 && same.stderr.contains("is named both for training and in --holdout"), "{same:?}");
}

#[test]
fn what_controls_do_between_samples_is_kept_in_the_model_and_used() {
    let folder = Folder::new();
    let u = |t: f64| (3.0 * t).sin();
    // x' = u between samples by a straight line.
    let mut x = 0.0;
    let rows: String = (0..120)
        .map(|i| 0.2 * f64::from(i))
        .map(|t| {
            let row = format!("{t},{x},{}\n", u(t));
            x += 0.1 * (u(t) + u(t + 0.2));
            row
        })
        .collect();
    folder.write("log.csv", &format!("t,x,u\n{rows}"));
    folder.run("identify log.csv --state x --control u --degree 1 --out m.toml").done();
    assert!(folder.read("m.toml").contains("hold = \"linear\""), "{}", folder.read("m.toml"));
    let score = |hold: &str| -> f64 {
        let ran = folder.run(&format!("score m.toml --data log.csv --json {hold}")).done();
        let result: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        result["rollout"]["pooled"].as_f64().unwrap()
    };
    assert_eq!(score(""), score("--hold linear"));
    assert!(score("--hold zero") > 10.0 * score(""));
    let simulate = |hold: &str| folder.run(&format!("simulate m.toml --data log.csv {hold}")).done().stdout;
    assert_eq!(simulate(""), simulate("--hold linear"));
    assert_ne!(simulate(""), simulate("--hold zero"));
}

#[test]
fn mistakes_in_states_and_degree_are_named() {
    let folder = Folder::new();
    let log = data("hare_lynx.csv");
    for (options, expected) in [
        ("--state t,hare", "`t` is the time column and cannot be a state; leave it out"),
        ("--state hare --degree -1", "expected a whole number from 0 to 9"),
        ("--state hare --degree two", "expected a whole number from 0 to 9"),
        ("--state hare --free h --term hare^2", "`h` must be in a term or an equation that is given"),
    ] {
        let ran = folder.run(&format!("identify {log} {options}"));
        assert!(ran.status == 2 && ran.stderr.contains(expected), "{options}: {ran:?}");
    }
}
