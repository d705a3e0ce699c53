//! `gpsindy inspect`, and the options that read logs of other formats.

use crate::common::Folder;

const HELD: &str = "Time,x [m],u,mode\n1700000000.00,1,5,run\n1700000000.01,1.5,5,run\n1700000000.02,2.25,5,run\n\
                    1700000000.03,2.5,5,run\n1700000000.50,3.125,5,run\n";

#[test]
fn a_table_is_shown_with_its_clock_its_columns_and_its_faults() {
    let folder = Folder::new();
    folder.write("log.csv", HELD);
    let shown = folder.run("inspect log.csv").done().stdout;
    for expected in [
        "log.csv: CSV",
        "5 samples, 100 Hz",
        "time `Time`: 1700000000 s to 1700000000.500 s",
        "1 gap",
        "u: is always 5",
        "mode",
    ] {
        assert!(shown.contains(expected), "{expected} is not in\n{shown}");
    }
    let json = folder.run("inspect log.csv log.csv --json").done().stdout;
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["schema"], "gpsindy.inspection/1");
    assert_eq!(value["logs"][1]["topics"][0]["columns"][0]["unit"], "m");
    let findings = value["logs"][0]["findings"].as_array().unwrap();
    let kinds: Vec<&str> = findings.iter().map(|f| f["kind"].as_str().unwrap()).collect();
    assert!(kinds.contains(&"constant") && kinds.contains(&"gaps"), "{kinds:?}");
}

#[test]
fn a_pipeline_refuses_a_flawed_log_with_its_reasons() {
    let folder = Folder::new();
    let rows =
        |x: &dyn Fn(u32) -> f64| (0..200).map(|i| format!("{},{}\n", 0.01 * f64::from(i), x(i))).collect::<String>();
    folder.write("good.csv", &format!("t,x\n{}", rows(&|i| (0.1 * f64::from(i)).sin())));
    folder.write("still.csv", &format!("t,x\n{}", rows(&|_| 1.0)));
    folder.run("inspect good.csv --strict").done();
    folder.run("inspect still.csv").done();
    let refused = folder.run("inspect good.csv still.csv --strict");
    assert_eq!(refused.status, 3, "{}", refused.stderr);
    assert!(
        refused.stdout.contains("good.csv") && refused.stderr.contains("1 flaw: still.csv: x: "),
        "{}",
        refused.stderr
    );
    folder.run("inspect still.csv --strict --allow held,constant").done();
    assert!(folder.run("inspect still.csv --strict --allow heldd").refused().contains("heldd"));
    // A command may rest; a sensor that does is dead.
    folder.run("inspect still.csv --strict --control x").done();
    assert_eq!(folder.run("inspect still.csv --strict --control u").status, 3);
}

#[test]
fn stamps_that_stand_still_are_inspected_and_refused_by_the_methods() {
    let folder = Folder::new();
    folder.write("log.csv", "t,x\n0,1\n0.1,2\n0.1,3\n0.2,4\n");
    assert!(folder.run("inspect log.csv").done().stdout.contains("1 stamp is the same as the one before"));
    let refused = folder.run("smooth log.csv");
    assert!(refused.refused().contains("time does not advance"), "{refused:?}");
}

#[test]
fn formats_that_are_not_read_say_the_way_out() {
    let folder = Folder::new();
    folder.write("old.bag", "#ROSBAG V2.0\n").write("bag.db3", "SQLite format 3\0");
    assert!(folder.run("inspect old.bag").refused().contains("mcap convert"));
    assert!(folder.run("smooth bag.db3").refused().contains("mcap convert"));
    assert!(folder.run("smooth .").refused().contains("neither a LeRobot data set"));
}

#[test]
fn maps_serve_tables_too() {
    let folder = Folder::new();
    folder.write("log.csv", "t,speed [m/s]\n0,1\n0.1,2\n0.2,3\n");
    folder.write("map.toml", "[map]\nv = \"speed\"\n");
    let smoothed = folder.run("smooth log.csv --map-file map.toml --state v").done().stdout;
    assert!(smoothed.starts_with("t [s],v [m/s],"), "{smoothed}");
    let refused = folder.run("smooth log.csv --map v=sped --state v");
    assert!(refused.refused().contains("did you mean `speed`?"), "{refused:?}");
    folder.write("bad.toml", "[maps]\n");
    assert!(folder.run("smooth log.csv --map-file bad.toml").refused().starts_with("bad.toml:1: unknown field `maps`"));
}

#[test]
fn options_that_a_log_cannot_follow_are_refused() {
    let folder = Folder::new();
    folder.write("log.csv", "t,speed\n0,1\n0.1,2\n0.2,3\n");
    let refused = folder.run("smooth log.csv --offset /command=0.1");
    assert!(refused.refused().contains("--offset /command: the log is a table, with one clock"), "{refused:?}");
    let refused = folder.run("smooth log.csv --map v=speed --map v=t");
    assert!(refused.refused().contains("`v` is mapped twice"), "{refused:?}");
    let whole = std::fs::read(crate::common::data("pendulum.mcap")).unwrap();
    std::fs::write(folder.path().join("log.mcap"), &whole).unwrap();
    std::fs::write(folder.path().join("cut.mcap"), &whole[..2000]).unwrap();
    let map = "--map q=/joint_states.position[hinge] --state q";
    let refused = folder.run(&format!("smooth log.mcap {map} --time stamp"));
    assert!(refused.refused().contains("--time stamp: the log has topics, each with its own stamps"), "{refused:?}");
    let refused = folder.run(&format!("smooth log.mcap {map} --run trial"));
    assert!(refused.refused().contains("--run trial: the log has topics and is one run"), "{refused:?}");
    // Its only chunk is cut, so that nothing of it can be read.
    let refused = folder.run(&format!("smooth cut.mcap {map}"));
    assert!(refused.refused().starts_with("cut.mcap: the file breaks off behind 0 messages"), "{refused:?}");
    std::fs::create_dir_all(folder.path().join("set/meta")).unwrap();
    folder.write("set/meta/info.json", "{}");
    assert!(
        folder.run("inspect set").refused().contains("no .parquet file is there; was the data set downloaded whole?")
    );
}
