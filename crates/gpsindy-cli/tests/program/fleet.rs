//! `gpsindy fleet` as a user runs it: sliders of one design, one of which drags more.

use crate::common::Folder;
use crate::common::slider::{SLIDER, coast};

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
    let ran = folder.run(&format!("fleet fleet.toml --out fleet {SUSPECTS}")).ended(4);
    assert!(
        ran.stdout.contains("8 reports, 1 failed") && ran.stdout.contains("s7: quadratic_drag c"),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stderr.ends_with("error: 1 of 9 tasks without a diagnosis; the reasons stand above and in fleet.json\n"),
        "{ran:?}"
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
    let again = folder.run(&format!("fleet fleet.toml --out fleet {SUSPECTS} --json")).ended(4);
    assert_eq!(folder.read(&format!("fleet/tasks/{key}/report.html")), "kept");
    assert_eq!(serde_json::from_str::<serde_json::Value>(&again.stdout).unwrap(), report);
}

#[test]
fn parts_of_a_fleet_are_done_apart_and_the_last_one_compares() {
    let folder = fleet();
    let first = folder.run("fleet fleet.toml --out fleet --shard 1/2 --effects quadratic_drag,bias").ended(4);
    assert!(first.stdout.is_empty() && first.stderr.contains("of other parts are missing"), "{first:?}");
    let second = folder.run(&format!("fleet fleet.toml --out fleet --shard 2/2 {SUSPECTS}")).ended(4);
    assert!(second.stdout.contains("8 reports"), "{second:?}");
    let whole = folder.run(&format!("fleet fleet.toml --out whole {SUSPECTS}")).ended(4);
    assert!(whole.stdout.contains("8 reports"));
    // A part does not see the other part's failures: they are reported where they happen.
    let odd = |folder_name: &str| {
        let report: serde_json::Value =
            serde_json::from_str(&folder.read(&format!("{folder_name}/fleet.json"))).unwrap();
        (report["units"].clone(), report["odd"].clone())
    };
    assert_eq!(odd("fleet"), odd("whole"));
}

#[test]
fn a_fleet_without_a_diagnosis_says_nothing_of_its_units() {
    let folder = Folder::new();
    folder.write("model.toml", "schema = \"gpsindy.model/2\"\n").write("log.csv", "t,x\n0,0\n1,1\n");
    let manifest = "[[unit]]\nunit = \"a\"\nlogs = [\"log.csv\"]\nmodel = \"model.toml\"\n";
    folder.write("fleet.toml", manifest);
    let ran = folder.run("fleet fleet.toml --out fleet").ended(1);
    assert!(ran.stderr.contains("unit a: no diagnosis: "), "{ran:?}");
    assert!(ran.stdout.contains("0 reports, 1 failed") && !ran.stdout.contains("stands out"), "{ran:?}");
    // A simulator's own file is refused once, whatever the number of units.
    let one = manifest.replace("model.toml", "robot.xml");
    let other = one.replace("unit = \"a\"", "unit = \"b\"");
    folder.write("robot.xml", "<mujoco/>").write("fleet.toml", &format!("{one}{other}"));
    let ran = folder.run("fleet fleet.toml --out other").ended(2);
    assert!(ran.stderr.contains("robot.xml is a simulator's own file") && ran.stderr.lines().count() == 1, "{ran:?}");
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

/// The program while it watches a folder; killed with the test.
#[cfg(unix)]
struct Watching(std::process::Child);

#[cfg(unix)]
impl Watching {
    fn start(folder: &Folder, arguments: &str) -> Self {
        let child = std::process::Command::new(env!("CARGO_BIN_EXE_gpsindy"))
            .args(arguments.split(' '))
            .current_dir(folder.path())
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        Self(child)
    }

    /// Sends Ctrl-C and returns the exit status and stderr.
    fn interrupt(mut self) -> (Option<i32>, String) {
        let id = self.0.id().to_string();
        assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let mut text = String::new();
        std::io::Read::read_to_string(self.0.stderr.as_mut().unwrap(), &mut text).unwrap();
        (self.0.wait().unwrap().code(), text)
    }
}

#[cfg(unix)]
impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until the comparison has so many reports.
#[cfg(unix)]
fn wait_for_units(folder: &Folder, file: &str, count: usize) -> serde_json::Value {
    let look = || {
        std::thread::sleep(std::time::Duration::from_millis(50));
        let text = std::fs::read_to_string(folder.path().join(file)).ok()?;
        let report: serde_json::Value = serde_json::from_str(&text).ok()?;
        (report["units"].as_array()?.len() == count).then_some(report)
    };
    (0..1200).find_map(|_| look()).unwrap()
}

#[test]
#[cfg(unix)]
fn a_watched_folder_takes_new_logs_once_they_are_whole_and_ends_on_an_interrupt() {
    let folder = Folder::new();
    let log = |unit: &str, day: u32, text: &str| {
        std::fs::create_dir_all(folder.path().join(format!("logs/{unit}"))).unwrap();
        folder.write(&format!("logs/{unit}/run_2026-01-{day:02}.csv"), text);
    };
    std::fs::create_dir(folder.path().join("logs")).unwrap();
    folder.write("logs/model.toml", SLIDER);
    log("a", 5, &coast(2.5, 0.3));
    log("b", 5, &coast(2.6, 0.3));
    let line = "fleet watch logs --every 0.2 --effects quadratic_drag,bias";
    let watching = Watching::start(&folder, line);
    let report = wait_for_units(&folder, "logs/result/fleet.json", 2);
    assert_eq!(report["units"][0]["since"], "2026-01-05");
    // A log that grows between the looks is not taken until it is whole.
    let whole = coast(2.4, 0.31);
    for rows in [10, 20, 30] {
        log("a", 6, &whole.lines().take(rows).map(|line| format!("{line}\n")).collect::<String>());
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    log("a", 6, &whole);
    folder.write("logs/b/run_2026-01-06.csv.part", "t [s],v");
    let report = wait_for_units(&folder, "logs/result/fleet.json", 3);
    assert!(report["failed"].as_array().unwrap().is_empty(), "{report}");
    let reports = std::fs::read_dir(folder.path().join("logs/result/tasks")).unwrap().count();
    assert_eq!(reports, 3, "a part of a log was diagnosed");
    let (status, stderr) = watching.interrupt();
    assert_eq!(status, Some(0), "{stderr}");
    assert!(stderr.contains("a since 2026-01-06: tasks/") && stderr.contains("stopped"), "{stderr}");
    // The next start finds what was done.
    let again = folder.run(&format!("{line} --idle 0.5")).done();
    assert!(again.stdout.contains("3 reports, 0 failed") && !again.stderr.contains("tasks/"), "{again:?}");
}

#[test]
fn a_watched_manifest_may_be_wrong_for_a_while() {
    let folder = fleet();
    std::fs::create_dir(folder.path().join("watched")).unwrap();
    folder.write("watched/fleet.toml", "[[unit]]\nunit = \"a\"\nlogs = \"../unit_0_run_*.csv\"\n");
    let ran = folder.run("fleet watch watched --out result --every 0.1 --idle 0.3").done();
    assert!(ran.stderr.contains("lacks `model`; looking again"), "{ran:?}");
    let entry = "model = \"../slider.toml\"\n[[unit]]\nunit = \"a\"\nlogs = \"../unit_0_run_*.csv\"\n";
    folder.write("watched/fleet.toml", entry);
    let ran =
        folder.run("fleet watch watched --out result --every 0.1 --idle 0.3 --effects quadratic_drag,bias").done();
    assert!(ran.stdout.contains("1 reports, 0 failed"), "{ran:?}");
    let refused = folder.run("fleet watch nowhere");
    assert!(refused.refused().contains("nowhere: not a folder"));
    assert!(folder.run("fleet watch watched --every 0").refused().contains("--every must be above 0"));
    assert!(folder.run("fleet fleet.toml --out s3://bucket/x").refused().contains("takes a folder"));
}
