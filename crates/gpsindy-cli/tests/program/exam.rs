//! Where `gpsindy exam` writes. What it finds is tested in `withheld.rs`.

#![cfg(unix)]

use crate::common::Folder;
use std::os::unix::fs::symlink;

/// A suite with one null case, in `suite/case_1`.
fn suite() -> Folder {
    let folder = Folder::new();
    std::fs::create_dir_all(folder.path().join("suite/case_1")).unwrap();
    let mut log = String::from("t,x\n");
    for i in 0..60 {
        let t = 0.1 * f64::from(i);
        // A little noise without a generator: the fractions of multiples of an irrational number.
        log += &format!("{t:.1},{:.5}\n", (-t).exp() + 0.002 * ((0.618_034 * f64::from(i)).fract() - 0.5));
    }
    folder.write("suite/case_1/model.toml", "[[state]]\nname = \"x\"\nequation = \"-x\"\n");
    folder.write("suite/case_1/real_1.csv", &log);
    let answer = "schema = \"gpsindy.suite/1\"\n[[case]]\nid = \"case_1\"\neffects = []\nin_catalogue = true\n";
    folder.write("suite/answers.toml", answer);
    folder
}

#[test]
fn reports_stand_in_out_although_a_case_is_a_link() {
    let folder = suite();
    std::fs::rename(folder.path().join("suite/case_1"), folder.path().join("elsewhere")).unwrap();
    symlink(folder.path().join("elsewhere"), folder.path().join("suite/case_1")).unwrap();
    folder.run("exam suite --quiet").done();
    assert!(folder.path().join("exam/case_1/report.json").is_file());
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path().join("elsewhere")).unwrap().flatten().map(|e| e.file_name()).collect();
    names.sort();
    assert_eq!(names, ["model.toml", "real_1.csv"]);
}

#[test]
fn nothing_is_written_through_a_link_or_among_the_cases() {
    let folder = suite();
    std::fs::create_dir_all(folder.path().join("exam")).unwrap();
    std::fs::create_dir_all(folder.path().join("elsewhere")).unwrap();
    symlink(folder.path().join("elsewhere"), folder.path().join("exam/case_1")).unwrap();
    symlink(folder.path().join("suite"), folder.path().join("mirror")).unwrap();
    for (arguments, expected) in [
        ("exam suite", "--out: exam/case_1 is a symbolic link; remove it or name another folder"),
        ("exam suite --out suite", "--out: suite holds the cases; name another folder"),
        ("exam suite --out mirror", "--out: mirror holds the cases; name another folder"),
        ("exam suite --out suite/case_1", "--out: suite/case_1 holds the cases; name another folder"),
        ("exam suite --out suite/answers.toml", "--out: suite/answers.toml is a file; name a folder"),
    ] {
        let ran = folder.run(arguments);
        assert!(ran.refused().starts_with(expected), "{arguments}\n{ran:?}");
    }
    assert_eq!(std::fs::read_dir(folder.path().join("elsewhere")).unwrap().count(), 0);
    assert_eq!(std::fs::read_dir(folder.path().join("suite/case_1")).unwrap().count(), 2);
}

#[test]
fn reports_of_another_tool_are_scored() {
    let folder = suite();
    std::fs::create_dir_all(folder.path().join("other/case_1")).unwrap();
    folder.write("other/case_1/report.json", "{\"verdict\": \"no_gap\"}");
    let stated = folder.run("exam suite --reports other --out card --quiet").done().stdout;
    assert!(stated.contains("diagnoses: other"), "{stated}");
    let card: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("card/scorecard.json")).unwrap()).unwrap();
    assert_eq!(card["cases"][0]["verdict"], "no_gap", "{card}");
    assert!(!folder.path().join("card/case_1").exists());
    folder.write("other/case_1/report.json", "{\"verdict\": \"perhaps\"}");
    let stated = folder.run("exam suite --reports other --out card");
    assert!(stated.refused().contains("other/case_1/report.json: "), "{stated:?}");
    assert!(
        folder
            .run("exam suite --reports nowhere --out card")
            .refused()
            .contains("--reports: nowhere has no CASE/report.json")
    );
}

#[test]
fn an_effect_that_is_left_out_is_not_called_explained_by_another() {
    let folder = suite();
    let mut log = String::from("t,x\n");
    for i in 0..120 {
        let t = 0.05 * f64::from(i);
        // x' = -x + 0.4 from one.
        let x = 0.4 + 0.6 * (-t).exp();
        log += &format!("{t:.2},{:.5}\n", x + 0.004 * ((0.618_034 * f64::from(i)).fract() - 0.5));
    }
    folder.write("suite/case_1/real_1.csv", &log);
    let answer = "schema = \"gpsindy.suite/1\"\n[[case]]\nid = \"case_1\"\nin_catalogue = true\n\
                  [[case.effects]]\neffect = \"bias\"\nstate = \"x\"\n";
    folder.write("suite/answers.toml", answer);
    let stated = folder.run("exam suite --leave-out --effects bias,cubic_stiffness,drift --quiet").done().stdout;
    assert!(stated.contains("effect left out of the catalogue: explained"), "{stated}");
    let card: serde_json::Value = serde_json::from_str(&folder.read("exam/scorecard.json")).unwrap();
    assert_eq!(card["cases"][0]["verdict"], "explained", "{card}");
    let left = &card["left_out"];
    assert_eq!(
        (left["wrongly_explained"]["of"].as_u64(), left["wrongly_explained"]["hits"].as_u64()),
        (Some(1), Some(0))
    );
    assert_eq!(left["cases"][0]["left_out"], "bias x");
    assert_ne!(left["cases"][0]["verdict"], "explained", "{card}");
    // What explains nothing leaves the held-out logs as they were.
    assert_eq!(left["cases"][0]["follows"], false, "{card}");
    assert_eq!(left["visibly_wrong"]["hits"].as_u64(), Some(0), "{card}");
    let without: serde_json::Value =
        serde_json::from_str(&folder.read("exam/case_1/without_1_bias/report.json")).unwrap();
    assert!(without["causes"].as_array().unwrap().iter().all(|c| c["effect"] != "bias"), "{without}");
}
