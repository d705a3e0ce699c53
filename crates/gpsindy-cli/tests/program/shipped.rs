//! The two commands of the README that lead from a log of topics to a first diagnosis.

use crate::common::{Folder, data};
use serde_json::Value;

#[test]
fn the_readmes_commands_diagnose_the_shipped_bag() {
    let readme = std::fs::read_to_string(data("../README.md")).unwrap();
    let commands: Vec<&str> = readme.lines().filter(|line| line.contains("data/pendulum.mcap")).collect();
    let [build, diagnose] = commands[..] else { panic!("{commands:?}") };
    // What is installed is the program under test.
    let (_, inspect) = build.split_once("gpsindy ").unwrap();
    let (_, diagnose) = diagnose.split_once("gpsindy ").unwrap();
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
    let report: Value = serde_json::from_str(&folder.read("from_topics/report.json")).unwrap();
    // Friction that may grow with a load, and does not here, is the same force.
    let effect = report["causes"][0]["effect"].as_str().unwrap();
    assert!(["coulomb_friction", "load_friction"].contains(&effect), "{report}");
    let size = report["causes"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((size - 0.35).abs() < 0.05, "{report}");
    assert_eq!(report["verdict"], "explained", "{report}");
}

#[test]
fn the_offset_of_a_clock_is_estimated_where_asked() {
    let folder = Folder::new();
    for name in ["pendulum.mcap", "pendulum.toml", "pendulum_map.toml"] {
        std::fs::copy(data(name), folder.path().join(name)).unwrap();
    }
    let score = "score pendulum.toml --data pendulum.mcap --map-file pendulum_map.toml";
    let ran = folder.run(&format!("{score} --offset /joint_commands=auto")).done();
    let stated = ran.stderr.lines().find(|line| line.contains("were added to the stamps of `/joint_commands`"));
    let stated = stated.unwrap_or_else(|| panic!("{ran:?}"));
    // Both topics have one clock: the estimate is near 0 and its interval holds it.
    let numbers: Vec<f64> = stated.split([' ', '(', ')']).filter_map(|word| word.parse().ok()).collect();
    let [seconds, low, high, ..] = numbers[..] else { panic!("{stated}") };
    assert!(seconds.abs() < 5e-3 && low <= 0.0 && 0.0 <= high, "{stated}");
    let refused = folder.run(&format!("{score} --offset /joint_command=auto"));
    assert!(refused.refused().contains("did you mean `/joint_commands`"), "{refused:?}");
    let refused = folder.run(&format!("{score} --offset /joint_commands=soon"));
    assert!(refused.stderr.contains("neither a number of seconds nor `auto`"), "{refused:?}");
}
