//! `gpsindy demo` as a new user runs it: nothing but the program.

use crate::common::Folder;

#[test]
fn the_demo_identifies_diagnoses_and_says_where_the_files_are() {
    let folder = Folder::new();
    let ran = folder.run("demo --quiet").done();
    assert!(ran.stdout.contains("x1' = 1.10") && ran.stdout.contains("*x1*x2"), "{}", ran.stdout);
    assert!(ran.stdout.contains("Coulomb friction in the"), "{}", ran.stdout);
    assert_eq!(ran.stderr, "");
    for name in [
        "diagnosis/report.html",
        "diagnosis/report.json",
        "diagnosis/augmented.toml",
        "predator_prey.toml",
        "pendulum.csv",
    ] {
        assert!(folder.path().join("gpsindy-demo").join(name).is_file(), "{name}");
    }
    let report: serde_json::Value = serde_json::from_str(&folder.read("gpsindy-demo/diagnosis/report.json")).unwrap();
    assert_eq!(report["verdict"], "explained");
    assert_eq!(report["causes"][0]["effect"], "coulomb_friction");
    // What the demo says to try next works as it is written.
    let next: Vec<&str> = ran.stdout.lines().skip_while(|l| *l != "Try next").skip(1).collect();
    assert_eq!(next.len(), 2);
    for line in next {
        folder.run(line.trim().strip_prefix("gpsindy ").unwrap()).done();
    }
    let ran = folder.run("demo --out gpsindy-demo/pendulum.csv");
    assert!(ran.refused().starts_with("--out: gpsindy-demo/pendulum.csv is a file; name a folder"), "{ran:?}");
}
