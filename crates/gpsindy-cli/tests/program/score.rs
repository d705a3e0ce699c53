//! `gpsindy score` as a user runs it.

use crate::common::{Folder, data};
use gpsindy_beside::shared;

const DECAY: &str = "name = \"decay\"\n[[state]]\nname = \"x\"\nunit = \"m\"\nequation = \"-x\"\n";

/// A decay at twice the model's rate.
fn fast() -> String {
    let mut text = String::from("t,x\n");
    for i in 0..=20 {
        let t = 0.1 * f64::from(i);
        text += &format!("{t},{}\n", (-2.0 * t).exp());
    }
    text
}

#[test]
fn the_error_is_the_one_on_paper() {
    let folder = Folder::new();
    folder.write("m.toml", DECAY).write("log.csv", &fast());
    let json = folder.run("score m.toml --data log.csv --json").done().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let errors = (0..=20).map(|i| (-0.1 * f64::from(i)).exp() - (-0.2 * f64::from(i)).exp());
    let expected = (errors.map(|e| e * e).sum::<f64>() / 21.0).sqrt();
    let found = json["rollout"]["by_state"][0]["rmse"].as_f64().unwrap();
    assert!((found - expected).abs() < 1e-6, "{found} and {expected}");
    assert_eq!(json["one_step"]["started"], 20);
}

#[test]
fn the_table_is_for_people_and_the_file_for_programs() {
    let folder = Folder::new();
    folder.write("m.toml", DECAY).write("log.csv", &fast());
    let text = folder.run("score m.toml --data log.csv --window 0.5").done().stdout;
    assert!(text.starts_with("decay on 1 run, 21 samples;") && text.contains("0.5 s windows"), "{text}");
    assert!(text.lines().any(|line| line.starts_with("x ") && line.contains(" m ")), "{text}");
    let ran = folder.run("score m.toml --data log.csv --out score.csv").done();
    assert_eq!(ran.stdout, "");
    assert!(
        folder
            .read("score.csv")
            .starts_with("prediction,state,unit,rmse,normalised,samples,started,diverged\nrollout,x,m,")
    );
}

#[test]
fn models_are_compared_side_by_side_on_the_same_logs() {
    let folder = Folder::new();
    folder.write("m.toml", DECAY).write("log.csv", &fast());
    folder.write("better.toml", &DECAY.replace("-x", "-1.9*x").replace("decay", "faster"));
    let text = folder.run("score m.toml better.toml --data log.csv").done().stdout;
    assert!(text.starts_with("2 models on 1 run, 21 samples;"), "{text}");
    let row = |model: &str, what: &str| {
        let cells = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
        cells.filter(|c| c.len() > 3 && c[..2] == [model, what]).map(|c| c.join(" ")).next().unwrap()
    };
    let alone = folder.run("score better.toml --data log.csv").done().stdout;
    let alone =
        alone.lines().find(|line| line.starts_with("x ")).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(row("faster", "x"), format!("faster {alone}"));
    assert!(row("decay", "together") != row("faster", "together"));
    let json = folder.run("score m.toml better.toml --data log.csv --json").done().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let pooled = |i: usize| json["models"][i]["rollout"]["pooled"].as_f64().unwrap();
    assert_eq!(json["models"][1]["model"], "faster");
    assert!(pooled(1) < 0.5 * pooled(0), "{json}");
    folder.run("score m.toml m.toml --data log.csv --out score.csv").done();
    // Two of one name go by their files.
    assert!(folder.read("score.csv").starts_with("model,prediction,state,unit,rmse,"), "{}", folder.read("score.csv"));
    assert!(folder.read("score.csv").contains("\nm.toml,rollout,x,m,"));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    let arguments = format!("score {} --data {} --run run --json", data("pendulum.toml"), data("pendulum.csv"));
    let one = folder.run(&format!("{arguments} --threads 1")).done().stdout;
    assert_eq!(folder.run(&format!("{arguments} --threads 3")).done().stdout, one);
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("m.toml", DECAY).write("log.csv", &fast()).write("y.csv", "t,y\n0,1\n1,2\n");
    for (arguments, expected) in [
        (
            "score m.toml --data y.csv",
            "y.csv: no column is a state of the model (x); found: y; name them with --rename",
        ),
        ("score m.toml --data log.csv --window 0", "`window` must be above 0 s, found 0"),
        ("score m.toml", "the following required arguments were not provided: --data <LOG>..."),
        ("score m.toml --data log.csv none.csv", "none.csv: cannot be read: there is no such file"),
    ] {
        let ran = folder.run(&format!("{arguments} --quiet"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    assert_eq!(folder.names(), ["log.csv", "m.toml", "y.csv"]);
}

#[test]
fn the_car_is_scored_where_its_logs_are_at_hand() {
    let (Some(model), Some(log)) = (shared("data/jetracer/nominal.toml"), shared("data/jetracer/rollout_01.csv"))
    else {
        return;
    };
    let (model, log) = (model.display(), log.display());
    let ran = Folder::new().run(&format!("score {model} --data {log} --angle heading --window 1")).done();
    assert!(ran.stdout.contains("heading"), "{}", ran.stdout);
}

#[test]
fn a_model_that_predicts_no_number_is_a_failure() {
    let folder = Folder::new();
    folder
        .write("m.toml", "schema = \"gpsindy.model/1\"\nname = \"m\"\n[[state]]\nname = \"v\"\nequation = \"-v/m\"\n[[parameter]]\nname = \"m\"\nvalue = 0.0\n")
        .write("log.csv", &format!("t,v\n{}", (0..50).map(|i| format!("{},{}\n", 0.1 * f64::from(i), (-0.1 * f64::from(i)).exp())).collect::<String>()));
    for option in ["", " --json", " --out s.csv"] {
        let ran = folder.run(&format!("score m.toml --data log.csv{option}")).ended(1);
        assert_eq!(
            ran.stderr,
            "error: m.toml: no prediction of the model is a number, not one step ahead; check its parameters (a division by 0?) and its initial values\n"
        );
    }
}

#[test]
fn a_log_without_a_value_is_no_fault_of_the_model() {
    let folder = Folder::new();
    let rows: String = (0..50).map(|i| format!("{},nan\n", 0.1 * f64::from(i))).collect();
    folder
        .write("m.toml", "schema = \"gpsindy.model/1\"\nname = \"m\"\n[[state]]\nname = \"v\"\nequation = \"-v\"\n")
        .write("log.csv", &format!("t,v\n{rows}"));
    let ran = folder.run("score m.toml --data log.csv").ended(2);
    let stated = "error: m.toml: the logs hold no value of a state of the model, which would be compared; log one, or score on other logs\n";
    assert_eq!(ran.stderr, stated);
}
