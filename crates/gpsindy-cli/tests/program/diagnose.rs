//! `gpsindy diagnose`, `exam` and `effects` as a user runs them.

use crate::common::Folder;
use crate::common::slider::{SLIDER, coast};

fn lab(drag: f64) -> Folder {
    let folder = Folder::new();
    folder.write("slider.toml", SLIDER);
    for (i, start) in [1.5, 2.5, 3.0, 2.0].into_iter().enumerate() {
        folder.write(&format!("run_{}.csv", i + 1), &coast(start, drag));
    }
    folder
}

const LOGS: &str = "run_1.csv run_2.csv run_3.csv --holdout run_4.csv";
const SUSPECTS: &str = "--effects quadratic_drag,coulomb_friction,bias";

#[test]
fn rates_are_per_the_logs_own_unit_of_time_unless_the_model_speaks_of_seconds() {
    let folder = lab(0.3);
    for i in 1..=4 {
        let log = folder.read(&format!("run_{i}.csv")).replace("t [s]", "t [h]").replace("v [m/s]", "v [kg]");
        folder.write(&format!("run_{i}.csv"), &log);
    }
    let units = |report: &str| -> Vec<String> {
        let report: serde_json::Value = serde_json::from_str(report).unwrap();
        [&report["gap"]["by_state"][0], &report["causes"][0]["parameters"][0], &report["excluded"][0]]
            .map(|entry| entry["unit"].as_str().unwrap().to_string())
            .into()
    };
    let command = format!("diagnose slider.toml {LOGS} {SUSPECTS} --out report --quiet --json");
    folder.write("slider.toml", &SLIDER.replace("m/s", "kg"));
    let ran = folder.run(&command).done();
    assert_eq!(units(&ran.stdout), ["kg/h", "1/(kg*h)", "kg/h"]);
    assert!(folder.read("report/augmented.toml").contains("unit = \"1/(kg*h)\""));
    assert!(!folder.read("report/report.html").contains("kg/s"));
    folder.write("slider.toml", SLIDER);
    assert_eq!(units(&folder.run(&command).done().stdout), ["m/s^2", "1/m", "m/s^2"]);
}

#[test]
fn the_missing_drag_is_found_and_the_corrected_simulator_runs() {
    let folder = lab(0.3);
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --out report --quiet")).done();
    assert!(
        ran.stdout.starts_with("EXPLAINED  slider") && ran.stdout.ends_with("report: report/report.html\n"),
        "{}",
        ran.stdout
    );
    assert!(!ran.stdout.contains('\x1b') && ran.stderr.is_empty(), "{ran:?}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert_eq!(report["schema"], "gpsindy.diagnosis/1");
    assert_eq!(report["verdict"], "explained");
    assert_eq!(report["causes"][0]["effect"], "quadratic_drag");
    assert_eq!(report["runs"]["holdout"][0], "run_4.csv");
    assert!(report.get("figures").is_none());
    let size = report["causes"][0]["parameters"][0]["value"].as_f64().unwrap();
    // Noise of 0.4 % of the signal on 240 samples.
    assert!((size - 0.3).abs() < 0.02, "{size}");
    assert!(folder.read("report/report.html").starts_with("<!DOCTYPE html>"));
    let before = folder.run("score slider.toml --data run_4.csv --json").done().stdout;
    let after = folder.run("score report/augmented.toml --data run_4.csv --json").done().stdout;
    let error =
        |json: &str| serde_json::from_str::<serde_json::Value>(json).unwrap()["rollout"]["pooled"].as_f64().unwrap();
    assert!(error(&after) < 0.1 * error(&before), "{} and {}", error(&after), error(&before));
}

#[test]
fn a_perfect_simulator_has_no_gap() {
    let ran = lab(0.0).run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --json --quiet")).done();
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(report["verdict"], "no_gap", "{}", ran.stdout);
    assert_eq!(ran.stderr, "");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let folder = lab(0.3);
    let one = folder.run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --json --threads 1")).done().stdout;
    assert_eq!(folder.run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --json --threads 3")).done().stdout, one);
}

#[test]
fn a_file_that_gpsindy_did_not_write_is_not_overwritten() {
    let folder = lab(0.3);
    std::fs::create_dir_all(folder.path().join("report")).unwrap();
    folder.write("report/augmented.toml", SLIDER);
    let command = format!("diagnose slider.toml {LOGS} {SUSPECTS} --out report --quiet");
    let ran = folder.run(&command);
    let refusal = ran.refused();
    assert!(refusal.contains("augmented.toml") && refusal.contains("--force"), "{refusal}");
    assert_eq!(folder.read("report/augmented.toml"), SLIDER);
    folder.run(&format!("{command} --force")).done();
    // What it wrote itself it may write again.
    folder.run(&command).done();
}

#[test]
fn a_verdict_ends_with_status_3_where_it_was_asked_to() {
    let folder = lab(0.3);
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --quiet --fail-if gap"));
    assert_eq!(ran.status, 3, "{ran:?}");
    assert!(ran.stdout.starts_with("EXPLAINED"), "{ran:?}");
    folder.run(&format!("diagnose slider.toml {LOGS} {SUSPECTS} --quiet --fail-if unexplained")).done();
}

#[test]
fn effects_of_the_user_s_own_are_suspects_too() {
    let folder = lab(0.3);
    folder.write("own.toml", "[[effect]]\nid = \"wake\"\nstate = \"v\"\nform = \"-c*v^2\"\nparameters = [{ name = \"c\", low = 0.0, high = 2.0 }]\n");
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} --effects wake --effects-file own.toml --json")).done();
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(report["causes"][0]["effect"], "wake", "{}", ran.stdout);
}

#[test]
fn a_control_that_no_log_has_may_be_said_to_be_constant() {
    let folder = lab(0.3);
    folder.write(
        "u.toml",
        &SLIDER.replace("-b*v", "u - b*v").replace("[[parameter]]", "[[control]]\nname = \"u\"\n[[parameter]]"),
    );
    let ran = folder.run(&format!("diagnose u.toml {LOGS} {SUSPECTS} --constant u=0 --quiet")).done();
    assert!(ran.stdout.starts_with("EXPLAINED"), "{ran:?}");
    let ran = folder.run(&format!("diagnose u.toml {LOGS} --constant u=0 --constant v=1"));
    assert!(ran.refused().starts_with("run_1.csv: --constant v: the log has a column `v` already"), "{ran:?}");
    let ran = folder.run(&format!("diagnose u.toml {LOGS} --constant u"));
    assert!(ran.refused().contains("--constant <COLUMN=VALUE>"), "{ran:?}");
}

#[test]
fn every_mistake_is_one_line_and_nothing_is_written() {
    let folder = lab(0.3);
    folder.write(
        "u.toml",
        &SLIDER.replace("-b*v", "u - b*v").replace("[[parameter]]", "[[control]]\nname = \"u\"\n[[parameter]]"),
    );
    folder
        .write("w.toml", &SLIDER.replace("-b*v", "-b*w"))
        .write("bomb.toml", &SLIDER.replace("-b*v", "exp(exp(50*v^2))"));
    folder.write("short.csv", "t,v\n0,1\n").write("x.csv", "t,x\n0,1\n1,1\n").write("own.toml", "[[effect]]\nid = 1\n");
    let before = folder.names();
    for (arguments, expected) in [
        ("slider.toml", "the following required arguments were not provided: <LOG>..."),
        (
            "u.toml run_1.csv",
            "run_1.csv: column `u` is not in the file; found: v, note; the model needs it as a control: give a column that name with --rename COLUMN=u, or say that it was constant, --constant u=0",
        ),
        ("w.toml run_1.csv", "w.toml: `-b*w`, at character 4: name `w` is unknown in the equation of state `v`"),
        ("slider.toml short.csv", "short.csv:2: 1 sample; a run needs at least 2"),
        ("slider.toml x.csv", "x.csv: no column is a state of the model (v); found: x; name them with --rename"),
        ("slider.toml run_1.csv --effects nothing", "effect `nothing` is unknown; known: parameter_error, bias"),
        ("slider.toml run_1.csv --effects bias,!coulomb_friction", "--effects: name either the effects to test"),
        ("slider.toml run_1.csv --effects-file own.toml", "own.toml:2: invalid type: integer `1`, expected a string"),
        ("slider.toml run_1.csv --confidence 2", "`confidence` must be between 0.5 and 0.999, found 2"),
        ("slider.toml run_1.csv --holdout run_1.csv", "run_1.csv is named both for training and in --holdout"),
        ("slider.toml run_1.csv --holdout nothing.csv", "nothing.csv: cannot be read: there is no such file"),
    ] {
        let ran = folder.run(&format!("diagnose {arguments} --out report --quiet"));
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}\nexpected {expected}");
    }
    let ran = folder.run("diagnose slider.toml run_1.csv --out run_2.csv");
    assert!(ran.refused().starts_with("--out: run_2.csv is a file; name a folder"), "{ran:?}");
    let ran = folder.run(&format!("diagnose bomb.toml {LOGS} --out report"));
    assert!(ran.status != 0 && ran.stderr.lines().filter(|l| l.starts_with("error: ")).count() == 1, "{ran:?}");
    assert_eq!(folder.names(), before);
}

#[test]
fn a_simulator_of_which_there_are_only_logs_is_identified_first() {
    let folder = lab(0.3);
    for (i, start) in [1.5, 2.5, 3.0, 2.0, 1.0, 2.8].into_iter().enumerate() {
        folder.write(&format!("sim_{}.csv", i + 1), &coast(start, 0.0));
    }
    let sims = "--simulated sim_1.csv sim_2.csv sim_3.csv sim_4.csv sim_5.csv sim_6.csv --state v --degree 1";
    let ran = folder.run(&format!("diagnose {LOGS} {SUSPECTS} {sims} --out report --quiet")).done();
    assert!(ran.stdout.starts_with("EXPLAINED"), "{}", ran.stdout);
    let report: serde_json::Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert_eq!(report["causes"][0]["effect"], "quadratic_drag");
    assert!(folder.read("report/simulator.toml").contains("gpsindy.model/1"));
    let ran = folder.run(&format!("diagnose {LOGS} --simulated sim_1.csv run_1.csv --state v"));
    assert!(ran.refused().starts_with("run_1.csv is named both as a log of the machine and in --simulated"), "{ran:?}");
}

#[test]
fn a_power_study_says_what_the_logs_could_reveal() {
    let folder = lab(0.0);
    let suspects = "--effects quadratic_drag,bias --power --out report --quiet";
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} {suspects}")).done();
    assert!(ran.stdout.contains("\nPower    Each effect was added"), "{}", ran.stdout);
    let report: serde_json::Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert_eq!(report["power"]["null"]["draws"], 20);
    assert_eq!(report["power"]["effects"].as_array().unwrap().len(), 2);
    assert!(folder.read("report/report.html").contains("What could these logs reveal?"));
    let one = folder.run(&format!("diagnose slider.toml {LOGS} {suspects} --json --threads 1")).done().stdout;
    assert_eq!(folder.run(&format!("diagnose slider.toml {LOGS} {suspects} --json --threads 3")).done().stdout, one);
}

#[test]
fn an_exam_reads_the_answers_last_and_rates_the_diagnoses() {
    let folder = lab(0.3);
    for case in ["case_1", "case_2"] {
        std::fs::create_dir_all(folder.path().join("suite").join(case)).unwrap();
        folder.write(&format!("suite/{case}/model.toml"), SLIDER);
        let drag = if case == "case_1" { 0.3 } else { 0.0 };
        for (name, start) in [("real_1.csv", 1.5), ("real_2.csv", 2.5), ("real_10.csv", 3.0), ("holdout_1.csv", 2.0)] {
            folder.write(&format!("suite/{case}/{name}"), &coast(start, drag));
        }
    }
    let ran = folder.run(&format!("exam suite {SUSPECTS}"));
    assert!(ran.refused().starts_with("suite/answers.toml: there is no such file"), "{ran:?}");
    folder.write(
        "suite/answers.toml",
        "[[case]]\nid = \"case_1\"\neffects = [{ effect = \"quadratic_drag\", state = \"v\", variables = [\"v\"] }]\n[[case]]\nid = \"case_2\"\n",
    );
    let ran = folder.run(&format!("exam suite {SUSPECTS}")).done();
    assert!(ran.stdout.starts_with("2 cases: 1 null, 1 with one effect"), "{}", ran.stdout);
    let card: serde_json::Value = serde_json::from_str(&folder.read("exam/scorecard.json")).unwrap();
    assert_eq!(card["top_1"]["hits"], 1, "{card}");
    let report: serde_json::Value = serde_json::from_str(&folder.read("exam/case_1/report.json")).unwrap();
    assert_eq!(report["runs"]["train"], serde_json::json!(["real_1.csv", "real_2.csv", "real_10.csv"]));
    let ran = folder.run("exam suite --only case_9");
    assert!(ran.refused().starts_with("--only: suite has no case `case_9`"), "{ran:?}");
    assert!(folder.run("exam nowhere").refused().starts_with("nowhere: not a folder that can be read"));
}

#[test]
fn the_catalogue_is_listed_for_people_and_programs() {
    let folder = Folder::new();
    let text = folder.run("effects").done().stdout;
    assert!(text.contains("coulomb_friction       -c*sign(z)\n"), "{text}");
    let list: serde_json::Value = serde_json::from_str(&folder.run("effects --json").done().stdout).unwrap();
    assert_eq!(list.as_array().unwrap().len(), 45);
    assert!(folder.run("effects backlash").done().stdout.starts_with("backlash "));
    assert!(folder.run("effects luck").refused().starts_with("effect `luck` is not in the catalogue"));
    assert!(folder.run("effects coulomb_frictoin").refused().contains("did you mean `coulomb_friction`"));
}

#[test]
fn confidence_moves_intervals_and_nothing_else() {
    let folder = Folder::new();
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data");
    let report = |confidence: &str| -> serde_json::Value {
        let ran = folder.run(&format!(
            "diagnose {data}/pendulum.toml {data}/pendulum.csv --run run --confidence {confidence} --json"
        ));
        serde_json::from_str(&ran.done().stdout).unwrap()
    };
    let stated = |report: &serde_json::Value| {
        let causes = report["causes"].as_array().unwrap().iter();
        let causes: Vec<String> =
            causes.map(|c| format!("{} {} {} {}", c["effect"], c["state"], c["included"], c["probability"])).collect();
        (
            report["verdict"].to_string(),
            report["gap"]["detected"].to_string(),
            causes,
            report["unexplained"].to_string(),
        )
    };
    let width = |report: &serde_json::Value| {
        let parameter = &report["causes"][0]["parameters"][0];
        parameter["high"].as_f64().unwrap() - parameter["low"].as_f64().unwrap()
    };
    let all: Vec<serde_json::Value> = ["0.6", "0.9", "0.95", "0.99"].map(report).into();
    for pair in all.windows(2) {
        assert_eq!(stated(&pair[0]), stated(&pair[1]));
        assert!(width(&pair[0]) < width(&pair[1]), "{} {}", width(&pair[0]), width(&pair[1]));
    }
}

#[test]
fn a_time_limit_ends_the_search_with_a_report_that_says_so() {
    let folder = lab(0.3);
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} --time-limit 0.000001 --json")).done();
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let notes = report["notes"].as_array().unwrap();
    assert!(notes.iter().any(|note| note.as_str().unwrap().starts_with("the time limit of")), "{notes:?}");
    assert_eq!(report["interrupted"], 1e-6);
    assert!(
        ["unexplained", "partly_explained"].contains(&report["verdict"].as_str().unwrap()),
        "{}",
        report["verdict"]
    );
    let ran = folder.run(&format!("diagnose slider.toml {LOGS} --time-limit -1"));
    assert!(ran.refused().contains("`time_limit` must be above 0 s"), "{ran:?}");
}

#[test]
fn a_gap_of_which_no_rollout_gives_a_number_is_not_explained() {
    let folder = lab(0.3);
    let rows: String =
        (0..200).map(|i| format!("{},{}\n", 0.05 * f64::from(i), 1e15 + (-0.01 * f64::from(i)).exp())).collect();
    folder.write("far.csv", &format!("t,v\n{rows}"));
    let ran = folder.run(&format!("diagnose slider.toml far.csv {SUSPECTS} --out report")).done();
    let report: serde_json::Value = serde_json::from_str(&folder.read("report/report.json")).unwrap();
    assert!(report["closure"]["after"].is_null(), "{}", report["closure"]);
    assert_ne!(report["verdict"], "explained");
    assert!(!ran.stdout.contains("diverged times the noise"), "{}", ran.stdout);
}
