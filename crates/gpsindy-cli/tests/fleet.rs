//! `gpsindy fleet` as a user runs it: sliders of one design, one of which drags more.
#![allow(clippy::unwrap_used)]

mod common;
use common::Folder;
use common::slider::{SLIDER, coast};

/// Eight units, the last one with twice the drag, and a ninth without logs.
fn fleet() -> Folder {
    let folder = Folder::new();
    folder.write("slider.toml", SLIDER);
    let mut manifest = String::from("model = \"slider.toml\"\n");
    for unit in 0..8 {
        let drag = if unit == 7 { 0.6 } else { 0.3 + 0.002 * f64::from(unit) };
        for (run, start) in [1.5, 2.5, 3.0, 2.0].into_iter().enumerate() {
            folder.write(&format!("unit_{unit}_run_{run}.csv"), &coast(start + 0.01 * f64::from(unit), drag));
        }
        manifest += &format!("[[unit]]\nunit = \"s{unit}\"\nlogs = \"unit_{unit}_run_*.csv\"\n");
    }
    manifest += "[[unit]]\nunit = \"lost\"\nlogs = \"lost.csv\"\n";
    folder.write("fleet.toml", &manifest);
    folder
}

const SUSPECTS: &str = "--effects quadratic_drag,bias --quiet";

#[test]
fn the_unit_that_drags_more_is_told_and_a_second_run_does_nothing_again() {
    let folder = fleet();
    let ran = folder.run(&format!("fleet fleet.toml --out fleet {SUSPECTS}")).done();
    assert!(
        ran.stdout.contains("8 reports, 1 failed") && ran.stdout.contains("s7: quadratic_drag c"),
        "{}",
        ran.stdout
    );
    let json = folder.read("fleet/fleet.json");
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["schema"], "gpsindy.fleet/1");
    assert_eq!(report["odd"].as_array().unwrap().len(), 1, "{json}");
    assert_eq!(report["odd"][0]["unit"], "s7");
    assert_eq!(report["failed"][0]["unit"], "lost");
    let page = folder.read("fleet/fleet.html");
    let key = report["units"][0]["key"].as_str().unwrap();
    assert!(page.contains(&format!("tasks/{key}/report.html")));
    let first = folder.read(&format!("fleet/tasks/{key}/report.json"));
    // The same report as the command for one machine writes.
    let logs = "unit_0_run_0.csv unit_0_run_1.csv unit_0_run_2.csv unit_0_run_3.csv";
    folder.run(&format!("diagnose slider.toml {logs} --out one {SUSPECTS}")).done();
    assert_eq!(first, folder.read("one/report.json"));
    // What is there is not made again; what is gone is, with the same bytes.
    folder.write(&format!("fleet/tasks/{key}/report.html"), "kept");
    let again = folder.run(&format!("fleet fleet.toml --out fleet {SUSPECTS} --json")).done();
    assert_eq!(folder.read(&format!("fleet/tasks/{key}/report.html")), "kept");
    assert_eq!(serde_json::from_str::<serde_json::Value>(&again.stdout).unwrap(), report);
}

#[test]
fn parts_of_a_fleet_are_done_apart_and_the_last_one_compares() {
    let folder = fleet();
    let first = folder.run("fleet fleet.toml --out fleet --shard 1/2 --effects quadratic_drag,bias").done();
    assert!(first.stdout.is_empty() && first.stderr.contains("of other parts are missing"), "{first:?}");
    let second = folder.run(&format!("fleet fleet.toml --out fleet --shard 2/2 {SUSPECTS}")).done();
    assert!(second.stdout.contains("8 reports"), "{second:?}");
    let whole = folder.run(&format!("fleet fleet.toml --out whole {SUSPECTS}")).done();
    assert!(whole.stdout.contains("8 reports"));
    // A part does not see the other part's failures: they are told where they happen.
    let odd = |folder_name: &str| {
        let report: serde_json::Value =
            serde_json::from_str(&folder.read(&format!("{folder_name}/fleet.json"))).unwrap();
        (report["units"].clone(), report["odd"].clone())
    };
    assert_eq!(odd("fleet"), odd("whole"));
}

#[test]
fn a_bad_manifest_is_one_line_and_writes_nothing() {
    let folder = fleet();
    folder.write("bad.toml", "[[unit]]\nunit = \"a\"\nlogs = \"x.csv\"\n");
    let ran = folder.run("fleet bad.toml --out nothing");
    assert_eq!(ran.status, 2, "{ran:?}");
    assert!(ran.stderr.contains("bad.toml: entry 1 (unit `a`): lacks `model`"), "{ran:?}");
    assert!(!folder.path().join("nothing").exists());
    let shard = folder.run("fleet fleet.toml --out nothing --shard 3/2");
    assert_eq!(shard.status, 2);
    assert!(shard.stderr.contains("expected K/N"), "{shard:?}");
}
