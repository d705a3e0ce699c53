//! The two commands of the README that lead from a log of topics to a first diagnosis.
#![allow(clippy::unwrap_used)]

mod common;
use common::{Folder, data};
use serde_json::Value;

#[test]
fn the_readmes_commands_diagnose_the_shipped_bag() {
    let readme = std::fs::read_to_string(data("../README.md")).unwrap();
    let commands: Vec<&str> = readme.lines().filter(|line| line.contains("data/pendulum.mcap")).collect();
    let [build, diagnose] = commands[..] else { panic!("{commands:?}") };
    // What cargo would build and run is the program under test.
    let (_, inspect) = build.split_once("cargo run --release -- ").unwrap();
    let (_, diagnose) = diagnose.split_once("cargo run --release -- ").unwrap();
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("data")).unwrap();
    for name in ["pendulum.mcap", "pendulum.toml", "pendulum_map.toml"] {
        std::fs::copy(data(name), folder.path().join("data").join(name)).unwrap();
    }
    let shown = folder.run(inspect).done().stdout;
    for expected in ["/joint_states", "position[hinge]", "/joint_commands", "effort[hinge]", "50 Hz", "25 Hz"] {
        assert!(shown.contains(expected), "{expected} is not in\n{shown}");
    }
    folder.run(diagnose).done();
    let report: Value = serde_json::from_str(&folder.read("diagnosis/report.json")).unwrap();
    assert_eq!(report["causes"][0]["effect"], "coulomb_friction", "{report}");
    let size = report["causes"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((size - 0.35).abs() < 0.05, "{report}");
    assert_eq!(report["verdict"], "explained", "{report}");
}
